#include "outline/outlier_pixels.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "outline/edge_model.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

struct OutlierPixelTuning {
  float max_glint_share = 0.25f;          // of the inner disc; if more is too bright, the ball's light is not known yet
  float max_background_variance = 0.75f;  // in variances of a picture; a pixel is judged only by a better background
  int neighbour_px = 2;                   // around an outlier that get no weight: lens blur and demosaicing
  int glint_neighbour_px = 1;             // around a glint: it is small and on the ball
};
constexpr OutlierPixelTuning outlier_pixels{};

using Block = EdgeSamples::Block;

// Among n samples of a block: those well inside the outline, and those of them brighter than a matte ball.
struct Inner {
  int all, glints;
};
HUETRACK_CLONES Inner count_inner(const Block& of, int n) {
  Inner out{.all = 0, .glints = 0};
  for (int k = 0; k < n; ++k) {
    const int is_inner = of.covered[k] > outlier.well_inside ? 1 : 0;
    out.all += is_inner, out.glints += of.off[k] > robust(outlier.glint_sigmas2) ? is_inner : 0;
  }
  return out;
}

// Classifies each sample by itself; returns the sum of the classes, because most blocks have no outlier.
constexpr std::int32_t other_thing = 1, occluder = 2;  // layout: bits
HUETRACK_CLONES int classify(const Block& of, int n, std::int32_t* __restrict outliers) {
  int all = 0;
  for (int k = 0; k < n; ++k) {
    const float off = of.off[k] < 0 ? -of.off[k] : of.off[k];
    const std::int32_t is_known = of.unsure[k] <= outlier_pixels.max_background_variance ? 1 : 0;
    const std::int32_t is_other =
        of.covered[k] <= outlier.outside && off >= robust(outlier.other_sigmas2) ? other_thing : 0;
    const std::int32_t hides = of.covered[k] >= outlier.inside && of.hidden[k] > 0 ? occluder : 0;
    outliers[k] = is_known * (is_other | hides);
    all += outliers[k];
  }
  return all;
}

// visit(block, index in it, class) for every outlier.
template <typename Visit>
void for_each_outlier(const EdgeSamples& samples, Visit&& visit) {
  alignas(64) std::int32_t outliers[EdgeSamples::block];
  for (int b = 0; b < samples.block_count(); ++b) {
    const int n = samples.count_in(b);
    if (classify(samples.blocks[b], n, outliers) == 0) continue;
    for (int k = 0; k < n; ++k)
      if (outliers[k] != 0) visit(samples.blocks[b], k, outliers[k]);
  }
}

}  // namespace

OutlierPixels::OutlierPixels()
    : near_marks_(largest_grid * largest_grid), near_marks_before_(largest_grid * largest_grid) {
  marks_.reserve(4 * static_cast<std::size_t>(EdgeSamples::most));
}

OutlierPixels::Change OutlierPixels::judge(double candidates, const PixelGrid& grid, EdgeSamples& light,
                                           EdgeSamples& chroma) {
  // Occluders and glints stay marked: later the fit may have moved to explain them.
  const bool had_marks = !marks_.empty();
  std::erase_if(marks_, [](const Mark& mark) { return mark.kind == Kind::other_thing; });
  // At the first step the object's light is not known yet: no glints.
  const bool is_first = !std::exchange(is_judged_, true);
  if (candidates == 0 && !had_marks) return Change::none;
  if (!is_first && !had_glints_) had_glints_ = find_glints(light);
  find_outliers(grid, light, chroma);
  return had_marks || !marks_.empty() ? distrust_marked(grid, light, chroma) : Change::none;
}

bool OutlierPixels::find_glints(EdgeSamples& light) {
  int inner = 0, glints = 0;
  for (int b = 0; b < light.block_count(); ++b) {
    const Inner of = count_inner(light.blocks[b], light.count_in(b));
    inner += of.all, glints += of.glints;
  }
  if (glints == 0 || static_cast<float>(glints) >= outlier_pixels.max_glint_share * static_cast<float>(inner))
    return false;
  light.for_each([&](const Block& of, int k) {
    if (of.covered[k] > outlier.well_inside && of.off[k] > robust(outlier.glint_sigmas2))
      marks_.push_back({of.at_u[k], of.at_v[k], Kind::glint});
  });
  return true;
}

void OutlierPixels::find_outliers(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma) {
  for_each_outlier(light, [&](const Block& of, int k, std::int32_t as) {
    marks_.push_back({of.at_u[k], of.at_v[k], as == other_thing ? Kind::other_thing : Kind::occluder});
  });
  for_each_outlier(chroma, [&](const Block& of, int k, std::int32_t as) {
    if (as != other_thing) return;
    for (int part = 0; part < grid.columns * grid.rows; ++part)
      marks_.push_back({of.at_u[k] * grid.columns + part % grid.columns, of.at_v[k] * grid.rows + part / grid.columns,
                        Kind::other_thing});
  });
}

OutlierPixels::Change OutlierPixels::distrust_marked(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma) {
  std::swap(near_marks_, near_marks_before_);
  const auto map = std::span(near_marks_).first(static_cast<std::size_t>(grid.width * grid.height));
  std::ranges::fill(map, std::uint8_t{0});
  for (const Mark& mark : marks_) {
    const int reach = mark.kind == Kind::glint ? outlier_pixels.glint_neighbour_px : outlier_pixels.neighbour_px;
    const int u = mark.u - grid.u0, v = mark.v - grid.v0;
    const int first = std::max(0, u - reach), last = std::min(grid.width - 1, u + reach);
    for (int row = std::max(0, v - reach); row <= std::min(grid.height - 1, v + reach); ++row)
      std::ranges::fill(
          map.subspan(static_cast<std::size_t>(row * grid.width + first), static_cast<std::size_t>(last - first + 1)),
          std::uint8_t{1});
  }
  if (std::exchange(has_map_, true) && std::ranges::equal(map, std::span(near_marks_before_).first(map.size())))
    return Change::none;
  int changed = 0, at_the_edge = 0;
  const auto judge = [&](EdgeSamples& samples, int columns, int rows) {
    samples.for_each([&](EdgeSamples::Block& of, int k) {
      const int u = of.at_u[k] * columns - grid.u0, v = of.at_v[k] * rows - grid.v0;
      const float trust = map[static_cast<std::size_t>(v * grid.width + u)] != 0 ? 0.f : 1.f;
      const bool is_other = trust != of.trust[k];
      changed += is_other,
          at_the_edge += is_other && of.covered[k] > outlier.outside && of.covered[k] < 1 - outlier.outside;
      of.trust[k] = trust;
    });
  };
  judge(light, 1, 1);
  judge(chroma, grid.columns, grid.rows);
  return at_the_edge > 0 ? Change::at_the_edge : changed > 0 ? Change::some : Change::none;
}

}  // namespace huetrack::outline
