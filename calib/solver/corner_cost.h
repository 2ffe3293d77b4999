// What Ceres needs to know of a corner, a lens and what is known beforehand: cost functions and manifolds with analytic
// derivatives, apart from the solver's own headers, which are dear to compile. Private to this module.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <memory>
#include <vector>

#include "calib/solver/corner.h"

namespace huetrack::solver {

// A camera's pose as Ceres keeps it: quaternion x y z w, then translation.
inline constexpr int pose_block_size = 7;
void write_pose(const calib::Rigid3d& pose, double* block);
calib::Rigid3d read_pose(const double* block);

// A board that moves has in its block, after its pose, its course, and an error of the stamp of each of its views.
inline constexpr int course_at = pose_block_size, stamps_at = pose_block_size + 12;

// left: exp(delta) * pose; otherwise pose * exp(delta). more: what follows the pose in the block is moved by adding.
std::unique_ptr<ceres::Manifold> pose_manifold(bool left, int more = 0);

// Blocks: lens (12), cam_from_world (7), board (7), warp (3).
std::unique_ptr<ceres::CostFunction> corner_cost(LensModel lens, const BoardCorner& corner);

// Blocks: the same, the board's with `views` errors of stamps, and latency and readout of the camera (2). view: which
// of the stamps is this view's. after_s: of the stamp, after BoardMotion::at_s.
std::unique_ptr<ceres::CostFunction> moving_corner_cost(LensModel lens, const BoardCorner& corner, double after_s,
                                                        int view, int views);

// What is known beforehand of a board's course, in its block. noise_px: what one standard deviation costs.
std::unique_ptr<ceres::CostFunction> course_cost(int block_size, const BoardMotion& motion, double noise_px);

// What is known beforehand of some numbers of a block: weight * (number - mean) for each, from number `from` on.
std::unique_ptr<ceres::CostFunction> prior_cost(int block_size, int from, std::vector<double> means,
                                                std::vector<double> weights);

// What is known of a lens beforehand, in its block. noise_px: what one standard deviation costs.
std::unique_ptr<ceres::CostFunction> lens_prior_cost(const LensPrior& prior, double noise_px);

// See AdjustedCamera::unfold. reach: see reach_of(). Costs nothing where the lens is healthy.
std::unique_ptr<ceres::CostFunction> lens_shape_cost(LensModel lens, double reach, double weight);

}  // namespace huetrack::solver
