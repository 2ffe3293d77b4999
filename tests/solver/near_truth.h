// Adjustments that start near the truth of a synthetic capture.
#pragma once

#include "solver/synthetic_rig.h"

namespace huetrack::solver {

// A camera of an adjustment as it is in a rig; lens: OpenCV's first four coefficients.
inline AdjustedCamera adjusted_camera(const calib::Camera& camera) {
  AdjustedCamera c;
  c.name = camera.name;
  c.image_size = camera.image_size;
  c.lens = LensModel::radtan4;
  c.parameters = parameters_of(camera.model);
  c.cam_from_world = camera.cam_from_world;
  return c;
}

// At the truth, moved off by a few centimetres and degrees.
inline Adjustment near_truth(const calib::CameraRig& rig, const board::Board& board,
                             const std::vector<calib::Rigid3d>& boards, const std::vector<BoardView>& views) {
  Adjustment a;
  a.board = board;
  a.views = views;
  std::mt19937_64 rng(5);
  const auto off = [&](double size) {
    calib::Tangent6d t;
    for (int i = 0; i < 6; ++i) t(i) = size * normal(rng);
    return calib::exp(t);
  };
  for (const calib::Camera& camera : rig.cameras) {
    AdjustedCamera c = adjusted_camera(camera);
    c.pose_is_free = !a.cameras.empty();  // the first one is where it is
    if (c.pose_is_free) c.cam_from_world = off(0.02) * c.cam_from_world;
    c.parameters(0) *= 1.02;
    c.parameters(1) *= 0.99;
    c.parameters(2) += 4;
    a.cameras.push_back(c);
  }
  for (const calib::Rigid3d& board_pose : boards) a.world_from_board.push_back(board_pose * off(0.02));
  return a;
}

inline Adjustment near_truth(const SyntheticCapture& capture) {
  return near_truth(capture.rig, capture.board, capture.world_from_board, capture.views);
}

}  // namespace huetrack::solver
