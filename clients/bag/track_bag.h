// Tracks as the ROS 2 messages of huetrackd (service/publish): a pose with covariance and a transform in /tf for each
// position. Pure.
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "clients/bag/bag.h"
#include "clients/plot/track_file.h"

namespace huetrack::bag {

// Skips rows without a position.
//   tracks     of plot::read_tracks(): by target, or by camera
//   frame_id   the world's name in the headers
//   offset     added to all times
// Throws std::runtime_error: a time outside of ROS 2's range (1970 to 2038); no row has a position.
Bag bag_of(const std::map<std::string, std::vector<plot::TrackRow>>& tracks, const std::string& frame_id,
           std::chrono::nanoseconds offset);

}  // namespace huetrack::bag
