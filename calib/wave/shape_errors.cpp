#include "calib/wave/shape_errors.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "calib/model/cross_matrix.h"

namespace huetrack::wave {
namespace {

using calib::cross_matrix;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// Of a lens with k1 and k2, see RigUncertainty::CameraParameters.
int lens_count(const calib::CameraModel& lens) {
  for (const int count : {8, 9})
    if (calib::is_lens_count(lens, count)) return count;
  return 12;
}

}  // namespace

double ShapeErrors::rms(const Eigen::MatrixXd& covariance) const {
  return places > 0 ? std::sqrt(std::max(0.0, (by_errors * covariance * by_errors.transpose()).trace() / places)) : 0;
}

Eigen::MatrixXd ShapeErrors::of_camera(Eigen::Index c, const Vector3d& centre) const {
  Eigen::MatrixXd error = Eigen::MatrixXd::Zero(6, by_errors.cols());
  error.block<6, 6>(0, 6 * c).setIdentity();
  if (places == 0) return error;
  error.topRows<3>() -= alignment.topRows<3>() - cross_matrix(centre) * alignment.bottomRows<3>();
  error.bottomRows<3>() += alignment.bottomRows<3>();  // rotations are of cam_from_world: against the world's
  return error;
}

calib::RigUncertainty ShapeErrors::uncertainty(const calib::CameraRig& rig, const WaveState& state,
                                               const Eigen::MatrixXd& covariance, double scale_sigma) const {
  const auto n = static_cast<Eigen::Index>(state.cam_from_world.size());
  // RigUncertainty is in the cameras' own axes, as an error of cam_from_world: t = -R centre.
  std::vector<calib::RigUncertainty::CameraParameters> cameras;
  Eigen::Index size = 0;
  for (const calib::Camera& camera : rig.cameras) {
    cameras.push_back({.lens_count = lens_count(camera.model), .has_pose = true});
    size += cameras.back().size();
  }
  Eigen::MatrixXd by_found = Eigen::MatrixXd::Zero(size, covariance.cols());
  Eigen::VectorXd by_scale = Eigen::VectorXd::Zero(size);
  Eigen::Index at = 0;
  for (Eigen::Index c = 0; c < n; ++c) {
    const calib::Rigid3d& pose = state.cam_from_world[static_cast<std::size_t>(c)];
    const Matrix3d turn = pose.rotation.toRotationMatrix();
    const Vector3d centre = calib::inverse(pose).translation;
    const Eigen::MatrixXd aligned = of_camera(c, centre);
    const Eigen::Index lens = 6 * n + lens_freedom * c;
    by_found.block<2, 1>(at, lens) = calib::parameters_of(rig.cameras[static_cast<std::size_t>(c)].model).head<2>();
    by_found.block<lens_freedom - 1, lens_freedom - 1>(at + 2, lens + 1).setIdentity();
    at += cameras[static_cast<std::size_t>(c)].lens_count;
    by_found.middleRows<3>(at) = turn * aligned.bottomRows<3>();
    by_found.middleRows<3>(at + 3) = -turn * aligned.topRows<3>();
    by_scale.segment<3>(at + 3) = -turn * (scale_sigma * (centre - middle));
    at += 6;
  }
  return calib::RigUncertainty::of(std::move(cameras),
                                   by_found * covariance * by_found.transpose() + by_scale * by_scale.transpose());
}

ShapeErrors shape_errors(const calib::CameraRig& rig, const WaveState& state, const std::vector<Vector3d>& wanted) {
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  std::vector<Eigen::MatrixXd> moved;
  std::vector<Vector3d> places;
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : wanted) {
    Matrix3d information = Matrix3d::Zero();
    Eigen::MatrixXd by_camera_errors = Eigen::MatrixXd::Zero(3, (6 + lens_freedom) * n);
    int views = 0;
    for (Eigen::Index c = 0; c < n; ++c) {
      const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
      const calib::Rigid3d& pose = state.cam_from_world[static_cast<std::size_t>(c)];
      calib::CameraModel::Jacobian by_cam;
      const auto px = camera.model.project(pose * p, by_cam);
      if (!px || !camera.contains(*px)) continue;
      ++views;
      const Eigen::Matrix<double, 2, 3> j = by_cam * pose.rotation.toRotationMatrix();
      const Vector3d lever = p - calib::inverse(pose).translation;
      Eigen::Matrix<double, 2, 6> by_camera;
      by_camera.leftCols<3>() = -j;
      by_camera.rightCols<3>() = -j * cross_matrix(lever);
      information += j.transpose() * j;
      by_camera_errors.middleCols<6>(6 * c) -= j.transpose() * by_camera;
      const calib::LensParameters lens = calib::parameters_of(camera.model);
      calib::PixelByLens by_lens;
      Eigen::Vector2d unused;
      if (calib::project_like(camera.model, lens, pose * p, unused, nullptr, &by_lens))
        by_camera_errors.middleCols<lens_freedom>(6 * n + lens_freedom * c) -= j.transpose() * by_change(by_lens, lens);
    }
    if (views < 2) continue;
    moved.push_back(information.ldlt().solve(by_camera_errors));
    places.push_back(p);
    mean += p;
  }
  ShapeErrors shape;
  shape.places = static_cast<double>(places.size());
  const auto rows = 3 * static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd all(rows, (6 + lens_freedom) * n), world(rows, 6);
  for (std::size_t k = 0; k < places.size(); ++k) {
    const auto row = 3 * static_cast<Eigen::Index>(k);
    all.middleRows<3>(row) = moved[k];
    world.block<3, 3>(row, 0).setIdentity();
    world.block<3, 3>(row, 3) = -cross_matrix(places[k]);
    shape.reach_m += (places[k] - mean / shape.places).squaredNorm() / shape.places;
  }
  if (!places.empty()) shape.middle = mean / shape.places;
  shape.reach_m = std::sqrt(shape.reach_m);
  const Eigen::MatrixXd normal = world.transpose() * world, right = world.transpose() * all;
  shape.alignment = normal.ldlt().solve(right);
  shape.by_errors = all - world * shape.alignment;
  return shape;
}

std::vector<Vector3d> places_along(const BallPath& path, double from_s, double to_s) {
  constexpr int samples = 60;
  std::vector<Vector3d> places;
  for (int i = 0; i <= samples; ++i) places.push_back(path.at(from_s + (to_s - from_s) * i / samples));
  return places;
}

std::vector<Vector3d> places_in(const solver::WorldBox& box) {
  constexpr int steps = 6;
  std::vector<Vector3d> places;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k)
        places.push_back(box.low + Vector3d(i, j, k).cwiseProduct(box.high - box.low) / steps);
    }
  }
  return places;
}

}  // namespace huetrack::wave
