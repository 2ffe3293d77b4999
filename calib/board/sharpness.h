// Judges a camera's focus by the blur of a board's edges.
#pragma once

namespace huetrack::board {

// Whether a camera is out of focus. blur_px, sharpest_px: blur of this camera and of the rig's sharpest (standard
// deviation, px). True above 2.5 px, and above 1.8 px if the sharpest is 1.6 times sharper.
inline bool is_out_of_focus(double blur_px, double sharpest_px) {
  constexpr double blurred_px = 1.8, blurred_of_others = 1.6, blurred_alone_px = 2.5;
  return blur_px > blurred_alone_px || (blur_px > blurred_px && blur_px > blurred_of_others * sharpest_px);
}

}  // namespace huetrack::board
