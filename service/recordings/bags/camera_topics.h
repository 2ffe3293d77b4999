// Which topics of a bag are cameras, and what they are called. Pure functions.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "recordings/bags/bag.h"

namespace huetrack::bags {

struct CameraTopics {
  std::string camera;  // a name for a rig: letters, digits, _ - .
  BagTopic picture;
  std::string lens;  // topic of its sensor_msgs/CameraInfo; empty: the bag has none
};

// One camera for every topic of pictures, in the bag's order. Of several of one camera: not rectified, in colour,
// not compressed. A camera is called by the last part of its topics' common path (/stereo/left/image_raw/compressed:
// left), without a part that all cameras share there (/left/color/image_raw and /right/color/image_raw: left, right).
std::vector<CameraTopics> cameras_of(std::span<const BagTopic> topics);

}  // namespace huetrack::bags
