#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <glog/logging.h>

#include <algorithm>
#include <array>

#include "calib/model/index.h"
#include "calib/solver/adjustment_steps.h"
#include "calib/solver/corner_cost.h"

namespace huetrack::solver {
namespace {

using calib::index;

// Silences Ceres' log of rejected steps, once per process: adjustments run on several threads.
void silence_ceres() {
  static const bool done = [] {
    FLAGS_minloglevel = google::GLOG_FATAL;
    return true;
  }();
  static_cast<void>(done);
}

// Parameter blocks. Ceres orders them by address, and the order decides the last digits: all cameras lie in one array,
// all boards in another.
class ParameterBlocks {
 public:
  explicit ParameterBlocks(const Adjustment& a)
      : cameras_(a.cameras.size() + 1), view_in_set_(a.views.size()), views_of_(a.world_from_board.size()) {
    std::copy_n(a.warp.data(), 3, warp());
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      std::copy_n(a.cameras[c].parameters.data(), 12, lens(c));
      write_pose(a.cameras[c].cam_from_world, pose(c));
      cameras_[c].times = {a.cameras[c].latency.value_s, a.cameras[c].readout.value_s};
    }
    for (std::size_t v = 0; v < a.views.size(); ++v) view_in_set_[v] = views_of_[index(a.views[v].set)]++;
    for (std::size_t s = 0; s < views_of_.size(); ++s) {
      board_at_.push_back(boards_.size());
      boards_.resize(boards_.size() + index(a.moves(static_cast<int>(s)) ? stamps_at + views_of_[s] : pose_block_size));
    }
    for (std::size_t s = 0; s < views_of_.size(); ++s) {
      write_pose(a.world_from_board[s], board(s));
      if (a.moves(static_cast<int>(s))) std::copy_n(a.motions[s].course.data(), 12, board(s) + course_at);
    }
    for (std::size_t v = 0; v < a.views.size(); ++v) {
      if (a.moves(a.views[v].set)) *stamp_error(a, v) = a.stamp_error_s[v];
    }
  }

  double* lens(std::size_t camera) { return cameras_[camera].lens.data(); }
  double* pose(std::size_t camera) { return cameras_[camera].pose.data(); }
  double* times(std::size_t camera) { return cameras_[camera].times.data(); }  // latency, readout
  double* board(std::size_t set) { return boards_.data() + board_at_[set]; }
  double* warp() { return cameras_.back().lens.data(); }
  int view_in_set(std::size_t view) const { return view_in_set_[view]; }
  int views_of(std::size_t set) const { return views_of_[set]; }

  void put_into(Adjustment& a) {
    const auto normalized = [](const double* block) {
      calib::Rigid3d pose = read_pose(block);
      pose.rotation.normalize();
      return pose;
    };
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      std::copy_n(lens(c), 12, a.cameras[c].parameters.data());
      a.cameras[c].cam_from_world = normalized(pose(c));
      a.cameras[c].latency.value_s = times(c)[0];
      a.cameras[c].readout.value_s = times(c)[1];
    }
    for (std::size_t s = 0; s < views_of_.size(); ++s) {
      a.world_from_board[s] = normalized(board(s));
      if (a.moves(static_cast<int>(s))) std::copy_n(board(s) + course_at, 12, a.motions[s].course.data());
    }
    for (std::size_t v = 0; v < a.views.size(); ++v) {
      if (a.moves(a.views[v].set)) a.stamp_error_s[v] = *stamp_error(a, v);
    }
    std::copy_n(warp(), 3, a.warp.data());
  }

 private:
  double* stamp_error(const Adjustment& a, std::size_t view) {
    return board(index(a.views[view].set)) + stamps_at + view_in_set_[view];
  }

  struct CameraBlocks {
    std::array<double, 12> lens;
    std::array<double, pose_block_size> pose;
    std::array<double, 2> times;
  };
  std::vector<CameraBlocks> cameras_;  // the last lens block holds the warp
  std::vector<double> boards_;
  std::vector<std::size_t> board_at_;  // in boards_, per set
  std::vector<int> view_in_set_;       // per view: index in its set
  std::vector<int> views_of_;          // views per set
};

// Cameras and sets with a used corner.
struct UsedBlocks {
  std::vector<bool> cameras, boards;
  std::vector<bool> timed;  // cameras that see a moving board
};

// nullptr: squares. Ownership passes to the problem.
ceres::LossFunction* loss_of(const AdjustedCamera& camera, double robust_px) {
  ceres::LossFunction* loss = robust_px > 0 ? new ceres::CauchyLoss(robust_px * camera.relative_noise) : nullptr;
  const double weight = 1 / (camera.relative_noise * camera.relative_noise);
  return weight == 1 ? loss : new ceres::ScaledLoss(loss, weight, ceres::TAKE_OWNERSHIP);
}

// One residual per used corner. robust_px: see SolveOptions.
UsedBlocks add_corners(ceres::Problem& problem, const Adjustment& a, const BoardShape& shape, ParameterBlocks& blocks,
                       double robust_px) {
  UsedBlocks used{std::vector<bool>(a.cameras.size()), std::vector<bool>(a.world_from_board.size()),
                  std::vector<bool>(a.cameras.size())};
  // Shared by all corners of a camera.
  std::vector<ceres::LossFunction*> losses;
  for (const AdjustedCamera& camera : a.cameras) losses.push_back(loss_of(camera, robust_px));
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    const BoardView& view = a.views[v];
    const std::size_t c = index(view.camera), s = index(view.set);
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      if (!a.fits[v].used[k]) continue;
      const BoardCorner corner = corner_of(a, shape, v, k);
      if (a.moves(view.set)) {
        problem.AddResidualBlock(moving_corner_cost(a.cameras[c].lens, corner, *view.stamp_s - a.motions[s].at_s,
                                                    blocks.view_in_set(v), blocks.views_of(s))
                                     .release(),
                                 losses[c], blocks.lens(c), blocks.pose(c), blocks.board(s), blocks.warp(),
                                 blocks.times(c));
        used.timed[c] = true;
      } else {
        problem.AddResidualBlock(corner_cost(a.cameras[c].lens, corner).release(), losses[c], blocks.lens(c),
                                 blocks.pose(c), blocks.board(s), blocks.warp());
      }
      used.cameras[c] = used.boards[s] = true;
    }
  }
  // The problem owns only losses that are used.
  for (std::size_t c = 0; c < losses.size(); ++c) {
    if (!used.cameras[c]) delete losses[c];
  }
  return used;
}

// Free parameters of a lens, and its fold penalty.
void free_lens(ceres::Problem& problem, const AdjustedCamera& camera, double noise_px, double* lens) {
  if (!camera.lens_is_free) {
    problem.SetParameterBlockConstant(lens);
    return;
  }
  std::vector<int> fixed;
  for (int i = parameter_count(camera.lens); i < 12; ++i) fixed.push_back(i);
  if (!fixed.empty()) problem.SetManifold(lens, new ceres::SubsetManifold(12, fixed));
  problem.AddResidualBlock(lens_prior_cost(lens_prior(camera), noise_px).release(), nullptr, lens);
  if (camera.unfold > 0)
    problem.AddResidualBlock(lens_shape_cost(camera.lens, reach_of(camera), camera.unfold).release(), nullptr, lens);
}

// Free times of a camera, and their priors.
void free_times(ceres::Problem& problem, const AdjustedCamera& camera, double noise_px, double* times) {
  const std::array<const AdjustedTime*, 2> both{&camera.latency, &camera.readout};
  std::vector<int> fixed;
  for (int i = 0; i < 2; ++i) {
    const AdjustedTime& time = *both[index(i)];
    if (time.prior_sigma_s > 0) {
      problem.AddResidualBlock(prior_cost(2, i, {time.prior_s}, {noise_px / time.prior_sigma_s}).release(), nullptr,
                               times);
    } else {
      fixed.push_back(i);
    }
  }
  if (fixed.size() == 2) {
    problem.SetParameterBlockConstant(times);
  } else if (!fixed.empty()) {
    problem.SetManifold(times, new ceres::SubsetManifold(2, fixed));
  }
}

// Priors of a board's motion and of stamp errors.
void add_motion(ceres::Problem& problem, const Adjustment& a, std::size_t set, const ParameterBlocks& blocks,
                double* board) {
  const int views = blocks.views_of(set), size = stamps_at + views;
  problem.AddResidualBlock(course_cost(size, a.motions[set], a.noise_px).release(), nullptr, board);
  std::vector<double> means(index(views), 0.0), weights(index(views));
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (index(a.views[v].set) == set)
      weights[index(blocks.view_in_set(v))] = a.noise_px / a.cameras[index(a.views[v].camera)].stamp_sigma_s;
  }
  problem.AddResidualBlock(prior_cost(size, stamps_at, std::move(means), std::move(weights)).release(), nullptr, board);
}

}  // namespace

void solve(Adjustment& a, const BoardShape& shape, const SolveOptions& given) {
  ParameterBlocks blocks(a);
  ceres::Problem problem;
  const UsedBlocks used = add_corners(problem, a, shape, blocks, given.robust_px);
  if (problem.NumResidualBlocks() == 0) throw CalibrationError("no view of the board is left to calibrate with");

  auto* ordering = new ceres::ParameterBlockOrdering;  // eliminates board poses first
  for (std::size_t s = 0; s < used.boards.size(); ++s) {
    if (!used.boards[s]) continue;
    const bool moves = a.moves(static_cast<int>(s));
    problem.SetManifold(blocks.board(s),
                        pose_manifold(false, moves ? stamps_at + blocks.views_of(s) - pose_block_size : 0).release());
    if (moves) add_motion(problem, a, s, blocks, blocks.board(s));
    ordering->AddElementToGroup(blocks.board(s), 0);
  }
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (!used.cameras[c]) continue;
    free_lens(problem, a.cameras[c], a.noise_px, blocks.lens(c));
    problem.SetManifold(blocks.pose(c), pose_manifold(true).release());
    if (!a.cameras[c].pose_is_free) problem.SetParameterBlockConstant(blocks.pose(c));
    ordering->AddElementToGroup(blocks.lens(c), 1);
    ordering->AddElementToGroup(blocks.pose(c), 1);
    if (!used.timed[c]) continue;
    free_times(problem, a.cameras[c], a.noise_px, blocks.times(c));
    ordering->AddElementToGroup(blocks.times(c), 1);
  }
  if (!a.warp_is_free) problem.SetParameterBlockConstant(blocks.warp());
  ordering->AddElementToGroup(blocks.warp(), 1);

  ceres::Solver::Options options;
  options.num_threads = 1;  // deterministic
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering.reset(ordering);
  options.max_num_iterations = given.max_iterations;
  // Ceres' initial radius, 1e4, needs ten steps along weakly determined directions.
  constexpr double whole_steps = 1e9;
  if (given.is_near) options.initial_trust_region_radius = whole_steps;
  options.function_tolerance = given.tolerance;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  silence_ceres();
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  // Ceres' own message does not help a user.
  if (!summary.IsSolutionUsable())
    throw CalibrationError("the views do not determine what is asked of them (the adjustment does not converge)",
                           Fault::undetermined);
  blocks.put_into(a);
}

}  // namespace huetrack::solver
