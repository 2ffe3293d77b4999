// Detects regions of the ball's colour in every frame, and refines their outlines.
#pragma once

#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/progress.h"
#include "calib/wave/ball_outline.h"
#include "capture/frame.h"
#include "color/color_region.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::wave {

// One frame of one camera.
struct BallFrame {
  int camera = 0;                           // of the rig
  double t_s = 0;                           // smoothed stamp; latency and readout are not applied
  std::vector<color::ColorRegion> regions;  // of the target's colour, largest first; none that the image's border cuts
  std::vector<BallPatch> patches = {};      // one per region, or none
};

// Of the rig only names and image sizes are used. thread-compatible.
class BallFinder {
 public:
  BallFinder(const calib::CameraRig& rig, const object_tracking::TargetOptions& target) : views_(rig, target) {}

  // nullopt: corrupted, or of another size than the rig's (counted).
  std::optional<BallFrame> detect(const capture::Frame& frame);

  std::size_t unusable_frames() const { return unusable_; }

 private:
  object_tracking::TargetViews views_;
  color::RegionFinder finder_;
  std::size_t unusable_ = 0;
};

// Fits each region's outline over its camera's background, and drops the patches. Frames of a camera must ascend in
// time. A camera with too few background samples keeps its regions.
void refine_outlines(std::vector<BallFrame>& frames, const BackgroundSamples& background, const calib::CameraRig& rig,
                     const solver::Progress& progress = {});

// Removes static clutter: regions at one place (to 1.5 px) in at least `share` of their camera's frames. Returns the
// number of such places per camera.
std::vector<int> remove_still_regions(std::vector<BallFrame>& frames, std::size_t camera_count, double share = 0.5);

// Concatenates several balls of one size in time, as if waved one after the other. Static clutter is removed. frames:
// per ball.
std::vector<BallFrame> one_after_the_other(std::vector<std::vector<BallFrame>> frames, std::size_t camera_count);

}  // namespace huetrack::wave
