#include "metrics/pipeline_meter.h"

#include "capture/timing/capture_clock.h"

namespace huetrack::metrics {

PipelineMeter::PipelineMeter(std::size_t cameras, std::size_t targets, const pipeline::Bus* bus)
    : bus_(bus), targets_(targets), capture_to_dequeue_(cameras) {}

void PipelineMeter::on_set(const pipeline::TrackedSet& set) {
  if (set.estimates.empty()) return;
  // With several objects, one that is tracked.
  const object_tracking::ObjectEstimate* before = nullptr;
  count_objects(set.estimates);
  for (const auto& estimate : set.estimates) {
    const bool is_first = before == nullptr || before->target != estimate.target;
    before = &estimate;
    if (!is_first && estimate.state != object_tracking::TrackState::tracking) continue;
    targets_[estimate.target].state = estimate.state;
    targets_[estimate.target].effective_sample_size = estimate.effective_sample_size;
    targets_[estimate.target].particles = estimate.particle_count;
  }
  for (std::size_t t = 0; t < set.mistakes.size() && t < targets_.size(); ++t) {
    std::uint32_t kinds = 0;
    for (const view_watch::Mistake& mistake : set.mistakes[t]) kinds |= 1U << unsigned(mistake.kind);
    targets_[t].mistakes = kinds;
  }
  const capture::Timestamp now = capture::unix_now();
  const auto [begun, sent] = bus_ != nullptr ? bus_->last_writing() : publish::EstimatePublisher::Writing{now, now};
  dequeue_to_write_.add(begun - set.received_at);
  dequeue_to_publish_.add(sent - set.received_at);
  capture_to_publish_.add(sent - set.frames.at);
}

void PipelineMeter::count_objects(std::span<const object_tracking::ObjectEstimate> estimates) {
  using object_tracking::TrackState;
  for (std::size_t begin = 0, end = 0; begin < estimates.size(); begin = end) {
    int tracked = 0, coasting = 0;
    Target& target = targets_[estimates[begin].target];
    for (end = begin; end < estimates.size() && estimates[end].target == estimates[begin].target; ++end) {
      const auto& estimate = estimates[end];
      tracked += estimate.state == TrackState::tracking ? 1 : 0;
      coasting += estimate.state == TrackState::coasting ? 1 : 0;
      const bool is_found_again =  // a single object has no births: it is found when it has a position again
          estimate.object == 0 && estimate.has_position() && target.tracked + target.coasting == 0;
      if (estimate.is_birth || is_found_again) ++target.found;
    }
    target.tracked = tracked, target.coasting = coasting;
  }
}

std::vector<TargetFigures> PipelineMeter::targets() const {
  std::vector<TargetFigures> figures;
  for (const auto& target : targets_) {
    TargetFigures& out = figures.emplace_back(TargetFigures{.state = target.state,
                                                            .effective_sample_size = target.effective_sample_size,
                                                            .particles = target.particles,
                                                            .tracked = target.tracked,
                                                            .coasting = target.coasting,
                                                            .found = target.found});
    const std::uint32_t kinds = target.mistakes;
    for (std::size_t kind = 0; kind < out.mistakes.size(); ++kind) out.mistakes[kind] = (kinds >> kind & 1U) != 0;
  }
  return figures;
}

LatencyFigures PipelineMeter::latencies() const {
  LatencyFigures figures;
  for (const auto& camera : capture_to_dequeue_) figures.capture_to_dequeue.push_back(camera.snapshot());
  figures.dequeue_to_write = dequeue_to_write_.snapshot();
  figures.dequeue_to_publish = dequeue_to_publish_.snapshot();
  figures.capture_to_publish = capture_to_publish_.snapshot();
  return figures;
}

}  // namespace huetrack::metrics
