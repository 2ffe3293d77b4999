#include "room_watch/rotation_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "calib/model/covariance_ellipse.h"
#include "calib/model/cross_matrix.h"
#include "calib/model/median.h"
#include "calib/model/rigid3.h"

namespace huetrack::room_watch {
namespace {

struct RotationFitTuning {
  int most_rounds = 6;        // of reweighting
  double tukey_sigmas = 4.5;  // zero weight beyond; 95 % efficiency is at 4.685
  double bias_px = 0.05;      // 1 sigma per patch of JPEG blocks, interpolation and lens model
};
constexpr RotationFitTuning rotation_tuning{};
constexpr std::size_t least_rays = 4;  // maths: unknowns

struct AimGuessTuning {
  double max_zoom = 0.1;  // beyond it a patch no longer correlates with its picture
  int zoom_votes = 3;     // more rays that must agree with a zoom: by chance 1 or 2 of 16 do
};
constexpr AimGuessTuning aim_guess{};

using Row = Eigen::Matrix<double, 2, 4>;
using Matrix4 = Eigen::Matrix4d;

Eigen::Quaterniond quaternion(const Eigen::Vector3d& rotation) {
  const double angle = rotation.norm();
  if (angle < 1e-12) return Eigen::Quaterniond(1, rotation.x() / 2, rotation.y() / 2, rotation.z() / 2).normalized();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, rotation / angle));
}

Eigen::Vector3d vector_of(const Eigen::Quaterniond& rotation) {
  return calib::log({rotation, Eigen::Vector3d::Zero()}).head<3>();
}

struct Linear {
  Row derivative;                        // of the pixel by rotation and zoom
  Eigen::Matrix<double, 2, 3> by_shift;  // by p_now - R p_then in units of the room's distance
  Eigen::Vector2d difference;            // measured less predicted
  double variance;
  double weight = 0;
};

double tukey(double r_over_gate) {
  const double inside = 1 - r_over_gate * r_over_gate;
  return inside > 0 ? inside * inside : 0;
}

std::vector<Linear> linearised(const calib::CameraModel& lens, std::span<const SeenRay> seen,
                               const Eigen::Quaterniond& start, double zoom) {
  std::vector<Linear> all;
  all.reserve(seen.size());
  const Eigen::Vector2d centre(lens.cx(), lens.cy());
  for (const SeenRay& s : seen) {
    const Eigen::Vector3d p = start * s.ray;
    calib::CameraModel::Jacobian jacobian;
    const auto px = lens.project(p, jacobian);
    if (!px) continue;
    Linear& added = all.emplace_back();
    added.derivative.leftCols<3>() = -(1 + zoom) * jacobian * calib::cross_matrix(p);
    added.derivative.col(3) = px->px - centre;
    added.by_shift = (1 + zoom) * jacobian;
    added.difference = s.px - centre - (1 + zoom) * (px->px - centre);
    added.variance = s.sigma_px * s.sigma_px + rotation_tuning.bias_px * rotation_tuning.bias_px;
  }
  return all;
}

}  // namespace

Eigen::Vector3d turned(const Eigen::Vector3d& rotation, const Eigen::Vector3d& p) {
  return quaternion(rotation) * p;
}

Eigen::Vector3d turned_back(const Eigen::Vector3d& rotation, const Eigen::Vector3d& p) {
  return quaternion(rotation).conjugate() * p;
}

Eigen::Vector3d rotation_between(const Eigen::Vector3d& before, const Eigen::Vector3d& after) {
  return vector_of(quaternion(after) * quaternion(before).conjugate());
}

std::optional<Eigen::Vector2d> pixel_of(const calib::CameraModel& lens, const Aim& aim, const Eigen::Vector3d& ray) {
  const auto px = lens.project(turned(aim.rotation, ray));
  if (!px) return std::nullopt;
  const Eigen::Vector2d centre(lens.cx(), lens.cy());
  return centre + (1 + aim.zoom) * (px->px - centre);
}

std::optional<RotationFit> fit_rotation(const calib::CameraModel& lens, std::span<const SeenRay> seen, const Aim& start,
                                        double gate_px) {
  const Eigen::Quaterniond from = quaternion(start.rotation);
  std::vector<Linear> all = linearised(lens, seen, from, start.zoom);
  if (all.size() < least_rays) return std::nullopt;
  Eigen::Vector4d x = Eigen::Vector4d::Zero();
  Matrix4 normal = Matrix4::Zero();
  double gate = gate_px;
  std::vector<double> distances;
  for (int round = 0; round < rotation_tuning.most_rounds; ++round) {
    distances.clear();
    for (Linear& l : all) {
      const double r = (l.difference - l.derivative * x).norm();
      l.weight = tukey(r / gate) / l.variance;
      if (r < gate) distances.push_back(r);
    }
    if (distances.size() < least_rays) return std::nullopt;
    normal.setZero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (const Linear& l : all) {
      if (l.weight <= 0) continue;
      normal += l.weight * l.derivative.transpose() * l.derivative;
      right += l.weight * l.derivative.transpose() * l.difference;
    }
    const Eigen::LLT<Matrix4> solver(normal);
    if (solver.info() != Eigen::Success) return std::nullopt;
    x = solver.solve(right);
    constexpr double median_in_sigmas = 1.177;  // maths: of a Rayleigh distribution
    const double middle = calib::median_in_place(std::span(distances));
    const double sigma = std::max(middle / median_in_sigmas, rotation_tuning.bias_px);
    const double before = std::exchange(gate, std::min(gate, rotation_tuning.tukey_sigmas * sigma));
    if (round > 0 && gate == before) break;
  }
  RotationFit fit;
  double sum = 0, chi2 = 0;
  Eigen::Matrix<double, 4, 3> by_shift = Eigen::Matrix<double, 4, 3>::Zero();
  for (const Linear& l : all) {
    const double r2 = (l.difference - l.derivative * x).squaredNorm();
    if (r2 >= gate * gate) continue;
    ++fit.inliers;
    sum += r2;
    chi2 += r2 / l.variance;
    by_shift += l.weight * l.derivative.transpose() * l.by_shift;
  }
  if (fit.inliers < int(least_rays)) return std::nullopt;
  fit.rms_px = std::sqrt(sum / fit.inliers);
  const Matrix4 inverse = normal.llt().solve(Matrix4::Identity());
  const double scale = std::max(1.0, chi2 / (2.0 * fit.inliers - 4));
  fit.covariance = scale * inverse.topLeftCorner<3, 3>();
  fit.zoom = start.zoom + x(3);
  fit.with_zoom = scale * inverse.topRightCorner<3, 1>();
  fit.zoom_sigma = std::sqrt(scale * inverse(3, 3));
  fit.shift_to_rotation = (inverse * by_shift).topRows<3>();
  fit.rotation = vector_of(quaternion(x.head<3>()) * from);
  return fit;
}

RotationFit without_zoom(const RotationFit& fit) {
  RotationFit only = fit;
  const double variance = fit.zoom_sigma * fit.zoom_sigma;
  only.rotation -= fit.with_zoom * (fit.zoom / variance);
  only.covariance -= fit.with_zoom * fit.with_zoom.transpose() / variance;
  only.zoom = 0;
  return only;
}

std::optional<double> zoom_instead(const RotationFit& fit, const Eigen::Vector3d& rotation) {
  const Eigen::Vector3d off = rotation_between(rotation, fit.rotation);
  const Eigen::Vector3d weighted = fit.covariance.llt().solve(off);
  if (off.dot(weighted) > calib::chi2_999_in_3d) return std::nullopt;
  return fit.zoom - fit.with_zoom.dot(weighted);
}

namespace {

struct Guess {
  Aim aim;
  int agree = 2;
};

// The hypothesis of two rays with most inliers. is_zooming: a changed angle between them is zoom, not an error.
Guess best_guess(const calib::CameraModel& lens, std::span<const SeenRay> seen, double gate_px, bool is_zooming) {
  const Eigen::Vector2d centre(lens.cx(), lens.cy());
  const auto frame = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    Eigen::Matrix3d axes;
    axes.col(0) = (a + b).normalized();
    axes.col(1) = a.cross(b).normalized();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    return axes;
  };
  const auto unzoomed = [&](std::size_t i, double zoom) {
    return lens.ray({centre + (seen[i].px - centre) / (1 + zoom)});
  };
  const double gate_rad = gate_px / std::max(lens.fx(), lens.fy());
  std::vector<std::optional<Eigen::Vector3d>> now;
  for (std::size_t i = 0; i < seen.size(); ++i) now.push_back(unzoomed(i, 0));
  Guess best;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = i + 1; j < seen.size(); ++j) {
      const double apart = (seen[i].ray - seen[j].ray).norm();
      auto first = now[i], second = now[j];
      if (!first || !second) continue;
      const double zoom = is_zooming ? (*first - *second).norm() / apart - 1 : 0;
      if (std::abs(zoom) > aim_guess.max_zoom) continue;
      if (is_zooming) first = unzoomed(i, zoom), second = unzoomed(j, zoom);
      // A rotation keeps the angle between two rays.
      if (!first || !second || std::abs(apart - (*first - *second).norm()) > 2 * gate_rad) continue;
      const Eigen::Matrix3d rotation = frame(*first, *second) * frame(seen[i].ray, seen[j].ray).transpose();
      const Aim aim{vector_of(Eigen::Quaterniond(rotation)), zoom};
      const auto agrees = [&](const SeenRay& s) {
        const auto px = lens.project(rotation * s.ray);
        return px && (centre + (1 + zoom) * (px->px - centre) - s.px).norm() < gate_px;
      };
      const int agree = int(std::ranges::count_if(seen, agrees));
      if (agree > best.agree) best = {aim, agree};
    }
  }
  return best;
}

}  // namespace

std::optional<Aim> guess_aim(const calib::CameraModel& lens, std::span<const SeenRay> seen, double gate_px) {
  const Guess turned = best_guess(lens, seen, gate_px, false);
  const Guess best =
      int(seen.size()) >= turned.agree + aim_guess.zoom_votes ? best_guess(lens, seen, gate_px, true) : turned;
  const Guess& better = best.agree >= turned.agree + aim_guess.zoom_votes ? best : turned;
  if (better.agree <= 2) return std::nullopt;
  return better.aim;
}

}  // namespace huetrack::room_watch
