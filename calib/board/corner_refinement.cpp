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

using Normal = Eigen::Matrix<double, 7, 7>;

// Two crossing, blurred edges, fitted to the pixels around a corner.
class CrossFit {
 public:
  // basis: step_i, step_j. right-handed, and more than a pixel.
  CrossFit(const Vector2d& start, const Eigen::Matrix2d& basis, bool dark)
      : start_(start),
        step_i_(basis.col(0)),
        step_j_(basis.col(1)),
        to_lattice_(basis.inverse()),
        square_i_(basis.determinant() / step_j_.norm()),
        square_j_(basis.determinant() / step_i_.norm()),
        dark_(dark) {}

  // reach: radius of the pixels used, in steps. False: too few pixels.
  bool take_pixels(const cv::Mat& image, double white_margin, double reach) {
    constexpr double max_radius = 11;
    const int radius = static_cast<int>(std::ceil(std::min(max_radius, reach * (step_i_.norm() + step_j_.norm()))));
    const int u0 = static_cast<int>(std::lround(start_.x())), v0 = static_cast<int>(std::lround(start_.y()));
    if (u0 < 2 || v0 < 2 || u0 > image.cols - 3 || v0 > image.rows - 3) return false;
    for (int v = std::max(0, v0 - radius); v <= std::min(image.rows - 1, v0 + radius); ++v) {
      for (int u = std::max(0, u0 - radius); u <= std::min(image.cols - 1, u0 + radius); ++u) {
        const Vector2d offset = Vector2d(u, v) - start_;
        const Vector2d steps = to_lattice_ * offset;
        if (offset.norm() > max_radius || steps.cwiseAbs().maxCoeff() > reach) continue;
        const bool in_dark = (steps.x() * steps.y() > 0) == dark_;
        if (!in_dark && steps.cwiseAbs().minCoeff() > white_margin) continue;
        const double grey = image.at<unsigned char>(v, u);
        samples_.push_back({{u, v}, grey});
        low_ = std::min(low_, grey);
        high_ = std::max(high_, grey);
      }
    }
    few_ = samples_.size() < 30;
    return samples_.size() >= 9;
  }

  // Levenberg-Marquardt.
  RefinedCorner solve() {
    x_ << start_, std::atan2(step_i_.y(), step_i_.x()), std::atan2(step_j_.y(), step_j_.x()), 0.8,
        (dark_ ? -1 : 1) * (high_ - low_) / 2, (high_ + low_) / 2;
    Normal jtj;
    Parameters jtr;
    double cost = evaluate(x_, &jtj, &jtr), damping = 1e-3;
    for (int iteration = 0; iteration < 40; ++iteration) {
      Normal damped = jtj;
      damped.diagonal() += damping * jtj.diagonal() + Parameters::Constant(1e-9);
      const Parameters step = -damped.ldlt().solve(jtr);
      Parameters trial = x_ + step;
      trial(4) = std::clamp(trial(4), 0.25, 6.0);
      const double trial_cost = evaluate(trial, nullptr, nullptr);
      if (trial_cost < cost) {
        const bool settled = step.head<2>().norm() < 1e-4;
        x_ = trial;
        cost = evaluate(x_, &jtj, &jtr);
        damping = std::max(1e-7, damping / 5);
        if (settled) break;
      } else {
        damping *= 6;
        if (damping > 1e6) break;
      }
    }
    RefinedCorner corner;
    corner.px = x_.head<2>();
    corner.contrast = std::abs(x_(5));
    corner.blur_px = x_(4);
    corner.residual = std::sqrt(cost / static_cast<double>(samples_.size()));
    return corner;
  }

  // Whether the solution is still the corner of the start.
  bool is_sound(const RefinedCorner& corner) const {
    const bool drifted =
        (to_lattice_ * (corner.px - start_)).cwiseAbs().maxCoeff() > 0.4 || (corner.px - start_).norm() > 6;
    return !(drifted || (x_(5) < 0) != dark_ || corner.contrast < 4 || corner.residual > 0.7 * corner.contrast);
  }

 private:
  // Sum of squares; jtj, jtr: null, or the normal equations.
  double evaluate(const Parameters& p, Normal* jtj, Parameters* jtr) const {
    // Edge i runs along step_i; its normal points to growing j.
    const Vector2d along_i(std::cos(p(2)), std::sin(p(2))), along_j(std::cos(p(3)), std::sin(p(3)));
    const Vector2d normal_i(-along_i.y(), along_i.x()), normal_j(along_j.y(), -along_j.x());
    double cost = 0;
    if (jtj) {
      jtj->setZero();
      jtr->setZero();
    }
    for (const Sample& s : samples_) {
      const Vector2d r = s.px - p.head<2>();
      const Profile a = profile(normal_i.dot(r), square_j_, p(4)), b = profile(normal_j.dot(r), square_i_, p(4));
      const double error = p(6) + p(5) * a.value * b.value - s.grey;
      cost += error * error;
      if (!jtj) continue;
      Parameters j;
      j.head<2>() = -p(5) * (a.by_distance * b.value * normal_i + a.value * b.by_distance * normal_j);
      j(2) = few_ ? 0 : -p(5) * a.by_distance * b.value * along_i.dot(r);
      j(3) = few_ ? 0 : p(5) * a.value * b.by_distance * along_j.dot(r);
      j(4) = p(5) * (a.by_blur * b.value + a.value * b.by_blur);
      j(5) = a.value * b.value;
      j(6) = 1;
      *jtj += j * j.transpose();
      *jtr += j * error;
    }
    return cost;
  }

  const Vector2d start_, step_i_, step_j_;
  const Eigen::Matrix2d to_lattice_;
  const double square_i_, square_j_;  // the distance between neighbouring parallel edges
  const bool dark_;
  std::vector<Sample> samples_;
  double low_ = 255, high_ = 0;
  bool few_ = false;  // few samples: the edges keep the lattice's directions
  Parameters x_;
};

std::optional<RefinedCorner> fit(const cv::Mat& image, const Vector2d& start, const Vector2d& step_i,
                                 const Vector2d& step_j, bool dark, double white_margin, double reach) {
  const Eigen::Matrix2d basis = (Eigen::Matrix2d() << step_i, step_j).finished();
  if (!(basis.determinant() > 1)) return std::nullopt;
  CrossFit cross(start, basis, dark);
  if (!cross.take_pixels(image, white_margin, reach)) return std::nullopt;
  const RefinedCorner corner = cross.solve();
  return cross.is_sound(corner) ? std::optional(corner) : std::nullopt;
}

}  // namespace

std::optional<RefinedCorner> refine_corner(const cv::Mat& image, const Vector2d& start, const Vector2d& step_i,
                                           const Vector2d& step_j, bool dark, double white_margin) {
  const auto misfit = [](const std::optional<RefinedCorner>& c) { return c ? c->residual / c->contrast : 1.0; };
  const auto wide = fit(image, start, step_i, step_j, dark, white_margin, 0.62);
  if (misfit(wide) < 0.15) return wide;
  const auto narrow =
      fit(image, start, step_i, step_j, dark, white_margin, 0.3);  // for squares that are cut or partly hidden
  return misfit(narrow) < 0.6 * misfit(wide) ? narrow : wide;
}

}  // namespace huetrack::board
