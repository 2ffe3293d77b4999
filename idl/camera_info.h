// How a calibrated camera is said in ROS' words, of previews on the bus as of pictures in a bag. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "idl/ros2_messages.h"

namespace huetrack::idl {

// All but the header.
//   model       as rig files name lenses: "pinhole_radtan", "fisheye_kb" or "stereographic"
//   intrinsics  fx, fy, cx, cy of a picture of this size; the first pixel's centre is (0, 0)
sensor_msgs::msg::dds_::CameraInfo_ camera_info(std::uint32_t width, std::uint32_t height, std::string_view model,
                                                const std::array<double, 4>& intrinsics,
                                                std::vector<double> distortion);

}  // namespace huetrack::idl
