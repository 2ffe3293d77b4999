// The messages of cameras: pictures, lenses, poses. ROS 2 (CDR, little and big endian), ROS 1, and Foxglove's pictures
// (protobuf, CDR). Pure functions; every length is checked.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "recordings/bags/bag.h"

namespace huetrack::bags {

struct PictureMessage {
  std::int64_t stamp_ns = 0;  // header.stamp; 0: none
  std::string frame_id;
  bool is_compressed = false;
  std::string encoding;                           // "bgr8", "bayer_rggb8", ...; compressed: its format, free text
  std::uint32_t width = 0, height = 0, step = 0;  // not of compressed ones. step: bytes of a row
  bool is_big_endian = false;                     // of samples with 16 bits
  std::span<const std::uint8_t> data;             // of the message
};

struct LensMessage {  // sensor_msgs/CameraInfo
  std::string frame_id;
  std::uint32_t width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};
  std::uint32_t binning_x = 0, binning_y = 0;  // 0 and 1: none
  std::array<std::uint32_t, 4> roi{};          // u, v, height, width; all 0: the whole image
};

struct TransformMessage {  // of a tf2_msgs/TFMessage
  std::string parent, child;
  std::array<double, 3> translation{};
  std::array<double, 4> rotation_xyzw{};
};

bool is_picture(const BagTopic& topic);  // of a type that picture_of() reads
bool is_lens(const BagTopic& topic);
bool is_transform(const BagTopic& topic);

// nullopt: damaged, or of another type.
std::optional<PictureMessage> picture_of(const BagMessage& message);
std::optional<LensMessage> lens_of(const BagMessage& message);
std::optional<std::vector<TransformMessage>> transforms_of(const BagMessage& message);

}  // namespace huetrack::bags
