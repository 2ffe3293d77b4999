#include "calib/board/corner_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace huetrack::board {
namespace {

using Eigen::Vector2d;

// The profile across an edge, between -1 and 1: a step at 0 and the opposite ones a square further, blurred.
struct Profile {
  double value, by_distance, by_blur;
};

Profile profile(double distance, double square, double blur) {
  const double k = 1 / (std::numbers::sqrt2 * blur);
  const auto step = [&](double d) {
    const double slope = 2 * k / std::sqrt(std::numbers::pi) * std::exp(-d * d * k * k);
    return Profile{std::erf(d * k), slope, -d / blur * slope};
  };
  const Profile middle = step(distance), right = step(square - distance), left = step(square + distance);
  return {middle.value * right.value * left.value,
          middle.by_distance * right.value * left.value - middle.value * right.by_distance * left.value +
              middle.value * right.value * left.by_distance,
          middle.by_blur * right.value * left.value + middle.value * right.by_blur * left.value +
              middle.value * right.value * left.by_blur};
}

struct Sample {
  Vector2d px;
  double grey;
};

using Parameters = Eigen::Matrix<double, 7, 1>;  // u, v, angle of edge i, angle of edge j, blur, contrast, mean

// reach: how far from the corner pixels are used, in steps.
std::optional<RefinedCorner> fit(const cv::Mat& image, const Vector2d& start, const Vector2d& step_i,
                                 const Vector2d& step_j, bool dark, double white_margin, double reach) {
  const Eigen::Matrix2d basis = (Eigen::Matrix2d() << step_i, step_j).finished();
  const double area = basis.determinant();
  if (!(area > 1)) return std::nullopt;  // must be right-handed, and more than a pixel
  const Eigen::Matrix2d to_lattice = basis.inverse();
  // The distance between neighbouring parallel edges.
  const double square_i = area / step_j.norm(), square_j = area / step_i.norm();
  constexpr double max_radius = 11;
  const int radius = static_cast<int>(std::ceil(std::min(max_radius, reach * (step_i.norm() + step_j.norm()))));
  const int u0 = static_cast<int>(std::lround(start.x())), v0 = static_cast<int>(std::lround(start.y()));
  if (u0 < 2 || v0 < 2 || u0 > image.cols - 3 || v0 > image.rows - 3) return std::nullopt;
  std::vector<Sample> samples;
  double low = 255, high = 0;
  for (int v = std::max(0, v0 - radius); v <= std::min(image.rows - 1, v0 + radius); ++v) {
    for (int u = std::max(0, u0 - radius); u <= std::min(image.cols - 1, u0 + radius); ++u) {
      const Vector2d offset = Vector2d(u, v) - start;
      const Vector2d steps = to_lattice * offset;
      if (offset.norm() > max_radius || steps.cwiseAbs().maxCoeff() > reach) continue;
      const bool in_dark = (steps.x() * steps.y() > 0) == dark;
      if (!in_dark && steps.cwiseAbs().minCoeff() > white_margin) continue;
      const double grey = image.at<unsigned char>(v, u);
      samples.push_back({{u, v}, grey});
      low = std::min(low, grey);
      high = std::max(high, grey);
    }
  }
  const bool few = samples.size() < 30;  // then the directions of the edges are the lattice's
  if (samples.size() < 9) return std::nullopt;

  Parameters x;
  x << start, std::atan2(step_i.y(), step_i.x()), std::atan2(step_j.y(), step_j.x()), 0.8,
      (dark ? -1 : 1) * (high - low) / 2, (high + low) / 2;
  const auto evaluate = [&](const Parameters& p, Eigen::Matrix<double, 7, 7>* jtj, Parameters* jtr) {
    // Edge i runs along step_i; its normal points to growing j.
    const Vector2d along_i(std::cos(p(2)), std::sin(p(2))), along_j(std::cos(p(3)), std::sin(p(3)));
    const Vector2d normal_i(-along_i.y(), along_i.x()), normal_j(along_j.y(), -along_j.x());
    double cost = 0;
    if (jtj) {
      jtj->setZero();
      jtr->setZero();
    }
    for (const Sample& s : samples) {
      const Vector2d r = s.px - p.head<2>();
      const Profile a = profile(normal_i.dot(r), square_j, p(4)), b = profile(normal_j.dot(r), square_i, p(4));
      const double error = p(6) + p(5) * a.value * b.value - s.grey;
      cost += error * error;
      if (!jtj) continue;
      Parameters j;
      j.head<2>() = -p(5) * (a.by_distance * b.value * normal_i + a.value * b.by_distance * normal_j);
      j(2) = few ? 0 : -p(5) * a.by_distance * b.value * along_i.dot(r);
      j(3) = few ? 0 : p(5) * a.value * b.by_distance * along_j.dot(r);
      j(4) = p(5) * (a.by_blur * b.value + a.value * b.by_blur);
      j(5) = a.value * b.value;
      j(6) = 1;
      *jtj += j * j.transpose();
      *jtr += j * error;
    }
    return cost;
  };
  Eigen::Matrix<double, 7, 7> jtj;
  Parameters jtr;
  double cost = evaluate(x, &jtj, &jtr), damping = 1e-3;
  for (int iteration = 0; iteration < 40; ++iteration) {
    Eigen::Matrix<double, 7, 7> damped = jtj;
    damped.diagonal() += damping * jtj.diagonal() + Parameters::Constant(1e-9);
    const Parameters step = -damped.ldlt().solve(jtr);
    Parameters trial = x + step;
    trial(4) = std::clamp(trial(4), 0.25, 6.0);
    const double trial_cost = evaluate(trial, nullptr, nullptr);
    if (trial_cost < cost) {
      const bool settled = step.head<2>().norm() < 1e-4;
      x = trial;
      cost = evaluate(x, &jtj, &jtr);
      damping = std::max(1e-7, damping / 5);
      if (settled) break;
    } else {
      damping *= 6;
      if (damping > 1e6) break;
    }
  }
  RefinedCorner corner;
  corner.px = x.head<2>();
  corner.contrast = std::abs(x(5));
  corner.blur_px = x(4);
  corner.residual = std::sqrt(cost / static_cast<double>(samples.size()));
  const bool drifted = (to_lattice * (corner.px - start)).cwiseAbs().maxCoeff() > 0.4 || (corner.px - start).norm() > 6;
  if (drifted || (x(5) < 0) != dark || corner.contrast < 4 || corner.residual > 0.7 * corner.contrast)
    return std::nullopt;
  return corner;
}

}  // namespace

std::optional<RefinedCorner> refine_corner(const cv::Mat& image, const Vector2d& start, const Vector2d& step_i,
                                           const Vector2d& step_j, bool dark, double white_margin) {
  const auto misfit = [](const std::optional<RefinedCorner>& c) { return c ? c->residual / c->contrast : 1.0; };
  const auto wide = fit(image, start, step_i, step_j, dark, white_margin, 0.62);
  if (misfit(wide) < 0.15) return wide;
  const auto narrow =
      fit(image, start, step_i, step_j, dark, white_margin, 0.3);  // squares that are cut, or partly hidden
  return misfit(narrow) < 0.6 * misfit(wide) ? narrow : wide;
}

}  // namespace huetrack::board
