// What the cameras of a rig see now, against what the rig says: who moved, by how much. Facts; what they are worth is
// said in calib/report/rig_check_report.h.
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
  calib::Rigid3d cam_from_world;  // where it stands now
  // Of that, as calib::RigUncertainty has a pose's, the other cameras being where the rig says.
  calib::Covariance6d covariance = calib::Covariance6d::Zero();
};

struct RigCheck {
  // With fewer shared views than these a camera is not judged, nor its lens.
  static constexpr int enough_views = 4;

  // Of the corners of shared views, per camera; pixels.
  std::vector<double> rms_px;     // with the rig as it is
  std::vector<int> shared_views;  // with another camera: what can be judged
  // Of all: with the rig as it is; with every camera posed anew; with those of `moved` posed anew.
  double as_is_px = 0, best_px = 0, with_moved_px = 0;

  // Either of these explains everything; then nothing more is looked for.
  // All distances between the cameras are so many times what the rig says.
  std::optional<double> scale;
  std::optional<std::pair<int, int>> swapped;  // two cameras whose names are exchanged in the pictures
  std::optional<int> mirrored;                 // a camera whose pictures are mirrored, left and right

  std::vector<MovedCamera> moved;  // that explain it; empty: the rig fits, or it is one of the above
  // Cameras that would explain it (nearly) as well, instead of the first of `moved`: two cameras cannot tell which of
  // them moved.
  std::vector<int> alternatives;
  std::vector<std::optional<LensContradiction>> lenses;  // per camera: its lens no longer fits its own views
};

// views: BoardView::camera indexes the rig. throws CalibrationError: too few shared views to judge any camera.
RigCheck check_rig(const board::Board& board, const calib::CameraRig& rig, const std::vector<BoardView>& views,
                   const Progress& progress = {});

}  // namespace huetrack::solver
