// A recording of one moving camera in memory, with its poses, and how far a trajectory is from them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_tracker.h"
#include "capture/frames/frame.h"

namespace huetrack::figures {

struct CameraSequence {
  std::string name;
  calib::Camera camera;
  std::vector<capture::Frame> frames;
  std::vector<std::optional<calib::Rigid3d>> world_from_camera;  // per frame; what the truth file says
};
// truth: a TUM file in the folder. max_frames 0: all.
CameraSequence load_camera_sequence(const std::filesystem::path& folder, const std::string& truth,
                                    std::size_t max_frames = 0);
std::filesystem::path shared_camera_data();        // may not be there: then tests SKIP
camera_tracking::RectangleStart desk_rectangle();  // of data/rendered/desk; pixels left to be found
camera_tracking::PointsStart kitchen_points();     // of data/hand_held_7scenes

std::vector<camera_tracking::CameraEstimate> run(camera_tracking::CameraTracker& tracker,
                                                 const CameraSequence& sequence);

// Against metric truth, no alignment, over the frames whose state is `tracking`.
struct PoseErrors {
  int tracked = 0, coasting = 0;
  double rms_m = 0, max_m = 0, rms_deg = 0, max_deg = 0;
  int max_at = -1;       // the frame of max_m
  double mean_nees = 0;  // 6 is perfect
  double inside_95 = 0;  // share with NEES below 12.592
};
PoseErrors errors_of(const std::vector<camera_tracking::CameraEstimate>& estimates, const CameraSequence& sequence,
                     std::size_t from = 0, std::size_t to = SIZE_MAX);
// Frames from `first` to the first tracked one at or after it; nullopt: none.
std::optional<int> frames_until_tracked(const std::vector<camera_tracking::CameraEstimate>& estimates,
                                        std::size_t first);

// Absolute trajectory error (rms of positions) after similarity alignment (Umeyama 1991), metres; with lever_arm also
// one constant offset in the camera's frame is allowed (truth of another sensor of the same device).
struct AlignedError {
  double rms_m = 0, scale = 1;
  int count = 0;
};
AlignedError aligned_error(const std::vector<camera_tracking::CameraEstimate>& estimates,
                           const CameraSequence& sequence, bool lever_arm);

}  // namespace huetrack::figures
