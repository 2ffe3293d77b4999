#include "camera_tracking/leds/led_blobs.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "particle_filter/vector_clones.h"

namespace huetrack::leds {

namespace {

// Brightness where it lies: every `step` bytes from `offset` of a row on.
class Brightness {
 public:
  explicit Brightness(const capture::Image& image)
      : plane_(image.planes[0]),
        step_(image.format == capture::PixelFormat::yuyv  ? 2
              : image.format == capture::PixelFormat::bgr ? 3
                                                          : 1),
        is_bgr_(image.format == capture::PixelFormat::bgr) {}

  int operator()(int u, int v) const {
    const std::uint8_t* p = plane_.data + v * plane_.stride + static_cast<std::ptrdiff_t>(u) * step_;
    return is_bgr_ ? (p[0] + p[1] + p[2]) / 3 : p[0];
  }
  const std::uint8_t* row(int v) const { return plane_.data + v * plane_.stride; }
  int step() const { return step_; }
  bool is_bgr() const { return is_bgr_; }

 private:
  capture::Plane plane_;
  std::ptrdiff_t step_;
  bool is_bgr_;
};

// Of every row of 64 pixels: whole images are read once, at memory speed.
constexpr int tile = 64;

HUETRACK_CLONES int brightest_of(const std::uint8_t* p, int bytes) {
  std::uint8_t most = 0;
  for (int i = 0; i < bytes; ++i) most = p[i] > most ? p[i] : most;
  return most;
}
HUETRACK_CLONES int brightest_of_even(const std::uint8_t* p, int pixels) {
  std::uint8_t most = 0;
  for (int i = 0; i < pixels; ++i) most = p[2 * i] > most ? p[2 * i] : most;
  return most;
}

int brightest(const Brightness& y, int u0, int u1, int v) {
  const std::uint8_t* p = y.row(v) + static_cast<std::ptrdiff_t>(u0) * y.step();
  if (y.step() == 1) return brightest_of(p, u1 - u0);
  if (y.step() == 2) return brightest_of_even(p, u1 - u0);
  int most = 0;
  for (int u = u0; u < u1; ++u) most = std::max(most, y(u, v));
  return most;
}

struct Region {
  int left, top, right, bottom;  // inclusive
};

}  // namespace

std::vector<LedBlob> find_led_blobs(const capture::Image& image, const LedBlobOptions& options) {
  const Brightness y(image);
  const int columns = (image.width + tile - 1) / tile;

  // The dark of the room: the median of a sparse sample.
  std::array<int, 256> histogram{};
  int samples = 0;
  for (int v = 3; v < image.height; v += 8)
    for (int u = 3; u < image.width; u += 8, ++samples) ++histogram[static_cast<std::size_t>(y(u, v))];
  int dark = 0;
  for (int below = 0; dark < 255; ++dark)
    if ((below += histogram[static_cast<std::size_t>(dark)]) * 2 >= samples) break;

  struct Seed {
    int peak, u, v;
  };
  std::vector<Seed> seeds;
  for (int v = 0; v < image.height; ++v) {
    for (int c = 0; c < columns; ++c) {
      const int u0 = c * tile, u1 = std::min(image.width, u0 + tile);
      if (brightest(y, u0, u1, v) < dark + options.min_contrast) continue;
      for (int u = u0; u < u1; ++u) {
        const int here = y(u, v);
        if (here < dark + options.min_contrast) continue;
        const auto at = [&](int du, int dv) {
          return u + du < 0 || v + dv < 0 || u + du >= image.width || v + dv >= image.height ? 0 : y(u + du, v + dv);
        };
        // A peak: none of the eight around it is brighter; of equals the last in reading order counts.
        if (at(-1, -1) > here || at(0, -1) > here || at(1, -1) > here || at(-1, 0) > here || at(1, 0) >= here ||
            at(-1, 1) >= here || at(0, 1) >= here || at(1, 1) >= here)
          continue;
        seeds.push_back({here, u, v});
      }
    }
    if (seeds.size() > 4096) break;  // a lit room, no dark one: there is nothing to find
  }
  std::ranges::stable_sort(seeds, std::ranges::greater{}, &Seed::peak);

  std::vector<LedBlob> blobs;
  std::vector<Region> taken;
  std::vector<std::array<int, 2>> queue;
  std::vector<std::uint8_t> seen;
  for (const Seed& seed : seeds) {
    if (blobs.size() >= 4 * static_cast<std::size_t>(options.max_count)) break;
    if (std::ranges::any_of(taken, [&](const Region& r) {
          return seed.u >= r.left && seed.u <= r.right && seed.v >= r.top && seed.v <= r.bottom;
        }))
      continue;
    // The connected pixels above the threshold, in a square around the peak that is too small for what is no LED.
    const int reach = options.max_diameter_px, side = 2 * reach + 1;
    const double threshold = dark + options.threshold * (seed.peak - dark);
    seen.assign(static_cast<std::size_t>(side * side), 0);
    queue.assign(1, {seed.u, seed.v});
    seen[static_cast<std::size_t>(reach * side + reach)] = 1;
    Region box{seed.u, seed.v, seed.u, seed.v};
    double weight = 0;
    Eigen::Vector2d sum(0, 0);
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const auto [u, v] = queue[i];
      const double w = y(u, v) - threshold;
      weight += w;
      sum += w * Eigen::Vector2d(u, v);
      box = {std::min(box.left, u), std::min(box.top, v), std::max(box.right, u), std::max(box.bottom, v)};
      for (const auto& [du, dv] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const int nu = u + du, nv = v + dv;
        if (nu < 0 || nv < 0 || nu >= image.width || nv >= image.height) continue;
        if (std::abs(nu - seed.u) > reach || std::abs(nv - seed.v) > reach) continue;
        std::uint8_t& mark = seen[static_cast<std::size_t>((nv - seed.v + reach) * side + nu - seed.u + reach)];
        if (mark != 0 || y(nu, nv) <= threshold) continue;
        mark = 1;
        queue.push_back({nu, nv});
      }
    }
    taken.push_back(box);
    const bool too_large =
        box.right - box.left >= options.max_diameter_px || box.bottom - box.top >= options.max_diameter_px;
    // Cut off by the image's edge: its centre would be wrong.
    const bool cut = box.left == 0 || box.top == 0 || box.right == image.width - 1 || box.bottom == image.height - 1;
    if (too_large || cut || !(weight > 0)) continue;
    blobs.push_back({sum / weight, seed.peak, static_cast<int>(queue.size())});
  }
  std::ranges::stable_sort(blobs, std::ranges::greater{}, [](const LedBlob& b) { return b.peak * b.area_px; });
  if (blobs.size() > static_cast<std::size_t>(options.max_count))
    blobs.resize(static_cast<std::size_t>(options.max_count));
  return blobs;
}

}  // namespace huetrack::leds
