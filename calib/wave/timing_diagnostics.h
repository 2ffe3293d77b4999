// Timing faults of one camera, from the residuals of a solution. Private to this module.
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

namespace huetrack::wave {

// One frame's region compared with the solution.
struct TimingSample {
  double t_s = 0;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // measured minus predicted, px
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of the predicted outline, px/s
};

// Residuals along the motion that grow with its speed are time errors; residuals across it measure the noise.
struct TimingDiagnostics {
  double wander_s = 0;          // rms lag per second of recording, less the noise
  double wander_sigmas = 0;     // rms lag in its own standard deviations; about 1 for noise alone
  std::map<int, double> lag_s;  // median lag by second of exposure (rounded down), where there are enough samples
  double scatter_s = 0;         // rms lag from frame to frame, less the noise
  double repeated = 0;          // 0..1; share of fast frames that show the ball where it was one frame earlier
};

// samples: all frames whose region may be the ball, unused ones included. frame_s: between two frames.
TimingDiagnostics timing_diagnostics(const std::vector<TimingSample>& samples, double frame_s);

}  // namespace huetrack::wave
