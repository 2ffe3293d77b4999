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

void BallTracks::move_earlier(std::size_t camera, double by_s) {
  for (Point& p : of_camera[camera]) p.t_s -= by_s;
}

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

std::optional<Vector3d> triangulated(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                                     const std::vector<bool>& use, const BallTracks& tracks, double t_s) {
  constexpr double most_off = 0.35;  // rad between a ray and the point: initial poses are rough
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

BallPath triangulated_path(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                           const BallTracks& tracks, double from_s, double to_s, double step_s, std::size_t* count) {
  BallPath path = BallPath::over(from_s, to_s, step_s);
  const std::vector<bool> all(rig.cameras.size(), true);
  std::vector<std::size_t> known;
  for (std::size_t k = 0; k < path.control.size(); ++k) {
    const double t = from_s + (static_cast<double>(k) - 1) * step_s;  // where its weight is largest
    if (const auto p = triangulated(rig, cam_from_world, all, tracks, t)) {
      path.control[k] = *p;
      known.push_back(k);
    }
  }
  *count = known.size();
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

constexpr double reach_px = 2;            // residual of an inlier
constexpr std::size_t least_common = 12;  // inliers of two cameras, or of a camera and the path

// Inlier share of synchronised cameras; with fewer, latencies are searched over this range and step.
constexpr double most_agree = 0.7;
constexpr double most_late_s = 0.06, late_step_s = 0.005;

// Latency with the most inliers. agreement(later_s): their number, of `all`.
double best_latency(std::size_t all, auto&& agreement) {
  int best = agreement(0.0);
  double best_s = 0;
  if (best >= most_agree * static_cast<double>(all)) return best_s;
  for (int i = 1; i * late_step_s < most_late_s + late_step_s / 2; ++i) {
    for (const double later_s : {i * late_step_s, -i * late_step_s}) {
      const int count = agreement(later_s);
      if (count > best) best = count, best_s = later_s;
    }
  }
  return best_s;
}

struct FirstPair {
  std::size_t a = 0, b = 0;
  int inliers = 0;
  double b_later_s = 0;
  calib::Rigid3d b_from_a;
};

// Relative pose of two cameras by their essential matrix, if the stamps of b are later_s late.
FirstPair pair_of(const calib::CameraRig& rig, const BallTracks& tracks, std::size_t a, std::size_t b, double later_s) {
  FirstPair pair{a, b, 0, later_s, {}};
  std::vector<cv::Point2d> in_a, in_b;
  for (const BallTracks::Point& p : tracks.of_camera[a]) {
    const auto other = tracks.at(b, p.t_s + later_s);
    if (!other) continue;
    const auto pa = on_plane(rig.cameras[a].model, p.px), pb = on_plane(rig.cameras[b].model, *other);
    if (!pa || !pb) continue;
    in_a.push_back(*pa);
    in_b.push_back(*pb);
  }
  if (in_a.size() < least_common) return pair;
  // OpenCV's RANSAC has a fixed seed: deterministic.
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat mask, rotation, translation;
  const cv::Mat essential =
      cv::findEssentialMat(in_a, in_b, identity, cv::RANSAC, 0.9999,
                           2 * reach_px / (focal_of(rig.cameras[a]) + focal_of(rig.cameras[b])), mask);
  if (essential.rows != 3 || essential.cols != 3) return pair;
  pair.inliers = cv::recoverPose(essential, in_a, in_b, identity, rotation, translation, mask);
  pair.b_from_a = pose_of(rotation, translation);
  return pair;
}

// The pair with most inliers. throws CalibrationError
FirstPair first_pair(const calib::CameraRig& rig, const BallTracks& tracks) {
  FirstPair best;
  for (std::size_t a = 0; a < rig.cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < rig.cameras.size(); ++b) {
      best_latency(tracks.shared(a, b).size(), [&](double later_s) {
        const FirstPair pair = pair_of(rig, tracks, a, b, later_s);
        if (pair.inliers > best.inliers) best = pair;
        return pair.inliers;
      });
    }
  }
  if (best.inliers < static_cast<int>(least_common)) {
    throw solver::CalibrationError("no two cameras agree on how the ball moved, so their poses cannot be found",
                                   solver::Fault::contradicting_motion);
  }
  return best;
}

// A camera without a pose, and its views of the path of those that have one.
struct NextCamera {
  std::size_t camera = 0;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> seen;  // of each point, on the plane z = 1
};

NextCamera common_of(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& poses,
                     const std::vector<bool>& placed, const BallTracks& tracks, std::size_t camera, double later_s) {
  NextCamera common{camera, {}, {}};
  for (const BallTracks::Point& p : tracks.of_camera[camera]) {
    const auto p_world = triangulated(rig, poses, placed, tracks, p.t_s - later_s);
    const auto plane = on_plane(rig.cameras[camera].model, p.px);
    if (!plane || !p_world) continue;
    common.points.emplace_back(p_world->x(), p_world->y(), p_world->z());
    common.seen.push_back(*plane);
  }
  return common;
}

// The one with most shared points; no points: none shares any.
NextCamera next_camera(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& poses,
                       const std::vector<bool>& placed, const BallTracks& tracks) {
  NextCamera next;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (placed[c]) continue;
    NextCamera here = common_of(rig, poses, placed, tracks, c, 0);
    if (here.points.size() > next.points.size()) next = std::move(here);
  }
  return next;
}

struct PathPose {
  int inliers = 0;  // fewer than least_common: no pose
  calib::Rigid3d cam_from_world;
};

// Without repeated points, as of a ball at rest.
NextCamera thinned(const NextCamera& all) {
  constexpr double least_apart = 0.05;  // of the rms distance from the mean
  cv::Point3d mean;
  double squares = 0;
  const auto count = static_cast<double>(all.points.size());
  for (const cv::Point3d& p : all.points) mean += p / count;
  for (const cv::Point3d& p : all.points) squares += (p - mean).dot(p - mean) / count;
  NextCamera out{all.camera, {}, {}};
  for (std::size_t i = 0; i < all.points.size(); ++i) {
    const auto is_near = [&](const cv::Point3d& p) {
      return cv::norm(p - all.points[i]) < least_apart * std::sqrt(squares);
    };
    if (std::ranges::any_of(out.points, is_near)) continue;
    out.points.push_back(all.points[i]);
    out.seen.push_back(all.seen[i]);
  }
  return out;
}

PathPose pose_by_pnp(const calib::CameraRig& rig, const NextCamera& next) {
  if (next.points.size() < least_common) return {};
  cv::Mat rotation_vector, translation, rotation, inliers;
  if (!cv::solvePnPRansac(
          next.points, next.seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation_vector, translation, false, 500,
          static_cast<float>(3 * reach_px / focal_of(rig.cameras[next.camera])), 0.999, inliers, cv::SOLVEPNP_SQPNP) ||
      inliers.rows < static_cast<int>(least_common))
    return {};
  cv::Rodrigues(rotation_vector, rotation);
  return {inliers.rows, pose_of(rotation, translation)};
}

PathPose pose_from_path(const calib::CameraRig& rig, const NextCamera& next) {
  try {
    return pose_by_pnp(rig, next);
  } catch (const cv::Exception&) {  // SQPnP throws for samples of points at one place
  }
  try {
    return pose_by_pnp(rig, thinned(next));
  } catch (const cv::Exception&) {
    return {};
  }
}

}  // namespace

WaveStart start_from_nothing(const calib::CameraRig& rig, BallTracks tracks) {
  const std::size_t n = rig.cameras.size();
  const FirstPair pair = first_pair(rig, tracks);
  WaveStart start{std::vector<calib::Rigid3d>(n), std::vector<double>(n, 0)};
  std::vector<calib::Rigid3d>& poses = start.cam_from_world;
  std::vector<bool> placed(n, false);
  const auto place = [&](std::size_t camera, const calib::Rigid3d& pose, double later_s) {
    poses[camera] = pose;
    start.later_s[camera] = later_s;
    tracks.move_earlier(camera, later_s);
    placed[camera] = true;
  };
  place(pair.a, {}, 0);
  place(pair.b, pair.b_from_a, pair.b_later_s);
  for (std::size_t round = 2; round < n; ++round) {
    const NextCamera next = next_camera(rig, poses, placed, tracks);
    const double later_s = best_latency(next.points.size(), [&](double s) {
      return pose_from_path(rig, common_of(rig, poses, placed, tracks, next.camera, s)).inliers;
    });
    const PathPose pose = pose_from_path(rig, common_of(rig, poses, placed, tracks, next.camera, later_s));
    if (pose.inliers < static_cast<int>(least_common)) {
      std::vector<std::string_view> names;
      for (std::size_t c = 0; c < n; ++c) {
        if (!placed[c]) names.emplace_back(rig.cameras[c].name);
      }
      throw solver::CalibrationError(
          fmt::format(
              "{}: cannot be placed: its regions of the target's colour do not fit the ball's path as the other "
              "cameras saw it",
              fmt::to_string(fmt::join(names, ", "))),
          solver::Fault::unplaced_camera);
    }
    place(next.camera, pose.cam_from_world, later_s);
  }
  // Latencies are relative to the first camera's.
  const double first_s = start.later_s[0];
  for (double& later_s : start.later_s) later_s -= first_s;
  return start;
}

}  // namespace huetrack::wave
