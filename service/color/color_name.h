// What a person calls a colour range: its name, and a swatch of it.
#pragma once

#include <string>
#include <string_view>

#include "color/color_model.h"

namespace huetrack::color {

std::string_view hue_name(double hue_deg);  // hue_deg >= 0: one of twelve names, every 30 degrees

// The colour in the middle of the range, for a swatch: darker than that where no screen shows it.
Rgb middle_of(const HsiRange& range);

std::string hue_text(const HsiRange& range);  // "hue_deg [33, 57] is orange to yellow (#c39d2f)"

// The hue is one degree wide at most, from 0 to 1: probably shares of the circle.
bool is_share_of_circle(const HsiRange& range);

// What to write if the numbers are OpenCV's hue, 0 to 179 in units of two degrees, or shares of the circle; empty where
// they cannot be.
std::string other_unit_text(const HsiRange& range);

}  // namespace huetrack::color
