// Judges a calibration's figures and adds advice where they are not good enough. Private to this module.
#pragma once

#include "calib/report/calibration_report.h"

namespace huetrack::report {

// Input of the judgement besides the figures of the report.
struct Evidence {
  double alone_px = 0;  // noise of the corners of each camera alone; 0: unknown
  // rms of the corners in the slowest and the fastest third of the views; 0: the board does not move
  double slow_px = 0, fast_px = 0;
  std::vector<double> behind;         // per camera: share of used views that show a side of the board from behind
  std::vector<double> late_s;         // per camera: delay relative to the reference camera, s
  double stamps_s = 0;                // scatter of the time stamps; 0: the board does not move
  std::vector<bool> covers_image;     // per camera: its lens model reaches the image's corners
  std::vector<std::string> warnings;  // damaged files
  std::string board_doubt;            // empty: none
  Reader reader = Reader::terminal;
  const solver::Extrinsics* extrinsics = nullptr;  // nullptr: a lens alone
};

// Sets checks and verdict.
void judge(CalibrationReport& report, const Evidence& evidence);

}  // namespace huetrack::report
