#include "outline/strange_pixels.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "outline/edge_model.h"

namespace huetrack::outline {

StrangePixels::StrangePixels() : near_marks_(largest_grid * largest_grid) {
  marks_.reserve(4 * static_cast<std::size_t>(EdgeSamples::most));
}

StrangePixels::Count StrangePixels::judge(double might_be, const PixelGrid& grid, EdgeSamples& light,
                                          EdgeSamples& chroma) {
  // Where the object was expected, what hides it is found before the fit has given way to it.
  const bool had_marks = !marks_.empty();
  std::erase_if(marks_, [](const Mark& mark) { return mark.as == Strange::is_else; });
  // The first step does not know the object's light yet.
  const bool is_first = !std::exchange(is_judged_, true);
  if (might_be == 0 && !had_marks) return Count::the_same;
  if (!is_first && !had_glints_) had_glints_ = find_glints(light);
  find_strange(grid, light, chroma);
  return had_marks || !marks_.empty() ? distrust_marked(grid, light, chroma) : Count::the_same;
}

bool StrangePixels::find_glints(EdgeSamples& light) {
  constexpr float largest_glint = 0.25f;  // of the disc; of more the light is not known yet
  using Block = EdgeSamples::Block;
  const auto is_glint = [](const Block& of, int k) {
    return of.covered[k] > within && of.off[k] > robust(glint_sigmas2);
  };
  int inner = 0, shining = 0;
  light.for_each([&](const Block& of, int k) { inner += of.covered[k] > within, shining += is_glint(of, k); });
  if (shining == 0 || static_cast<float>(shining) >= largest_glint * static_cast<float>(inner)) return false;
  light.for_each([&](const Block& of, int k) {
    if (is_glint(of, k)) marks_.push_back({of.at_u[k], of.at_v[k], Strange::shines});
  });
  return true;
}

void StrangePixels::find_strange(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma) {
  constexpr float one_look = 0.75f;  // of the mean's variance
  light.for_each([&](const EdgeSamples::Block& of, int k) {
    if (of.unsure[k] > one_look) return;
    if (of.covered[k] <= outside) {
      if (std::abs(of.off[k]) >= robust(strange_sigmas2)) marks_.push_back({of.at_u[k], of.at_v[k], Strange::is_else});
    } else if (of.covered[k] >= inside && of.hidden[k] > 0) {
      marks_.push_back({of.at_u[k], of.at_v[k], Strange::hides});
    }
  });
  chroma.for_each([&](const EdgeSamples::Block& of, int k) {
    if (of.unsure[k] > one_look || of.covered[k] > outside || std::abs(of.off[k]) < robust(strange_sigmas2)) return;
    for (int part = 0; part < grid.columns * grid.rows; ++part)
      marks_.push_back({of.at_u[k] * grid.columns + part % grid.columns, of.at_v[k] * grid.rows + part / grid.columns,
                        Strange::is_else});
  });
}

StrangePixels::Count StrangePixels::distrust_marked(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma) {
  constexpr int soft_px = 2, soft_glint_px = 1;
  const auto map = std::span(near_marks_).first(static_cast<std::size_t>(grid.width * grid.height));
  std::ranges::fill(map, std::uint8_t{0});
  for (const Mark& mark : marks_) {
    const int reach = mark.as == Strange::shines ? soft_glint_px : soft_px;
    const int u = mark.u - grid.u0, v = mark.v - grid.v0;
    const int first = std::max(0, u - reach), last = std::min(grid.width - 1, u + reach);
    for (int row = std::max(0, v - reach); row <= std::min(grid.height - 1, v + reach); ++row)
      std::ranges::fill(
          map.subspan(static_cast<std::size_t>(row * grid.width + first), static_cast<std::size_t>(last - first + 1)),
          std::uint8_t{1});
  }
  int changed = 0, at_the_edge = 0;
  const auto judge = [&](EdgeSamples& samples, int columns, int rows) {
    samples.for_each([&](EdgeSamples::Block& of, int k) {
      const int u = of.at_u[k] * columns - grid.u0, v = of.at_v[k] * rows - grid.v0;
      const float trust = map[static_cast<std::size_t>(v * grid.width + u)] != 0 ? 0.f : 1.f;
      const bool is_other = trust != of.trust[k];
      changed += is_other, at_the_edge += is_other && of.covered[k] > outside && of.covered[k] < 1 - outside;
      of.trust[k] = trust;
    });
  };
  judge(light, 1, 1);
  judge(chroma, grid.columns, grid.rows);
  return at_the_edge > 0 ? Count::others_at_the_edge : changed > 0 ? Count::others : Count::the_same;
}

}  // namespace huetrack::outline
