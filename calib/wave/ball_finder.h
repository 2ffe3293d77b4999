// Where the waved ball may be in every frame: its colour's regions.
#pragma once

#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/progress.h"
#include "calib/wave/ball_outline.h"
#include "capture/frames/frame.h"
#include "color/color_region.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::wave {

// One frame of one camera.
struct BallFrame {
  int camera = 0;  // in the rig
  double t_s = 0;  // the camera's stamp, smoothed: its latency and its readout are not taken out yet
  std::vector<color::ColorRegion>
      regions;                          // of the target's colour, largest first; not those that the image's border cuts
  std::vector<BallPatch> patches = {};  // beside the regions, or none
};

// Of the rig only names and image sizes matter. thread-compatible.
class BallFinder {
 public:
  BallFinder(const calib::CameraRig& rig, const object_tracking::TargetOptions& target) : views_(rig, target) {}

  // nullopt: corrupted, or of another size than the rig's (counted).
  std::optional<BallFrame> look(const capture::Frame& frame);

  std::size_t unusable_frames() const { return unusable_; }

 private:
  object_tracking::TargetViews views_;
  color::RegionFinder finder_;
  std::size_t unusable_ = 0;
};

// The regions once more, against what each camera sees behind them: ten times as right where the background has things
// of the object's hue. Lets the patches go. Of a camera with too few samples they stay as they are.
void sharpen(std::vector<BallFrame>& frames, const BackgroundSamples& background, const calib::CameraRig& rig,
             const solver::Progress& progress = {});

// Takes out what stays where it is: regions that are seen at the same place (to 1.5 px) in at least `share` of their
// camera's frames. The ball may rest for a while, things of its colour rest for ever. Returns how many such places
// there are, per camera.
std::vector<int> remove_still_regions(std::vector<BallFrame>& frames, std::size_t camera_count, double share = 0.5);

// Several balls of one size in one recording, as if they had been waved one after the other: the times of each are
// moved beyond the end of the one before. Still regions are removed. frames: per ball.
std::vector<BallFrame> one_after_the_other(std::vector<std::vector<BallFrame>> frames, std::size_t camera_count);

}  // namespace huetrack::wave
