// Whether a rig still fits what its cameras see: a camera that was bumped is named, with how far it moved.
#pragma once

#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/report/calibration_report.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/progress.h"

namespace huetrack::report {

struct MovedCamera {
  int camera = 0;
  double moved_m = 0, moved_sigma_m = 0;  // of its centre
  double turned_rad = 0, turned_sigma_rad = 0;
  calib::Rigid3d cam_from_world;  // where it stands now
};

struct RigCheck {
  // Of the corners of shared views, per camera; pixels.
  std::vector<double> rms_px;        // with the rig as it is
  std::vector<int> shared_views;     // with another camera: what can be judged
  double as_is_px = 0, best_px = 0;  // of all: with the rig as it is; with every camera posed anew
  std::vector<MovedCamera> moved;    // that explain it; empty: the rig fits
  // Cameras that would explain it (nearly) as well, instead of the first of `moved`: two cameras cannot tell which of
  // them moved.
  std::vector<int> or_else;
  std::vector<std::string> lenses;  // whose lens no longer fits its own views (focus, zoom): one clause each
  std::vector<Check> checks;        // the worst first
  Verdict verdict = Verdict::usable;
};

// views: BoardView::camera indexes the rig. throws CalibrationError: too few shared views to judge any camera.
RigCheck check_rig(const board::Board& board, const calib::CameraRig& rig, const std::vector<solver::BoardView>& views,
                   const solver::Progress& progress = {});

std::string to_text(const RigCheck& check, const calib::CameraRig& rig);

}  // namespace huetrack::report
