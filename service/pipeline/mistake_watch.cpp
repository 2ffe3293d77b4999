#include "pipeline/mistake_watch.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace huetrack::pipeline {
namespace {

// RMS distance of a pixel from the image centre, as a tangent.
double usual_tangent(const calib::Camera& camera) {
  const double diagonal_px = std::hypot(camera.image_size.width, camera.image_size.height);
  return diagonal_px / (2 * std::numbers::sqrt3) / view_watch::focal_px(camera);
}

// The size of a moved camera's error is known. Before it was detected, its inconsistency may have been attributed to
// any camera; rotations of the others would be detected by room_watch, too.
bool is_explained_by(const std::vector<bool>& moved, const view_watch::Mistake& mistake) {
  using view_watch::MistakeKind;
  if (std::ranges::none_of(moved, std::identity{})) return false;
  return mistake.kind == MistakeKind::turned || mistake.kind == MistakeKind::zoomed ||
         mistake.kind == MistakeKind::other_rig;
}

}  // namespace

double inflation_rad(const view_watch::Mistake& mistake, const calib::Camera& camera) {
  using view_watch::MistakeKind;
  switch (mistake.kind) {
    case MistakeKind::turned:
      return std::max(mistake.size, std::abs(mistake.zoom - 1) * usual_tangent(camera));
    case MistakeKind::zoomed:
      return std::abs(mistake.size - 1) * usual_tangent(camera);
    case MistakeKind::swapped:
    case MistakeKind::late:
    case MistakeKind::uneven_times:
    case MistakeKind::mirrored:
    case MistakeKind::upside_down:
    case MistakeKind::other_rig:
    case MistakeKind::contradiction: {
      // off_px is a median across the epipolar lines; the error along them is unknown and taken to be as large.
      constexpr double median_of_sigma = 0.6745;  // maths: median of |x| of a standard normal x
      return mistake.off_px / median_of_sigma / view_watch::focal_px(camera);
    }
    case MistakeKind::wrong_order:
    case MistakeKind::converted:
    case MistakeKind::exchanged:
    case MistakeKind::delayed:
    case MistakeKind::radius:
    case MistakeKind::shared_color:
      return 0;
  }
  return 0;
}

void add_inflation(std::span<const double> inflation, std::vector<object_tracking::CameraTrust>& trust) {
  trust.resize(std::max(trust.size(), inflation.size()));
  for (std::size_t c = 0; c < inflation.size(); ++c)
    trust[c].pose_covariance.diagonal().head<3>().array() += inflation[c] * inflation[c];
}

MistakeWatch::MistakeWatch(const calib::CameraRig& rig, std::span<const object_tracking::TargetOptions> targets)
    : rig_(rig), mistakes_(targets.size()), inflation_(rig.cameras.size(), 0.0), previous_inflation_(inflation_) {
  watches_.reserve(targets.size());
  for (const auto& target : targets) watches_.emplace_back(rig, target), paths_.push_back(paths_of(target));
}

void MistakeWatch::reset_target(std::size_t target, const object_tracking::TargetOptions& options) {
  watches_.at(target) = view_watch::ViewWatch(rig_, options);
  paths_[target] = paths_of(options);
  mistakes_[target].clear();
}

void MistakeWatch::begin_anew() {
  for (view_watch::ViewWatch& watch : watches_) watch.begin_anew();
  for (auto& paths : paths_)
    for (PathOfCamera& path : paths) path.times.begin_anew();
}

bool MistakeWatch::look(const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
                        std::span<const object_trackers::ObjectTracker> trackers, const std::vector<bool>& moved) {
  std::swap(inflation_, previous_inflation_);
  std::ranges::fill(inflation_, 0.0);
  late_s_.clear();
  for (std::size_t t = 0; t < watches_.size() && t < trackers.size(); ++t) {
    // ObjectTracker::regions() are those of one object, even if there are several; timing is common to all.
    const auto estimate = std::ranges::find(estimates, t, &object_tracking::ObjectEstimate::target);
    if (estimate != estimates.end()) {
      watches_[t].look(*estimate, trackers[t], set.at, moved);
      if (late_s_.empty()) late_s_ = watches_[t].late_s();
      look_at_paths(set, trackers[t].regions(), paths_[t]);
    }
    const auto is_explained = [&](const view_watch::Mistake& mistake) { return is_explained_by(moved, mistake); };
    mistakes_[t] = watches_[t].mistakes();
    std::erase_if(mistakes_[t], is_explained);
    for (const PathOfCamera& path : paths_[t])
      if (path.fault) mistakes_[t].push_back(*path.fault);
    for (const view_watch::Mistake& mistake : watches_[t].suspected_mistakes())
      if (!is_explained(mistake)) inflate(mistake);
  }
  if (std::ranges::any_of(watches_, [&](const auto& watch) { return !late_s_.empty() && watch.contradicts(late_s_); }))
    late_s_.clear();
  if (!late_s_.empty())
    for (view_watch::ViewWatch& watch : watches_) watch.note_correction();
  return inflation_ != previous_inflation_;
}

// With several objects the data association is not known.
std::vector<MistakeWatch::PathOfCamera> MistakeWatch::paths_of(const object_tracking::TargetOptions& target) const {
  return std::vector<PathOfCamera>(target.count == 1 ? rig_.cameras.size() : 0);
}

// Of a camera's regions that of the target, or the largest. What was found stays: it is the whole film's.
void MistakeWatch::look_at_paths(const capture::FrameSet& set, std::span<const object_tracking::SeenRegion> regions,
                                 std::vector<PathOfCamera>& paths) {
  if (!first_at_) first_at_ = set.at;
  for (std::size_t c = 0; c < paths.size(); ++c) {
    const auto is_known = [&](const auto& of_target) { return c < of_target.size() && of_target[c].fault; };
    if (!set.frames[c] || std::ranges::any_of(paths_, is_known)) continue;
    const object_tracking::SeenRegion* seen = nullptr;
    for (const auto& region : regions)
      if (std::size_t(region.camera) == c &&
          (seen == nullptr || region.is_target || (!seen->is_target && region.radius_px > seen->radius_px)))
        seen = &region;
    if (seen == nullptr) continue;
    const capture::Frame& frame = *set.frames[c];
    paths[c].times.see({.number = frame.sequence,
                        .stamp_s = capture::seconds(frame.captured_at - *first_at_),
                        .t_s = capture::seconds(seen->at - *first_at_),
                        .px = seen->px,
                        .sigma_px = seen->sigma_px,
                        .is_target = seen->is_target});
    paths[c].fault = paths[c].times.judge(int(c));
  }
}

void MistakeWatch::inflate(const view_watch::Mistake& mistake) {
  // If some views are consistent, object_tracking has already inflated the others.
  if (mistake.do_some_agree) return;
  for (std::size_t c = 0; c < inflation_.size(); ++c)
    if (mistake.cameras.empty() || std::ranges::find(mistake.cameras, int(c)) != mistake.cameras.end())
      inflation_[c] = std::max(inflation_[c], inflation_rad(mistake, rig_.cameras[c]));
}

}  // namespace huetrack::pipeline
