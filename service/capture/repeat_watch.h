// Whether a camera shows a picture once more, with a new time stamp: drivers, cables and capture sticks do so for a
// frame now and then, and for good when they hang.
//
// No two pictures of a live camera are the same: noise changes them everywhere. But pictures without noise (a drawn
// scene, video that codes only what changes) are the same while nothing moves, and are right. So a repetition is told
// only of a camera whose pictures never came alike: of those that differed from the one before, nearly all did so in
// most parts of the picture, where what moves in a room, and the key frames of a video, change some.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "capture/pixel_format.h"

namespace huetrack::capture {

// One per camera. Looks at 32 rows of a picture, a few microseconds. thread-compatible; allocates nothing.
class RepeatWatch {
 public:
  // Every whole picture of the camera, in their order. True: it is the one before it, shown once more.
  bool is_repeated(const Image& image);

 private:
  static constexpr std::size_t across = 4, down = 4, rows_of_cell = 8;
  std::array<std::uint64_t, across * down> cells_{};  // of the picture before: a number for what each part shows
  int differing_ = 0;                                 // pictures that were not the one before; both counts fade
  int noisy_ = 0;                                     // of these, those that differed in most cells
};

}  // namespace huetrack::capture
