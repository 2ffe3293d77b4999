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
  for (const auto& target : targets) watches_.emplace_back(rig, target);
}

void MistakeWatch::reset_target(std::size_t target, const object_tracking::TargetOptions& options) {
  watches_.at(target) = view_watch::ViewWatch(rig_, options);
  mistakes_[target].clear();
}

void MistakeWatch::begin_anew() {
  for (view_watch::ViewWatch& watch : watches_) watch.begin_anew();
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
    }
    const auto is_explained = [&](const view_watch::Mistake& mistake) { return is_explained_by(moved, mistake); };
    mistakes_[t] = watches_[t].mistakes();
    std::erase_if(mistakes_[t], is_explained);
    for (const view_watch::Mistake& mistake : watches_[t].suspected_mistakes())
      if (!is_explained(mistake)) inflate(mistake);
  }
  if (std::ranges::any_of(watches_, [&](const auto& watch) { return !late_s_.empty() && watch.contradicts(late_s_); }))
    late_s_.clear();
  if (!late_s_.empty())
    for (view_watch::ViewWatch& watch : watches_) watch.note_correction();
  return inflation_ != previous_inflation_;
}

void MistakeWatch::inflate(const view_watch::Mistake& mistake) {
  // If some views are consistent, object_tracking has already inflated the others.
  if (mistake.do_some_agree) return;
  for (std::size_t c = 0; c < inflation_.size(); ++c)
    if (mistake.cameras.empty() || std::ranges::find(mistake.cameras, int(c)) != mistake.cameras.end())
      inflation_[c] = std::max(inflation_[c], inflation_rad(mistake, rig_.cameras[c]));
}

}  // namespace huetrack::pipeline
