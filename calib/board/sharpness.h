// What the blur of a board's edges says of a camera's focus.
#pragma once

namespace huetrack::board {

// Whether a camera is out of focus whose pictures' edges are blurred by so much (standard deviation, px), where those
// of the sharpest camera of the rig are by `sharpest_px`: from 1.8 px on if another one's are 1.6 times sharper,
// from 2.5 px on whatever the others' are.
inline bool is_out_of_focus(double blur_px, double sharpest_px) {
  constexpr double blurred_px = 1.8, blurred_of_others = 1.6, blurred_alone_px = 2.5;
  return blur_px > blurred_alone_px || (blur_px > blurred_px && blur_px > blurred_of_others * sharpest_px);
}

}  // namespace huetrack::board
