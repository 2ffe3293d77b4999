#include "calib/wave/outline_cost.h"

#include <ceres/sized_cost_function.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "calib/model/cross_matrix.h"
#include "calib/solver/lens.h"

namespace huetrack::wave {

using calib::cross_matrix;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Matrix3d rotation_of(const Vector3d& omega) {
  const double angle = omega.norm();
  return angle < 1e-12 ? Matrix3d(Matrix3d::Identity() + cross_matrix(omega))
                       : Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix();
}

Matrix3d right_jacobian(const Vector3d& omega) {
  const double a = omega.norm();
  const Matrix3d w = cross_matrix(omega);
  if (a < 1e-6) return Matrix3d::Identity() - w / 2;
  return Matrix3d::Identity() - (1 - std::cos(a)) / (a * a) * w + (a - std::sin(a)) / (a * a * a) * w * w;
}

namespace {

// Point whose pinhole projection is the centre of the outline of a ball at p. The tangent cone of a sphere meets the
// image in an ellipse centred at (X Z, Y Z) / (Z^2 - r^2). Fisheye: the outline is nearly symmetric in angle, and p
// itself is used. z_by_z: derivative of its z by p.z.
Vector3d outline_point(bool pinhole, const Vector3d& p, double radius, double* z_by_z) {
  *z_by_z = 1;
  if (!pinhole || p.z() < 2 * radius) return p;
  *z_by_z = 1 + radius * radius / (p.z() * p.z());
  return {p.x(), p.y(), p.z() - radius * radius / p.z()};
}

class OutlineCost final : public ceres::SizedCostFunction<2, 6, 3, 3, 3, 3, 1, 1, lens_freedom> {
 public:
  OutlineCost(const calib::CameraModel& model, const Matrix3d& base, const BallObservation& o, double below,
              const BallPath& path, std::size_t first, double radius)
      : lens_(solver::lens_model_of(model)),
        parameters_(solver::parameters_of(model)),
        base_(base),
        measured_(o.px),
        stamp_s_(o.t_s),
        below_(below),
        path_(path),
        first_(first),
        radius_(radius) {
    whiten_ = Matrix2d(o.covariance.inverse()).llt().matrixL().transpose();
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Vector3d> omega(blocks[0]), t(blocks[0] + 3);
    const BallPath::Basis basis = path_.basis(stamp_s_ - blocks[5][0] + below_ * blocks[6][0], first_);
    Vector3d p = Vector3d::Zero(), velocity = Vector3d::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Map<const Vector3d> control(blocks[k + 1]);
      p += basis.weight[k] * control;
      velocity += basis.weight_per_s[k] * control;
    }
    const Matrix3d rotation = base_ * rotation_of(omega);
    const Vector3d p_cam = rotation * p + t;
    double z_by_z = 1;
    const Vector3d outline = outline_point(solver::is_pinhole(lens_), p_cam, radius_, &z_by_z);
    Vector2d px;
    solver::PixelByPoint by_point;
    solver::PixelByLens by_lens;
    const solver::LensParameters lens = changed(parameters_, LensChange(blocks[7]));
    const bool seen = solver::project(lens_, lens, outline, px, &by_point, &by_lens) && px.allFinite();
    Eigen::Map<Vector2d> r(residuals);
    // Behind the camera there is no slope that leads back: the loss makes it an outlier.
    r = seen ? Vector2d(whiten_ * (px - measured_)) : Vector2d::Constant(1e4);
    if (!jacobians) return true;
    by_point.col(2) *= z_by_z;
    const Eigen::Matrix<double, 2, 3> by_cam = seen ? Eigen::Matrix<double, 2, 3>(whiten_ * by_point)
                                                    : Eigen::Matrix<double, 2, 3>(Eigen::Matrix<double, 2, 3>::Zero());
    if (jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> j(jacobians[0]);
      j.leftCols<3>() = -by_cam * rotation * cross_matrix(p) * right_jacobian(omega);
      j.rightCols<3>() = by_cam;
    }
    const Eigen::Matrix<double, 2, 3> by_world = by_cam * rotation;
    for (std::size_t k = 0; k < 4; ++k) {
      if (jacobians[k + 1])
        Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobians[k + 1]} = basis.weight[k] * by_world;
    }
    const Vector2d by_time = by_world * velocity;
    if (jacobians[5]) Eigen::Map<Vector2d>{jacobians[5]} = -by_time;
    if (jacobians[6]) Eigen::Map<Vector2d>{jacobians[6]} = below_ * by_time;
    if (jacobians[7]) {
      Eigen::Map<Eigen::Matrix<double, 2, lens_freedom, Eigen::RowMajor>> j(jacobians[7]);
      if (seen)
        j = whiten_ * by_change(by_lens, lens);
      else
        j.setZero();
    }
    return true;
  }

 private:
  solver::LensModel lens_;
  solver::LensParameters parameters_;
  Matrix3d base_;
  Vector2d measured_;
  double stamp_s_, below_;
  const BallPath& path_;  // for its knots
  std::size_t first_;
  double radius_;
  Matrix2d whiten_;
};

}  // namespace

std::unique_ptr<ceres::CostFunction> outline_cost(const calib::Camera& camera, const Matrix3d& base,
                                                  const BallObservation& observation, double below_middle,
                                                  const BallPath& path, std::size_t first, double radius_m) {
  return std::make_unique<OutlineCost>(camera.model, base, observation, below_middle, path, first, radius_m);
}

std::optional<Vector2d> outline_centre(const calib::CameraModel& model, const Vector3d& p_cam, double radius_m) {
  double unused = 1;
  const bool pinhole = std::holds_alternative<calib::PinholeRadtan>(model.lens());
  if (pinhole && p_cam.z() <= 0) return std::nullopt;
  const auto px = model.project(outline_point(pinhole, p_cam, radius_m, &unused));
  if (!px) return std::nullopt;
  return px->px;
}

namespace {

LinearOutline linear_outline(const calib::CameraRig& rig, const BallObservation& o, const WaveState& state,
                             double radius_m) {
  const auto c = static_cast<std::size_t>(o.camera);
  const double t_s = state.exposed_s(rig, o.camera, o.t_s, o.px);
  const std::size_t first = state.path.piece(t_s);
  const Matrix3d rotation = state.cam_from_world[c].rotation.toRotationMatrix();
  Eigen::Matrix<double, 6, 1> pose;
  pose << Vector3d::Zero(), state.cam_from_world[c].translation;
  const CameraTime time = state.times.empty() ? CameraTime{} : state.times[c];
  const LensChange lens = state.lenses.empty() ? LensChange(LensChange::Zero()) : state.lenses[c];
  const auto cost =
      outline_cost(rig.cameras[c], rotation, o, below_middle(rig.cameras[c], o.px), state.path, first, radius_m);
  std::array<const double*, 8> blocks{pose.data(), nullptr,         nullptr,         nullptr,
                                      nullptr,     &time.latency_s, &time.readout_s, lens.data()};
  for (std::size_t k = 0; k < 4; ++k) blocks[k + 1] = state.path.control[first + k].data();
  Vector2d residual;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  std::array<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>, 4> by_control;
  Eigen::Matrix<double, 2, lens_freedom, Eigen::RowMajor> by_lens;
  std::array<double*, 8> jacobians{
      by_pose.data(), by_control[0].data(), by_control[1].data(), by_control[2].data(), by_control[3].data(), nullptr,
      nullptr,        by_lens.data()};
  cost->Evaluate(blocks.data(), residual.data(), jacobians.data());
  LinearOutline out{.observation = o, .in_path = {.t_s = t_s}, .by_errors = {}};
  out.in_path.by_position = by_control[0] + by_control[1] + by_control[2] + by_control[3];
  out.in_path.value = out.in_path.by_position * state.path.at(t_s) - residual;
  // t = -R exp(omega) centre
  const Vector3d centre = calib::inverse(state.cam_from_world[c]).translation;
  out.by_errors << -by_pose.rightCols<3>() * rotation,
      by_pose.leftCols<3>() + by_pose.rightCols<3>() * rotation * cross_matrix(centre), by_lens;
  return out;
}

}  // namespace

std::vector<LinearOutline> linear_outlines(const calib::CameraRig& rig,
                                           const std::vector<BallObservation>& observations, const WaveState& state,
                                           double radius_m) {
  std::vector<LinearOutline> out;
  std::vector<double> distance2;
  for (const BallObservation& o : observations) {
    const LinearOutline linear = linear_outline(rig, o, state, radius_m);
    if (linear.in_path.by_position.isZero(0)) continue;
    distance2.push_back(
        (linear.in_path.by_position * state.path.at(linear.in_path.t_s) - linear.in_path.value).squaredNorm());
    out.push_back(linear);
  }
  std::ranges::stable_sort(out, {}, [](const LinearOutline& o) { return o.in_path.t_s; });
  const double noise = std::sqrt(noise_variance(distance2, WaveAdjustmentOptions{}.loss));
  for (LinearOutline& o : out) o.in_path.by_position /= noise, o.in_path.value /= noise, o.by_errors /= noise;
  return out;
}

}  // namespace huetrack::wave
