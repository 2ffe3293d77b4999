#include "room_watch/patch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace huetrack::room_watch {
namespace {

constexpr int lanes = 8;  // layout: partial sums, so that the order of additions is fixed
static_assert(patch_pixels % lanes == 0);

constexpr int margin = 3;  // layout: blocks around the patch that are read with it
constexpr int window_side = patch_side + 1 + 2 * margin;
// maths: bilinear interpolation half-way between blocks blurs by 0.25 squared blocks and removes 1 - cos(w / 2) of a
// wave of w radians per block, where a blur of one block removes 1 - exp(-w^2 / 2): for waves of 4 to 6 blocks, which
// most detail consists of, 1.4 times 0.25.
constexpr float loss_by_interpolation = 1.4f;

float sum_of(const std::array<float, lanes>& partial) {
  float sum = 0;
  for (const float p : partial) sum += p;
  return sum;
}

struct Sums {
  float value = 0, square = 0, with_patch = 0, with_x = 0, with_y = 0;
};

using Pixels = std::array<float, patch_pixels>;
using SeenPixels = std::array<float, std::size_t(seen_side) * seen_side>;

float product(const Pixels& a, const Pixels& b) {
  std::array<float, lanes> partial{};
  for (std::size_t p = 0; p < patch_pixels; p += lanes)
    for (std::size_t l = 0; l < lanes; ++l) partial[l] += a[p + l] * b[p + l];
  return sum_of(partial);
}

// Gaussian blur with a replicated border. In pictures of rooms a patch blurred so correlates with the blurred picture
// by 0.97 to 1 up to 6 blocks.
SeenPixels blurred_pixels(const SeenPixels& seen, double sigma) {
  using Square = Eigen::Matrix<float, seen_side, seen_side, Eigen::RowMajor>;
  Square kernel = Square::Zero();  // of one line
  const int reach = int(std::ceil(3 * sigma));
  for (int k = -reach; k <= reach; ++k) {
    const auto weight = float(std::exp(-0.5 * k * k / (sigma * sigma)));
    for (int i = 0; i < seen_side; ++i) kernel(i, std::clamp(i + k, 0, seen_side - 1)) += weight;
  }
  kernel /= kernel.row(0).sum();
  SeenPixels out;
  Eigen::Map<Square>(out.data()) = kernel * Eigen::Map<const Square>(seen.data()) * kernel.transpose();
  return out;
}

SeenPixels pixels_of(const SeenPatch& seen) {
  SeenPixels pixels;
  std::ranges::transform(seen, pixels.begin(), [](std::uint8_t value) { return float(value); });
  return pixels;
}

Pixels inner(const SeenPixels& seen) {
  Pixels pixels;
  for (std::size_t j = 0; j < patch_side; ++j)
    for (std::size_t i = 0; i < patch_side; ++i) pixels[j * patch_side + i] = seen[(j + 1) * seen_side + i + 1];
  return pixels;
}

void set_detail(Patch& patch) {
  const SeenPixels seen = pixels_of(patch.seen);
  const Pixels sharp = inner(seen), soft = inner(blurred_pixels(seen, 1));
  float mean = 0;
  for (std::size_t k = 0; k < patch_pixels; ++k) {
    patch.detail[k] = sharp[k] - soft[k];
    mean += patch.detail[k] / float(patch_pixels);
  }
  for (float& value : patch.detail) value -= mean;
  patch.detail_of_values = product(patch.detail, patch.values) / patch.energy;
  const Eigen::Vector2f shift = patch.from_gradient * Eigen::Vector2f(product(patch.detail, patch.gradient_x),
                                                                      product(patch.detail, patch.gradient_y));
  for (std::size_t k = 0; k < patch_pixels; ++k)
    patch.detail[k] -=
        patch.detail_of_values * patch.values[k] + shift.x() * patch.gradient_x[k] + shift.y() * patch.gradient_y[k];
  patch.detail_energy = std::max(product(patch.detail, patch.detail), 1e-3f);
}

// The loss in: now = gain (values - loss * whole detail) + shift. Patch::detail lacks the whole detail's share of the
// values, which lowers the measured gain.
float loss_of(const Patch& patch, const Pixels& now, float measured_gain) {
  const float lost = -product(now, patch.detail) / (patch.detail_energy * measured_gain);
  return lost > 0 ? lost / (1 + lost * patch.detail_of_values) : lost;
}

// Sums over `now`, the window that begins `from` blocks after the buffer's corner.
Sums sums_at(const Patch& patch, const float* buffer, const Eigen::Vector2f& from, Pixels& now) {
  const int u = int(from.x()), v = int(from.y());
  const float du = from.x() - float(u), dv = from.y() - float(v);
  const float w00 = (1 - du) * (1 - dv), w10 = du * (1 - dv), w01 = (1 - du) * dv, w11 = du * dv;
  for (int j = 0; j < patch_side; ++j) {
    const float* const a = buffer + std::ptrdiff_t(v + j) * window_side + u;
    const float* const b = a + window_side;
    float* const out = now.data() + std::ptrdiff_t(j) * patch_side;
    for (int i = 0; i < patch_side; ++i) out[i] = w00 * a[i] + w10 * a[i + 1] + w01 * b[i] + w11 * b[i + 1];
  }
  std::array<float, lanes> value{}, square{}, with_patch{}, with_x{}, with_y{};
  for (int p = 0; p < patch_pixels; p += lanes) {
    for (int l = 0; l < lanes; ++l) {
      const auto k = std::size_t(p + l);
      const auto s = std::size_t(l);
      value[s] += now[k];
      square[s] += now[k] * now[k];
      with_patch[s] += now[k] * patch.values[k];
      with_x[s] += now[k] * patch.gradient_x[k];
      with_y[s] += now[k] * patch.gradient_y[k];
    }
  }
  return {sum_of(value), sum_of(square), sum_of(with_patch), sum_of(with_x), sum_of(with_y)};
}

}  // namespace

float Patch::contrast() const {
  return std::sqrt(energy / float(patch_pixels));
}

std::optional<Patch> make_patch(const Eigen::Vector2d& centre, const SeenPatch& seen) {
  Patch patch;
  patch.centre = centre;
  patch.seen = seen;
  const auto at = [&](int i, int j) { return float(seen[std::size_t(j + 1) * seen_side + std::size_t(i + 1)]); };
  double mean = 0, mean_x = 0, mean_y = 0;
  for (int j = 0; j < patch_side; ++j) {
    for (int i = 0; i < patch_side; ++i) {
      const auto k = std::size_t(j) * patch_side + std::size_t(i);
      patch.values[k] = at(i, j);
      patch.gradient_x[k] = (at(i + 1, j) - at(i - 1, j)) / 2;
      patch.gradient_y[k] = (at(i, j + 1) - at(i, j - 1)) / 2;
      mean += double(patch.values[k]), mean_x += double(patch.gradient_x[k]), mean_y += double(patch.gradient_y[k]);
    }
  }
  double energy = 0, x_along = 0, y_along = 0;
  for (std::size_t k = 0; k < patch_pixels; ++k) {
    patch.values[k] -= float(mean / patch_pixels);
    patch.gradient_x[k] -= float(mean_x / patch_pixels);
    patch.gradient_y[k] -= float(mean_y / patch_pixels);
    const double value = double(patch.values[k]);
    energy += value * value;
    x_along += value * double(patch.gradient_x[k]), y_along += value * double(patch.gradient_y[k]);
  }
  if (energy <= 0) return std::nullopt;
  patch.energy = float(energy);
  double xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < patch_pixels; ++k) {
    patch.gradient_x[k] -= float(x_along / energy) * patch.values[k];
    patch.gradient_y[k] -= float(y_along / energy) * patch.values[k];
    const double x = double(patch.gradient_x[k]), y = double(patch.gradient_y[k]);
    xx += x * x, xy += x * y, yy += y * y;
  }
  const double least = (xx + yy) / 2 - std::hypot((xx - yy) / 2, xy);
  patch.least_texture = float(least / patch_pixels);
  if (least <= 1e-6 * (xx + yy) || xx + yy <= 0) return std::nullopt;
  const double determinant = xx * yy - xy * xy;
  patch.from_gradient << float(yy / determinant), float(-xy / determinant), float(-xy / determinant),
      float(xx / determinant);
  set_detail(patch);
  return patch;
}

Found find(const Patch& patch, const Luma& luma, const Eigen::Vector2d& start) {
  constexpr float half = float(patch_side - 1) / 2;
  std::array<float, std::size_t(window_side) * window_side> buffer;
  Found found;
  Eigen::Vector2d centre = start;
  Eigen::Vector2i corner = Eigen::Vector2i::Zero();
  bool is_read = false, is_settled = false;
  Sums sums;
  alignas(64) Pixels now;
  Eigen::Vector2f read_at = Eigen::Vector2f::Zero();
  for (int step = 0; step < patch_fit.most_steps; ++step) {
    Eigen::Vector2f from = (centre - corner.cast<double>()).cast<float>() - Eigen::Vector2f::Constant(half);
    if (!is_read || from.minCoeff() < 0 || from.maxCoeff() >= float(2 * margin + 1)) {
      corner = (centre.array() - double(half)).floor().cast<int>().matrix() - Eigen::Vector2i::Constant(margin);
      if (!luma.read(corner.x(), corner.y(), window_side, window_side, buffer.data())) return found;
      is_read = true;
      from = (centre - corner.cast<double>()).cast<float>() - Eigen::Vector2f::Constant(half);
    }
    sums = sums_at(patch, buffer.data(), from, now);
    read_at = from;
    if (sums.with_patch <= 0) break;  // negative correlation
    const float gain = sums.with_patch / patch.energy;
    const Eigen::Vector2f change = patch.from_gradient * Eigen::Vector2f(sums.with_x, sums.with_y) / gain;
    centre -= change.cast<double>();
    if (!((centre - start).norm() <= double(patch_fit.max_shift_blocks))) break;
    is_settled = change.norm() < float(patch_fit.settled_blocks);
    if (is_settled) break;
  }
  const float energy = std::max(sums.square - sums.value * sums.value / float(patch_pixels), 1e-3f);
  found.contrast = std::sqrt(energy / float(patch_pixels));
  found.correlation = sums.with_patch / std::sqrt(energy * patch.energy);
  if (!is_settled || found.correlation < patch_fit.min_correlation ||
      found.contrast < patch_fit.min_contrast * patch.contrast()) {
    found.outcome = Found::Outcome::differs;
    return found;
  }
  found.outcome = Found::Outcome::found;
  found.centre = centre;
  const float unexplained = std::max(0.f, 1 - found.correlation * found.correlation);  // share of the energy
  const float noise = patch.energy * unexplained / float(patch_pixels);
  found.sigma = std::sqrt(noise * patch.from_gradient.trace() / 2);
  const Eigen::Array2f between = read_at.array() - read_at.array().floor();
  found.loss =
      loss_of(patch, now, sums.with_patch / patch.energy) - loss_by_interpolation * (between * (1 - between)).mean();
  found.loss_sigma = std::sqrt(noise / patch.detail_energy);
  return found;
}

float correlation(const Patch& patch, const Luma& luma, const Eigen::Vector2d& centre) {
  const Eigen::Vector2i corner = (centre.array() - double(patch_side - 1) / 2).round().cast<int>().matrix();
  Pixels now;
  if (!luma.read(corner.x(), corner.y(), patch_side, patch_side, now.data())) return 0;
  float mean = 0;
  for (const float value : now) mean += value / float(patch_pixels);
  for (float& value : now) value -= mean;
  return product(now, patch.values) / std::sqrt(std::max(product(now, now), 1e-3f) * patch.energy);
}

std::optional<Patch> blurred(const Patch& patch, double sigma_blocks) {
  const SeenPixels soft = blurred_pixels(pixels_of(patch.seen), sigma_blocks);
  SeenPatch seen;
  std::ranges::transform(soft, seen.begin(), [](float value) { return static_cast<std::uint8_t>(std::lround(value)); });
  return make_patch(patch.centre, seen);
}

double blur_of(const Patch& patch, double loss) {
  // maths: nodes between which the loss is nearly linear in the blur
  constexpr std::array blurs{0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0};
  if (loss <= 0) return 0;
  const SeenPixels seen = pixels_of(patch.seen);
  double blur = 0, at_blur = 0;
  for (const double next : blurs) {
    const Pixels now = inner(blurred_pixels(seen, next));
    const float gain = product(now, patch.values) / patch.energy;
    const double at_next = gain > 0 ? double(loss_of(patch, now, gain)) : at_blur;
    if (at_next >= loss) return blur + (next - blur) * (loss - at_blur) / (at_next - at_blur);
    if (at_next > at_blur) blur = next, at_blur = at_next;
  }
  return blur;
}

std::optional<Eigen::Vector2d> search(const Patch& patch, const Luma& luma, const Eigen::Vector2d& start, int reach) {
  const Eigen::Vector2i corner = (start.array() - double(patch_side - 1) / 2).round().cast<int>().matrix();
  const int left = std::max(0, corner.x() - reach), top = std::max(0, corner.y() - reach);
  const int right = std::min(luma.columns() - patch_side, corner.x() + reach);
  const int bottom = std::min(luma.rows() - patch_side, corner.y() + reach);
  if (right < left || bottom < top) return std::nullopt;
  const int columns = right - left + patch_side, rows = bottom - top + patch_side;
  std::vector<float> area(std::size_t(columns) * std::size_t(rows));
  if (!luma.read(left, top, columns, rows, area.data())) return std::nullopt;
  constexpr int stride = 2;  // layout: every second place in both directions; find() does the rest
  const int places = (right - left) / stride + 1, lines = (bottom - top) / stride + 1;
  std::vector<float> alike(std::size_t(places) * std::size_t(lines));
  std::vector<float> with_patch(static_cast<std::size_t>(places)), value(with_patch), square(with_patch);
  for (int v = 0; v < lines; ++v) {
    std::ranges::fill(with_patch, 0.f), std::ranges::fill(value, 0.f), std::ranges::fill(square, 0.f);
    for (int j = 0; j < patch_side; ++j) {
      const float* const line = area.data() + std::ptrdiff_t(stride * v + j) * columns;
      for (int i = 0; i < patch_side; ++i) {
        const float p = patch.values[std::size_t(j) * patch_side + std::size_t(i)];
        for (int u = 0; u < places; ++u) {
          const float now = line[stride * u + i];
          with_patch[std::size_t(u)] += now * p;
          value[std::size_t(u)] += now;
          square[std::size_t(u)] += now * now;
        }
      }
    }
    for (int u = 0; u < places; ++u) {
      const auto k = std::size_t(u);
      const float energy = square[k] - value[k] * value[k] / float(patch_pixels);
      const bool has_contrast = energy > patch_fit.min_contrast * patch_fit.min_contrast * patch.energy;
      alike[std::size_t(v) * std::size_t(places) + k] =
          has_contrast ? with_patch[k] / std::sqrt(energy * patch.energy) : 0.f;
    }
  }
  const auto best = std::ranges::max_element(alike);
  if (*best < patch_fit.search_correlation) return std::nullopt;
  const int at = int(best - alike.begin()), u = at % places, v = at / places;
  for (int k = 0; k < int(alike.size()); ++k) {
    const bool is_apart = std::abs(k % places - u) > patch_fit.search_neighbour_steps ||
                          std::abs(k / places - v) > patch_fit.search_neighbour_steps;
    if (is_apart && alike[std::size_t(k)] > *best - patch_fit.search_margin) return std::nullopt;
  }
  return Eigen::Vector2d(left + stride * u, top + stride * v) + Eigen::Vector2d::Constant(double(patch_side - 1) / 2);
}

}  // namespace huetrack::room_watch
