#include "calib/wave/wave_start.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "calib/solver/bundle_adjustment.h"

namespace huetrack::wave {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// On the plane z = 1; nullopt: too far off the axis for it.
std::optional<cv::Point2d> on_plane(const calib::CameraModel& model, const Vector2d& px) {
  const auto ray = model.ray({px});
  if (!ray || ray->z() < 0.1) return std::nullopt;
  return cv::Point2d(ray->x() / ray->z(), ray->y() / ray->z());
}

calib::Rigid3d pose_of(const cv::Mat& rotation, const cv::Mat& translation) {
  Matrix3d r;
  Vector3d t;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) r(i, j) = rotation.at<double>(i, j);
    t[i] = translation.at<double>(i);
  }
  return {Eigen::Quaterniond(r).normalized(), t};
}

}  // namespace

std::optional<Vector2d> BallTracks::at(std::size_t camera, double t_s) const {
  const auto& track = of_camera[camera];
  const auto after = std::ranges::lower_bound(track, t_s - 1e-6, {}, &Point::t_s);
  if (after != track.end() && after->t_s <= t_s + 1e-6) return after->px;
  if (after == track.begin() || after == track.end()) return std::nullopt;
  const auto before = after - 1;
  const double gap = after->t_s - before->t_s;
  if (gap > max_gap_s) return std::nullopt;
  const double share = (t_s - before->t_s) / gap;
  return Vector2d((1 - share) * before->px + share * after->px);
}

std::vector<double> BallTracks::shared(std::size_t a, std::size_t b) const {
  std::vector<double> times;
  for (const Point& p : of_camera[a]) {
    if (at(b, p.t_s)) times.push_back(p.t_s);
  }
  return times;
}

std::optional<Vector3d> crossing(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                                 const std::vector<bool>& use, const BallTracks& tracks, double t_s) {
  constexpr double most_off = 0.35;  // radians between a ray and the crossing: the poses may be well off
  Matrix3d sum = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  std::vector<std::pair<Vector3d, Vector3d>> rays;  // centre, direction
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (!use[c]) continue;
    const auto px = tracks.at(c, t_s);
    if (!px) continue;
    const auto ray = rig.cameras[c].model.ray({*px});
    if (!ray) continue;
    const calib::Rigid3d world_from_cam = calib::inverse(cam_from_world[c]);
    rays.emplace_back(world_from_cam.translation, world_from_cam.rotation * *ray);
    const Matrix3d across = Matrix3d::Identity() - rays.back().second * rays.back().second.transpose();
    sum += across;
    right += across * rays.back().first;
  }
  if (rays.size() < 2) return std::nullopt;
  const Eigen::FullPivLU<Matrix3d> lu(sum);
  if (lu.rcond() < 1e-6) return std::nullopt;
  const Vector3d p = lu.solve(right);
  const bool meet = std::ranges::all_of(rays, [&](const auto& ray) {
    const Vector3d d = p - ray.first;
    return d.norm() > 1e-9 && std::acos(std::clamp(d.normalized().dot(ray.second), -1.0, 1.0)) < most_off;
  });
  if (!meet) return std::nullopt;
  return p;
}

BallPath crossed_path(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                      const BallTracks& tracks, double from_s, double to_s, double step_s, std::size_t* crossed) {
  BallPath path = BallPath::over(from_s, to_s, step_s);
  const std::vector<bool> all(rig.cameras.size(), true);
  std::vector<std::size_t> known;
  for (std::size_t k = 0; k < path.control.size(); ++k) {
    const double t = from_s + (static_cast<double>(k) - 1) * step_s;  // where this control point has most weight
    if (const auto p = crossing(rig, cam_from_world, all, tracks, t)) {
      path.control[k] = *p;
      known.push_back(k);
    }
  }
  *crossed = known.size();
  if (known.empty()) return path;
  for (std::size_t k = 0; k < known.front(); ++k) path.control[k] = path.control[known.front()];
  for (std::size_t k = known.back() + 1; k < path.control.size(); ++k) path.control[k] = path.control[known.back()];
  for (std::size_t i = 0; i + 1 < known.size(); ++i) {
    const Vector3d a = path.control[known[i]], b = path.control[known[i + 1]];
    const auto steps = static_cast<double>(known[i + 1] - known[i]);
    for (std::size_t k = known[i] + 1; k < known[i + 1]; ++k)
      path.control[k] = a + (b - a) * static_cast<double>(k - known[i]) / steps;
  }
  return path;
}

namespace {

double focal_of(const calib::Camera& camera) {
  return (camera.model.fx() + camera.model.fy()) / 2;
}

constexpr double reach_px = 2;            // of an inlier
constexpr std::size_t least_common = 12;  // observations that two cameras, or a camera and the path, must agree in

struct FirstPair {
  std::size_t a = 0, b = 0;
  int inliers = 0;
  calib::Rigid3d b_from_a;
};

// The two cameras that agree most on how the ball moved, by their essential matrix. throws CalibrationError
FirstPair first_pair(const calib::CameraRig& rig, const BallTracks& tracks) {
  FirstPair best;
  for (std::size_t a = 0; a < rig.cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < rig.cameras.size(); ++b) {
      std::vector<cv::Point2d> in_a, in_b;
      for (const double t : tracks.shared(a, b)) {
        const auto pa = on_plane(rig.cameras[a].model, *tracks.at(a, t));
        const auto pb = on_plane(rig.cameras[b].model, *tracks.at(b, t));
        if (!pa || !pb) continue;
        in_a.push_back(*pa);
        in_b.push_back(*pb);
      }
      if (in_a.size() < least_common) continue;
      // OpenCV's RANSAC has a seed of its own: the same input gives the same answer.
      const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
      cv::Mat mask, rotation, translation;
      const cv::Mat essential =
          cv::findEssentialMat(in_a, in_b, identity, cv::RANSAC, 0.9999,
                               2 * reach_px / (focal_of(rig.cameras[a]) + focal_of(rig.cameras[b])), mask);
      if (essential.rows != 3 || essential.cols != 3) continue;
      const int inliers = cv::recoverPose(essential, in_a, in_b, identity, rotation, translation, mask);
      if (inliers > best.inliers) best = {a, b, inliers, pose_of(rotation, translation)};
    }
  }
  if (best.inliers < static_cast<int>(least_common)) {
    throw solver::CalibrationError(
        "no two cameras agree on how the ball moved, so their poses cannot be found: is its colour seen on anything "
        "else that moves? Give approximate poses (--config with a rig), or wave for longer, through the whole volume");
  }
  return best;
}

// A camera that is not placed yet, and what it saw of the path that those before it make.
struct NextCamera {
  std::size_t camera = 0;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> seen;  // beside the points, on the plane z = 1
};

// The one that shares most with those that are placed; no points: there is none.
NextCamera next_camera(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& poses,
                       const std::vector<bool>& placed, const BallTracks& tracks) {
  NextCamera next;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (placed[c]) continue;
    NextCamera here{c, {}, {}};
    for (const BallTracks::Point& p : tracks.of_camera[c]) {
      const auto p_world = crossing(rig, poses, placed, tracks, p.t_s);
      const auto plane = on_plane(rig.cameras[c].model, p.px);
      if (!plane || !p_world) continue;
      here.points.emplace_back(p_world->x(), p_world->y(), p_world->z());
      here.seen.push_back(*plane);
    }
    if (here.points.size() > next.points.size()) next = std::move(here);
  }
  return next;
}

// nullopt: too little of what it saw agrees with the path.
std::optional<calib::Rigid3d> pose_from_path(const calib::CameraRig& rig, const NextCamera& next) {
  if (next.points.size() < least_common) return std::nullopt;
  cv::Mat rotation_vector, translation, rotation, inliers;
  if (!cv::solvePnPRansac(
          next.points, next.seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation_vector, translation, false, 500,
          static_cast<float>(3 * reach_px / focal_of(rig.cameras[next.camera])), 0.999, inliers, cv::SOLVEPNP_SQPNP) ||
      inliers.rows < static_cast<int>(least_common))
    return std::nullopt;
  cv::Rodrigues(rotation_vector, rotation);
  return pose_of(rotation, translation);
}

}  // namespace

std::vector<calib::Rigid3d> poses_from_nothing(const calib::CameraRig& rig, const BallTracks& tracks) {
  const std::size_t n = rig.cameras.size();
  const FirstPair pair = first_pair(rig, tracks);
  std::vector<calib::Rigid3d> poses(n);
  std::vector<bool> placed(n, false);
  poses[pair.b] = pair.b_from_a;
  placed[pair.a] = placed[pair.b] = true;
  for (std::size_t round = 2; round < n; ++round) {
    const NextCamera next = next_camera(rig, poses, placed, tracks);
    const auto pose = pose_from_path(rig, next);
    if (!pose) {
      std::vector<std::string_view> names;
      for (std::size_t c = 0; c < n; ++c) {
        if (!placed[c]) names.emplace_back(rig.cameras[c].name);
      }
      throw solver::CalibrationError(
          fmt::format("{}: cannot be placed; wave the ball where it and two other cameras see it at once",
                      fmt::to_string(fmt::join(names, ", "))));
    }
    poses[next.camera] = *pose;
    placed[next.camera] = true;
  }
  return poses;
}

}  // namespace huetrack::wave
