#include "camera_tracking/leds/led_motion.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <tuple>

#include "calib/model/cross_matrix.h"

namespace huetrack::leds {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

calib::Rigid3d step(const LedMotionState& s, double dt_s) {
  const double half = 0.5 * dt_s * dt_s;
  calib::Tangent6d twist;
  twist << s.angular_rate * dt_s + s.angular_acceleration * half, s.velocity * dt_s + s.acceleration * half;
  return calib::exp(twist);
}

Eigen::Quaterniond turn(const Vector3d& w) {
  calib::Tangent6d twist;
  twist << w, Vector3d::Zero();
  return calib::exp(twist).rotation;
}

// d error(t + dt) / d error(t), to second order in omega dt.
LedCovariance transition(const LedMotionState& s, double dt_s) {
  const calib::Rigid3d d = step(s, dt_s);
  const Matrix3d r = s.world_from_camera.rotation.toRotationMatrix();
  const Matrix3d half_turn = turn(0.5 * dt_s * s.angular_rate).toRotationMatrix();
  const Matrix3d turned = r * half_turn;
  LedCovariance f = LedCovariance::Identity();
  f.block<3, 3>(0, 3) = -calib::cross_matrix(r * d.translation);
  f.block<3, 3>(0, 6) = turned * dt_s;
  f.block<3, 3>(0, 9) = -0.5 * dt_s * dt_s * r * calib::cross_matrix(s.velocity);
  f.block<3, 3>(0, 12) = turned * (0.5 * dt_s * dt_s);
  f.block<3, 3>(3, 9) = turned * dt_s;
  f.block<3, 3>(3, 15) = turned * (0.5 * dt_s * dt_s);
  f.block<6, 6>(6, 12) = dt_s * Eigen::Matrix<double, 6, 6>::Identity();
  return f;
}

}  // namespace

LedMotionState moved(const LedMotionState& state, double dt_s) {
  LedMotionState later = state;
  later.world_from_camera = state.world_from_camera * step(state, dt_s);
  later.velocity += dt_s * state.acceleration;
  later.angular_rate += dt_s * state.angular_acceleration;
  return later;
}

LedMotionState corrected(const LedMotionState& state, const LedTangent& error) {
  LedMotionState s = state;
  s.world_from_camera.translation += error.head<3>();
  s.world_from_camera.rotation = (turn(error.segment<3>(3)) * state.world_from_camera.rotation).normalized();
  s.velocity += error.segment<3>(6);
  s.angular_rate += error.segment<3>(9);
  s.acceleration += error.segment<3>(12);
  s.angular_acceleration += error.segment<3>(15);
  return s;
}

LedTangent difference(const LedMotionState& state, const LedMotionState& from) {
  LedTangent d;
  d.head<3>() = state.world_from_camera.translation - from.world_from_camera.translation;
  const calib::Rigid3d turned{
      (state.world_from_camera.rotation * from.world_from_camera.rotation.conjugate()).normalized(), Vector3d::Zero()};
  d.segment<3>(3) = calib::log(turned).head<3>();
  d.segment<3>(6) = state.velocity - from.velocity;
  d.segment<3>(9) = state.angular_rate - from.angular_rate;
  d.segment<3>(12) = state.acceleration - from.acceleration;
  d.segment<3>(15) = state.angular_acceleration - from.angular_acceleration;
  return d;
}

LedGaussian predicted(const LedGaussian& state, double dt_s, const LedMotionNoise& noise) {
  LedGaussian next;
  next.mean = moved(state.mean, dt_s);
  const double dt = std::abs(dt_s), kept = std::exp(-dt / noise.correlation_s);
  next.mean.acceleration *= kept;
  next.mean.angular_acceleration *= kept;
  LedCovariance f = transition(state.mean, dt_s);
  f.bottomRightCorner<6, 6>() *= kept;
  next.covariance.noalias() = f * state.covariance * f.transpose();
  // White jerk integrated over dt; pose errors in world axes, all others in camera axes.
  const Matrix3d r = next.mean.world_from_camera.rotation.toRotationMatrix();
  const double d2 = dt * dt, d3 = d2 * dt, d4 = d3 * dt, d5 = d4 * dt;
  for (const auto& [pose, rate, acceleration, sigma] :
       {std::tuple{0, 6, 12, noise.acceleration}, std::tuple{3, 9, 15, noise.angular_acceleration}}) {
    const double q = 2 * sigma * sigma / noise.correlation_s;
    const auto add = [&](int row, int column, const Matrix3d& block) {
      next.covariance.block<3, 3>(row, column) += block;
      if (row != column) next.covariance.block<3, 3>(column, row) += block.transpose();
    };
    const double sign = dt_s < 0 ? -1 : 1;
    add(pose, pose, q * d5 / 20 * Matrix3d::Identity());
    add(pose, rate, sign * q * d4 / 8 * r);
    add(pose, acceleration, q * d3 / 6 * r);
    add(rate, rate, q * d3 / 3 * Matrix3d::Identity());
    add(rate, acceleration, sign * q * d2 / 2 * Matrix3d::Identity());
    add(acceleration, acceleration, q * dt * Matrix3d::Identity());
  }
  next.covariance = 0.5 * (next.covariance + next.covariance.transpose()).eval();
  return next;
}

std::optional<Eigen::Vector2d> led_pixel(const calib::CameraModel& model, const LedMotionState& state,
                                         const Vector3d& led, double dt_s, LedJacobian* jacobian) {
  const LedMotionState then = dt_s == 0 ? state : moved(state, dt_s);
  const Matrix3d camera_from_world = then.world_from_camera.rotation.conjugate().toRotationMatrix();
  const Vector3d away = led - then.world_from_camera.translation;
  const Vector3d p = camera_from_world * away;
  if (jacobian == nullptr) {
    const auto pixel = model.project(p);
    return pixel ? std::optional(pixel->px) : std::nullopt;
  }
  calib::CameraModel::Jacobian lens;
  const auto pixel = model.project(p, lens);
  if (!pixel) return std::nullopt;
  LedJacobian at_then = LedJacobian::Zero();
  at_then.leftCols<3>() = -lens * camera_from_world;
  at_then.middleCols<3>(3) = lens * camera_from_world * calib::cross_matrix(away);
  if (dt_s == 0)
    *jacobian = at_then;
  else
    jacobian->noalias() = at_then * transition(state, dt_s);
  return pixel->px;
}

std::optional<LedFit> fit_leds(const calib::CameraModel& model, std::span<const Vector3d> leds,
                               const LedGaussian& prior, const LedMotionState& start,
                               std::span<const LedSighting> sightings, int iterations) {
  const Eigen::LLT<LedCovariance> prior_factor(prior.covariance);
  if (prior_factor.info() != Eigen::Success) return std::nullopt;
  const LedCovariance prior_information = prior_factor.solve(LedCovariance::Identity());

  struct Normal {  // equations at one state
    LedCovariance h;
    LedTangent g;
    double cost = 0, chi2 = 0;
    int used = 0;
  };
  const auto linearise = [&](const LedMotionState& at) {
    Normal n;
    const LedTangent off = difference(prior.mean, at);
    n.h = prior_information;
    n.g = prior_information * off;
    for (const LedSighting& s : sightings) {
      LedJacobian j;
      const auto px = led_pixel(model, at, leds[static_cast<std::size_t>(s.led)], s.dt_s, &j);
      if (!px) continue;
      const double w = 1 / (s.sigma_px * s.sigma_px);
      const Eigen::Vector2d e = s.px - *px;
      n.h.noalias() += w * j.transpose() * j;
      n.g.noalias() += w * j.transpose() * e;
      n.chi2 += w * e.squaredNorm();
      ++n.used;
    }
    n.cost = n.chi2 + off.dot(prior_information * off);
    return n;
  };

  LedMotionState at = start;
  Normal normal = linearise(at);
  double damping = 0;
  for (int i = 0; i < iterations; ++i) {
    LedCovariance h = normal.h;
    h.diagonal() *= 1 + damping;
    const LedTangent correction = h.llt().solve(normal.g);
    if (!correction.allFinite()) return std::nullopt;
    const LedMotionState next = corrected(at, correction);
    const Normal there = linearise(next);
    if (there.used < normal.used || !(there.cost <= normal.cost * (1 + 1e-9) + 1e-12)) {
      damping = std::max(1e-3, 10 * damping);
      if (damping > 1e6) break;
      continue;
    }
    const double gain = normal.cost - there.cost;
    at = next;
    normal = there;
    damping = damping > 1e-4 ? 0.1 * damping : 0;
    if (gain < 1e-4 * (1 + normal.cost) && damping == 0) break;
  }
  const Eigen::LLT<LedCovariance> factor(normal.h);
  if (factor.info() != Eigen::Success) return std::nullopt;
  LedFit fit;
  fit.posterior.mean = at;
  fit.posterior.covariance = factor.solve(LedCovariance::Identity());
  fit.posterior.covariance = 0.5 * (fit.posterior.covariance + fit.posterior.covariance.transpose()).eval();
  fit.chi2 = normal.chi2;
  fit.used = normal.used;
  return fit;
}

}  // namespace huetrack::leds
