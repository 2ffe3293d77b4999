#include "calib/solver/corner.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"

namespace huetrack::solver {
namespace {

using calib::cross_matrix;
using calib::index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

PointByWarp point_by_warp(const Vector3d& point, const Vector3d& low, const Vector3d& high) {
  PointByWarp by_warp = PointByWarp::Zero();
  for (int axis = 0; axis < 2; ++axis) {
    const double size = high[axis] - low[axis];
    const double t = size > 0 ? 2 * (point[axis] - low[axis]) / size - 1 : 0;
    by_warp(2, axis) = 1 - t * t;  // of a bend: 1 in the middle, 0 at the edges
  }
  const Vector3d from_middle = point - (low + high) / 2;
  by_warp.col(2) << from_middle.x() / 2, -from_middle.y() / 2, 0;
  return by_warp;
}

// How a point of the board has moved since the moment of its set, with derivatives.
struct MovedPoint {
  Vector3d point;
  Matrix3d rotation = Matrix3d::Identity();
  Eigen::Matrix<double, 3, 12> by_course;
  Vector3d by_time;
};

MovedPoint moved(const BoardMotion& motion, double tau, const Vector3d& point) {
  const calib::Tangent6d displacement = motion.course * Eigen::Vector2d(tau, tau * tau / 2),
                         rate_now = motion.course * Eigen::Vector2d(1, tau);
  const Vector3d turn = displacement.head<3>();
  const double angle = turn.norm();
  const Matrix3d w = cross_matrix(turn);
  // exp(turn + d) = exp(turn) exp(J d). The closed forms lose digits at small angles, where the series is exact.
  const double angle2 = angle * angle;
  const double s = angle < 1e-3 ? 1 - angle2 / 6 : std::sin(angle) / angle;
  const double b = angle < 1e-3 ? 0.5 - angle2 / 24 : (1 - std::cos(angle)) / angle2;
  const double c = angle < 1e-3 ? 1.0 / 6 - angle2 / 120 : (angle - std::sin(angle)) / (angle2 * angle);
  MovedPoint result;
  result.rotation = Matrix3d::Identity() + s * w + b * w * w;
  result.point = result.rotation * point + displacement.tail<3>();
  const Matrix3d by_turn = -result.rotation * cross_matrix(point) * (Matrix3d::Identity() - b * w + c * w * w);
  for (const int order : {0, 1}) {
    const double by_course = order == 0 ? tau : tau * tau / 2;
    result.by_course.middleCols<3>(6 * order) = by_course * by_turn;
    result.by_course.middleCols<3>(6 * order + 3) = by_course * Matrix3d::Identity();
  }
  result.by_time = by_turn * rate_now.head<3>() + rate_now.tail<3>();
  return result;
}

// From the image of the centre of a circle to the centre of area of its image. axes: of the circle's plane, in the
// camera's frame, as long as its radius. nullopt: partly behind the camera.
std::optional<Vector2d> circle_offset(LensModel lens, const LensParameters& parameters, const Vector3d& p_cam,
                                      const Vector2d& px, const Eigen::Matrix<double, 3, 2>& axes) {
  constexpr int count = 12;
  // A polygon of 12 corners has the second moments of a circle of 0.977 times its radius, which the offset depends on.
  const double stretch = std::sqrt(3 / (2 + std::cos(2 * std::numbers::pi / count)));
  std::array<Vector2d, count> rim;
  for (std::size_t k = 0; k < count; ++k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / count;
    const Vector3d p = p_cam + stretch * (axes * Vector2d(std::cos(angle), std::sin(angle)));
    if (!project(lens, parameters, p, rim[k], nullptr, nullptr)) return std::nullopt;
    rim[k] -= px;
  }
  double area = 0;
  Vector2d moment = Vector2d::Zero();
  for (std::size_t k = 0; k < count; ++k) {
    const Vector2d &a = rim[k], &b = rim[(k + 1) % count];
    const double cross = a.x() * b.y() - a.y() * b.x();
    area += cross;
    moment += cross * (a + b);
  }
  return moment / (3 * area);
}

}  // namespace

BoardShape::BoardShape(const board::Board& board) : circle_radius(board.diameter / 2) {
  for (int id = 0; id < board.point_count(); ++id) points.push_back(board.point(id));
  Vector3d low = points.front(), high = points.front();
  for (const Vector3d& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  for (const Vector3d& p : points) by_warp.push_back(point_by_warp(p, low, high));
}

BoardCorner corner_of(const Adjustment& a, const BoardShape& shape, std::size_t v, std::size_t k) {
  const BoardView& view = a.views[v];
  const std::size_t id = index(view.ids[k]);
  const int height = a.cameras[index(view.camera)].image_size.height;
  return {shape.points[id], shape.by_warp[id], view.px[k], height > 1 ? view.px[k].y() / (height - 1) - 0.5 : 0.0,
          shape.circle_radius};
}

bool corner_residual(LensModel lens, const LensParameters& parameters, const calib::Rigid3d& cam_from_world,
                     const BoardState& board, const BoardCorner& corner, Vector2d& residual, CornerDerivatives* d) {
  const Vector3d own_point = corner.point + corner.by_warp * board.warp;
  MovedPoint moved_point;
  if (board.motion != nullptr) moved_point = moved(*board.motion, board.after_s, own_point);
  const Vector3d point = board.motion != nullptr ? moved_point.point : own_point;
  const Vector3d p_cam = cam_from_world * (board.world_from_board * point);
  PixelByPoint by_point;
  Vector2d px;
  if (!project(lens, parameters, p_cam, px, d ? &by_point : nullptr, d ? &d->by_lens : nullptr)) return false;
  residual = px - corner.measured;
  if (corner.circle_radius > 0) {
    const Matrix3d cam_from_board = (cam_from_world.rotation * board.world_from_board.rotation).toRotationMatrix();
    const Eigen::Matrix<double, 3, 2> axes =
        corner.circle_radius * (cam_from_board * moved_point.rotation).leftCols<2>();
    const auto offset = circle_offset(lens, parameters, p_cam, px, axes);
    if (!offset) return false;
    residual += *offset;
  }
  if (d) {
    d->by_camera.leftCols<3>() = -by_point * cross_matrix(p_cam);
    d->by_camera.rightCols<3>() = by_point;
    const PixelByPoint by_board_point =
        by_point * (cam_from_world.rotation * board.world_from_board.rotation).toRotationMatrix();
    d->by_board.leftCols<3>() = -by_board_point * cross_matrix(point);
    d->by_board.rightCols<3>() = by_board_point;
    if (board.motion != nullptr) {
      d->by_warp = by_board_point * moved_point.rotation * corner.by_warp;
      d->by_course = by_board_point * moved_point.by_course;
      d->by_time = by_board_point * moved_point.by_time;
    } else {
      d->by_warp = by_board_point * corner.by_warp;
    }
  }
  return true;
}

bool corner_residual(const Adjustment& a, const BoardShape& shape, std::size_t v, std::size_t k, Vector2d& residual,
                     CornerDerivatives* d) {
  const BoardView& view = a.views[v];
  const AdjustedCamera& camera = a.cameras[index(view.camera)];
  const BoardCorner corner = corner_of(a, shape, v, k);
  BoardState board{a.world_from_board[index(view.set)], a.warp};
  if (a.moves(view.set)) {
    board.motion = &a.motions[index(view.set)];
    board.after_s = *view.stamp_s + a.stamp_error_s[v] - camera.latency.value_s +
                    corner.below_middle * camera.readout.value_s - board.motion->at_s;
  }
  return corner_residual(camera.lens, camera.parameters, camera.cam_from_world, board, corner, residual, d);
}

}  // namespace huetrack::solver
