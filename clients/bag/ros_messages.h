// Shared by all messages of a bag: definitions, times, names, CDR. Internal to this module.
#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "idl/ros2_messages.h"

namespace huetrack::bag {

inline constexpr std::size_t rtps_prefix = 2;  // a ROS 2 topic /x is the DDS topic rt/x

std::string separator();          // before a nested definition
std::string header_definition();  // std_msgs/Header and its members
std::string quaternion_definition();
std::string tf_definition();  // tf2_msgs/TFMessage

// A valid part of a topic's name.
std::string word_of(std::string name);

// Throws std::runtime_error: not representable in ROS 2.
std::int64_t ros_time(std::chrono::nanoseconds since_epoch, std::chrono::nanoseconds offset);

template <typename Ros>
std::string cdr_of(const Ros& message) {
  constexpr std::size_t encapsulation = 4;
  std::string bytes(encapsulation + Ros::getCdrSerializedSize(message), '\0');
  eprosima::fastcdr::FastBuffer buffer(bytes.data(), bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS, eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.serialize(cdr);
  bytes.resize(cdr.getSerializedDataLength());
  return bytes;
}

}  // namespace huetrack::bag
