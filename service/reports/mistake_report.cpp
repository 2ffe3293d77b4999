#include "reports/mistake_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "reports/mistake_words.h"

namespace huetrack::reports {
namespace {

bool any_has_moved(std::span<const pipeline::CameraCalibration> calibration) {
  return std::ranges::any_of(calibration,
                             [](const pipeline::CameraCalibration& camera) { return camera.moved.has_value(); });
}

// That a camera was moved while it ran is told by the calibration's report, with its size; here it would look like a
// rig that was wrong from the start.
bool is_told_by_the_room(const view_watch::Mistake& mistake, std::span<const pipeline::CameraCalibration> calibration) {
  return view_watch::is_of_rig(mistake.kind) && mistake.kind != view_watch::MistakeKind::swapped &&
         any_has_moved(calibration);
}

}  // namespace

MistakeReport::MistakeReport(const config::ServiceConfig& config)
    : rig_(config.rig), cameras_(config.rig.camera_names()), targets_(config.targets) {}

void MistakeReport::make_watches() {
  watches_.clear();
  watches_.reserve(targets_.size());  // they do not move
  for (const auto& target : targets_) watches_.emplace_back(rig_, target);
  are_targets_new_ = false;
}

void MistakeReport::on_set(const pipeline::TrackedSet& set) {
  if (!first_at_) first_at_ = set.frames.at;
  const std::scoped_lock lock(mutex_);
  if (are_targets_new_) make_watches();
  std::vector<std::string> now, kinds;
  for (std::size_t t = 0; t < watches_.size() && t < set.trackers.size(); ++t) {
    // While views contradict one another for a reason that is known, looking for another one only takes time.
    // Of several objects the tracker shows the views of one (ObjectTracker::regions()); times are those of any.
    const auto estimate = std::ranges::find(set.estimates, t, &object_tracking::ObjectEstimate::target);
    if (!any_has_moved(set.calibration) && estimate != set.estimates.end())
      watches_[t].look(*estimate, set.trackers[t], set.frames.at);
    for (const auto& mistake : watches_[t].mistakes()) {
      if (is_told_by_the_room(mistake, set.calibration)) continue;
      if (view_watch::is_of_rig(mistake.kind) && mistake.kind != view_watch::MistakeKind::contradiction)
        has_explained_rig_ = true;
      now.push_back(mistake_text(mistake, targets_[t], cameras_));
      kinds.push_back(fmt::format("{} {} {}", t, int(mistake.kind), fmt::join(mistake.cameras, " ")));
    }
  }
  if (now == warnings_) return;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const std::string &sentence = now[i], &kind = kinds[i];
    if (const auto known = ever_.find(kind); known != ever_.end()) {
      known->second.sentence = sentence;
      continue;
    }
    spdlog::warn("{}", sentence);
    ever_.emplace(kind, Named{capture::seconds(set.frames.at - *first_at_), sentence});
    order_.push_back(kind);
  }
  warnings_ = std::move(now);
}

void MistakeReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  targets_ = config.targets;
  are_targets_new_ = true;
}

std::vector<std::string> MistakeReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  return warnings_;
}

std::vector<std::string> MistakeReport::summary() const {
  std::vector<std::string> all;
  for (const std::string& kind : order_)
    all.push_back(fmt::format("from {:.1f} s on: {}", ever_.at(kind).at_s, ever_.at(kind).sentence));
  return all;
}

}  // namespace huetrack::reports
