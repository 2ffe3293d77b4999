#include "outline/outlier_pixels.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "outline/edge_model.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::outline {

namespace {

using Block = EdgeSamples::Block;

// Of n samples of a block: how many lie well within the outline, and how many of these are brighter than a dull ball.
struct Inner {
  int all = 0, shining = 0;
};
HUETRACK_CLONES Inner count_inner(const Block& of, int n) {
  Inner out;
  for (int k = 0; k < n; ++k) {
    const int is_inner = of.covered[k] > within ? 1 : 0;
    out.all += is_inner, out.shining += of.off[k] > robust(glint_sigmas2) ? is_inner : 0;
  }
  return out;
}

// What each of them is taken for by itself; returns the sum of all, as most blocks have none.
constexpr std::int32_t an_else = 1, a_hiding = 2;
HUETRACK_CLONES int find_odd(const Block& of, int n, std::int32_t* __restrict odd) {
  constexpr float one_look = 0.75f;  // of the mean's variance
  int all = 0;
  for (int k = 0; k < n; ++k) {
    const float off = of.off[k] < 0 ? -of.off[k] : of.off[k];
    const std::int32_t is_known = of.unsure[k] <= one_look ? 1 : 0;
    const std::int32_t is_else = of.covered[k] <= outside && off >= robust(strange_sigmas2) ? an_else : 0;
    const std::int32_t hides = of.covered[k] >= inside && of.hidden[k] > 0 ? a_hiding : 0;
    odd[k] = is_known * (is_else | hides);
    all += odd[k];
  }
  return all;
}

// visit(block, index in it, what it is) for every odd one.
template <typename Visit>
void for_each_odd(const EdgeSamples& samples, Visit&& visit) {
  alignas(64) std::int32_t odd[EdgeSamples::block];
  for (int b = 0; b < samples.block_count(); ++b) {
    const int n = samples.count_in(b);
    if (find_odd(samples.blocks[b], n, odd) == 0) continue;
    for (int k = 0; k < n; ++k)
      if (odd[k] != 0) visit(samples.blocks[b], k, odd[k]);
  }
}

}  // namespace

StrangePixels::StrangePixels()
    : near_marks_(largest_grid * largest_grid), near_marks_before_(largest_grid * largest_grid) {
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
  int inner = 0, shining = 0;
  for (int b = 0; b < light.block_count(); ++b) {
    const Inner of = count_inner(light.blocks[b], light.count_in(b));
    inner += of.all, shining += of.shining;
  }
  if (shining == 0 || static_cast<float>(shining) >= largest_glint * static_cast<float>(inner)) return false;
  light.for_each([&](const Block& of, int k) {
    if (of.covered[k] > within && of.off[k] > robust(glint_sigmas2))
      marks_.push_back({of.at_u[k], of.at_v[k], Strange::shines});
  });
  return true;
}

void StrangePixels::find_strange(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma) {
  for_each_odd(light, [&](const Block& of, int k, std::int32_t odd) {
    marks_.push_back({of.at_u[k], of.at_v[k], odd == an_else ? Strange::is_else : Strange::hides});
  });
  for_each_odd(chroma, [&](const Block& of, int k, std::int32_t odd) {
    if (odd != an_else) return;
    for (int part = 0; part < grid.columns * grid.rows; ++part)
      marks_.push_back({of.at_u[k] * grid.columns + part % grid.columns, of.at_v[k] * grid.rows + part / grid.columns,
                        Strange::is_else});
  });
}

StrangePixels::Count StrangePixels::distrust_marked(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma) {
  constexpr int soft_px = 2, soft_glint_px = 1;
  std::swap(near_marks_, near_marks_before_);
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
  if (std::exchange(has_map_, true) && std::ranges::equal(map, std::span(near_marks_before_).first(map.size())))
    return Count::the_same;
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
