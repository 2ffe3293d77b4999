#include "pipeline/mistake_watch.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace huetrack::pipeline {
namespace {

// How far from the middle of the picture a pixel of it usually is, as a tangent.
double usual_tangent(const calib::Camera& camera) {
  const double diagonal_px = std::hypot(camera.image_size.width, camera.image_size.height);
  return diagonal_px / std::sqrt(12.0) / view_watch::focal_px(camera);
}

// What moved is known with its size, and no mistake of the rig any more. Before that was known, views contradicted one
// another because of it, and any camera may have been blamed; the room tells of the others' turns, too.
bool is_explained_by(const std::vector<bool>& moved, const view_watch::Mistake& mistake) {
  using view_watch::MistakeKind;
  if (std::ranges::none_of(moved, std::identity{})) return false;
  return mistake.kind == MistakeKind::turned || mistake.kind == MistakeKind::zoomed ||
         mistake.kind == MistakeKind::other_rig;
}

}  // namespace

double doubt_of(const view_watch::Mistake& mistake, const calib::Camera& camera) {
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
    case MistakeKind::other_rig:
    case MistakeKind::contradiction: {
      // off_px is a median, across the epipolar lines; along them nobody knows, and it is taken to be as much.
      constexpr double median_of_sigma = 0.6745;
      return mistake.off_px / median_of_sigma / view_watch::focal_px(camera);
    }
    case MistakeKind::radius:
    case MistakeKind::shared_color:
    case MistakeKind::opencv_hue:
      return 0;
  }
  return 0;
}

void add_doubts(std::span<const double> doubts, std::vector<object_tracking::CameraTrust>& trust) {
  trust.resize(std::max(trust.size(), doubts.size()));
  for (std::size_t c = 0; c < doubts.size(); ++c)
    trust[c].pose_covariance.diagonal().head<3>().array() += doubts[c] * doubts[c];
}

MistakeWatch::MistakeWatch(const calib::CameraRig& rig, std::span<const object_tracking::TargetOptions> targets)
    : rig_(rig),
      mistakes_(targets.size()),
      late_s_(targets.size()),
      doubts_(rig.cameras.size(), 0.0),
      doubts_before_(doubts_) {
  watches_.reserve(targets.size());
  for (const auto& target : targets) watches_.emplace_back(rig, target);
}

void MistakeWatch::begin_anew(std::size_t target, const object_tracking::TargetOptions& options) {
  watches_.at(target) = view_watch::ViewWatch(rig_, options);
  mistakes_[target].clear();
}

bool MistakeWatch::look(const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
                        std::span<const object_trackers::ObjectTracker> trackers, const std::vector<bool>& moved) {
  std::swap(doubts_, doubts_before_);
  std::ranges::fill(doubts_, 0.0);
  for (std::size_t t = 0; t < watches_.size() && t < trackers.size(); ++t) {
    // Of several objects the tracker shows the views of one (ObjectTracker::regions()); times are those of any.
    const auto estimate = std::ranges::find(estimates, t, &object_tracking::ObjectEstimate::target);
    late_s_[t].clear();
    if (estimate != estimates.end()) {
      watches_[t].look(*estimate, trackers[t], set.at, moved);
      late_s_[t] = watches_[t].late_s();
    }
    const auto is_explained = [&](const view_watch::Mistake& mistake) { return is_explained_by(moved, mistake); };
    mistakes_[t] = watches_[t].mistakes();
    std::erase_if(mistakes_[t], is_explained);
    for (const view_watch::Mistake& mistake : watches_[t].suspected_mistakes())
      if (!is_explained(mistake)) doubt(mistake);
  }
  return doubts_ != doubts_before_;
}

void MistakeWatch::doubt(const view_watch::Mistake& mistake) {
  // Where some agree, the others are doubted already by the target's own views
  // (object_tracking/epipolar_consistency.h).
  if (mistake.do_some_agree) return;
  for (std::size_t c = 0; c < doubts_.size(); ++c)
    if (mistake.cameras.empty() || std::ranges::find(mistake.cameras, int(c)) != mistake.cameras.end())
      doubts_[c] = std::max(doubts_[c], doubt_of(mistake, rig_.cameras[c]));
}

}  // namespace huetrack::pipeline
