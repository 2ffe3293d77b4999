// CameraInfo of a calibrated camera, for DDS and bags. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "idl/ros2_messages.h"

namespace huetrack::idl {

// All fields except the header.
//   model       lens model of the rig file: "pinhole_radtan", "fisheye_kb" or "stereographic"
//   intrinsics  fx, fy, cx, cy for this image size; the first pixel's centre is (0, 0)
sensor_msgs::msg::dds_::CameraInfo_ camera_info(std::uint32_t width, std::uint32_t height, std::string_view model,
                                                const std::array<double, 4>& intrinsics,
                                                std::vector<double> distortion);

}  // namespace huetrack::idl
