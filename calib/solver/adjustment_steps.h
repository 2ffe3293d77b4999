// The steps that adjust() is made of. Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/solver/corner.h"

namespace huetrack::solver {

// How far a lens has to reach for its image's corners; a bit further than it does, when it folds before. Pinhole:
// radius on the plane z = 1; fisheye: angle; stereographic: radius on that projection.
double reach_of(const AdjustedCamera& camera);

// What every lens is believed to be, before any view: coefficients that views do not determine would otherwise cancel
// one another, here or where no board was. Small enough to be outweighed by a few dozen corners.
struct LensRegularizer {
  int parameter = 0;
  double sigma = 1;  // about 0
};
std::vector<LensRegularizer> lens_regularizers(const AdjustedCamera& camera);
// A standard deviation of a belief weighs as much as that error of one corner, per axis.
inline constexpr double regularizer_px = 0.1;

// Where a rational lens's denominator is smaller it hides a pole behind a zero of the numerator.
inline constexpr double least_denominator = 0.2;

struct SolveOptions {
  double robust_px = 0;  // of Cauchy's loss; 0: plain squares
  int max_iterations = 100;
  // It starts near the solution: steps are taken whole at once, also along what the views hardly determine.
  bool is_near = false;
  double tolerance = 1e-10;  // it ends when a step changes the cost by a smaller share
};

// One least-squares solution for the used corners, from where `a` is.
// What is known beforehand of a board's motion and of times counts by a.noise_px. throws CalibrationError
void solve(Adjustment& a, const BoardShape& shape, const SolveOptions& options);

// Sets noise_px, covariance, the offsets into it, and the sigmas of times.
void find_covariance(Adjustment& a, const BoardShape& shape);

// The normal equations of the views of one set: by parameters that are laid out elsewhere (none, where layout_size is
// 0), and by what is the set's own: its board's pose (right tangent), and where it moves its course and an error of the
// stamp of each view of the set.
struct SetEquations {
  Eigen::MatrixXd by_parameters, mixed, by_own;
  Eigen::VectorXd gradient, own_gradient;
  int residuals = 0;  // 0: no corner of it is used
  double cost = 0;    // the residuals' squares

  SetEquations(int layout_size, int own_size)
      : by_parameters(Eigen::MatrixXd::Zero(layout_size, layout_size)),
        mixed(Eigen::MatrixXd::Zero(layout_size, own_size)),
        by_own(Eigen::MatrixXd::Zero(own_size, own_size)),
        gradient(Eigen::VectorXd::Zero(layout_size)),
        own_gradient(Eigen::VectorXd::Zero(own_size)) {}
};
inline constexpr int own_course_at = 6, own_stamps_at = 18;

// first, last: views of one set, as [first, last) of a.views. What is known beforehand is in it.
SetEquations own_equations(const Adjustment& a, const BoardShape& shape, std::size_t first, std::size_t last);

// The lenses and poses of `one` less those of `other`, where the covariance of `one` has them; 0 for its times.
Eigen::VectorXd parameter_difference(const Adjustment& one, const Adjustment& other);

// Of latencies and readouts, as the covariance has them.
void set_time_sigmas(Adjustment& a);

// Sets further apart than this tell nothing of how the board moves in between: a hand turns back within half a second.
inline constexpr double longest_gap_s = 0.25;

// Whether views tell how the board moves: all have stamps, and some sets follow closely upon one another.
bool determine_motion(const std::vector<BoardView>& views);

// Where sets follow closely upon one another: moves each set's moment amid its views, and takes from the sets around
// how the board moves then (expected, information, is_known). Learns how boards are carried, and the usual errors
// of stamps, when asked to.
void renew_motions(Adjustment& a, const BoardShape& shape, bool with_stamps);

}  // namespace huetrack::solver
