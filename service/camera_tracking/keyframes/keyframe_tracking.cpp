#include "camera_tracking/keyframes/keyframe_tracking.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "camera_tracking/relocalizer.h"

namespace huetrack::keyframes {

namespace {

constexpr double border_px = 5;  // of a visible point to the image's border
// Dissimilarity of two views of a point: radians between the directions plus |log| of the distances' ratio. Its limit,
// and the penalty of all but the first view.
constexpr double most_dissimilar = 0.9, later_view_penalty = 0.15;
constexpr double known_share = 0.3;    // a readout counts as known below this relative sigma
constexpr double velocity_kept = 0.9;  // from frame to frame

// Least relative sigma of a seed's inverse depth in a fit (its error is correlated with the previous poses), and the
// relative step of its numerical derivative.
constexpr double seed_least_sigma = 0.5, seed_step = 0.05;
constexpr double max_line_sigma_px = 4;  // of a seed that is searched for
constexpr double most_swept_px = 60;     // between a point's projections by the middle row's pose and its own row's

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

std::optional<SweptFit> KeyframeTracking::refit_with_motion(const MotionPrior& prior, capture::Timestamp at,
                                                            const calib::Rigid3d& pose,
                                                            std::span<const PoseObservation> seen,
                                                            capture::Timestamp last_at) {
  if (!(readout().sigma_s < known_share * std::abs(readout().mean_s))) return std::nullopt;
  SweptFit fit =
      refine_swept_pose(camera_.model, seen, {pose, prior.sweep(pose, camera_.image_size.height - 1)}, prior);
  if (fit.fit.inliers < static_cast<int>(seen.size())) return std::nullopt;
  motion_.begin(at, fit.fit.cam_from_world), motion_.add(last_at, pose_, pose_covariance_);
  return fit;
}

// nullptr: all views are too dissimilar.
const PointView* KeyframeTracking::most_similar_view(const MapPoint& p, const Eigen::Vector3d& centre,
                                                     const SceneMap& map) {
  const PointView* best = nullptr;
  double least = most_dissimilar;
  for (int k = 0; k < p.view_count; ++k) {
    const PointView& view = p.view(k);
    const Eigen::Vector3d then = calib::inverse(map.keyframe(view.keyframe).cam_from_world).translation;
    const double dissimilarity = angle_between(then - p.position, centre - p.position) +
                                 std::abs(std::log((centre - p.position).norm() / (then - p.position).norm())) +
                                 (k > 0 ? later_view_penalty : 0.0);
    if (dissimilarity < least) least = dissimilarity, best = &view;
  }
  return best;
}

// normal: of its surface, world, unit; zero: towards the key frame.
std::optional<PatchTransfer> KeyframeTracking::patch_of(const SweptPose& pose, const SweptPixel& now,
                                                        const PointView& view, const Eigen::Vector3d& position,
                                                        const Eigen::Vector3d& normal, const SceneMap& map) const {
  const Keyframe& frame_then = map.keyframe(view.keyframe);
  const calib::Rigid3d then = frame_then.pose().at(view.px.y());
  const Eigen::Vector3d source = then * position;
  const bool known = normal.squaredNorm() > 0.5;
  const Eigen::Vector3d n = known ? Eigen::Vector3d(then.rotation * normal) : Eigen::Vector3d(source.normalized());
  auto patch = transfer_patch(camera_.model, view.px,
                              plane_homography(now.cam_from_world * calib::inverse(then), n, n.dot(source)));
  if (!patch) return std::nullopt;
  calib::CameraModel::Jacobian j;
  if (const Eigen::Vector3d p = now.cam_from_world * position; !pose.sweep.is_zero() && camera_.model.project(p, j))
    patch->affine = pose.sweep.unskew(j, p, now.px.y()).inverse() * patch->affine;
  if (const Sweep& sweep = frame_then.sweep; !sweep.is_zero() && camera_.model.project(source, j))
    patch->affine *= sweep.unskew(j, source, view.px.y());
  return patch;
}

std::vector<KeyframeTracking::Visible> KeyframeTracking::visible(const SweptPose& pose, const SceneMap& map,
                                                                 int levels) const {
  std::vector<Visible> out;
  const Eigen::Vector3d centre = calib::inverse(pose.cam_from_world).translation;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const MapPoint& p = map.points[i];
    if (!p.alive || p.view_count == 0 || is_corner(static_cast<int>(i))) continue;
    const auto middle = camera_.model.project(pose.cam_from_world * p.position);
    if (!middle || !is_inside(middle->px, camera_.image_size, -most_swept_px)) continue;
    const auto now = project_swept(camera_.model, pose, p.position);
    if (!now || !is_inside(now->px, camera_.image_size, border_px)) continue;
    calib::CameraModel::Jacobian j;
    if (!camera_.model.project(now->cam_from_world * p.position, j)) continue;
    Visible seen;
    seen.point = static_cast<int>(i), seen.px = now->px, seen.swept_px = (now->px - middle->px).cast<float>();
    seen.view = most_similar_view(p, centre, map);
    if (!seen.view) continue;
    const auto patch = patch_of(pose, *now, *seen.view, p.position, p.normal, map);
    if (!patch) continue;
    seen.patch = *patch;
    seen.level = search_level(seen.patch.affine, seen.view->level, levels);
    const Eigen::Matrix<double, 2, 3> d = j * now->cam_from_world.rotation.toRotationMatrix();
    seen.map_sigma_px = std::sqrt(0.5 * (d * p.covariance * d.transpose()).trace());
    out.push_back(seen);
  }
  return out;
}

// The seeds whose projection is certain enough to search for.
std::vector<KeyframeTracking::Visible> KeyframeTracking::visible_seeds(const SweptPose& pose, double shift_sigma_m,
                                                                       const SceneMap& map, int levels) const {
  std::vector<Visible> out;
  for (const PointSeed& s : map.seeds) {
    const Keyframe& frame_then = map.keyframe(s.view.keyframe);
    const calib::Rigid3d world_from_then = calib::inverse(frame_then.pose().at(s.view.px.y()));
    Visible seen;
    seen.point = -1, seen.view = &s.view;
    seen.position = world_from_then * (s.ray / s.inverse_depth);
    const auto now = project_swept(camera_.model, pose, seen.position);
    if (!now || !is_inside(now->px, camera_.image_size, border_px)) continue;
    const double step = seed_step * s.inverse_depth;
    const auto nearer =
        camera_.model.project(now->cam_from_world * world_from_then * (s.ray / (s.inverse_depth + step)));
    if (!nearer) continue;
    seen.px = now->px;
    const Eigen::Vector2d per_inverse_depth = (nearer->px - now->px) / step;
    const double sigma = std::max(s.sigma, seed_least_sigma * s.inverse_depth);
    seen.line_sigma_px = sigma * per_inverse_depth;
    seen.reach_px = s.sigma * per_inverse_depth;
    // The error of the camera's position times the error of the inverse depth moves it in every direction.
    seen.map_sigma_px = std::hypot(s.row_px_per_s * readout().sigma_s, sigma * camera_.model.fx() * shift_sigma_m);
    if (seen.reach_px.norm() > max_line_sigma_px || seen.map_sigma_px > max_line_sigma_px) continue;
    const auto patch = patch_of(pose, *now, s.view, seen.position, Eigen::Vector3d::Zero(), map);
    if (!patch) continue;
    seen.patch = *patch;
    seen.level = search_level(seen.patch.affine, s.view.level, levels);
    out.push_back(seen);
  }
  return out;
}

// Evenly, in map order.
void KeyframeTracking::subsample(std::vector<Visible>& seen, std::size_t most) {
  if (seen.size() <= most) return;
  std::vector<Visible> fewer;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (i * most / seen.size() != (i + 1) * most / seen.size()) fewer.push_back(seen[i]);
  }
  seen.swap(fewer);
}

bool KeyframeTracking::warp(const Visible& seen, const SceneMap& map, int level) {
  const Pyramid& source = *map.keyframe(seen.view->keyframe).pyramid;
  return warp_patch(source, seen.view->px, seen.patch.affine, level, patch_side, patch_);
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
    // A constant, slightly decaying velocity.
    const double keep = unproven_ == 0 ? velocity_kept : 0.0;
    const calib::Rigid3d predicted = calib::exp(calib::Tangent6d(keep * calib::log(step_))) * pose_;
    best = fine(coarse({predicted, prior_.sweep(predicted, last_row)}, *pyramid, map), *pyramid, map, false);
    if (!best.proven && unproven_ == 0) try_from(predicted, false);
    if (!best.proven && unproven_ == 0) try_from(predicted, false, true);
  }
  if (!best.proven) {  // a pose that is found below does not continue the motion
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
