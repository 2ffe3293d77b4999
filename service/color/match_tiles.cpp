#include "color/match_tiles.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "color/unit_filter.h"
#include "color/window_kernels.h"

namespace huetrack::color {
namespace {

constexpr int size = TileAt::size;
static_assert(size == capture::Matches::tile_size);

}  // namespace

std::uint64_t classify_cut_tile(const capture::Image& image, const ColorTable& table, int u0, int v0) {
  std::uint64_t bits = 0;
  for (int r = 0; r < std::min(size, image.height - v0); ++r) {
    for (int c = 0; c < std::min(size, image.width - u0); ++c)
      bits |= static_cast<std::uint64_t>(has_color(image, table, u0 + c, v0 + r)) << (size * r + c);
  }
  return bits;
}

capture::MatchedColor matched_color(const HsiRange& range) {
  return {.hue_min_deg = range.hue_min_deg,
          .hue_max_deg = range.hue_max_deg,
          .saturation_min = range.saturation_min,
          .saturation_max = range.saturation_max,
          .intensity_min = range.intensity_min,
          .intensity_max = range.intensity_max};
}

HsiRange range_of(const capture::MatchedColor& color) {
  return {.hue_min_deg = color.hue_min_deg,
          .hue_max_deg = color.hue_max_deg,
          .saturation_min = color.saturation_min,
          .saturation_max = color.saturation_max,
          .intensity_min = color.intensity_min,
          .intensity_max = color.intensity_max};
}

void match_tiles(const capture::Image& image, const ColorTable& table, std::vector<std::uint64_t>& tiles) {
  const std::size_t across = capture::tiles_across(image.width);
  const int whole_across = image.width / size, whole_down = image.height / size;
  tiles.assign(capture::tiles_of(image.width, image.height), 0);
  const UnitFilter filter(image.on_demand.get(), &table, 1);
  constexpr std::size_t group = 64;
  std::array<TileAt, group> some;
  std::array<std::uint64_t, group> bits;
  std::size_t n = 0;
  const auto classify_some = [&] {
    require_tiles(image.on_demand.get(), {some.data(), n});
    best_window_kernels().classify(image, table, some.data(), n, bits.data());
    for (std::size_t i = 0; i < n; ++i)
      tiles[static_cast<std::size_t>(some[i].v - 1) * across + static_cast<std::size_t>(some[i].u - 1)] = bits[i];
    n = 0;
  };
  for (int v = 0; v < whole_down; ++v) {
    for (int u = 0; u < whole_across; ++u) {
      if (!filter.may_match(size * u, size * v)) continue;
      some[n++] = {static_cast<std::uint16_t>(u + 1), static_cast<std::uint16_t>(v + 1)};  // counted from the margin's
      if (n == group) classify_some();
    }
  }
  if (n > 0) classify_some();
  const auto cut = [&](int u, int v) {
    tiles[static_cast<std::size_t>(v) * across + static_cast<std::size_t>(u)] =
        classify_cut_tile(image, table, size * u, size * v);
  };
  if (image.width % size != 0)
    for (int v = 0; v < whole_down; ++v) cut(whole_across, v);
  if (image.height % size != 0)
    for (int u = 0; u < static_cast<int>(across); ++u) cut(u, whole_down);
}

}  // namespace huetrack::color
