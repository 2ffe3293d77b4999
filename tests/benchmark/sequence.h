// A recording in memory as frame sets, with its rig and, where there is one, its truth.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::figures {

struct TruthRow {
  capture::Timestamp at;
  Eigen::Vector3d position;     // metres
  std::vector<double> visible;  // per camera, share of the ball that can be seen; a frame off the image has 0
  int views_that_see() const;   // more than half of it
};

struct Sequence {
  std::string name;
  calib::CameraRig rig;
  std::vector<capture::FrameSet> sets;
  std::map<std::string, std::vector<TruthRow>> truth;  // per target, by time
  // At this time: that of the nearest row, its position between that one's and its neighbour's. nullopt: before the
  // first row or after the last.
  std::optional<TruthRow> row(const std::string& target, capture::Timestamp at) const;
};

// every = 2: as free-running cameras of half the rate; camera i begins with frame `phases` >> i & 1, so 0b010 lets the
// middle one of three take the frames that the others leave out.
Sequence load_sequence(const std::filesystem::path& folder, int every = 1, unsigned phases = 0b010);

std::filesystem::path shared_data();   // may not be there: then tests SKIP
bool have(const std::string& folder);  // below shared_data()

object_tracking::TargetOptions lime_ball();  // of data/rendered
object_tracking::TargetOptions pink_ball();
object_tracking::TargetOptions red_square();  // of data/red_square_stereo, colours per camera
object_tracking::ObjectTrackerOptions rendered_options(object_tracking::Observation observation,
                                                       std::uint64_t seed);  // defaults, and their volume
object_tracking::ObjectTrackerOptions red_square_options(object_tracking::Observation observation, std::uint64_t seed);

}  // namespace huetrack::figures
