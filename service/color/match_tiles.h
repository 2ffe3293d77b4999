// Which pixels of a whole image have a colour, for hosts that send this instead of the pixels (capture/matches.h).
#pragma once

#include <cstdint>
#include <vector>

#include "capture/frames/frame.h"
#include "color/color_model.h"

namespace huetrack::color {

// The range as it is sent with matches, and back; the same numbers.
capture::MatchedColor matched_color(const HsiRange& range);
HsiRange range_of(const capture::MatchedColor& color);

// One tile that the image's right or lower border cuts. (u0, v0): its first pixel, in the image. Bit 8 r + c is the
// pixel in its row r and column c; 0 beyond the image.
std::uint64_t classify_cut_tile(const capture::Image& image, const ColorTable& table, int u0, int v0);

// The same bits as MatchBits finds in that image, in the order of capture::Matches::OfColor. `table` must be for the
// image's format.
void match_tiles(const capture::Image& image, const ColorTable& table, std::vector<std::uint64_t>& tiles);

}  // namespace huetrack::color
