// Where a rig's cameras stand, as ROS 2 has it in /tf_static: world from each camera's optical frame, which is named as
// the camera's pictures name it. Pure.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "calib/model/camera_rig.h"
#include "clients/bag/bag.h"

namespace huetrack::bag {

Topic static_tf_topic();

// One message with all of them. moving: cameras that are left out, as /tf says where they are, and a frame has but one
// parent. Message::topic is 0.
Message static_tf_of(const calib::CameraRig& rig, const std::set<std::string>& moving, const std::string& frame_id,
                     std::int64_t at_ns);

}  // namespace huetrack::bag
