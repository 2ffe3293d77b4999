#include "color/color_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace huetrack::color {

namespace {

std::string named(const HsiRange& range) {
  const std::string_view first = hue_name(range.hue_min_deg), last = hue_name(range.hue_max_deg);
  const auto byte = [](double share) { return std::lround(255 * share); };
  const Rgb middle = middle_of(range);
  return fmt::format("{}{} (#{:02x}{:02x}{:02x})", first, first == last ? "" : fmt::format(" to {}", last),
                     byte(middle.r), byte(middle.g), byte(middle.b));
}

}  // namespace

std::string_view hue_name(double hue_deg) {
  constexpr std::array<std::string_view, 12> names{"red",  "orange", "yellow", "lime",   "green",   "mint",
                                                   "cyan", "azure",  "blue",   "violet", "magenta", "rose"};
  return names[static_cast<std::size_t>(std::lround(hue_deg / 30)) % names.size()];
}

Rgb middle_of(const HsiRange& range) {
  const double saturation = (range.saturation_min + range.saturation_max) / 2;
  const double intensity = (range.intensity_min + range.intensity_max) / 2;
  const double hue_deg = std::fmod(range.hue_min_deg + hue_width_deg(range) / 2, 360);
  // Gonzalez and Woods: in the sector of 120 degrees that begins at a primary, the primary before is the smallest.
  const double in_sector = std::fmod(hue_deg, 120) * (std::numbers::pi / 180);
  const double smallest = intensity * (1 - saturation);
  const double first = intensity * (1 + saturation * std::cos(in_sector) / std::cos(std::numbers::pi / 3 - in_sector));
  const double second = 3 * intensity - smallest - first;
  const double scale = std::max({1.0, first, second});
  const double a = first / scale, b = second / scale, c = smallest / scale;
  return hue_deg < 120 ? Rgb{a, b, c} : hue_deg < 240 ? Rgb{c, a, b} : Rgb{b, c, a};
}

bool is_share_of_circle(const HsiRange& range) {
  return range.hue_min_deg <= range.hue_max_deg && range.hue_max_deg <= 1;
}

std::string hue_text(const HsiRange& range) {
  if (range.hue_min_deg == 0 && range.hue_max_deg == 360) return "hue_deg [0, 360] is any hue";
  const int digits = is_share_of_circle(range) ? 2 : 0;
  return fmt::format("hue_deg [{:.{}f}, {:.{}f}] is {}", range.hue_min_deg, digits, range.hue_max_deg, digits,
                     named(range));
}

std::string other_unit_text(const HsiRange& range) {
  if (range.hue_min_deg > range.hue_max_deg || range.hue_max_deg >= 180) return {};
  const bool is_of_circle = is_share_of_circle(range);
  HsiRange meant = range;
  meant.hue_min_deg *= is_of_circle ? 360 : 2, meant.hue_max_deg *= is_of_circle ? 360 : 2;
  return fmt::format("if the numbers are {}, write [{:.0f}, {:.0f}], {}",
                     is_of_circle ? "shares of the circle, 0 to 1" : "from OpenCV, whose hue is 0 to 179",
                     meant.hue_min_deg, meant.hue_max_deg, named(meant));
}

}  // namespace huetrack::color
