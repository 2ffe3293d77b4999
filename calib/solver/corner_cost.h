// Ceres cost functions and manifolds with analytic derivatives. Private to this module.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <memory>
#include <vector>

#include "calib/solver/corner.h"

namespace huetrack::solver {

// Pose block: quaternion x y z w, translation.
inline constexpr int pose_block_size = 7;
void write_pose(const calib::Rigid3d& pose, double* block);
calib::Rigid3d read_pose(const double* block);

// Block of a moving board: pose, course, one stamp error per view.
inline constexpr int course_at = pose_block_size, stamps_at = pose_block_size + 12;

// left: exp(delta) * pose; otherwise pose * exp(delta). more: further parameters of the block, added.
std::unique_ptr<ceres::Manifold> pose_manifold(bool left, int more = 0);

// Blocks: lens (12), cam_from_world (7), board (7), warp (3).
std::unique_ptr<ceres::CostFunction> corner_cost(LensModel lens, const BoardCorner& corner);

// Blocks: the same, the board's with `views` stamp errors, and the camera's latency and readout (2). view: index of
// this view's stamp error. after_s: stamp relative to BoardMotion::at_s.
std::unique_ptr<ceres::CostFunction> moving_corner_cost(LensModel lens, const BoardCorner& corner, double after_s,
                                                        int view, int views);

// Prior of a board's course. noise_px: residual of one standard deviation.
std::unique_ptr<ceres::CostFunction> course_cost(int block_size, const BoardMotion& motion, double noise_px);

// weight * (x - mean) for consecutive parameters of a block, from index `from` on.
std::unique_ptr<ceres::CostFunction> prior_cost(int block_size, int from, std::vector<double> means,
                                                std::vector<double> weights);

// Prior of a lens. noise_px: residual of one standard deviation.
std::unique_ptr<ceres::CostFunction> lens_prior_cost(const LensPrior& prior, double noise_px);

// Penalty against folding, see AdjustedCamera::unfold; 0 for a healthy lens. reach: see reach_of().
std::unique_ptr<ceres::CostFunction> lens_shape_cost(LensModel lens, double reach, double weight);

}  // namespace huetrack::solver
