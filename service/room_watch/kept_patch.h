// Patches of a still room as they are stored in a room file: pieces of a camera's picture and their places.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

namespace huetrack::room_watch {

constexpr int patch_side = 12;  // layout: blocks (luma.h); the centre lies between the sixth and the seventh
constexpr int patch_pixels = patch_side * patch_side;
constexpr int seen_side = patch_side + 2;  // layout: with a border, for the gradients

// Brightness of blocks, row by row.
using SeenPatch = std::array<std::uint8_t, std::size_t(seen_side) * seen_side>;

struct KeptPatch {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw pixel of its centre, with the camera where the rig has it
  int cell = 0;                                  // of the grid that spreads patches over the image (patch_choice.h)
  SeenPatch seen{};
};

}  // namespace huetrack::room_watch
