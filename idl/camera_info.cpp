#include "idl/camera_info.h"

#include <algorithm>
#include <utility>

namespace huetrack::idl {

sensor_msgs::msg::dds_::CameraInfo_ camera_info(std::uint32_t width, std::uint32_t height, std::string_view model,
                                                const std::array<double, 4>& intrinsics,
                                                std::vector<double> distortion) {
  sensor_msgs::msg::dds_::CameraInfo_ info;
  info.width(width);
  info.height(height);
  if (model == "fisheye_kb") {
    info.distortion_model("equidistant");
  } else if (model == "stereographic") {
    // ROS has no name for it: an unknown name is better than a known name with other coefficients.
    info.distortion_model("stereographic");
  } else {
    const bool is_rational =
        distortion.size() > 5 && std::any_of(distortion.begin() + 5, distortion.end(), [](double k) { return k != 0; });
    info.distortion_model(is_rational ? "rational_polynomial" : "plumb_bob");
    if (!is_rational) distortion.resize(5, 0.0);
  }
  info.d(std::move(distortion));
  const auto [fx, fy, cx, cy] = intrinsics;
  info.k({fx, 0, cx, 0, fy, cy, 0, 0, 1});
  info.r({1, 0, 0, 0, 1, 0, 0, 0, 1});
  info.p({fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0});
  return info;
}

}  // namespace huetrack::idl
