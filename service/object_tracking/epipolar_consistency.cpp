#include "object_tracking/epipolar_consistency.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "object_tracking/sighting.h"

namespace huetrack::object_tracking {
namespace {

constexpr double quantile = 0.75;            // maths: of the window; the one below belongs to it
constexpr double chi_square_there = 1.3233;  // maths: 75 % quantile of chi-square with 1 dof

struct EpipolarConsistencyTuning {
  double noise_scale2 = 2;               // variance ratio up to which a pair shows noise alone (experiment)
  double gross_scale2 = 25;              // variance ratio above what occlusion or adhering colour causes (experiment)
  double gross_nis = 12;                 // 1 dof, 3.5 sigma: two such residuals in a row count at once
  double rise_share = 1.0 / 30;          // of an excess that a residual adds to the lasting one: about 1 s at 30 fps
  double lasting_decay = 1 - 1.0 / 600;  // per residual, of the lasting excess: 20 s at 30 fps
  double max_raise = 3;                  // factor by which all inflations are raised at most to cover every pair
  double single_decay = 0.75;  // per frame set, of a camera's own error: a late camera's turns with the motion
  double max_along = 10;       // an error's variance over what a pair shows of it: 20 degrees off the epipolar lines
  double min_sine = 0.1;       // between two rays, below which they cannot be compared
};
constexpr EpipolarConsistencyTuning epipolar_consistency{};
// Variance ratio up to which a pair is consistent: noise, and as much again by rig, shading, seams.
constexpr double consistent_scale2 = epipolar_consistency.noise_scale2 * epipolar_consistency.noise_scale2;
// Of the expected variance, below which an excess is zero.
constexpr double negligible_share = 1 / consistent_scale2;
// Radii between two places at which a pair was consistent: regions of one object do not reach from one to the other.
constexpr double place_radii = 2 * sighting_tuning.extent_radii;
constexpr double mean_share = 2.0 / pair_history.kept;  // of a new residual in running means, as old as the window

constexpr int least_squares_steps = 40;  // capacity: multiplicative updates

}  // namespace

bool epipolar_residual(const PathResidual& i, const PathResidual& j, double path_variance_m2, EpipolarResidual& out) {
  // Errors along a ray are invisible: the residual is across both rays.
  const auto ray_of = [](const Eigen::Matrix<double, 2, 3>& jacobian) -> Eigen::Vector3d {
    return jacobian.row(0).cross(jacobian.row(1)).normalized();
  };
  const Eigen::Vector3d across = ray_of(i.jacobian).cross(ray_of(j.jacobian));
  if (!(across.squaredNorm() > epipolar_consistency.min_sine * epipolar_consistency.min_sine)) return false;
  Eigen::Vector2d u = (i.jacobian * i.jacobian.transpose()).inverse() * (i.jacobian * across);
  Eigen::Vector2d w = -((j.jacobian * j.jacobian.transpose()).inverse() * (j.jacobian * across));
  const double norm = std::sqrt(u.squaredNorm() + w.squaredNorm());
  u /= norm, w /= norm;
  out.off_px = u.dot(i.off_px) + w.dot(j.off_px);
  out.expected_px2 =
      u.dot(i.covariance * u) + w.dot(j.covariance * w) + (i.jacobian.transpose() * u).squaredNorm() * path_variance_m2;
  out.share_i = u.squaredNorm(), out.share_j = w.squaredNorm();
  out.across_i = u, out.across_j = w;
  return true;
}

namespace {

double discriminated_px2(double radius_i_px, double radius_j_px) {
  const double limit_px = 0.5 * std::min(radius_i_px, radius_j_px);
  return limit_px * limit_px;
}

}  // namespace

bool is_discriminating(const EpipolarResidual& seen, double radius_i_px, double radius_j_px) {
  return seen.expected_px2 <= discriminated_px2(radius_i_px, radius_j_px);
}

EpipolarConsistency::EpipolarConsistency(std::size_t cameras, double radius_m)
    : cameras_(cameras),
      radius_m_(radius_m),
      pairs_(cameras * (cameras - std::min<std::size_t>(cameras, 1)) / 2),
      alone_(cameras),
      variance_px2_(cameras),
      up_(cameras),
      down_(cameras) {}

const EpipolarConsistency::Pair& EpipolarConsistency::pair(std::size_t i, std::size_t j) const {
  if (i > j) std::swap(i, j);
  return pairs_[j * (j - 1) / 2 + i];
}

void EpipolarConsistency::compare(std::span<const PathResidual> views, double velocity_sigma_m_s,
                                  double acceleration_m_s2) {
  for (const PathResidual& view : views) {
    Alone& alone = alone_[std::size_t(view.camera)];
    alone.information *= epipolar_consistency.single_decay, alone.vector *= epipolar_consistency.single_decay;
  }
  for (std::size_t a = 0; a < views.size(); ++a) {
    for (std::size_t b = a + 1; b < views.size(); ++b) {
      const PathResidual& i = views[a].camera < views[b].camera ? views[a] : views[b];
      const PathResidual& j = views[a].camera < views[b].camera ? views[b] : views[a];
      const double apart_s = i.at_s - j.at_s;
      const double path_m = std::hypot(apart_s * velocity_sigma_m_s, 0.5 * apart_s * apart_s * acceleration_m_s2);
      EpipolarResidual seen;
      if (!epipolar_residual(i, j, path_m * path_m, seen)) continue;
      const auto ci = std::size_t(i.camera), cj = std::size_t(j.camera);
      Pair& p = pair(ci, cj);
      if (p.noise_scale2 == 0) p.noise_scale2 = 1;
      p.noise_scale2 += mean_share * (seen.off_px * seen.off_px / seen.expected_px2 - p.noise_scale2);
      if (i.is_cut || j.is_cut) continue;
      note(p, seen);
      note_place(p, seen, i, j);
      for (const auto& [camera, across] : {std::pair(i.camera, seen.across_i), std::pair(j.camera, seen.across_j)}) {
        Alone& alone = alone_[std::size_t(camera)];
        alone.information += across * across.transpose() / seen.expected_px2;
        alone.vector += across * seen.off_px / seen.expected_px2;
      }
    }
  }
  explain();
}

void EpipolarConsistency::add(std::size_t i, std::size_t j, const EpipolarResidual& seen) {
  note(pair(i, j), seen);
  explain();
}

void EpipolarConsistency::keep(Pair& p, float square) {
  float* const end = p.sorted + std::min(p.count, pair_history.kept);
  float& oldest = p.squares[p.count % pair_history.kept];
  float* at = p.count < pair_history.kept ? end : std::min(std::lower_bound(p.sorted, end, oldest), end - 1);
  for (; at > p.sorted && at[-1] > square; --at) *at = at[-1];
  for (; at + 1 < end && at[1] < square; ++at) *at = at[1];
  *at = oldest = square;
}

void EpipolarConsistency::note(Pair& p, const EpipolarResidual& seen) {
  keep(p, float(seen.off_px * seen.off_px / seen.expected_px2));
  const double share = p.count == 0 ? 1 : std::max(mean_share, 1 / double(p.count + 1));
  ++p.count;
  p.expected_px2 += share * (seen.expected_px2 - p.expected_px2);
  p.share_i += share * (seen.share_i - p.share_i);
  p.share_j += share * (seen.share_j - p.share_j);
  p.scale2 = scale2_of(p);
  double excess_px2 = p.scale2 > consistent_scale2 ? (p.scale2 - 1) * p.expected_px2 : 0;
  // Only once the quantile is in use: two wrong regions are 100 px off and would last for 20 s.
  const double rise = p.count >= pair_history.min_residuals && excess_px2 > p.lasting_px2
                          ? epipolar_consistency.rise_share * (excess_px2 - p.lasting_px2)
                          : 0;
  p.lasting_px2 = epipolar_consistency.lasting_decay * p.lasting_px2 + rise;
  // Fast reaction: two gross residuals in a row are no repeated frame.
  if (p.count > 1) {
    const double of_both =
        double(std::min(p.squares[(p.count - 1) % pair_history.kept], p.squares[(p.count - 2) % pair_history.kept]));
    if (of_both > epipolar_consistency.gross_nis) excess_px2 = std::max(excess_px2, of_both * p.expected_px2);
  }
  p.excess_px2 = std::max(excess_px2, p.lasting_px2);
  if (p.excess_px2 < negligible_share * p.expected_px2) p.excess_px2 = 0;
}

// Wrong views are consistent along their epipolar lines: at one place by chance, but hardly at another.
void EpipolarConsistency::note_place(Pair& p, const EpipolarResidual& seen, const PathResidual& i,
                                     const PathResidual& j) const {
  if (p.scale2 > consistent_scale2) {
    p.place_count = 0;
    return;
  }
  const auto radius_px = [&](const PathResidual& view) {
    return radius_m_ * view.jacobian.norm() / std::numbers::sqrt2;
  };
  const double ri_px = radius_px(i), rj_px = radius_px(j);
  if (p.is_sure() || !is_discriminating(seen, ri_px, rj_px)) return;
  if (seen.off_px * seen.off_px > seen.expected_px2 || p.scale2 > epipolar_consistency.noise_scale2) return;
  const Eigen::Vector4d place(i.px.x(), i.px.y(), j.px.x(), j.px.y());
  const auto is_near = [&](const Eigen::Vector4d& other) {
    const Eigen::Vector4d path = other - place;
    return std::max(path.head<2>().norm() / ri_px, path.tail<2>().norm() / rj_px) < place_radii;
  };
  if (std::none_of(p.places, p.places + p.place_count, is_near)) p.places[p.place_count++] = place;
  if (!p.is_sure()) return;
  p.was_sure = true;
  // What was larger than this was no error of a camera; what a hand causes is smaller.
  p.lasting_px2 = std::min(p.lasting_px2, discriminated_px2(ri_px, rj_px));
}

// Of few residuals: their mean, with two as expected added.
double EpipolarConsistency::scale2_of(const Pair& p) {
  const std::size_t n = std::min(p.count, pair_history.kept);
  if (n < pair_history.min_residuals) {
    double sum = 2;
    for (std::size_t k = 0; k < n; ++k) sum += double(p.squares[k]);
    return sum / double(n + 2);
  }
  return double(p.sorted[std::size_t(quantile * double(n))]) / chi_square_there;
}

// Hypothesis: one camera is wrong, and all pairs without it are consistent. Several such cameras have equal odds. While
// the pairs without it were consistent at too few places, which may be chance, a gross error inflates all cameras.
// Faded excess excludes no hypothesis and inflates every camera. false: no such camera.
bool EpipolarConsistency::explain_by_one() {
  std::ranges::fill(up_, 0.0);    // per camera: excess of the pairs without it
  std::ranges::fill(down_, 0.0);  // and its variance that explains the others
  double faded_px2 = 0;
  bool any_gross = false;
  for_each_pair([&](const Pair& p, std::size_t i, std::size_t j) {
    if (p.is_consistent()) faded_px2 = std::max(faded_px2, p.excess_px2);
    any_gross = any_gross || p.excess_px2 > (epipolar_consistency.gross_scale2 - 1) * p.expected_px2;
    for (std::size_t c = 0; c < cameras_; ++c) up_[c] += c != i && c != j && !p.is_consistent() ? p.excess_px2 : 0;
    constexpr double min_share = 1 / epipolar_consistency.max_along;
    down_[i] = std::max(down_[i], p.excess_px2 / std::max(min_share, p.share_i));
    down_[j] = std::max(down_[j], p.excess_px2 / std::max(min_share, p.share_j));
  });
  const auto suspects = std::ranges::count(up_, 0.0);
  if (suspects == 0) return false;
  bool is_proven = !any_gross;
  for (std::size_t c = 0; c < cameras_; ++c) is_proven = is_proven || (up_[c] == 0 && are_others_proven(c));
  if (!is_proven) {
    inflate_all();
    return true;
  }
  for (std::size_t c = 0; c < cameras_; ++c) {
    const double alone_px2 = up_[c] > 0 ? 0 : std::max(down_[c], error_px2(c, down_[c])) / double(suspects);
    variance_px2_[c] = std::max(alone_px2, faded_px2);
  }
  return true;
}

bool EpipolarConsistency::Pair::is_consistent() const {
  return excess_px2 <= (consistent_scale2 - 1) * expected_px2;
}

// Each by its pairs without that camera, or, if it has none, by its pair with it.
bool EpipolarConsistency::are_others_proven(std::size_t without) const {
  for (std::size_t c = 0; c < cameras_; ++c) {
    if (c == without) continue;
    std::size_t places = 0;
    bool is_compared = false;
    for (std::size_t other = 0; other < cameras_; ++other) {
      if (other == c || other == without) continue;
      places += pair(c, other).place_count;
      is_compared = is_compared || pair(c, other).scale2 > 0;
    }
    if (places < pair_history.places && (is_compared || (pair(c, without).scale2 > 0 && !pair(c, without).was_sure)))
      return false;
  }
  return true;
}

// By the largest error of a pair. Pairs measure it across their lines only: k samples, Student's t with k degrees of
// freedom.
void EpipolarConsistency::inflate_all() {
  int pairs = 0;
  for_each_pair([&](const Pair&, std::size_t, std::size_t) { ++pairs; });
  const double samples = std::max(3, pairs);  // of fewer, the variance is not finite
  std::ranges::fill(variance_px2_, samples / (samples - 2) * *std::ranges::max_element(down_));
  no_consistent_pair_ = std::ranges::all_of(pairs_, [](const Pair& p) { return p.place_count == 0; });
}

// Squared error of a camera that alone explains its pairs' residuals now, by least squares. With nearly parallel
// epipolar lines the prior bounds the component along them.
double EpipolarConsistency::error_px2(std::size_t camera, double usual_px2) const {
  if (!(usual_px2 > 0)) return 0;
  // Biases of a consistent pair persist over residuals: these count as one.
  constexpr double as_one = (1 - epipolar_consistency.single_decay) / consistent_scale2;
  const Alone& alone = alone_[camera];
  const Eigen::Matrix2d information =
      as_one * alone.information + Eigen::Matrix2d::Identity() / (epipolar_consistency.max_along * usual_px2);
  return (as_one * information.inverse() * alone.vector).squaredNorm();
}

// Least squares with S >= 0 by multiplicative updates (Lee and Seung 2001) from equal shares, which keeps equivalent
// cameras equal. Not the likelihood of the pairs' variances: a consistent pair is no evidence against an error along
// its epipolar lines. Then all S are raised until each pair's excess is covered.
void EpipolarConsistency::explain() {
  double largest_px2 = 0;
  for (const Pair& p : pairs_) largest_px2 = std::max(largest_px2, p.excess_px2);
  any_ = largest_px2 > 0;
  no_consistent_pair_ = false;
  std::ranges::fill(variance_px2_, largest_px2);
  if (!any_) return;
  if (explain_by_one()) return;
  const auto may_be_right = [](const Pair& p) { return p.was_sure || (p.scale2 > 0 && p.is_consistent()); };
  if (std::ranges::none_of(pairs_, may_be_right)) return inflate_all();
  for (int step = 0; step < least_squares_steps; ++step) {
    std::ranges::fill(up_, 0.0);
    std::ranges::fill(down_, 0.0);
    for_each_pair([&](const Pair& p, std::size_t i, std::size_t j) {
      const double modelled_px2 = p.share_i * variance_px2_[i] + p.share_j * variance_px2_[j];
      up_[i] += p.share_i * p.excess_px2, down_[i] += p.share_i * modelled_px2;
      up_[j] += p.share_j * p.excess_px2, down_[j] += p.share_j * modelled_px2;
    });
    for (std::size_t c = 0; c < cameras_; ++c)
      variance_px2_[c] = down_[c] > 0 ? variance_px2_[c] * up_[c] / down_[c] : 0;
  }
  double raise = 1;
  for_each_pair([&](const Pair& p, std::size_t i, std::size_t j) {
    const double modelled_px2 = p.share_i * variance_px2_[i] + p.share_j * variance_px2_[j];
    if (p.excess_px2 > raise * modelled_px2 && modelled_px2 > 0) raise = p.excess_px2 / modelled_px2;
  });
  for (double& variance : variance_px2_) variance *= std::min(raise, epipolar_consistency.max_raise);
  // At least the smallest excess among a camera's pairs.
  std::ranges::fill(up_, largest_px2);
  std::ranges::fill(down_, 0.0);
  for_each_pair([&](const Pair& p, std::size_t i, std::size_t j) {
    for (const std::size_t c : {i, j}) up_[c] = std::min(up_[c], p.excess_px2), down_[c] = 1;
  });
  for (std::size_t c = 0; c < cameras_; ++c)
    if (down_[c] > 0) variance_px2_[c] = std::max(variance_px2_[c], up_[c]);
}

template <typename F>
void EpipolarConsistency::for_each_pair(F&& each) const {
  for (std::size_t j = 1; j < cameras_; ++j) {
    for (std::size_t i = 0; i < j; ++i)
      if (pair(i, j).scale2 > 0) each(pair(i, j), i, j);
  }
}

double EpipolarConsistency::noise_scale2() const {
  double sum = 0, pairs = 0;
  for (const Pair& p : pairs_)
    if (p.noise_scale2 > 0) sum += std::min(p.noise_scale2, consistent_scale2), ++pairs;
  return pairs > 0 ? std::max(1.0, sum / pairs) : 1;
}

void EpipolarConsistency::forget(std::size_t camera) {
  for (std::size_t other = 0; other < cameras_; ++other)
    if (other != camera) pair(camera, other) = {};
  std::ranges::fill(alone_, Alone{});
  explain();
}

}  // namespace huetrack::object_tracking
