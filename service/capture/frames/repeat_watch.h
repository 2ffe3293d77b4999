// Whether a camera shows a picture once more, with a new time stamp: drivers, cables and capture sticks do so for a
// frame now and then, and for good when they hang.
//
// No two pictures of a live camera are the same: noise changes them everywhere. But pictures without noise (a drawn
// scene, video that codes only what changes) are the same while nothing moves, and are right. So a repetition is told
// only of a camera whose pictures hardly come alike: of those that differed from the one before, nearly all did so in
// most parts of the picture, where what moves in a room changes some; and between two of them there were few that did
// not differ, where a video has many from key frame to key frame. A picture that is the same in all its rows has no
// noise to tell by: the light is off, or the lens is covered.
// Not found: a camera that hangs on several pictures in turn, or half of whose picture is clipped.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// One per camera. Looks at 32 rows of a picture. thread-compatible; allocates nothing.
class RepeatWatch {
 public:
  // Every whole picture of the camera, in their order. True: it is the one before it, shown once more.
  bool is_repeated(const Image& image);
  // Two pictures have differed. A camera that hangs from its first one never has: that is no repetition that could be
  // told from a drawn scene's, but no live camera goes on so.
  bool has_changed() const { return differing_ > 1; }

 private:
  static constexpr std::size_t across = 4, down = 4, rows_of_cell = 8;
  std::array<std::uint64_t, across * down> cells_{};  // of the picture before: a number for what each part shows
  int differing_ = 0;                                 // pictures that were not the one before; all three counts fade
  int noisy_ = 0;                                     // of these, those that differed in most cells
  int alike_ = 0;  // pictures that were the one before; of a run of them the first few only
  int run_ = 0;    // so many came alike last
};

}  // namespace huetrack::capture
