// Detects repeated pictures: drivers, cables and capture sticks sometimes deliver the previous picture again under a
// new time stamp, and do nothing else once they hang.
//
// Noise changes every picture of a live camera everywhere, so an identical picture is a repetition. Pictures without
// noise (a drawn scene, video that codes only changes) are identical while nothing moves, and are valid. So repetitions
// are reported only for a camera whose pictures look noisy:
//   - of those that differed from the previous one, nearly all differed in most parts of the picture;
//   - few identical ones came between two that differed (a video has many from key frame to key frame).
// A picture whose rows are all equal has no noise: the light is off, or the lens is covered.
// A film codes a repetition anew, so some of it differs: it is one where hardly anything changes in a film in which
// nearly everything changes otherwise. Films without noise do not show it.
// Not detected: a camera that cycles through several pictures, or with half of its picture clipped.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// One per camera. Hashes 32 rows of a picture. thread-compatible; allocates nothing.
class RepeatWatch {
 public:
  // Call with every undamaged picture of the camera, in order. True: it repeats the previous one.
  bool is_repeated(const Image& image);
  // At least two pictures have differed. A camera that hangs from its first picture never gets there, and cannot be
  // distinguished from a drawn scene, so is_repeated() stays false.
  bool has_changed() const { return differing_ > 1; }

 private:
  static constexpr std::size_t across = 4, down = 4, rows_of_cell = 8, fine_across = 32;
  bool is_coded_again(double changed);                                   // share of the picture
  std::array<std::uint64_t, across * down> cells_{};                     // hashes of the previous picture's parts
  std::array<std::uint64_t, down * rows_of_cell * fine_across> fine_{};  // the same, of smaller ones
  int all_changed_ = 0, some_changed_ = 0, hardly_changed_ = 0;          // pictures of a film; the counts fade
  int hardly_run_ = 0;                                                   // of the last ones, in a row
  int differing_ = 0;  // pictures that differed from the previous one; the counts fade
  int noisy_ = 0;      // of these, those that differed in most cells
  int alike_ = 0;      // identical pictures; of a run only the first few count
  int run_ = 0;        // identical pictures in a row
};

}  // namespace huetrack::capture
