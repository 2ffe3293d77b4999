// Choice of patches that can be found again: corners, at most one in each cell of a grid. Pure.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "room_watch/luma.h"

namespace huetrack::room_watch {

constexpr int cell_columns = 8, cell_rows = 6;  // layout: 48 patches determine a rotation to some 0.01 blocks

struct ChosenPatch {
  Eigen::Vector2i corner;  // first block of SeenPatch, border included
  int cell = 0;            // row by row
};

// One per cell that has texture, by cell. margin: blocks left out at the image's edge, because a patch that leaves the
// image when the camera turns cannot be measured.
std::vector<ChosenPatch> choose_patches(const Luma& luma, int margin);

}  // namespace huetrack::room_watch
