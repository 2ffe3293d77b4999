// Compares new board views with a rig: which cameras moved, and by how much. Facts; calib/report/rig_check_report.h
// judges them.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/intrinsics.h"
#include "calib/solver/progress.h"

namespace huetrack::solver {

struct MovedCamera {
  int camera = 0;
  double moved_m = 0, moved_sigma_m = 0;  // of its centre
  double turned_rad = 0, turned_sigma_rad = 0;
  calib::Rigid3d cam_from_world;  // new pose
  // Of the new pose, as in calib::RigUncertainty, given the other cameras' poses.
  calib::Covariance6d covariance = calib::Covariance6d::Zero();
};

struct RigCheck {
  // Shared views that are needed to judge a camera and its lens.
  static constexpr int enough_views = 4;

  // Per camera, shared views only.
  std::vector<double> rms_px;     // with the rig as it is
  std::vector<int> shared_views;  // with another camera
  // All cameras: with the rig as it is; with all poses free; with those of `moved` free.
  double as_is_px = 0, best_px = 0, with_moved_px = 0;

  // Each of these explains everything; `moved` is empty then.
  std::optional<double> scale;                 // true distances between cameras over those of the rig
  std::optional<std::pair<int, int>> swapped;  // two cameras whose names are exchanged
  std::optional<int> mirrored;                 // a camera with mirrored images

  std::vector<MovedCamera> moved;
  // Cameras that would explain the views as well as the first of `moved`, as in a rig of two cameras.
  std::vector<int> alternatives;
  std::vector<std::optional<LensContradiction>> lenses;  // per camera: its lens no longer fits its views
};

// views: BoardView::camera indexes the rig. throws CalibrationError: too few shared views to judge any camera.
RigCheck check_rig(const board::Board& board, const calib::CameraRig& rig, const std::vector<BoardView>& views,
                   const Progress& progress = {});

}  // namespace huetrack::solver
