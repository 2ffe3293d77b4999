// Projection of a board's corner with derivatives, for boards at rest and for moving boards with row-wise exposure.
// Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/lens.h"

namespace huetrack::solver {

// Derivative of a corner's position by BoardWarp.
using PointByWarp = Eigen::Matrix3d;

struct BoardShape {
  std::vector<Eigen::Vector3d> points;
  std::vector<PointByWarp> by_warp;
  double circle_radius = 0;  // metres; 0: corners
  explicit BoardShape(const board::Board& board);
};

using PoseJacobian = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

struct CornerDerivatives {
  PixelByLens by_lens;
  PoseJacobian by_camera;  // left tangent of cam_from_world
  PoseJacobian by_board;   // right tangent of world_from_board
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_warp;
  // Of a board that moves:
  Eigen::Matrix<double, 2, 12> by_course;  // of BoardMotion, column by column
  Eigen::Vector2d by_time;                 // by the exposure time, px/s
};

// One corner in one view.
struct BoardCorner {
  Eigen::Vector3d point;  // as in the board's file
  PointByWarp by_warp;    // see BoardShape
  Eigen::Vector2d measured;
  double below_middle = 0;  // of its row, in image heights: -1/2 the first row, 1/2 the last
  // > 0: `measured` is the centre of area of the image of a circle of this radius around `point`, which lies beside the
  // image of `point` (perspective, distortion). Modelled; its derivatives, some 1e-3 of the point's, are neglected.
  double circle_radius = 0;
};
BoardCorner corner_of(const Adjustment& a, const BoardShape& shape, std::size_t view, std::size_t corner);

// motion: null for a board at rest.
struct BoardState {
  const calib::Rigid3d& world_from_board;
  const BoardWarp& warp;
  const BoardMotion* motion = nullptr;
  double after_s = 0;  // exposure of the corner, relative to BoardMotion::at_s
};

// Projected minus measured; d may be null. false: behind the camera.
bool corner_residual(LensModel lens, const LensParameters& parameters, const calib::Rigid3d& cam_from_world,
                     const BoardState& board, const BoardCorner& corner, Eigen::Vector2d& residual,
                     CornerDerivatives* d);

// The same for a corner of an adjustment at its present state.
bool corner_residual(const Adjustment& a, const BoardShape& shape, std::size_t view, std::size_t corner,
                     Eigen::Vector2d& residual, CornerDerivatives* d);

}  // namespace huetrack::solver
