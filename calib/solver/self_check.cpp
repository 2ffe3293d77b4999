#include "calib/solver/self_check.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/solver/adjustment_steps.h"
#include "calib/solver/corner.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

std::vector<int> sets_of(const std::vector<BoardView>& views) {
  std::set<int> sets;
  for (const BoardView& view : views) sets.insert(view.set);
  return {sets.begin(), sets.end()};
}

// Per set: whether it belongs to the first half.
std::map<int, bool> split(const Adjustment& a, const std::vector<int>& sets, HalvesCheck::Split by) {
  std::map<int, bool> first;
  if (by == HalvesCheck::Split::in_place) {
    // Along the first principal axis of the boards' positions.
    Vector3d mean = Vector3d::Zero();
    for (const int set : sets) mean += a.world_from_board[index(set)].translation / static_cast<double>(sets.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const int set : sets) {
      const Vector3d off = a.world_from_board[index(set)].translation - mean;
      spread += off * off.transpose();
    }
    const Vector3d axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2);
    std::vector<double> along;
    for (const int set : sets) along.push_back(axis.dot(a.world_from_board[index(set)].translation));
    const double middle = calib::median(along);
    for (std::size_t s = 0; s < sets.size(); ++s) first[sets[s]] = along[s] < middle;
    return first;
  }
  // Sets close in time share a motion prior: pieces of four stay together.
  constexpr std::size_t piece = 4;
  for (std::size_t s = 0; s < sets.size(); ++s)
    first[sets[s]] = by == HalvesCheck::Split::in_time ? 2 * s < sets.size() : s / piece % 2 == 0;
  return first;
}

std::optional<Adjustment> half_of(const Adjustment& a, const std::vector<BoardView>& good,
                                  const std::map<int, bool>& is_first, bool first) {
  constexpr int least_views = 5;  // of a camera
  Adjustment half = a;
  half.views.clear();
  half.stamp_error_s.clear();
  const std::vector<double> errors_s = stamp_errors_of_inliers(a);
  std::vector<int> views(a.cameras.size());
  for (std::size_t v = 0; v < good.size(); ++v) {
    if (is_first.at(good[v].set) != first) continue;
    half.views.push_back(good[v]);
    if (!errors_s.empty()) half.stamp_error_s.push_back(errors_s[v]);
    ++views[index(good[v].camera)];
  }
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (views[c] < least_views && a.views_used(static_cast<int>(c)) > 0) return std::nullopt;
  }
  try {
    return adjust(std::move(half), {.find_outliers = false, .max_iterations = 30});
  } catch (const CalibrationError&) {
    return std::nullopt;
  }
}

// Normal equations of a camera's pose from one set, with the set's board pose eliminated.
struct PoseEquations {
  int set = 0;
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

PoseEquations pose_equations(const Adjustment& a, const BoardShape& shape, const std::vector<std::size_t>& views,
                             int camera) {
  // Beyond: another board, or another numbering.
  constexpr double gross_px = 40;
  PoseEquations out;
  Matrix6d by_board = Matrix6d::Zero(), mixed = Matrix6d::Zero();
  Vector6d board_gradient = Vector6d::Zero();
  for (const std::size_t v : views) {
    const BoardView& view = a.views[v];
    const bool own = view.camera == camera;
    const double weight = std::pow(1 / a.cameras[index(view.camera)].relative_noise, 2);
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      Vector2d r;
      CornerDerivatives d;
      if (!corner_residual(a, shape, v, k, r, &d) || r.norm() > gross_px) continue;
      by_board += weight * d.by_board.transpose() * d.by_board;
      board_gradient += weight * d.by_board.transpose() * r;
      if (!own) continue;
      out.information += weight * d.by_camera.transpose() * d.by_camera;
      out.gradient += weight * d.by_camera.transpose() * r;
      mixed += weight * d.by_camera.transpose() * d.by_board;
    }
  }
  const Eigen::LDLT<Matrix6d> solver(by_board);
  out.information -= mixed * solver.solve(mixed.transpose());
  out.gradient -= mixed * solver.solve(board_gradient);
  return out;
}

struct Sums {
  Matrix6d information = 1e-9 * Matrix6d::Identity();
  Vector6d gradient = Vector6d::Zero();
  void add(const PoseEquations& e) {
    information += e.information;
    gradient += e.gradient;
  }
  Vector6d step() const { return -information.ldlt().solve(gradient); }
  double gain() const { return gradient.dot(information.ldlt().solve(gradient)); }
};

// Best change point of a camera's pose: first set of the second part, gain of two poses over one in px^2, and the gain
// over the scatter of single sets.
struct Parting {
  std::size_t at = 0;
  double gain = 0, ratio = 0;
  Vector6d step = Vector6d::Zero();  // from the former pose to the latter
};
std::optional<Parting> best_parting(const std::vector<PoseEquations>& sets) {
  constexpr std::size_t least_sets = 4;
  if (sets.size() < 2 * least_sets) return std::nullopt;
  Sums all;
  for (const PoseEquations& e : sets) all.add(e);
  const double together = all.gain();
  std::optional<Parting> best;
  Sums before;
  for (std::size_t at = 1; at + least_sets <= sets.size(); ++at) {
    before.add(sets[at - 1]);
    if (at < least_sets) continue;
    Sums after;
    for (std::size_t s = at; s < sets.size(); ++s) after.add(sets[s]);
    const double gain = before.gain() + after.gain() - together;
    if (!best || gain > best->gain) best = Parting{at, gain, 0, after.step() - before.step()};
  }
  // Scatter of single sets about their part's pose; the median is robust against wrong sets.
  std::vector<double> left;
  for (const bool second : {false, true}) {
    Sums part;
    const std::size_t first = second ? best->at : 0, last = second ? sets.size() : best->at;
    for (std::size_t s = first; s < last; ++s) part.add(sets[s]);
    const Vector6d step = part.step();
    for (std::size_t s = first; s < last; ++s) {
      const Vector6d g = sets[s].gradient + sets[s].information * step;
      left.push_back(g.dot((sets[s].information + 1e-9 * Matrix6d::Identity()).ldlt().solve(g)));
    }
  }
  constexpr double median_of_six = 5.35;  // of chi squared with six degrees of freedom
  const double chance = std::max(calib::median(left) / median_of_six, 1e-6);
  best->ratio = best->gain / chance;
  return best;
}

}  // namespace

std::vector<HalvesCheck> compare_halves(const Adjustment& a) {
  std::vector<HalvesCheck> checks;
  if (a.covariance.size() == 0) return checks;
  const std::vector<BoardView> good = inliers(a);
  const std::vector<int> sets = sets_of(good);
  const WorldBox box = board_volume(a);
  using Split = HalvesCheck::Split;
  for (const Split by : {Split::in_time, Split::in_place, Split::alternating}) {
    // Of a moving board, neighbouring pieces share their motion, and take long.
    if (by == Split::alternating && !a.motions.empty()) continue;
    const auto is_first = split(a, sets, by);
    const auto one = half_of(a, good, is_first, true);
    if (!one) continue;
    const auto other = half_of(a, good, is_first, false);
    if (!other || one->covariance.rows() != a.covariance.rows() || other->covariance.rows() != a.covariance.rows())
      continue;
    const ShapeError error =
        shape_error(a, box, parameter_difference(*one, *other), one->covariance + other->covariance);
    checks.push_back({by, error.seen_m / 2, error.expected_m / 2});
  }
  return checks;
}

void widen_by(Adjustment& a, const std::vector<HalvesCheck>& halves) {
  double worst = 0;
  for (const HalvesCheck& check : halves) worst = std::max(worst, check.ratio());
  if (worst > most_halves_ratio) a.covariance *= worst * worst;
}

std::optional<MovedWithin> find_moved_within(const Adjustment& a) {
  const BoardShape shape(a.board);
  std::map<int, std::vector<std::size_t>> views_of_set;
  for (std::size_t v = 0; v < a.views.size(); ++v) views_of_set[a.views[v].set].push_back(v);
  // Two poses fit better than one by chance, at the best of many change points by up to this much.
  constexpr double clearly = 60;
  constexpr double least_m = 0.0005, least_rad = 0.0005;
  // A camera that moved makes the others seem to move, too: the one with the largest gain is reported.
  std::optional<MovedWithin> moved;
  double most_gain = 0;
  for (int c = 0; c < static_cast<int>(a.cameras.size()); ++c) {
    std::vector<PoseEquations> sets;
    for (const auto& [set, views] : views_of_set) {
      // Moving boards are not used: their motion competes with the camera's.
      if (a.moves(set)) continue;
      const bool seen = std::ranges::any_of(views, [&](std::size_t v) { return a.views[v].camera == c; });
      const bool by_others = std::ranges::any_of(views, [&](std::size_t v) { return a.views[v].camera != c; });
      if (!seen || !by_others) continue;
      sets.push_back(pose_equations(a, shape, views, c));
      sets.back().set = set;
    }
    const auto parting = best_parting(sets);
    if (!parting || parting->ratio < clearly || parting->gain < most_gain) continue;
    const double moved_m = parting->step.tail<3>().norm(), turned_rad = parting->step.head<3>().norm();
    if (moved_m < least_m && turned_rad < least_rad) continue;
    most_gain = parting->gain;
    moved = MovedWithin{c, sets[parting->at].set, {}, moved_m, turned_rad, a.cameras.size() == 2};
    for (const std::size_t v : views_of_set[moved->set]) {
      if (a.views[v].camera == c) moved->image = a.views[v].image;
    }
  }
  return moved;
}

}  // namespace huetrack::solver
