#include "camera_tracking/keyframes/keyframe_tracking.h"

#include <Eigen/LU>
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
constexpr double known_share = 0.3;    // a readout is known that is surer than this share of it
constexpr double velocity_kept = 0.9;  // from frame to frame

// A seed's depth is made of the poses of the frames before, whose errors it has: it is not to hold the next ones to
// them, so that it counts as no surer than this share.
constexpr double seed_open = 0.5, seed_step = 0.05;
constexpr double most_open_px = 4;  // of a seed: so that twice that is sought, and nothing like it lies there

// So far off the image may a point be for the middle row, and yet be in view in its own.
constexpr double most_swept_px = 60;

bool is_inside(const Eigen::Vector2d& px, const calib::ImageSize& size, double margin) {
  return px.x() >= margin && px.y() >= margin && px.x() <= size.width - 1 - margin &&
         px.y() <= size.height - 1 - margin;
}

}  // namespace

KeyframeTracking::KeyframeTracking(const calib::Camera& camera, std::size_t particle_count, std::uint64_t seed)
    : camera_(camera),
      lens_(without_pose(camera)),
      rng_(seed, 1),
      particle_count_(particle_count),
      seed_(seed),
      readout_(camera.timing) {}

void KeyframeTracking::set_pose(capture::Timestamp at, const calib::Rigid3d& cam_from_world) {
  pose_ = cam_from_world;
  step_ = {};
  motion_.begin(at, cam_from_world);
  unproven_ = 0;
  particles_.reset(particle_count_, pose_);
  effective_sample_size_ = static_cast<double>(particle_count_);
}

void KeyframeTracking::forget() {
  step_ = {};
  motion_.forget();
}

std::optional<SweptFit> KeyframeTracking::with_motion(const MotionPrior& prior, capture::Timestamp at,
                                                      const calib::Rigid3d& pose, std::span<const PoseObservation> seen,
                                                      capture::Timestamp last_at) {
  if (!(readout().sigma_s < known_share * std::abs(readout().mean_s))) return std::nullopt;
  SweptFit fit =
      refine_swept_pose(camera_.model, seen, {pose, prior.sweep(pose, camera_.image_size.height - 1)}, prior);
  if (fit.fit.inliers < static_cast<int>(seen.size())) return std::nullopt;
  motion_.begin(at, fit.fit.cam_from_world), motion_.add(last_at, pose_, pose_covariance_);
  return fit;
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

// normal: of its surface, world, unit; zero: towards the key frame.
std::optional<PatchTransfer> KeyframeTracking::patch_of(const SweptPose& pose, const SweptPixel& now,
                                                        const PointLook& look, const Eigen::Vector3d& position,
                                                        const Eigen::Vector3d& normal, const SceneMap& map) const {
  const Keyframe& frame_then = map.keyframes[static_cast<std::size_t>(look.keyframe)];
  const calib::Rigid3d then = frame_then.pose().at(look.px.y());
  const Eigen::Vector3d source = then * position;
  const bool known = normal.squaredNorm() > 0.5;
  const Eigen::Vector3d n = known ? Eigen::Vector3d(then.rotation * normal) : Eigen::Vector3d(source.normalized());
  auto patch = transfer_patch(camera_.model, look.px,
                              plane_homography(now.cam_from_world * calib::inverse(then), n, n.dot(source)));
  if (!patch) return std::nullopt;
  calib::CameraModel::Jacobian j;
  if (const Eigen::Vector3d p = now.cam_from_world * position; !pose.sweep.is_none() && camera_.model.project(p, j))
    patch->affine = pose.sweep.unskewed(j, p, now.px.y()).inverse() * patch->affine;
  if (const Sweep& sweep = frame_then.sweep; !sweep.is_none() && camera_.model.project(source, j))
    patch->affine *= sweep.unskewed(j, source, look.px.y());
  return patch;
}

std::vector<KeyframeTracking::Visible> KeyframeTracking::visible(const SweptPose& pose, const SceneMap& map,
                                                                 int levels) const {
  std::vector<Visible> out;
  const Eigen::Vector3d centre = calib::inverse(pose.cam_from_world).translation;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const MapPoint& p = map.points[i];
    if (!p.alive || p.look_count == 0 || is_corner(static_cast<int>(i))) continue;
    const auto middle = camera_.model.project(pose.cam_from_world * p.position);
    if (!middle || !is_inside(middle->px, camera_.image_size, -most_swept_px)) continue;
    const auto now = project_swept(camera_.model, pose, p.position);
    if (!now || !is_inside(now->px, camera_.image_size, border_px)) continue;
    calib::CameraModel::Jacobian j;
    if (!camera_.model.project(now->cam_from_world * p.position, j)) continue;
    Visible seen;
    seen.point = static_cast<int>(i), seen.px = now->px, seen.swept_px = (now->px - middle->px).cast<float>();
    seen.look = look_most_alike(p, centre, map);
    if (!seen.look) continue;
    const auto patch = patch_of(pose, *now, *seen.look, p.position, p.normal, map);
    if (!patch) continue;
    seen.patch = *patch;
    seen.level = search_level(seen.patch.affine, seen.look->level, levels);
    const Eigen::Matrix<double, 2, 3> d = j * now->cam_from_world.rotation.toRotationMatrix();
    seen.map_sigma_px = std::sqrt(0.5 * (d * p.covariance * d.transpose()).trace());
    out.push_back(seen);
  }
  return out;
}

// Those whose place in the image is known well enough to be sought there.
std::vector<KeyframeTracking::Visible> KeyframeTracking::visible_seeds(const SweptPose& pose, double shift_sigma_m,
                                                                       const SceneMap& map, int levels) const {
  std::vector<Visible> out;
  for (const PointSeed& s : map.seeds) {
    const Keyframe& frame_then = map.keyframes[static_cast<std::size_t>(s.look.keyframe)];
    const calib::Rigid3d world_from_then = calib::inverse(frame_then.pose().at(s.look.px.y()));
    Visible seen;
    seen.point = -1, seen.look = &s.look;
    seen.position = world_from_then * (s.ray / s.inverse_depth);
    const auto now = project_swept(camera_.model, pose, seen.position);
    if (!now || !is_inside(now->px, camera_.image_size, border_px)) continue;
    const double step = seed_step * s.inverse_depth;
    const auto nearer =
        camera_.model.project(now->cam_from_world * world_from_then * (s.ray / (s.inverse_depth + step)));
    if (!nearer) continue;
    seen.px = now->px;
    const Eigen::Vector2d per_inverse_depth = (nearer->px - now->px) / step;
    const double open = std::max(s.sigma, seed_open * s.inverse_depth);
    seen.open_px = open * per_inverse_depth;
    seen.reach_px = s.sigma * per_inverse_depth;
    // A shift of the camera that nobody knows yet moves it by as much as its depth leaves open.
    seen.map_sigma_px = std::hypot(s.row_px_per_s * readout().sigma_s, open * camera_.model.fx() * shift_sigma_m);
    if (seen.reach_px.norm() > most_open_px || seen.map_sigma_px > most_open_px) continue;
    const auto patch = patch_of(pose, *now, s.look, seen.position, Eigen::Vector3d::Zero(), map);
    if (!patch) continue;
    seen.patch = *patch;
    seen.level = search_level(seen.patch.affine, s.look.level, levels);
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

ProvenPose KeyframeTracking::track(capture::Timestamp at, const std::shared_ptr<const Pyramid>& pyramid,
                                   const SceneMap& map, bool lost, const std::optional<calib::Rigid3d>& proposed) {
  ++frames_;
  ProvenPose best;
  const double last_row = camera_.image_size.height - 1;
  const auto try_from = [&](const calib::Rigid3d& pose, bool is_guess, bool is_near = false) {
    ProvenPose other = fine({pose, prior_.sweep(pose, last_row)}, *pyramid, map, is_guess, is_near);
    if (other.proven) best = std::move(other);
  };
  if (lost || unproven_ > 0) motion_.forget();
  prior_ = motion_.prior(at, readout());
  if (!lost) {
    // The velocity fades where it is not confirmed.
    const double keep = unproven_ == 0 ? velocity_kept : 0.0;
    const calib::Rigid3d predicted = calib::exp(calib::Tangent6d(keep * calib::log(step_))) * pose_;
    best = fine(coarse({predicted, prior_.sweep(predicted, last_row)}, *pyramid, map), *pyramid, map, false);
    if (!best.proven && unproven_ == 0) try_from(predicted, false);
    if (!best.proven && unproven_ == 0) try_from(predicted, false, true);
  }
  if (!best.proven) {  // whatever is found from here on is no continuation
    motion_.forget();
    prior_ = motion_.prior(at, readout());
  }
  if (!best.proven && map.keyframes.size() >= 2) {
    if (const auto proposal = relocalize(camera_, *pyramid, map, seed_ + frames_))
      try_from(proposal->cam_from_world, true);
  }
  if (!best.proven && proposed) try_from(*proposed, true);
  if (best.proven) {
    step_ = unproven_ == 0 ? best.pose.cam_from_world * calib::inverse(pose_) : calib::Rigid3d{};
    pose_ = best.pose.cam_from_world, pose_covariance_ = best.tangent_covariance;
    unproven_ = 0;
    motion_.add(at, pose_, pose_covariance_);
    if (best.readout) readout_.add(*best.readout);
  } else {
    ++unproven_;
    if (particles_.size() > 0) particles_.resample(rng_, particle_count_);
  }
  return best;
}

}  // namespace huetrack::keyframes
