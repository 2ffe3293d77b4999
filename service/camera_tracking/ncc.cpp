#include "camera_tracking/ncc.h"

#include <algorithm>
#include <cmath>

#include "particle_filter/vector_clones.h"

namespace huetrack::camera_tracking {
namespace {

// Per column of one row of anchors: sum of T I over the template.
HUETRACK_CLONES void correlate_row(const std::uint8_t* __restrict image, std::ptrdiff_t stride,
                                   const std::uint8_t* __restrict t, int side, int n, std::int32_t* __restrict out) {
  for (int u = 0; u < n; ++u) out[u] = 0;
  for (int j = 0; j < side; ++j) {
    const std::uint8_t* row = image + j * stride;
    for (int i = 0; i < side; ++i) {
      const std::int32_t weight = t[j * side + i];
      for (int u = 0; u < n; ++u) out[u] += weight * row[u + i];
    }
  }
}

// Sums of I and I^2 down the columns.
HUETRACK_CLONES void sum_columns(const std::uint8_t* __restrict image, std::ptrdiff_t stride, int side, int n,
                                 std::int32_t* __restrict sum, std::int32_t* __restrict square) {
  for (int u = 0; u < n; ++u) sum[u] = square[u] = 0;
  for (int j = 0; j < side; ++j) {
    const std::uint8_t* row = image + j * stride;
    for (int u = 0; u < n; ++u) {
      const std::int32_t x = row[u];
      sum[u] += x, square[u] += x * x;
    }
  }
}
HUETRACK_CLONES void slide_columns(const std::uint8_t* __restrict leaving, const std::uint8_t* __restrict entering,
                                   int n, std::int32_t* __restrict sum, std::int32_t* __restrict square) {
  for (int u = 0; u < n; ++u) {
    const std::int32_t a = leaving[u], b = entering[u];
    sum[u] += b - a, square[u] += b * b - a * a;
  }
}
HUETRACK_CLONES void finish_row(const std::int32_t* __restrict product, const std::int32_t* __restrict column_sum,
                                const std::int32_t* __restrict column_square, int side, int n, float t_sum,
                                float t_norm, std::int32_t* __restrict sum, std::int32_t* __restrict square,
                                float* __restrict out) {
  for (int u = 0; u < n; ++u) sum[u] = square[u] = 0;
  for (int i = 0; i < side; ++i) {
    for (int u = 0; u < n; ++u) sum[u] += column_sum[u + i], square[u] += column_square[u + i];
  }
  const float count = static_cast<float>(side * side);
  for (int u = 0; u < n; ++u) {
    // Scaled by the count, the differences of large numbers are exact in double.
    const double s = sum[u];
    const double top = static_cast<double>(count) * product[u] - static_cast<double>(t_sum) * s;
    const double var = static_cast<double>(count) * square[u] - s * s;  // count^2 times the variance
    const float flat = 0.25f * count * count;                           // half a grey level: that is noise
    const float below = t_norm * std::sqrt(static_cast<float>(count * static_cast<float>(std::max(var, 1.0))));
    const float rho = static_cast<float>(top) / std::max(below, 1e-6f);
    out[u] = static_cast<float>(var) > flat ? rho : 0.0f;
  }
}

}  // namespace

void NccTemplate::finish() {
  sum = 0;
  std::int64_t square = 0;
  for (const std::int32_t p : pixels) sum += p, square += p * p;
  const double n = static_cast<double>(pixels.size());
  norm = static_cast<float>(std::sqrt(std::max(0.0, static_cast<double>(square) - static_cast<double>(sum) * sum / n)));
  if (norm < 0.5f * static_cast<float>(side)) norm = 0;  // less than half a grey level: noise
}

PixelRegion clip(const PixelRegion& region, const GreyImage& image, int side) {
  const int before = (side - 1) / 2, after = side - 1 - before;
  return {std::max(region.u0, before), std::max(region.v0, before), std::min(region.u1, image.width - 1 - after),
          std::min(region.v1, image.height - 1 - after)};
}

void ncc_field(const GreyImage& image, const NccTemplate& t, const PixelRegion& region, std::vector<float>& field) {
  if (region.empty()) {
    field.clear();
    return;
  }
  const int n = region.width(), before = (t.side - 1) / 2, columns = n + t.side - 1;
  field.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(region.height()));
  if (!(t.norm > 0)) {
    std::ranges::fill(field, 0.0f);
    return;
  }
  const auto wide = static_cast<std::size_t>(columns);
  thread_local std::vector<std::int32_t> scratch;
  scratch.resize(5 * wide);
  std::int32_t* column_sum = scratch.data();
  std::int32_t* column_square = column_sum + wide;
  std::int32_t* product = column_square + wide;
  std::int32_t* sum = product + wide;
  std::int32_t* square = sum + wide;
  const std::uint8_t* corner = image.row(region.v0 - before) + (region.u0 - before);
  sum_columns(corner, image.stride, t.side, columns, column_sum, column_square);
  for (int v = 0; v < region.height(); ++v) {
    const std::uint8_t* row = corner + v * image.stride;
    if (v > 0) slide_columns(row - image.stride, row + (t.side - 1) * image.stride, columns, column_sum, column_square);
    correlate_row(row, image.stride, t.pixels.data(), t.side, n, product);
    finish_row(product, column_sum, column_square, t.side, n, static_cast<float>(t.sum), t.norm, sum, square,
               field.data() + static_cast<std::ptrdiff_t>(v) * n);
  }
}

NccPeak best_of(const std::vector<float>& field, const PixelRegion& region) {
  if (field.empty()) return {};
  const auto at = static_cast<int>(std::ranges::max_element(field) - field.begin());
  return {field[static_cast<std::size_t>(at)], region.u0 + at % region.width(), region.v0 + at / region.width()};
}

Eigen::Vector2d refined(const NccPeak& peak, const std::vector<float>& field, const PixelRegion& region) {
  const int i = peak.u - region.u0, j = peak.v - region.v0, width = region.width();
  const auto at = [&](int x, int y) { return static_cast<double>(field[static_cast<std::size_t>(y * width + x)]); };
  const auto top = [](double before, double here, double after) {
    const double bend = before - 2 * here + after;
    return bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
  };
  Eigen::Vector2d px(peak.u, peak.v);
  if (i > 0 && i + 1 < width) px.x() += top(at(i - 1, j), at(i, j), at(i + 1, j));
  if (j > 0 && j + 1 < region.height()) px.y() += top(at(i, j - 1), at(i, j), at(i, j + 1));
  return px;
}

}  // namespace huetrack::camera_tracking
