// How the pictures of what cameras see look: colours and sizes of text, pixels. Private to this module.
#pragma once

#include "drawing/canvas.h"

namespace huetrack::pictures {

inline constexpr drawing::Color background{24, 26, 30}, no_image{44, 47, 53}, faint{150, 156, 166},
    bright{238, 240, 244};
inline constexpr double headline_size = 19, text_size = 15, small_text_size = 14;

}  // namespace huetrack::pictures
