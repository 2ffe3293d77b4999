// Which pieces of a picture can be found again: corners, one at most in each cell of a grid, so that they are spread
// over it. Pure.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "room_watch/luma.h"

namespace huetrack::room_watch {

constexpr int cell_columns = 8, cell_rows = 6;  // 48 patches give a rotation to some hundredths of a block

struct ChosenPatch {
  Eigen::Vector2i corner;  // the block at which what is seen of it begins, border included
  int cell = 0;            // row by row
};

// One per cell that has some texture, by cell. margin: so many blocks at the image's edge are left out, as a patch that
// leaves the image when the camera is turned tells nothing.
std::vector<ChosenPatch> choose_patches(const Luma& luma, int margin);

}  // namespace huetrack::room_watch
