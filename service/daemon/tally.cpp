#include "daemon/tally.h"

namespace huetrack::daemon {

using Clock = std::chrono::steady_clock;

Tally::Tally(const config::ServiceConfig& config, const tracks::Truth* truth) {
  for (const auto& target : config.targets) {
    Target& added = targets_.emplace_back(
        Target{.summary = {.name = target.name, .tracked = {target.radius_m, config.rig.cameras.size()}}});
    if (truth == nullptr) continue;
    const auto& volume = config.object_tracking.volume;
    if (target.count == 1 && truth->targets().contains(target.name)) added.comparison.emplace(*truth, target.name);
    if (auto balls = truth->objects_of(target.name, config.targets.size() == 1); target.count > 1 && !balls.empty())
      added.objects.emplace(*truth, std::move(balls), Eigen::AlignedBox3d(volume.min, volume.max));
  }
  if (!config.camera_tracking.camera.empty()) camera_.emplace().name = config.camera_tracking.camera;
}

void Tally::Target::add(const object_tracking::ObjectEstimate& estimate, std::uint64_t set) {
  if (!first_at) first_at = estimate.at;
  ++summary.sets[estimate.state];
  if (estimate.state == object_tracking::TrackState::tracking && !summary.first_tracking_set) {
    summary.first_tracking_set = set;
    summary.first_tracking_s = capture::seconds(estimate.at - *first_at);
  }
  summary.tracked.add(estimate);
  if (comparison) comparison->add(estimate);
  if (estimate.is_birth) ++summary.objects, summary.most_objects = std::max(summary.most_objects, ++objects_now);
  if (estimate.is_end) --objects_now;
}

void Tally::on_set(const pipeline::TrackedSet& set) {
  ++sets_;
  last_at_ = set.frames.at;
  for (const auto& estimate : set.estimates) targets_[estimate.target].add(estimate, sets_);
  for (auto own = set.estimates; !own.empty();) {
    const std::size_t target = own.front().target;
    const auto end = std::ranges::find_if(own, [&](const auto& estimate) { return estimate.target != target; });
    const auto count = std::size_t(end - own.begin());
    if (auto& objects = targets_[target].objects) objects->add(set.frames.at, own.first(count));
    own = own.subspan(count);
  }
  for (std::size_t t = 0; t < targets_.size() && t < set.trackers.size(); ++t)
    targets_[t].summary.outlines = set.trackers[t].outline_findings();
  sets_until_ = Clock::now();
}

void Tally::on_camera_pose(const pipeline::TrackedFrame& frame) {
  ++camera_->frames[frame.estimate.state];
  if (frame.estimate.has_pose() && !camera_->first_pose_frame) camera_->first_pose_frame = frame.estimate.frame_number;
  no_pose_log_.log(camera_->name, frame.camera);
  camera_until_ = Clock::now();
}

std::vector<TargetSummary> Tally::targets() const {
  std::vector<TargetSummary> summaries;
  for (const auto& target : targets_) {
    TargetSummary& summary = summaries.emplace_back(target.summary);
    if (target.objects) summary.objects_truth = target.objects->figures();
    if (target.comparison) {
      summary.truth = target.comparison->figures();
      summary.explanation = target.comparison->explanation();
    }
  }
  return summaries;
}

}  // namespace huetrack::daemon
