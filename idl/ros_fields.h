// Fills common fields of ROS 2 messages, for DDS and bags. Pure functions. Vectors and quaternions: any type with [0],
// [1], ...
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>

#include "idl/ros2_messages.h"

namespace huetrack::idl {

inline constexpr std::array<double, 4> no_rotation{0, 0, 0, 1};  // x, y, z, w

inline void set_header(std_msgs::msg::dds_::Header_& header, std::int64_t unix_ns, const std::string& frame_id) {
  const std::chrono::nanoseconds since_epoch(unix_ns);
  const auto whole = std::chrono::floor<std::chrono::seconds>(since_epoch);
  header.stamp().sec(static_cast<std::int32_t>(whole.count()));
  header.stamp().nanosec(static_cast<std::uint32_t>((since_epoch - whole).count()));
  header.frame_id(frame_id);
}

template <typename Xyz, typename Vector>
void set_xyz(Xyz& to, const Vector& from) {
  to.x(from[0]);
  to.y(from[1]);
  to.z(from[2]);
}

template <typename Xyzw>
void set_rotation(geometry_msgs::msg::dds_::Quaternion_& to, const Xyzw& from) {
  set_xyz(to, from);
  to.w(from[3]);
}

template <typename Vector, typename Xyzw>
void set_transform(geometry_msgs::msg::dds_::TransformStamped_& transform, const std::string& child,
                   const Vector& translation, const Xyzw& rotation) {
  transform.child_frame_id(child);
  set_xyz(transform.transform().translation(), translation);
  set_rotation(transform.transform().rotation(), rotation);
}

}  // namespace huetrack::idl
