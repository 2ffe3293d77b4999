// What all messages of a bag have in common: definitions, times, names, CDR. Only for who makes messages.
#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "idl/ros2_messages.h"

namespace huetrack::bag {

inline constexpr std::size_t rtps_prefix = 2;  // a ROS 2 topic /x is the DDS topic rt/x

std::string separator();          // before a definition that another one refers to
std::string header_definition();  // std_msgs/Header, and what it is made of
std::string quaternion_definition();
std::string tf_definition();  // tf2_msgs/TFMessage

// As a part of a topic's name, whoever wrote the file.
std::string word_of(std::string name);

// throws std::runtime_error: none that ROS 2 can say
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
