#include "object_tracking/view_doubts.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace huetrack::object_tracking {
namespace {

// Of the ring, this quantile is compared with that of chi-square with one degree of freedom. A contradiction that
// begins is noticed when it has a quarter of the ring, some 0.3 s later; what is wrong more rarely moves nothing.
constexpr double quantile = 0.75, chi_square_there = 1.3233;
constexpr std::size_t least_count = 6;  // comparisons, before a pair says anything
// What a good calibration's own error, light from one side and a colour's seams make of it on good recordings
// (README.md): a pair below this agrees.
constexpr double usual_scale2 = 4;
constexpr double forgetting = 1.0 / 16;  // of the means, per comparison

}  // namespace

bool disagreement(const SeenBeside& i, const SeenBeside& j, double way_variance_m2, Disagreement& out) {
  // What a view sees along its ray is nothing: the two see together only what is across both rays.
  const auto ray_of = [](const Eigen::Matrix<double, 2, 3>& jacobian) -> Eigen::Vector3d {
    return jacobian.row(0).cross(jacobian.row(1)).normalized();
  };
  const Eigen::Vector3d across = ray_of(i.jacobian).cross(ray_of(j.jacobian));
  constexpr double least_sine = 0.03;
  if (!(across.squaredNorm() > least_sine * least_sine)) return false;
  Eigen::Vector2d u = (i.jacobian * i.jacobian.transpose()).inverse() * (i.jacobian * across);
  Eigen::Vector2d w = -((j.jacobian * j.jacobian.transpose()).inverse() * (j.jacobian * across));
  const double norm = std::sqrt(u.squaredNorm() + w.squaredNorm());
  u /= norm, w /= norm;
  out.off_px = u.dot(i.off_px) + w.dot(j.off_px);
  out.expected_px2 =
      u.dot(i.covariance * u) + w.dot(j.covariance * w) + (i.jacobian.transpose() * u).squaredNorm() * way_variance_m2;
  out.share_i = u.squaredNorm(), out.share_j = w.squaredNorm();
  return true;
}

ViewDoubts::ViewDoubts(std::size_t cameras)
    : cameras_(cameras),
      pairs_(cameras * (cameras - std::min<std::size_t>(cameras, 1)) / 2),
      variance_px2_(cameras),
      up_(cameras),
      down_(cameras) {}

const ViewDoubts::Pair& ViewDoubts::pair(std::size_t i, std::size_t j) const {
  if (i > j) std::swap(i, j);
  return pairs_[j * (j - 1) / 2 + i];
}

void ViewDoubts::compare(std::span<const SeenBeside> views, double velocity_sigma_m_s, double acceleration_m_s2) {
  bool is_new = false;
  for (std::size_t a = 0; a < views.size(); ++a) {
    for (std::size_t b = a + 1; b < views.size(); ++b) {
      const SeenBeside& i = views[a].camera < views[b].camera ? views[a] : views[b];
      const SeenBeside& j = views[a].camera < views[b].camera ? views[b] : views[a];
      const double apart_s = i.at_s - j.at_s;
      const double way_m = std::hypot(apart_s * velocity_sigma_m_s, 0.5 * apart_s * apart_s * acceleration_m_s2);
      Disagreement seen;
      if (!disagreement(i, j, way_m * way_m, seen)) continue;
      Pair& p = pair(std::size_t(i.camera), std::size_t(j.camera));
      p.squares[p.count % kept] = float(seen.off_px * seen.off_px / seen.expected_px2);
      const double share = p.count == 0 ? 1 : std::max(forgetting, 1 / double(p.count + 1));
      ++p.count;
      p.expected_px2 += share * (seen.expected_px2 - p.expected_px2);
      p.share_i += share * (seen.share_i - p.share_i);
      p.share_j += share * (seen.share_j - p.share_j);
      const std::size_t n = std::min(p.count, kept);
      if (n < least_count) continue;
      std::array<float, kept> sorted;
      std::copy_n(p.squares, n, sorted.begin());
      const auto at = sorted.begin() + std::ptrdiff_t(quantile * double(n));
      std::nth_element(sorted.begin(), at, sorted.begin() + std::ptrdiff_t(n));
      p.scale2 = double(*at) / chi_square_there;
      is_new = true;
    }
  }
  if (is_new) share_out();
}

// Maximum likelihood of the S where each pair's scale^2 is what a Gaussian of that variance has shown, by
// multiplicative steps (Fevotte, Bertin, Durrieu 2009, algorithm 1, with what is expected held): they keep S >= 0,
// treat cameras alike that the pairs treat alike, and believe a pair that agrees more than one that does not.
void ViewDoubts::share_out() {
  std::ranges::fill(variance_px2_, 0.0);
  double largest_px2 = 0;
  for (const Pair& p : pairs_)
    if (p.scale2 > usual_scale2) largest_px2 = std::max(largest_px2, (p.scale2 - 1) * p.expected_px2);
  any_ = largest_px2 > 0;
  if (!any_) return;
  std::ranges::fill(variance_px2_, largest_px2);
  constexpr int steps = 60;
  for (int step = 0; step < steps; ++step) {
    std::ranges::fill(up_, 0.0);
    std::ranges::fill(down_, 0.0);
    for (std::size_t j = 1; j < cameras_; ++j) {
      for (std::size_t i = 0; i < j; ++i) {
        const Pair& p = pair(i, j);
        if (p.scale2 == 0) continue;
        const double seen_px2 = (p.scale2 > usual_scale2 ? p.scale2 : 1) * p.expected_px2;
        const double model_px2 = p.expected_px2 + p.share_i * variance_px2_[i] + p.share_j * variance_px2_[j];
        up_[i] += p.share_i * seen_px2 / (model_px2 * model_px2), down_[i] += p.share_i / model_px2;
        up_[j] += p.share_j * seen_px2 / (model_px2 * model_px2), down_[j] += p.share_j / model_px2;
      }
    }
    for (std::size_t c = 0; c < cameras_; ++c)
      variance_px2_[c] = down_[c] > 0 ? variance_px2_[c] * up_[c] / down_[c] : 0;
  }
}

void ViewDoubts::forget(std::size_t camera) {
  for (std::size_t other = 0; other < cameras_; ++other)
    if (other != camera) pair(camera, other) = {};
  share_out();
}

}  // namespace huetrack::object_tracking
