// Regions that are consistent in several cameras: their rays meet where the regions are as large as the ball. Private
// to this module.
#pragma once

#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_finder.h"

namespace huetrack::wave {

// Ball and region differ by what poses of some centimetres and degrees, motion between frames, hands and colour
// thresholds make.
struct ConsistencyTuning {
  double gap = 0.05;          // 1 sigma of the rays' gap over the distance: 5 cm and 2 degrees at 3 m, 2 m/s
  double log_size = 0.2;      // 1 sigma of a region's radius: a third of the ball is hidden, or as much is added
  double most_sigmas2 = 7.8;  // chi-square, 3 dof, 95 %: one gap, two sizes
};

// Per frame the region that is most consistent with the other cameras' frames nearest in time; -1: none is. frames
// ascend in time; most_apart_s: frames further apart are not compared.
std::vector<int> consistent_regions(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, double radius_m,
                                    double most_apart_s, const ConsistencyTuning& tuning = {});

}  // namespace huetrack::wave
