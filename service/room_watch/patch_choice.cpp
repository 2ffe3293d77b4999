#include "room_watch/patch_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "room_watch/patch.h"

namespace huetrack::room_watch {
namespace {

constexpr int bin = 4;  // layout: blocks, in which gradients are summed; a patch is 3 x 3 bins
static_assert(patch_side % bin == 0);
constexpr int bins_of_patch = patch_side / bin;

struct Gradients {
  float xx = 0, xy = 0, yy = 0;
  Gradients& operator+=(const Gradients& other) {
    xx += other.xx, xy += other.xy, yy += other.yy;
    return *this;
  }
  float least() const { return (xx + yy) / 2 - std::sqrt((xx - yy) * (xx - yy) / 4 + xy * xy); }
};

// Sampled at every second block of every fourth row: a corner is larger.
std::vector<Gradients> gradients_of(const Luma& luma, int bin_columns, int bin_rows) {
  std::vector<Gradients> bins(std::size_t(bin_columns) * std::size_t(bin_rows));
  const int columns = bin_columns * bin;
  std::array<std::vector<float>, 3> lines;  // above, at and below
  for (auto& line : lines) line.resize(std::size_t(columns));
  for (int v = bin / 2; v + 1 < bin_rows * bin; v += bin) {
    for (int k = 0; k < 3; ++k) luma.read(0, v - 1 + k, columns, 1, lines[std::size_t(k)].data());
    Gradients* const row = bins.data() + std::ptrdiff_t(v / bin) * bin_columns;
    const float *const above = lines[0].data(), *const here = lines[1].data(), *const below = lines[2].data();
    for (int b = 0; b < bin_columns; ++b) {
      Gradients sum;
      for (int u = b * bin + 1; u < std::min((b + 1) * bin, columns - 1); u += 2) {
        const float x = (here[u + 1] - here[u - 1]) / 2, y = (below[u] - above[u]) / 2;
        sum += {x * x, x * y, y * y};
      }
      row[b] += sum;
    }
  }
  return bins;
}

// Adds to every bin the two that follow at that distance, in place.
void add_the_next(std::vector<Gradients>& bins, std::size_t distance) {
  static_assert(bins_of_patch == 3);
  for (std::size_t k = 0; k + 2 * distance < bins.size(); ++k)
    bins[k] += bins[k + distance], bins[k] += bins[k + 2 * distance];
}

}  // namespace

std::vector<ChosenPatch> choose_patches(const Luma& luma, int margin) {
  const int bin_columns = luma.columns() / bin, bin_rows = luma.rows() / bin;
  if (bin_columns < 2 * bins_of_patch || bin_rows < 2 * bins_of_patch) return {};
  std::vector<Gradients> of_patch = gradients_of(luma, bin_columns, bin_rows);  // beginning in that bin
  add_the_next(of_patch, 1);
  add_the_next(of_patch, std::size_t(bin_columns));
  struct Best {
    float texture = 0;
    Eigen::Vector2i corner = Eigen::Vector2i::Zero();
    bool is_any = false;
  };
  std::array<Best, std::size_t(cell_columns) * cell_rows> best;
  for (int j = (margin + bin) / bin; (j + bins_of_patch) * bin + margin <= luma.rows(); ++j) {
    for (int i = (margin + bin) / bin; (i + bins_of_patch) * bin + margin <= luma.columns(); ++i) {
      const int u = (2 * i + bins_of_patch) * cell_columns / (2 * bin_columns);
      const int v = (2 * j + bins_of_patch) * cell_rows / (2 * bin_rows);
      Best& of_cell = best[std::size_t(v) * cell_columns + std::size_t(u)];
      const float texture = of_patch[std::size_t(j) * std::size_t(bin_columns) + std::size_t(i)].least();
      if (texture > of_cell.texture) of_cell = {texture, {i * bin - 1, j * bin - 1}, true};
    }
  }
  std::vector<ChosenPatch> chosen;
  for (std::size_t cell = 0; cell < best.size(); ++cell)
    if (best[cell].is_any) chosen.push_back({best[cell].corner, int(cell)});
  return chosen;
}

}  // namespace huetrack::room_watch
