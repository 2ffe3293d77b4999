// What is kept of a still room: pieces of a camera's picture, and where they were. Pure values.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

namespace huetrack::room_watch {

constexpr int patch_side = 12;  // blocks (luma.h); its centre is between the sixth and the seventh
constexpr int patch_pixels = patch_side * patch_side;
constexpr int seen_side = patch_side + 2;  // with a border, for the gradients

// What was seen: the brightness of blocks, row by row.
using SeenPatch = std::array<std::uint8_t, std::size_t(seen_side) * seen_side>;

struct KeptPatch {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw pixel of its centre, where the rig has the camera
  int cell = 0;                                  // of the grid that spreads patches over the image (patch_choice.h)
  SeenPatch seen{};
};

}  // namespace huetrack::room_watch
