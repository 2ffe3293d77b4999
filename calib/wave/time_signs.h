// What a solution's residuals say about times that are not as the model has them. Private to this module.
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

namespace huetrack::wave {

// A frame's region against the solution.
struct TimingSample {
  double t_s = 0;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // measured minus predicted, px
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // of the predicted outline, px/s
};

// Of one camera. A residual along the ball's motion that grows with its speed is a time; one across it is none, and
// tells what is noise.
struct TimingDiagnostics {
  double wander_s = 0;          // rms by which its frames are early or late from second to second, beyond the noise
  double wander_sigmas = 0;     // rms of the same in its own standard deviations; about 1 where there is none
  std::map<int, double> lag_s;  // by the second, rounded down, in which they were exposed; of those with enough of them
  double scatter_s = 0;         // by which they are early or late from frame to frame, beyond the noise
  double repeated = 0;          // 0..1; share of the fast frames that show the ball where it was a frame earlier
};

// All frames with a region that may be the ball, those too that were not used; frame_s: between two of them.
TimingDiagnostics timing_diagnostics(const std::vector<TimingSample>& samples, double frame_s);

}  // namespace huetrack::wave
