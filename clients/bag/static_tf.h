// The poses of a rig's cameras for /tf_static: world from each camera's optical frame, whose name is the frame_id of
// its pictures. Pure.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "calib/model/camera_rig.h"
#include "clients/bag/bag.h"

namespace huetrack::bag {

Topic static_tf_topic();

// One message with all of them. moving: cameras that are in /tf, and so left out here. Message::topic is 0.
Message static_tf_of(const calib::CameraRig& rig, const std::set<std::string>& moving, const std::string& frame_id,
                     std::int64_t at_ns);

}  // namespace huetrack::bag
