#include "calib/solver/volume_accuracy.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/solver/ray_uncertainty.h"

namespace huetrack::solver {
namespace {

using calib::cross_matrix;
using calib::index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

double quantile(std::vector<double> values, double share) {
  return values.empty() ? 0 : calib::quantile_in_place(std::span(values), share);
}

// Derivatives of a triangulated point.
struct Sensitivity {
  std::size_t point;                                       // index into VolumeAccuracy::points
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_parameters;  // of the calibration's covariance
  Matrix3d by_noise;                                       // covariance for a noise of 1 px
};

// Sets point.views. nullopt: fewer than two cameras see it. index_of_point: see Sensitivity.
std::optional<Sensitivity> sensitivity_at(const Adjustment& a, PointAccuracy& point, std::size_t index_of_point) {
  Matrix3d h = Matrix3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> g = Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, a.covariance.rows());
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const AdjustedCamera& camera = a.cameras[c];
    const Vector3d p_cam = camera.cam_from_world * point.p_world;
    const calib::Camera finished{camera.name, camera.image_size, camera.model(), camera.cam_from_world, {}};
    const auto px = finished.project_world(point.p_world);
    if (!px || !finished.contains(*px)) continue;
    Vector2d ignored;
    PixelByPoint by_point;
    PixelByLens by_lens;
    if (!project(camera.lens, camera.parameters, p_cam, ignored, &by_point, &by_lens)) continue;
    ++point.views;
    const Eigen::Matrix<double, 2, 3> by_world = by_point * camera.cam_from_world.rotation.toRotationMatrix();
    h += by_world.transpose() * by_world;
    if (!a.lens_offset.empty() && a.lens_offset[c] >= 0) {
      const int count = parameter_count(camera.lens);
      g.middleCols(a.lens_offset[c], count) += by_world.transpose() * by_lens.leftCols(count);
    }
    if (!a.pose_offset.empty() && a.pose_offset[c] >= 0) {
      g.middleCols(a.pose_offset[c], 3) -= by_world.transpose() * by_point * cross_matrix(p_cam);
      g.middleCols(a.pose_offset[c] + 3, 3) += by_world.transpose() * by_point;
    }
  }
  if (point.views < 2) return std::nullopt;
  const Matrix3d inverse_h = h.inverse();
  return Sensitivity{index_of_point, -inverse_h * g, inverse_h};
}

VolumeAccuracy grid_of(const WorldBox& box, const std::array<int, 3>& steps, double object_noise_px) {
  VolumeAccuracy result;
  result.box = box;
  result.steps = steps;
  result.object_noise_px = object_noise_px;
  for (int iz = 0; iz < steps[2]; ++iz) {
    for (int iy = 0; iy < steps[1]; ++iy) {
      for (int ix = 0; ix < steps[0]; ++ix) {
        const Vector3d share(static_cast<double>(ix) / (steps[0] - 1), static_cast<double>(iy) / (steps[1] - 1),
                             static_cast<double>(iz) / (steps[2] - 1));
        result.points.emplace_back().p_world = box.low + (box.high - box.low).cwiseProduct(share);
      }
    }
  }
  return result;
}

// Sets the figures over all points.
void summarise(VolumeAccuracy& result) {
  std::vector<double> by_calibration, total;
  for (const PointAccuracy& point : result.points) {
    if (point.views < 2) continue;
    by_calibration.push_back(point.by_calibration_m);
    total.push_back(point.total_m);
  }
  result.covered =
      static_cast<double>(total.size()) / static_cast<double>(std::max<std::size_t>(1, result.points.size()));
  result.median_by_calibration_m = quantile(by_calibration, 0.5);
  result.p95_by_calibration_m = quantile(by_calibration, 0.95);
  result.median_total_m = quantile(total, 0.5);
  result.p95_total_m = quantile(total, 0.95);
}

// Of all points with two or more views, after the best rigid alignment. Sets the points' views and the alignment.
std::vector<Sensitivity> aligned_sensitivities(const Adjustment& a, VolumeAccuracy& result) {
  const Eigen::Index parameters = a.covariance.rows();
  std::vector<Sensitivity> seen;
  for (std::size_t k = 0; k < result.points.size(); ++k) {
    if (auto sensitivity = sensitivity_at(a, result.points[k], k)) seen.push_back(std::move(*sensitivity));
  }
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  MatrixXd moment = MatrixXd::Zero(6, parameters);
  const Vector3d middle = (result.box.low + result.box.high) / 2;
  const auto rigid = [&](const Sensitivity& s) {
    Eigen::Matrix<double, 3, 6> motion;
    motion << -cross_matrix(result.points[s.point].p_world - middle), Matrix3d::Identity();
    return motion;
  };
  for (const Sensitivity& s : seen) {
    const auto motion = rigid(s);
    normal += motion.transpose() * motion;
    moment += motion.transpose() * s.by_parameters;
  }
  const bool alignable = seen.size() >= 3;
  result.alignment = alignable ? MatrixXd(normal.ldlt().solve(moment)) : MatrixXd::Zero(6, parameters);
  for (Sensitivity& s : seen) s.by_parameters -= rigid(s) * result.alignment;
  return seen;
}

}  // namespace

VolumeAccuracy predict_accuracy(const Adjustment& a, const WorldBox& box, const std::array<int, 3>& steps,
                                double object_noise_px) {
  VolumeAccuracy result = grid_of(box, steps, object_noise_px);
  for (const Sensitivity& s : aligned_sensitivities(a, result)) {
    const double calibration = std::max(0.0, (s.by_parameters * a.covariance * s.by_parameters.transpose()).trace());
    PointAccuracy& point = result.points[s.point];
    point.by_calibration_m = std::sqrt(calibration);
    point.total_m = std::sqrt(calibration + object_noise_px * object_noise_px * s.by_noise.trace());
  }
  summarise(result);
  return result;
}

ShapeError shape_error(const Adjustment& a, const WorldBox& box, const Eigen::VectorXd& error,
                       const MatrixXd& covariance) {
  constexpr std::array<int, 3> coarse{6, 6, 4};
  VolumeAccuracy grid = grid_of(box, coarse, 0);
  const std::vector<Sensitivity> seen = aligned_sensitivities(a, grid);
  double squares = 0, variance = 0;
  for (const Sensitivity& s : seen) {
    squares += (s.by_parameters * error).squaredNorm();
    variance += std::max(0.0, (s.by_parameters * covariance * s.by_parameters.transpose()).trace());
  }
  const auto count = static_cast<double>(std::max<std::size_t>(1, seen.size()));
  return {std::sqrt(squares / count), std::sqrt(variance / count)};
}

VolumeAccuracy predict_accuracy(const calib::CameraRig& rig, const WorldBox& box, const std::array<int, 3>& steps,
                                double object_noise_px) {
  VolumeAccuracy result = grid_of(box, steps, object_noise_px);
  const Eigen::Matrix2d information = Eigen::Matrix2d::Identity() / (object_noise_px * object_noise_px);
  for (PointAccuracy& point : result.points) {
    std::vector<calib::PlaceView> views;
    Matrix3d normal = Matrix3d::Zero();
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const calib::Camera& camera = rig.cameras[c];
      calib::CameraModel::Jacobian by_point;
      const auto px = camera.model.project(camera.cam_from_world * point.p_world, by_point);
      if (!px || !camera.contains(*px)) continue;
      views.push_back({static_cast<int>(c), information});
      const Eigen::Matrix<double, 2, 3> by_world = by_point * camera.cam_from_world.rotation.toRotationMatrix();
      normal += by_world.transpose() * information * by_world;
    }
    point.views = static_cast<int>(views.size());
    if (views.size() < 2) continue;
    const double calibration = calib::rig_covariance_at(rig, point.p_world, views).trace();
    point.by_calibration_m = std::sqrt(std::max(0.0, calibration));
    point.total_m = std::sqrt(std::max(0.0, calibration + normal.inverse().trace()));
  }
  summarise(result);
  return result;
}

std::vector<CameraPlace> next_camera_places(const calib::CameraRig& rig, const VolumeAccuracy& map, std::size_t count) {
  const Vector3d middle = (map.box.low + map.box.high) / 2;
  double away = 0, lowest = 1e9, highest = -1e9;
  for (const calib::Camera& camera : rig.cameras) {
    const Vector3d centre = camera.centre();
    away += (centre - middle).head<2>().norm() / static_cast<double>(rig.cameras.size());
    lowest = std::min(lowest, centre.z());
    highest = std::max(highest, centre.z());
  }
  // A coarse grid suffices for a comparison. Unseen points count as far worse than seen ones.
  constexpr std::array<int, 3> coarse{7, 7, 5};
  const double unseen_m = 3 * std::max(map.p95_total_m, 0.01);
  std::vector<std::pair<double, CameraPlace>> tried;
  constexpr int directions = 24;
  for (int d = 0; d < directions; ++d) {
    for (const double z : {lowest, (lowest + highest) / 2, highest}) {
      const double angle = 2 * std::numbers::pi * d / directions;
      const Vector3d centre = Vector3d(middle.x() + away * std::cos(angle), middle.y() + away * std::sin(angle), z);
      calib::Camera camera = rig.cameras.front();
      Matrix3d turn;
      turn.row(2) = (middle - centre).normalized();
      turn.row(0) = Vector3d(turn.row(2)).cross(Vector3d::UnitZ()).normalized();
      turn.row(1) = Vector3d(turn.row(2)).cross(Vector3d(turn.row(0)));
      camera.cam_from_world = {Eigen::Quaterniond(turn), -turn * centre};
      calib::CameraRig more = rig;
      more.cameras.push_back(camera);
      if (more.uncertainty) more.uncertainty->cameras.push_back({.at = more.uncertainty->size()});
      const VolumeAccuracy then = predict_accuracy(more, map.box, coarse, map.object_noise_px);
      double squares = 0;
      for (const PointAccuracy& point : then.points)
        squares += std::pow(point.views < 2 ? unseen_m : std::min(unseen_m, point.total_m), 2);
      tried.emplace_back(squares,
                         CameraPlace{camera.cam_from_world, then.covered, then.median_total_m, then.p95_total_m});
      if (lowest == highest) break;
    }
  }
  std::ranges::stable_sort(tried, {}, &std::pair<double, CameraPlace>::first);
  std::vector<CameraPlace> best;
  const double apart = 0.5 * away;  // least distance of two proposals
  for (const auto& [squares, place] : tried) {
    const Vector3d centre = calib::inverse(place.cam_from_world).translation;
    const bool is_near = std::ranges::any_of(best, [&](const CameraPlace& other) {
      return (calib::inverse(other.cam_from_world).translation - centre).norm() < apart;
    });
    if (!is_near) best.push_back(place);
    if (best.size() == count) break;
  }
  return best;
}

PoseSigma pose_sigma(const Adjustment& a, const VolumeAccuracy& volume, int camera) {
  const calib::Rigid3d& cam_from_world = a.cameras[index(camera)].cam_from_world;
  const Matrix3d world_from_cam = cam_from_world.rotation.toRotationMatrix().transpose();
  const Vector3d centre = calib::inverse(cam_from_world).translation;
  // cam_from_world_true = exp(error) * cam_from_world: axes and centre move with the opposite sign.
  MatrixXd by_parameters = MatrixXd::Zero(6, a.covariance.rows());
  if (const int at = a.pose_offset.empty() ? -1 : a.pose_offset[index(camera)]; at >= 0) {
    by_parameters.block<3, 3>(0, at) = -world_from_cam;
    by_parameters.block<3, 3>(3, at + 3) = -world_from_cam;
  }
  // Correlated errors of rotation and lens that cancel in the rays do not count.
  if (const int at = a.lens_offset.empty() ? -1 : a.lens_offset[index(camera)]; at >= 0) {
    const AdjustedCamera& of = a.cameras[index(camera)];
    by_parameters.block(0, at, 3, parameter_count(of.lens)) -=
        world_from_cam * turn_by_lens(of, covered_stations(a, camera));
  }
  const Vector3d arm = centre - (volume.box.low + volume.box.high) / 2;
  by_parameters.topRows<3>() -= volume.alignment.topRows<3>();
  by_parameters.bottomRows<3>() -=
      -cross_matrix(arm) * volume.alignment.topRows<3>() + volume.alignment.bottomRows<3>();
  const Eigen::Matrix<double, 6, 1> variance = (by_parameters * a.covariance * by_parameters.transpose()).diagonal();
  PoseSigma sigma;
  sigma.rotation = variance.head<3>().cwiseMax(0).cwiseSqrt();
  sigma.position = variance.tail<3>().cwiseMax(0).cwiseSqrt();
  return sigma;
}

std::optional<calib::RigUncertainty> uncertainty_of(const Adjustment& a, const VolumeAccuracy& volume) {
  if (a.covariance.size() == 0 || a.lens_offset.size() != a.cameras.size()) return std::nullopt;
  const bool has_poses = std::ranges::any_of(a.pose_offset, [](int at) { return at >= 0; });
  std::vector<calib::RigUncertainty::CameraParameters> cameras;
  int size = 0;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const int lens_count = a.lens_offset[c] >= 0 ? parameter_count(a.cameras[c].lens) : 0;
    cameras.push_back({size, lens_count, has_poses});
    size += cameras.back().size();
  }
  if (size == 0) return std::nullopt;
  MatrixXd by_found = MatrixXd::Zero(size, a.covariance.rows());  // by the adjustment's parameters
  const Vector3d middle = (volume.box.low + volume.box.high) / 2;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const int lens_count = cameras[c].lens_count, pose_at = cameras[c].pose_at();
    if (lens_count > 0) by_found.block(cameras[c].at, a.lens_offset[c], lens_count, lens_count).setIdentity();
    if (!has_poses) continue;
    if (a.pose_offset[c] >= 0) by_found.block<6, 6>(pose_at, a.pose_offset[c]).setIdentity();
    // Alignment of the world, in the camera's axes: see pose_sigma().
    const calib::Rigid3d& cam_from_world = a.cameras[c].cam_from_world;
    const Matrix3d turn = cam_from_world.rotation.toRotationMatrix();
    const Vector3d arm = calib::inverse(cam_from_world).translation - middle;
    const auto turned = volume.alignment.topRows<3>(), shifted = volume.alignment.bottomRows<3>();
    by_found.middleRows<3>(pose_at) += turn * turned;
    by_found.middleRows<3>(pose_at + 3) += turn * (shifted - cross_matrix(arm) * turned);
  }
  return calib::RigUncertainty::of(std::move(cameras), by_found * a.covariance * by_found.transpose());
}

WorldBox board_volume(const Adjustment& a) {
  std::array<std::vector<double>, 3> along;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (v < a.fits.size() && a.fits[v].dropped) continue;
    for (const int id : a.views[v].ids) {
      const Vector3d p = a.world_from_board[index(a.views[v].set)] * a.board_point(id);
      for (int axis = 0; axis < 3; ++axis) along[index(axis)].push_back(p[axis]);
    }
  }
  WorldBox box;
  for (int axis = 0; axis < 3; ++axis) {
    box.low[axis] = quantile(along[index(axis)], 0.01);
    box.high[axis] = quantile(along[index(axis)], 0.99);
  }
  return box;
}

}  // namespace huetrack::solver
