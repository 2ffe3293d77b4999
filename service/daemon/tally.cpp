#include "daemon/tally.h"

#include <algorithm>

namespace huetrack::daemon {

using Clock = std::chrono::steady_clock;

Tally::Tally(const config::ServiceConfig& config, const tracks::Truth* truth)
    : moving_camera_(config.rig.index_of(config.camera_tracking.camera)) {
  for (const auto& target : config.targets) {
    Target& added = targets_.emplace_back(Target{.summary = {.name = target.name,
                                                             .radius_m = target.radius_m,
                                                             .tracked = {target.radius_m, config.rig.cameras.size()}}});
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
  note_lost(set);
  for (std::size_t t = 0; t < targets_.size() && t < set.trackers.size(); ++t) {
    const auto& tracker = set.trackers[t];
    TargetSummary& summary = targets_[t].summary;
    summary.outlines = tracker.outline_findings();
    summary.is_radius_known = tracker.is_radius_known();
    summary.shown_radius_m = tracker.shown_radius_m();
    if (summary.shown_radius_m) summary.radius_m = *summary.shown_radius_m;
  }
  sets_until_ = Clock::now();
}

void Tally::note_lost(const pipeline::TrackedSet& set) {
  const auto& frames = set.frames.frames;
  std::size_t still = frames.size(), delivered = 0;
  for (std::size_t c = 0; c < frames.size(); ++c) {
    const bool moves = moving_camera_ && *moving_camera_ == int(c);
    still -= moves ? 1 : 0;
    delivered += frames[c] && !moves ? 1 : 0;
  }
  if (delivered == 0 || delivered < std::min<std::size_t>(2, still)) return;
  std::vector<bool> has_position(targets_.size(), false);
  for (const auto& estimate : set.estimates)
    if (estimate.has_position()) has_position[estimate.target] = true;
  for (std::size_t t = 0; t < targets_.size(); ++t) {
    ++targets_[t].summary.delivered_sets;
    targets_[t].summary.lost_sets += has_position[t] ? 0 : 1;
  }
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
