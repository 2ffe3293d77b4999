// Tracks as the messages that huetrackd publishes for ROS 2 (service/publish): a pose with covariance for each
// position, and where it is in /tf. Pure.
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "clients/bag/bag.h"
#include "clients/plot/track_file.h"

namespace huetrack::bag {

// Rows without a position are no messages.
//   tracks     as plot::read_tracks() gives them: by target, or by camera
//   frame_id   the world's name in the headers
//   offset     is added to every time
// throws std::runtime_error: a time that ROS 2 cannot say (before 1970, after 2038); no row has a position.
Bag bag_of(const std::map<std::string, std::vector<plot::TrackRow>>& tracks, const std::string& frame_id,
           std::chrono::nanoseconds offset);

}  // namespace huetrack::bag
