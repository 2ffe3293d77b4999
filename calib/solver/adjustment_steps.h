// Steps of adjust(). Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/solver/corner.h"

namespace huetrack::solver {

// Largest radius that the image's corners need; if the lens folds before, slightly beyond the fold. Pinhole: radius on
// the plane z = 1; fisheye: angle; stereographic: radius on that projection.
double reach_of(const AdjustedCamera& camera);

// Of a free lens: the camera's own (AdjustedCamera::lens_prior), or that of webcams and action cameras (usual_lens.h),
// of which the focal length's mean is the present one.
LensPrior lens_prior(const AdjustedCamera& camera);

// A rational lens with a smaller denominator hides a pole behind a zero of the numerator.
inline constexpr double least_denominator = 0.2;

struct SolveOptions {
  double robust_px = 0;  // scale of Cauchy's loss; 0: squares
  int max_iterations = 100;
  // Near the solution: full steps at once, also along weakly determined directions.
  bool is_near = false;
  double tolerance = 1e-10;  // relative change of the cost at which it ends
};

// One least-squares solution for the used corners, from `a`. Priors are scaled by a.noise_px. throws CalibrationError
void solve(Adjustment& a, const BoardShape& shape, const SolveOptions& options);

// Sets noise_px, covariance, its offsets, and the sigmas of times.
void find_covariance(Adjustment& a, const BoardShape& shape);

// Normal equations of the views of one set: by global parameters (none, where layout_size is 0), and by the set's own:
// board pose (right tangent) and, where the board moves, its course and one stamp error per view.
struct SetEquations {
  Eigen::MatrixXd by_parameters, mixed, by_own;
  Eigen::VectorXd gradient, own_gradient;
  int residuals = 0;  // 0: no corner is used
  double cost = 0;    // sum of squares

  SetEquations(int layout_size, int own_size)
      : by_parameters(Eigen::MatrixXd::Zero(layout_size, layout_size)),
        mixed(Eigen::MatrixXd::Zero(layout_size, own_size)),
        by_own(Eigen::MatrixXd::Zero(own_size, own_size)),
        gradient(Eigen::VectorXd::Zero(layout_size)),
        own_gradient(Eigen::VectorXd::Zero(own_size)) {}
};
inline constexpr int own_course_at = 6, own_stamps_at = 18;

// Views [first, last) of a.views, of one set. Includes the priors.
SetEquations own_equations(const Adjustment& a, const BoardShape& shape, std::size_t first, std::size_t last);

// Lenses and poses of `one` less those of `other`, laid out as the covariance of `one`; 0 for times.
Eigen::VectorXd parameter_difference(const Adjustment& one, const Adjustment& other);

// Sigmas of latencies and readouts, from the covariance.
void set_time_sigmas(Adjustment& a);

// Longest gap between sets over which motion is interpolated: a hand turns back within half a second.
inline constexpr double longest_gap_s = 0.25;

// Whether the board's motion is observable: all views have stamps, and some sets are close in time.
bool determine_motion(const std::vector<BoardView>& views);

// Where sets are close in time: centres each set's moment on its views, and renews the motion prior from the
// neighbouring sets (expected, information, is_known) and its hyperparameters; with_stamps: stamp_sigma_s, too.
void renew_motions(Adjustment& a, const BoardShape& shape, bool with_stamps);

}  // namespace huetrack::solver
