// Style of pictures: colours and text sizes in pixels. Private to this module.
#pragma once

#include "drawing/canvas.h"

namespace huetrack::pictures {

inline constexpr drawing::Color background{24, 26, 30}, no_image{44, 47, 53}, faint{150, 156, 166},
    bright{238, 240, 244};

// For object_tracking::TrackState and camera_tracking::PoseState.
template <typename State>
drawing::Color state_color(State state) {
  constexpr drawing::Color searching{150, 190, 255}, tracking{90, 220, 120}, coasting{255, 176, 40}, lost{255, 96, 88};
  return state == State::searching  ? searching
         : state == State::tracking ? tracking
         : state == State::coasting ? coasting
                                    : lost;
}

inline constexpr double headline_size = 19, text_size = 15, small_text_size = 14;

}  // namespace huetrack::pictures
