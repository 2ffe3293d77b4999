#include "object_tracking/epipolar_consistency.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace huetrack::object_tracking {
namespace {

// Of the ring, this quantile is compared with that of chi-square with one degree of freedom. A contradiction that
// begins is noticed when it has a quarter of the ring, some 0.3 s later; what is wrong more rarely moves nothing.
constexpr double quantile = 0.75, chi_square_there = 1.3233;
constexpr std::size_t enough = 8;  // comparisons, for a quantile
// What a good calibration's own error, light from one side and a colour's seams make of it on good recordings
// (README.md): a pair below this agrees.
constexpr double usual_scale2 = 4;
constexpr double agreeing_scale2 = 2;  // and below this nothing but noise is in it
// What half a ball, or colour that sticks to it, makes of a pair is less than this; what a wrong rig does is mostly
// more.
constexpr double gross_scale2 = 25;
constexpr double usual_of_two = 12;      // (3.5 standard deviations)^2, twice
constexpr double forgetting = 1.0 / 16;  // of the means, per comparison
// A epipolar_residual that has lasted for a second is believed to be there for some 20 s more, fading: where the object
// is now, the cameras' error may lie along the epipolar lines.
constexpr double believed_per_comparison = 1.0 / 30, kept_of_excess = 1 - 1.0 / 600;
constexpr double negligible_of_expected = 0.25;
constexpr double most_raised = 3;
// Of a camera that is much further away than the other one, or sees hardly across: what it sees is hardly compared.
constexpr double least_compared_share = 0.1;
// What pairs say together is of now: the error of a camera that is late turns with the motion.
constexpr double kept_of_alone = 0.75;

}  // namespace

bool epipolar_residual(const PathResidual& i, const PathResidual& j, double way_variance_m2, EpipolarResidual& out) {
  // What a view sees along its ray is nothing: the two see together only what is across both rays.
  const auto ray_of = [](const Eigen::Matrix<double, 2, 3>& jacobian) -> Eigen::Vector3d {
    return jacobian.row(0).cross(jacobian.row(1)).normalized();
  };
  const Eigen::Vector3d across = ray_of(i.jacobian).cross(ray_of(j.jacobian));
  constexpr double least_sine = 0.1;  // cameras that face each other see hardly anything across both rays
  if (!(across.squaredNorm() > least_sine * least_sine)) return false;
  Eigen::Vector2d u = (i.jacobian * i.jacobian.transpose()).inverse() * (i.jacobian * across);
  Eigen::Vector2d w = -((j.jacobian * j.jacobian.transpose()).inverse() * (j.jacobian * across));
  const double norm = std::sqrt(u.squaredNorm() + w.squaredNorm());
  u /= norm, w /= norm;
  out.off_px = u.dot(i.off_px) + w.dot(j.off_px);
  out.expected_px2 =
      u.dot(i.covariance * u) + w.dot(j.covariance * w) + (i.jacobian.transpose() * u).squaredNorm() * way_variance_m2;
  out.share_i = u.squaredNorm(), out.share_j = w.squaredNorm();
  out.across_i = u, out.across_j = w;
  return true;
}

bool is_discriminating(const EpipolarResidual& seen, double radius_i_px, double radius_j_px) {
  const double telling_px = 0.5 * std::min(radius_i_px, radius_j_px);
  return seen.expected_px2 <= telling_px * telling_px;
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
    alone.information *= kept_of_alone, alone.vector *= kept_of_alone;
  }
  for (std::size_t a = 0; a < views.size(); ++a) {
    for (std::size_t b = a + 1; b < views.size(); ++b) {
      const PathResidual& i = views[a].camera < views[b].camera ? views[a] : views[b];
      const PathResidual& j = views[a].camera < views[b].camera ? views[b] : views[a];
      const double apart_s = i.at_s - j.at_s;
      const double way_m = std::hypot(apart_s * velocity_sigma_m_s, 0.5 * apart_s * apart_s * acceleration_m_s2);
      EpipolarResidual seen;
      if (!epipolar_residual(i, j, way_m * way_m, seen)) continue;
      Pair& p = pair(std::size_t(i.camera), std::size_t(j.camera));
      note(p, seen);
      note_place(p, seen, i, j);
      for (const auto& [camera, across] : {std::pair(i.camera, seen.across_i), std::pair(j.camera, seen.across_j)}) {
        Alone& alone = alone_[std::size_t(camera)];
        alone.information += across * across.transpose() / seen.expected_px2;
        alone.vector += across * seen.off_px / seen.expected_px2;
      }
    }
  }
  share_out();
}

void EpipolarConsistency::add(std::size_t i, std::size_t j, const EpipolarResidual& seen) {
  note(pair(i, j), seen);
  share_out();
}

void EpipolarConsistency::keep(Pair& p, float square) {
  float* const end = p.sorted + std::min(p.count, kept);
  float& oldest = p.squares[p.count % kept];
  // Where the oldest one was, or behind all; and from there to its place.
  float* at = p.count < kept ? end : std::min(std::lower_bound(p.sorted, end, oldest), end - 1);
  for (; at > p.sorted && at[-1] > square; --at) *at = at[-1];
  for (; at + 1 < end && at[1] < square; ++at) *at = at[1];
  *at = oldest = square;
}

void EpipolarConsistency::note(Pair& p, const EpipolarResidual& seen) {
  keep(p, float(seen.off_px * seen.off_px / seen.expected_px2));
  const double share = p.count == 0 ? 1 : std::max(forgetting, 1 / double(p.count + 1));
  ++p.count;
  p.expected_px2 += share * (seen.expected_px2 - p.expected_px2);
  p.share_i += share * (seen.share_i - p.share_i);
  p.share_j += share * (seen.share_j - p.share_j);
  p.scale2 = scale2_of(p);
  double excess_px2 = p.scale2 > usual_scale2 ? (p.scale2 - 1) * p.expected_px2 : 0;
  // Only what a good part of the ring says has lasted: a furniture's region that was taken for the object in two frames
  // is off by a hundred pixels, and would be believed for long.
  const double rise =
      p.count >= enough && excess_px2 > p.lasting_px2 ? believed_per_comparison * (excess_px2 - p.lasting_px2) : 0;
  p.lasting_px2 = kept_of_excess * p.lasting_px2 + rise;
  // Before it is usual: what two comparisons say, one after the other, is no frame that was shown once more.
  if (p.count > 1) {
    const double of_both = double(std::min(p.squares[(p.count - 1) % kept], p.squares[(p.count - 2) % kept]));
    if (of_both > usual_of_two) excess_px2 = std::max(excess_px2, of_both * p.expected_px2);
  }
  p.excess_px2 = std::max(excess_px2, p.lasting_px2);
  if (p.excess_px2 < negligible_of_expected * p.expected_px2) p.excess_px2 = 0;
}

// Two views that are wrong agree along their epipolar lines: at one place by chance, and not at the next ones, where
// these lie otherwise.
void EpipolarConsistency::note_place(Pair& p, const EpipolarResidual& seen, const PathResidual& i,
                                     const PathResidual& j) const {
  constexpr double radii_apart = 8;
  if (p.scale2 > usual_scale2) {
    p.place_count = 0;
    return;
  }
  const auto radius_px = [&](const PathResidual& view) {
    return radius_m_ * view.jacobian.norm() / std::numbers::sqrt2;
  };
  const double ri_px = radius_px(i), rj_px = radius_px(j);
  if (p.is_sure() || !is_discriminating(seen, ri_px, rj_px)) return;
  if (seen.off_px * seen.off_px > seen.expected_px2 || p.scale2 > agreeing_scale2) return;
  const Eigen::Vector4d place(i.px.x(), i.px.y(), j.px.x(), j.px.y());
  const auto is_near = [&](const Eigen::Vector4d& other) {
    const Eigen::Vector4d way = other - place;
    return std::max(way.head<2>().norm() / ri_px, way.tail<2>().norm() / rj_px) < radii_apart;
  };
  if (std::none_of(p.places, p.places + p.place_count, is_near)) p.places[p.place_count++] = place;
  p.was_sure = p.was_sure || p.is_sure();
}

// Of so few that a quantile says nothing: their mean, with two more that are as expected.
double EpipolarConsistency::scale2_of(const Pair& p) {
  const std::size_t n = std::min(p.count, kept);
  if (n < enough) {
    double sum = 2;
    for (std::size_t k = 0; k < n; ++k) sum += double(p.squares[k]);
    return sum / double(n + 2);
  }
  return double(p.sorted[std::size_t(quantile * double(n))]) / chi_square_there;
}

// One camera that is wrong is likelier than two at a time. Where one alone could explain what disagrees, as all pairs
// without it agree, it is off by what that takes; where any of several could, as pairs agree along their epipolar
// lines by chance, each is with equal odds. As long as pairs without it have agreed in so few places that this may be
// chance, too, everybody may be off that is off by much. A doubt of the past that has faded to what is usual hinders no
// explanation, and is anybody's. false: none could.
bool EpipolarConsistency::lay_on_one() {
  std::ranges::fill(up_, 0.0);    // per camera: what disagrees without it
  std::ranges::fill(down_, 0.0);  // and what it must be off by to explain the rest
  double faded_px2 = 0;
  bool any_gross = false;
  for_each_pair([&](const Pair& p, std::size_t i, std::size_t j) {
    if (p.is_usual()) faded_px2 = std::max(faded_px2, p.excess_px2);
    any_gross = any_gross || p.excess_px2 > (gross_scale2 - 1) * p.expected_px2;
    for (std::size_t c = 0; c < cameras_; ++c) up_[c] += c != i && c != j && !p.is_usual() ? p.excess_px2 : 0;
    down_[i] = std::max(down_[i], p.excess_px2 / std::max(least_compared_share, p.share_i));
    down_[j] = std::max(down_[j], p.excess_px2 / std::max(least_compared_share, p.share_j));
  });
  const auto suspects = std::ranges::count(up_, 0.0);
  if (suspects == 0) return false;
  bool is_proven = !any_gross;
  for (std::size_t c = 0; c < cameras_; ++c) is_proven = is_proven || (up_[c] == 0 && are_others_proven(c));
  if (!is_proven) {
    doubt_all();
    return true;
  }
  for (std::size_t c = 0; c < cameras_; ++c) {
    const double alone_px2 = up_[c] > 0 ? 0 : std::max(down_[c], error_px2(c, down_[c])) / double(suspects);
    variance_px2_[c] = std::max(alone_px2, faded_px2);
  }
  return true;
}

bool EpipolarConsistency::Pair::is_usual() const {
  return excess_px2 <= (usual_scale2 - 1) * expected_px2;
}

// By what they showed of one another; of a camera that only this one could be compared with, by what the two did.
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
    if (places < sure_places && (is_compared || (pair(c, without).scale2 > 0 && !pair(c, without).was_sure)))
      return false;
  }
  return true;
}

// By the largest error that pairs show. They see it across their lines alone, and what k samples of a variance tell of
// it has the variance of Student's distribution of k.
void EpipolarConsistency::doubt_all() {
  double samples = 0;
  for_each_pair([&](const Pair&, std::size_t, std::size_t) { ++samples; });
  samples = std::max(samples, 3.0);
  std::ranges::fill(variance_px2_, samples / (samples - 2) * *std::ranges::max_element(down_));
  is_nobody_believed_ = std::ranges::all_of(pairs_, [](const Pair& p) { return p.place_count == 0; });
}

// The square of the error that a camera alone must have for its pairs to be as far apart as they are now. Where its
// epipolar lines are nearly parallel a large error along them shows in how the pairs differ, and in nothing else; where
// they do not differ, what is across the lines is all that is seen.
double EpipolarConsistency::error_px2(std::size_t camera, double usual_px2) const {
  if (!(usual_px2 > 0)) return 0;
  // An error rarely is more than three times what is seen of it across: it would lie within 20 degrees of the lines.
  constexpr double widest = 10;  // as a variance
  // What good rigs and light leave in a pair lasts over comparisons: they count as one, of a pair that is usual.
  constexpr double as_one = (1 - kept_of_alone) / usual_scale2;
  const Alone& alone = alone_[camera];
  const Eigen::Matrix2d information = as_one * alone.information + Eigen::Matrix2d::Identity() / (widest * usual_px2);
  return (as_one * information.inverse() * alone.vector).squaredNorm();
}

// Least squares with S >= 0, by multiplicative steps (Lee and Seung 2001) from equal shares: cameras that the pairs
// treat alike stay alike. Least squares, and not the likelihood of the pairs' scales: a pair that agrees says nothing
// of an error along its epipolar lines, and must not lay all of another pair's on the third camera. Then all S are
// raised until each pair's epipolar_residual is covered.
void EpipolarConsistency::share_out() {
  double largest_px2 = 0;
  for (const Pair& p : pairs_) largest_px2 = std::max(largest_px2, p.excess_px2);
  any_ = largest_px2 > 0;
  is_nobody_believed_ = false;
  std::ranges::fill(variance_px2_, largest_px2);
  if (!any_) return;
  if (lay_on_one()) return;
  const auto may_be_right = [](const Pair& p) { return p.was_sure || (p.scale2 > 0 && p.is_usual()); };
  if (std::ranges::none_of(pairs_, may_be_right)) return doubt_all();
  constexpr int steps = 40;
  for (int step = 0; step < steps; ++step) {
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
  for (double& variance : variance_px2_) variance *= std::min(raise, most_raised);
  // And whoever agrees with nobody is doubted by as much as with whom it agrees best, whatever explains it otherwise.
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

void EpipolarConsistency::forget(std::size_t camera) {
  for (std::size_t other = 0; other < cameras_; ++other)
    if (other != camera) pair(camera, other) = {};
  std::ranges::fill(alone_, Alone{});
  share_out();
}

}  // namespace huetrack::object_tracking
