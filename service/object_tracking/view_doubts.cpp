#include "object_tracking/view_doubts.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace huetrack::object_tracking {
namespace {

constexpr double quantile = 0.75;            // maths: of the window; the one below belongs to it
constexpr double chi_square_there = 1.3233;  // maths: 75 % quantile of chi-square with 1 dof

struct ViewDoubtsTuning {
  std::size_t min_residuals = 8;  // of a pair, from which the quantile is used
  double consistent_scale2 = 4;   // variance ratio up to which a pair is consistent: rig, shading, seams (experiment)
  double noise_scale2 = 2;        // variance ratio up to which a pair shows noise alone (experiment)
  double gross_scale2 = 25;       // variance ratio above what occlusion or adhering colour causes (experiment)
  double gross_nis = 12;          // 1 dof, 3.5 sigma: two such residuals in a row count at once
  double mean_share = 1.0 / 16;   // of a new residual in a pair's running means
  double rise_share = 1.0 / 30;   // of an excess that a residual adds to the lasting one: about 1 s at 30 fps
  double lasting_decay =
      1 - 1.0 / 600;               // per residual, of the lasting excess: 20 s, as it may hide along epipolar lines
  double negligible_share = 0.25;  // of the expected variance, below which an excess is zero
  double max_raise = 3;            // factor by which all inflations are raised at most to cover every pair
  double min_share = 0.1;          // of a pair's residual that a camera has at least: far away, or along the baseline
  double single_decay = 0.75;      // per frame set, of a camera's own error: a late camera's turns with the motion
  double max_along = 10;           // variance along over across the epipolar lines: within 20 degrees of them
  double min_sine = 0.1;           // between two rays, below which they cannot be compared
  double discriminating_radii = 0.5;  // radii up to which an expected residual can tell anything
  double place_radii = 8;             // radii between two places at which a pair was consistent
  int steps = 40;                     // multiplicative updates of the least squares
};
constexpr ViewDoubtsTuning view_doubts{};

}  // namespace

bool disagreement(const SeenBeside& i, const SeenBeside& j, double way_variance_m2, Disagreement& out) {
  // What a view sees along its ray is nothing: the two see together only what is across both rays.
  const auto ray_of = [](const Eigen::Matrix<double, 2, 3>& jacobian) -> Eigen::Vector3d {
    return jacobian.row(0).cross(jacobian.row(1)).normalized();
  };
  const Eigen::Vector3d across = ray_of(i.jacobian).cross(ray_of(j.jacobian));
  if (!(across.squaredNorm() > view_doubts.min_sine * view_doubts.min_sine)) return false;
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

bool could_contradict(const Disagreement& seen, double radius_i_px, double radius_j_px) {
  const double telling_px = view_doubts.discriminating_radii * std::min(radius_i_px, radius_j_px);
  return seen.expected_px2 <= telling_px * telling_px;
}

ViewDoubts::ViewDoubts(std::size_t cameras, double radius_m)
    : cameras_(cameras),
      radius_m_(radius_m),
      pairs_(cameras * (cameras - std::min<std::size_t>(cameras, 1)) / 2),
      alone_(cameras),
      variance_px2_(cameras),
      up_(cameras),
      down_(cameras) {}

const ViewDoubts::Pair& ViewDoubts::pair(std::size_t i, std::size_t j) const {
  if (i > j) std::swap(i, j);
  return pairs_[j * (j - 1) / 2 + i];
}

void ViewDoubts::compare(std::span<const SeenBeside> views, double velocity_sigma_m_s, double acceleration_m_s2) {
  for (const SeenBeside& view : views) {
    Alone& alone = alone_[std::size_t(view.camera)];
    alone.information *= view_doubts.single_decay, alone.vector *= view_doubts.single_decay;
  }
  for (std::size_t a = 0; a < views.size(); ++a) {
    for (std::size_t b = a + 1; b < views.size(); ++b) {
      const SeenBeside& i = views[a].camera < views[b].camera ? views[a] : views[b];
      const SeenBeside& j = views[a].camera < views[b].camera ? views[b] : views[a];
      const double apart_s = i.at_s - j.at_s;
      const double way_m = std::hypot(apart_s * velocity_sigma_m_s, 0.5 * apart_s * apart_s * acceleration_m_s2);
      Disagreement seen;
      if (!disagreement(i, j, way_m * way_m, seen)) continue;
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

void ViewDoubts::add(std::size_t i, std::size_t j, const Disagreement& seen) {
  note(pair(i, j), seen);
  share_out();
}

void ViewDoubts::keep(Pair& p, float square) {
  float* const end = p.sorted + std::min(p.count, pair_history.kept);
  float& oldest = p.squares[p.count % pair_history.kept];
  // Where the oldest one was, or behind all; and from there to its place.
  float* at = p.count < pair_history.kept ? end : std::min(std::lower_bound(p.sorted, end, oldest), end - 1);
  for (; at > p.sorted && at[-1] > square; --at) *at = at[-1];
  for (; at + 1 < end && at[1] < square; ++at) *at = at[1];
  *at = oldest = square;
}

void ViewDoubts::note(Pair& p, const Disagreement& seen) {
  keep(p, float(seen.off_px * seen.off_px / seen.expected_px2));
  const double share = p.count == 0 ? 1 : std::max(view_doubts.mean_share, 1 / double(p.count + 1));
  ++p.count;
  p.expected_px2 += share * (seen.expected_px2 - p.expected_px2);
  p.share_i += share * (seen.share_i - p.share_i);
  p.share_j += share * (seen.share_j - p.share_j);
  p.scale2 = scale2_of(p);
  double excess_px2 = p.scale2 > view_doubts.consistent_scale2 ? (p.scale2 - 1) * p.expected_px2 : 0;
  // Only what a good part of the ring says has lasted: a furniture's region that was taken for the object in two frames
  // is off by a hundred pixels, and would be believed for long.
  const double rise = p.count >= view_doubts.min_residuals && excess_px2 > p.lasting_px2
                          ? view_doubts.rise_share * (excess_px2 - p.lasting_px2)
                          : 0;
  p.lasting_px2 = view_doubts.lasting_decay * p.lasting_px2 + rise;
  // Before it is usual: what two comparisons say, one after the other, is no frame that was shown once more.
  if (p.count > 1) {
    const double of_both =
        double(std::min(p.squares[(p.count - 1) % pair_history.kept], p.squares[(p.count - 2) % pair_history.kept]));
    if (of_both > view_doubts.gross_nis) excess_px2 = std::max(excess_px2, of_both * p.expected_px2);
  }
  p.excess_px2 = std::max(excess_px2, p.lasting_px2);
  if (p.excess_px2 < view_doubts.negligible_share * p.expected_px2) p.excess_px2 = 0;
}

// Two views that are wrong agree along their epipolar lines: at one place by chance, and not at the next ones, where
// these lie otherwise.
void ViewDoubts::note_place(Pair& p, const Disagreement& seen, const SeenBeside& i, const SeenBeside& j) const {
  if (p.scale2 > view_doubts.consistent_scale2) {
    p.place_count = 0;
    return;
  }
  const auto radius_px = [&](const SeenBeside& view) { return radius_m_ * view.jacobian.norm() / std::numbers::sqrt2; };
  const double ri_px = radius_px(i), rj_px = radius_px(j);
  if (p.is_sure() || !could_contradict(seen, ri_px, rj_px)) return;
  if (seen.off_px * seen.off_px > seen.expected_px2 || p.scale2 > view_doubts.noise_scale2) return;
  const Eigen::Vector4d place(i.px.x(), i.px.y(), j.px.x(), j.px.y());
  const auto is_near = [&](const Eigen::Vector4d& other) {
    const Eigen::Vector4d way = other - place;
    return std::max(way.head<2>().norm() / ri_px, way.tail<2>().norm() / rj_px) < view_doubts.place_radii;
  };
  if (std::none_of(p.places, p.places + p.place_count, is_near)) p.places[p.place_count++] = place;
  p.was_sure = p.was_sure || p.is_sure();
}

// Of so few that a quantile says nothing: their mean, with two more that are as expected.
double ViewDoubts::scale2_of(const Pair& p) {
  const std::size_t n = std::min(p.count, pair_history.kept);
  if (n < view_doubts.min_residuals) {
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
bool ViewDoubts::lay_on_one() {
  std::ranges::fill(up_, 0.0);    // per camera: what disagrees without it
  std::ranges::fill(down_, 0.0);  // and what it must be off by to explain the rest
  double faded_px2 = 0;
  bool any_gross = false;
  for_each_pair([&](const Pair& p, std::size_t i, std::size_t j) {
    if (p.is_usual()) faded_px2 = std::max(faded_px2, p.excess_px2);
    any_gross = any_gross || p.excess_px2 > (view_doubts.gross_scale2 - 1) * p.expected_px2;
    for (std::size_t c = 0; c < cameras_; ++c) up_[c] += c != i && c != j && !p.is_usual() ? p.excess_px2 : 0;
    down_[i] = std::max(down_[i], p.excess_px2 / std::max(view_doubts.min_share, p.share_i));
    down_[j] = std::max(down_[j], p.excess_px2 / std::max(view_doubts.min_share, p.share_j));
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

bool ViewDoubts::Pair::is_usual() const {
  return excess_px2 <= (view_doubts.consistent_scale2 - 1) * expected_px2;
}

// By what they showed of one another; of a camera that only this one could be compared with, by what the two did.
bool ViewDoubts::are_others_proven(std::size_t without) const {
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

// By the largest error that pairs show. They see it across their lines alone, and what k samples of a variance tell of
// it has the variance of Student's distribution of k.
void ViewDoubts::doubt_all() {
  double samples = 0;
  for_each_pair([&](const Pair&, std::size_t, std::size_t) { ++samples; });
  samples = std::max(samples, 3.0);
  std::ranges::fill(variance_px2_, samples / (samples - 2) * *std::ranges::max_element(down_));
  is_nobody_believed_ = std::ranges::all_of(pairs_, [](const Pair& p) { return p.place_count == 0; });
}

// The square of the error that a camera alone must have for its pairs to be as far apart as they are now. Where its
// epipolar lines are nearly parallel a large error along them shows in how the pairs differ, and in nothing else; where
// they do not differ, what is across the lines is all that is seen.
double ViewDoubts::error_px2(std::size_t camera, double usual_px2) const {
  if (!(usual_px2 > 0)) return 0;
  // What good rigs and light leave in a pair lasts over comparisons: they count as one, of a pair that is usual.
  constexpr double as_one = (1 - view_doubts.single_decay) / view_doubts.consistent_scale2;
  const Alone& alone = alone_[camera];
  const Eigen::Matrix2d information =
      as_one * alone.information + Eigen::Matrix2d::Identity() / (view_doubts.max_along * usual_px2);
  return (as_one * information.inverse() * alone.vector).squaredNorm();
}

// Least squares with S >= 0, by multiplicative steps (Lee and Seung 2001) from equal shares: cameras that the pairs
// treat alike stay alike. Least squares, and not the likelihood of the pairs' scales: a pair that agrees says nothing
// of an error along its epipolar lines, and must not lay all of another pair's on the third camera. Then all S are
// raised until each pair's disagreement is covered.
void ViewDoubts::share_out() {
  double largest_px2 = 0;
  for (const Pair& p : pairs_) largest_px2 = std::max(largest_px2, p.excess_px2);
  any_ = largest_px2 > 0;
  is_nobody_believed_ = false;
  std::ranges::fill(variance_px2_, largest_px2);
  if (!any_) return;
  if (lay_on_one()) return;
  const auto may_be_right = [](const Pair& p) { return p.was_sure || (p.scale2 > 0 && p.is_usual()); };
  if (std::ranges::none_of(pairs_, may_be_right)) return doubt_all();
  for (int step = 0; step < view_doubts.steps; ++step) {
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
  for (double& variance : variance_px2_) variance *= std::min(raise, view_doubts.max_raise);
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
void ViewDoubts::for_each_pair(F&& each) const {
  for (std::size_t j = 1; j < cameras_; ++j) {
    for (std::size_t i = 0; i < j; ++i)
      if (pair(i, j).scale2 > 0) each(pair(i, j), i, j);
  }
}

void ViewDoubts::forget(std::size_t camera) {
  for (std::size_t other = 0; other < cameras_; ++other)
    if (other != camera) pair(camera, other) = {};
  std::ranges::fill(alone_, Alone{});
  share_out();
}

}  // namespace huetrack::object_tracking
