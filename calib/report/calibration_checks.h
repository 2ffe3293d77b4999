// Which of a calibration's figures are good enough, and what to do where they are not. Private to this module.
#pragma once

#include "calib/report/calibration_report.h"

namespace huetrack::report {

// What judging needs besides the figures in the report.
struct Evidence {
  double alone_px = 0;  // noise of the corners, as each camera by itself shows it; 0: not known
  // rms of the corners of the third of the views in which the board moves least and most; 0: it does not move
  double slow_px = 0, fast_px = 0;
  std::vector<double> behind;         // per camera: share of its used views that show one of its sides from behind
  std::vector<double> late_s;         // per camera: against the one whose clock is the rig's, as was found; s
  double stamps_s = 0;                // by how much the time stamps of a board that moves scatter; 0: it does not move
  std::vector<bool> covers_image;     // per camera: its lens model reaches the image's corners
  std::vector<std::string> warnings;  // damaged files
  std::string board_doubt;            // empty: none
  const solver::Extrinsics* extrinsics = nullptr;  // nullptr: a lens alone
};

// Sets checks and verdict.
void judge(CalibrationReport& report, const Evidence& evidence);

}  // namespace huetrack::report
