#include "camera_tracking/keyframes/keyframe_tracking.h"

#include <algorithm>
#include <cmath>

#include "camera_tracking/relocalizer.h"

namespace huetrack::keyframes {

using namespace camera_tracking;

namespace {

constexpr double border_px = 5;  // that a point must be away from the image's border
// A look counts for a point when it is less unlike today's view than this: radians between the directions plus the
// logarithm of the distances' ratio. The first look is preferred by so much: it is nobody's copy.
constexpr double most_unlike = 0.9, later_look_penalty = 0.15;
constexpr double velocity_kept = 0.9;  // from frame to frame

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

KeyframeTracking::KeyframeTracking(const calib::Camera& camera, std::size_t particle_count, std::uint64_t seed)
    : camera_(camera), lens_(without_pose(camera)), rng_(seed, 1), particle_count_(particle_count), seed_(seed) {}

void KeyframeTracking::set_pose(const calib::Rigid3d& cam_from_world) {
  pose_ = cam_from_world;
  step_ = {};
  unproven_ = 0;
  particles_.reset(particle_count_, pose_);
  effective_sample_size_ = static_cast<double>(particle_count_);
}

void KeyframeTracking::forget() {
  step_ = {};
}

// nullptr: from here the point looks like in none of its looks.
const PointLook* KeyframeTracking::look_most_alike(const MapPoint& p, const Eigen::Vector3d& centre,
                                                   const SceneMap& map) {
  const PointLook* best = nullptr;
  double least = most_unlike;
  for (int k = 0; k < p.look_count; ++k) {
    const PointLook& look = p.looks[static_cast<std::size_t>(k)];
    const Eigen::Vector3d then =
        calib::inverse(map.keyframes[static_cast<std::size_t>(look.keyframe)].cam_from_world).translation;
    const double unlike = angle_between(then - p.position, centre - p.position) +
                          std::abs(std::log((centre - p.position).norm() / (then - p.position).norm())) +
                          (k > 0 ? later_look_penalty : 0.0);
    if (unlike < least) least = unlike, best = &look;
  }
  return best;
}

std::vector<KeyframeTracking::Visible> KeyframeTracking::visible(const calib::Rigid3d& pose, const SceneMap& map,
                                                                 int levels) const {
  std::vector<Visible> out;
  const Eigen::Vector3d centre = calib::inverse(pose).translation;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const MapPoint& p = map.points[i];
    if (!p.alive || p.look_count == 0 || is_corner(static_cast<int>(i))) continue;
    calib::CameraModel::Jacobian j;
    const auto px = camera_.model.project(pose * p.position, j);
    if (!px || px->px.x() < border_px || px->px.y() < border_px ||
        px->px.x() > camera_.image_size.width - 1 - border_px || px->px.y() > camera_.image_size.height - 1 - border_px)
      continue;
    Visible seen;
    seen.point = static_cast<int>(i), seen.px = px->px;
    seen.look = look_most_alike(p, centre, map);
    if (!seen.look) continue;
    const calib::Rigid3d& then = map.keyframes[static_cast<std::size_t>(seen.look->keyframe)].cam_from_world;
    const Eigen::Vector3d source = then * p.position;
    const bool known = p.normal.squaredNorm() > 0.5;
    const Eigen::Vector3d normal =
        known ? Eigen::Vector3d(then.rotation * p.normal) : Eigen::Vector3d(source.normalized());
    const auto patch = transfer_patch(camera_.model, seen.look->px,
                                      plane_homography(pose * calib::inverse(then), normal, normal.dot(source)));
    if (!patch) continue;
    seen.patch = *patch;
    seen.level = search_level(patch->affine, seen.look->level, levels);
    const Eigen::Matrix<double, 2, 3> d = j * pose.rotation.toRotationMatrix();
    seen.map_sigma_px = std::sqrt(0.5 * (d * p.covariance * d.transpose()).trace());
    out.push_back(seen);
  }
  return out;
}

// Evenly, in the order of the map.
void KeyframeTracking::thin_out(std::vector<Visible>& seen, std::size_t most) {
  if (seen.size() <= most) return;
  std::vector<Visible> fewer;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (i * most / seen.size() != (i + 1) * most / seen.size()) fewer.push_back(seen[i]);
  }
  seen.swap(fewer);
}

bool KeyframeTracking::warp(const Visible& seen, const SceneMap& map, int level) {
  const Pyramid& source = *map.keyframes[static_cast<std::size_t>(seen.look->keyframe)].pyramid;
  return warp_patch(source, seen.look->px, seen.patch.affine, level, patch_side, patch_);
}

ProvenPose KeyframeTracking::track(const std::shared_ptr<const Pyramid>& pyramid, const SceneMap& map, bool lost,
                                   const std::optional<calib::Rigid3d>& proposed) {
  ++frames_;
  ProvenPose best;
  const auto try_from = [&](const calib::Rigid3d& pose, bool is_guess) {
    ProvenPose other = fine(pose, *pyramid, map, is_guess);
    if (other.proven) best = std::move(other);
  };
  if (!lost) {
    // The velocity fades where it is not confirmed.
    const double keep = unproven_ == 0 ? velocity_kept : 0.0;
    const calib::Rigid3d predicted = calib::exp(calib::Tangent6d(keep * calib::log(step_))) * pose_;
    best = fine(coarse(predicted, *pyramid, map), *pyramid, map, false);
    if (!best.proven && unproven_ == 0) try_from(predicted, false);
  }
  if (!best.proven && map.keyframes.size() >= 2) {
    if (const auto proposal = relocalize(camera_, *pyramid, map, seed_ + frames_))
      try_from(proposal->cam_from_world, true);
  }
  if (!best.proven && proposed) try_from(*proposed, true);
  if (best.proven) {
    step_ = unproven_ == 0 ? best.cam_from_world * calib::inverse(pose_) : calib::Rigid3d{};
    pose_ = best.cam_from_world;
    unproven_ = 0;
  } else {
    ++unproven_;
    if (particles_.size() > 0) particles_.resample(rng_, particle_count_);
  }
  return best;
}

}  // namespace huetrack::keyframes
