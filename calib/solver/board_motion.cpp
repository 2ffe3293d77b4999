#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "calib/model/index.h"
#include "calib/solver/adjustment_steps.h"
#include "calib/solver/extrinsics.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Neighbouring sets on either side: the cubic model holds for a short time only.
constexpr int sets_each_way = 2;
// Each pair of sets contributes to the motion of both: weighted so that it does not count twice.
constexpr double share_of_each = 0.5;

// Initial hyperparameters of a hand-carried board: rms second and third derivative of rotation (rad) and position (m);
// at 1.5 Hz each derivative is ten times the one before.
constexpr std::array<double, 2> usual_change{15, 3}, usual_jerk{150, 30};
// Limits of the estimates, relative to the initial ones.
constexpr double least_carrying = 0.01, most_carrying = 2;

// Faster between two sets: separate places, not a continuous motion.
constexpr std::array<double, 2> fastest{10, 3};  // rad/s, m/s

// Upper limit: a program that takes the newest of five images a second has stamp errors uniform over 0.2 s, sigma 60
// ms. Initially the border between such stamps and drivers' own: too small a value distorts the motion, too large a one
// is corrected soon.
constexpr double least_stamp_sigma_s = 5e-5, most_stamp_sigma_s = 0.06, first_stamp_sigma_s = worst_stamps_of_camera_s;

// The views of one set, as [first, last).
struct ViewsOfSet {
  std::size_t first = 0, last = 0;
};

std::vector<ViewsOfSet> views_of_sets(const Adjustment& a) {
  std::vector<ViewsOfSet> sets;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (v == 0 || a.views[v].set != a.views[v - 1].set) sets.push_back({v, v});
    sets.back().last = v + 1;
  }
  return sets;
}

// Estimated board pose of a set, with its variance.
struct PlacedSet {
  ViewsOfSet views;
  int set = 0;
  double at_s = 0;
  calib::Tangent6d variance = calib::Tangent6d::Zero();  // of the pose, right tangent
};

// Exposure of a view's middle row, by its stamp without the estimated stamp error: that would feed back into the motion
// prior from round to round.
double middle_of(const Adjustment& a, std::size_t v) {
  return *a.views[v].stamp_s - a.cameras[index(a.views[v].camera)].latency.value_s;
}

// Moves pose and course to another time.
void move_moment(Adjustment& a, int set, double at_s) {
  BoardMotion& motion = a.motions[index(set)];
  if (motion.is_known) {
    const double tau = at_s - motion.at_s;
    const calib::Tangent6d displacement = motion.course * Eigen::Vector2d(tau, tau * tau / 2);
    calib::Rigid3d step = calib::exp((calib::Tangent6d() << displacement.head<3>(), Vector3d::Zero()).finished());
    step.translation = displacement.tail<3>();
    a.world_from_board[index(set)] = a.world_from_board[index(set)] * step;
    motion.course.col(0) += tau * motion.course.col(1);
    // In the turned axes of the board.
    motion.course.bottomRows<3>() =
        (step.rotation.toRotationMatrix().transpose() * motion.course.bottomRows<3>()).eval();
  }
  motion.at_s = at_s;
}

// Evidence estimate of a prior's standard deviation (MacKay: effective number of determined parameters).
class UsualSize {
 public:
  void add(double value, double variance, double usual) {
    determined_ += std::max(0.0, 1 - variance / (usual * usual));
    squares_ += value * value;
  }
  double sigma(double otherwise, double least, double most) const {
    constexpr double enough = 4;  // effective parameters
    if (determined_ < enough) return otherwise;
    return std::clamp(std::sqrt(squares_ / determined_), least, most);
  }

 private:
  double determined_ = 0, squares_ = 0;
};

// Estimates of the hyperparameters, of rotation and of position.
struct MotionStatistics {
  std::array<UsualSize, 2> change, jerk;
};

// Least-squares cubics through the neighbours' poses, relative to this set's.
void find_motion(Adjustment& a, const std::vector<PlacedSet>& sets, std::size_t s, MotionStatistics& statistics) {
  BoardMotion& motion = a.motions[index(sets[s].set)];
  const calib::Rigid3d board_from_world = calib::inverse(a.world_from_board[index(sets[s].set)]);
  std::vector<std::size_t> around;
  std::vector<calib::Tangent6d> moved;  // per neighbour
  for (const int side : {-1, 1}) {
    for (int k = 1; k <= sets_each_way; ++k) {
      const std::size_t other = s + static_cast<std::size_t>(side * k);  // unsigned wrap-around below 0 is rejected
      const double gap_s = other < sets.size() ? std::abs(sets[other].at_s - sets[s].at_s) : longest_gap_s;
      if (!(gap_s < longest_gap_s)) break;
      const calib::Rigid3d step = board_from_world * a.world_from_board[index(sets[other].set)];
      const Eigen::AngleAxisd turn(step.rotation);
      if (turn.angle() > fastest[0] * gap_s || step.translation.norm() > fastest[1] * gap_s) break;
      around.push_back(other);
      moved.emplace_back();
      moved.back() << turn.angle() * turn.axis(), step.translation;
    }
  }
  const bool was_known = motion.is_known;
  motion.is_known = !around.empty();
  if (around.empty()) {
    motion.course.setZero();
    return;
  }
  for (int i = 0; i < 6; ++i) {
    // Unknown: rate, change, jerk; with priors of the latter two.
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero(), g_of_own = Eigen::Vector3d::Zero();
    const std::size_t kind = i < 3 ? 0 : 1;
    const double change = a.motion_prior.change[kind], jerk = a.motion_prior.jerk[kind];
    h.diagonal() << 0, 1 / (change * change), 1 / (jerk * jerk);
    for (std::size_t k = 0; k < around.size(); ++k) {
      const PlacedSet& other = sets[around[k]];
      const double tau = other.at_s - sets[s].at_s;
      const Eigen::Vector3d j(tau, tau * tau / 2, tau * tau * tau / 6);
      h += j * j.transpose() / other.variance(i);
      g += j * moved[k](i) / other.variance(i);
      g_of_own -= j / other.variance(i);
    }
    const Eigen::Vector3d scale = h.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::Matrix3d inverse = scale.asDiagonal() *
                                    Eigen::Matrix3d(scale.asDiagonal() * h * scale.asDiagonal()).inverse() *
                                    scale.asDiagonal();
    const Eigen::Vector3d derivatives = inverse * g;
    statistics.change[kind].add(derivatives(1), inverse(1, 1), change);
    statistics.jerk[kind].add(derivatives(2), inverse(2, 2), jerk);
    motion.expected.row(i) = derivatives.head<2>().transpose();
    // This set's own pose has an error, too.
    const Eigen::Vector2d by_own = (inverse * g_of_own).head<2>();
    const Eigen::Matrix2d covariance =
        inverse.topLeftCorner<2, 2>() + sets[s].variance(i) * by_own * by_own.transpose();
    motion.information[index(i)] = share_of_each * covariance.inverse();
  }
  if (!was_known) motion.course = motion.expected;
}

}  // namespace

bool determine_motion(const std::vector<BoardView>& views) {
  std::map<int, double> at_s;
  for (const BoardView& view : views) {
    if (!view.stamp_s) return false;
    at_s[view.set] = *view.stamp_s;
  }
  std::vector<double> times;
  for (const auto& [set, time] : at_s) times.push_back(time);
  std::ranges::sort(times);
  return std::ranges::adjacent_find(times, [](double a, double b) { return b - a <= longest_gap_s; }) != times.end();
}

void renew_motions(Adjustment& a, const BoardShape& shape, bool with_stamps) {
  if (a.stamp_error_s.size() != a.views.size()) a.stamp_error_s.assign(a.views.size(), 0);
  for (AdjustedCamera& camera : a.cameras) {
    if (!(camera.stamp_sigma_s > 0)) camera.stamp_sigma_s = first_stamp_sigma_s;
  }
  if (!(a.motion_prior.change[0] > 0)) a.motion_prior = {usual_change, usual_jerk};
  std::vector<PlacedSet> sets;
  std::vector<UsualSize> errors(a.cameras.size());
  for (const ViewsOfSet& views : views_of_sets(a)) {
    PlacedSet set{views, a.views[views.first].set};
    // Unused views keep a stamp error of 0.
    std::vector<double> middles;
    for (std::size_t v = views.first; v < views.last; ++v) {
      if (a.fits[v].dropped) a.stamp_error_s[v] = 0;
      if (!a.fits[v].dropped) middles.push_back(middle_of(a, v));
    }
    if (middles.empty()) continue;
    const SetEquations equations = own_equations(a, shape, views.first, views.last);
    if (equations.residuals == 0) continue;
    const auto size = equations.by_own.rows();
    const MatrixXd covariance =
        a.noise_px * a.noise_px * equations.by_own.ldlt().solve(MatrixXd(MatrixXd::Identity(size, size)));
    if (!covariance.allFinite() || covariance.diagonal().minCoeff() <= 0) continue;
    // Limit by the flatness of a board.
    constexpr double least_sigma = 2e-5;
    set.variance = covariance.diagonal().head<6>().cwiseMax(least_sigma * least_sigma);
    for (std::size_t v = views.first; v < views.last && a.moves(set.set); ++v) {
      const auto at = own_stamps_at + static_cast<Eigen::Index>(v - views.first);
      const std::size_t camera = index(a.views[v].camera);
      errors[camera].add(a.stamp_error_s[v], covariance(at, at), a.cameras[camera].stamp_sigma_s);
    }
    double sum = 0;
    for (const double middle : middles) sum += middle;
    set.at_s = sum / static_cast<double>(middles.size());
    move_moment(a, set.set, set.at_s);
    sets.push_back(set);
  }
  double squares = 0;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    double& sigma_s = a.cameras[c].stamp_sigma_s;
    if (with_stamps) sigma_s = errors[c].sigma(sigma_s, least_stamp_sigma_s, most_stamp_sigma_s);
    squares += sigma_s * sigma_s / static_cast<double>(a.cameras.size());
  }
  a.stamp_sigma_s = std::sqrt(squares);
  std::ranges::stable_sort(sets, {}, &PlacedSet::at_s);
  MotionStatistics statistics;
  for (std::size_t s = 0; s < sets.size(); ++s) find_motion(a, sets, s, statistics);
  if (!with_stamps) return;
  const auto learn = [](double& usual, const UsualSize& size, double beforehand) {
    usual = size.sigma(usual, least_carrying * beforehand, most_carrying * beforehand);
  };
  for (std::size_t kind = 0; kind < 2; ++kind) {
    learn(a.motion_prior.change[kind], statistics.change[kind], usual_change[kind]);
    learn(a.motion_prior.jerk[kind], statistics.jerk[kind], usual_jerk[kind]);
  }
}

}  // namespace huetrack::solver
