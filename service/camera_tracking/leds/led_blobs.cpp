#include "camera_tracking/leds/led_blobs.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "particle_filter/vector_clones.h"

namespace huetrack::leds {

namespace {

constexpr int least_contrast = 25;       // grey levels that a LED's brightest pixel is above the dark around it
constexpr double threshold = 0.25;       // the paper's "dynamic threshold", between the dark (0) and the peak (1)
constexpr int largest_diameter_px = 40;  // larger ones are lamps or windows
constexpr std::size_t most_blobs = 16;   // the brightest ones

// The image's brightness without a copy.
class Brightness {
 public:
  explicit Brightness(const capture::Image& image)
      : plane_(image.planes[0]),
        step_(image.format == capture::PixelFormat::yuyv  ? 2
              : image.format == capture::PixelFormat::bgr ? 3
                                                          : 1),
        is_bgr_(image.format == capture::PixelFormat::bgr) {
    capture::require_all(image);
  }

  int operator()(int u, int v) const {
    const std::uint8_t* p = plane_.data + v * plane_.stride + static_cast<std::ptrdiff_t>(u) * step_;
    return is_bgr_ ? (p[0] + p[1] + p[2]) / 3 : p[0];
  }
  const std::uint8_t* row(int v) const { return plane_.data + v * plane_.stride; }
  int step() const { return step_; }

 private:
  capture::Plane plane_;
  std::ptrdiff_t step_;
  bool is_bgr_;
};

constexpr int tile = 64;  // layout: pixels whose maximum is computed at once

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

// The dark level: the median of a sparse sample.
int dark_of(const Brightness& y, const capture::Image& image) {
  std::array<int, 256> histogram{};
  int samples = 0;
  for (int v = 3; v < image.height; v += 8)
    for (int u = 3; u < image.width; u += 8, ++samples) ++histogram[static_cast<std::size_t>(y(u, v))];
  int dark = 0;
  for (int below = 0; dark < 255; ++dark) {
    below += histogram[static_cast<std::size_t>(dark)];
    if (2 * below >= samples) break;
  }
  return dark;
}

struct Peak {
  int brightness, u, v;
};

// Local maxima of the 8-neighbourhood, the brightest first; of equals the last in reading order.
std::vector<Peak> find_peaks(const Brightness& y, const capture::Image& image, int least) {
  constexpr std::size_t most = 4096;  // more: the room is lit
  const int columns = (image.width + tile - 1) / tile;
  std::vector<Peak> peaks;
  for (int v = 0; v < image.height && peaks.size() <= most; ++v) {
    for (int c = 0; c < columns; ++c) {
      const int u0 = c * tile, u1 = std::min(image.width, u0 + tile);
      if (brightest(y, u0, u1, v) < least) continue;
      for (int u = u0; u < u1; ++u) {
        const int here = y(u, v);
        if (here < least) continue;
        const auto at = [&](int du, int dv) {
          return u + du < 0 || v + dv < 0 || u + du >= image.width || v + dv >= image.height ? 0 : y(u + du, v + dv);
        };
        if (at(-1, -1) > here || at(0, -1) > here || at(1, -1) > here || at(-1, 0) > here || at(1, 0) >= here ||
            at(-1, 1) >= here || at(0, 1) >= here || at(1, 1) >= here)
          continue;
        peaks.push_back({here, u, v});
      }
    }
  }
  std::ranges::stable_sort(peaks, std::ranges::greater{}, &Peak::brightness);
  return peaks;
}

// Region growing around peaks, with reused buffers. thread-compatible.
class Growth {
 public:
  Growth(const Brightness& y, const capture::Image& image, int reach) : y_(y), image_(image), reach_(reach) {}

  struct Spot {
    int left, top, right, bottom;  // inclusive
    int area = 0;
    double weight = 0;
    Eigen::Vector2d weighted{0, 0};

    bool contains(const Peak& peak) const {
      return peak.u >= left && peak.u <= right && peak.v >= top && peak.v <= bottom;
    }
  };
  // The connected pixels above the threshold within `reach` of the peak.
  Spot around(const Peak& peak, double threshold) {
    const int side = 2 * reach_ + 1;
    seen_.assign(static_cast<std::size_t>(side * side), 0);
    queue_.assign(1, {peak.u, peak.v});
    seen_[static_cast<std::size_t>(reach_ * side + reach_)] = 1;
    Spot spot{peak.u, peak.v, peak.u, peak.v};
    for (std::size_t i = 0; i < queue_.size(); ++i) {
      const auto [u, v] = queue_[i];
      const double w = y_(u, v) - threshold;
      spot.weight += w;
      spot.weighted += w * Eigen::Vector2d(u, v);
      spot.left = std::min(spot.left, u), spot.right = std::max(spot.right, u);
      spot.top = std::min(spot.top, v), spot.bottom = std::max(spot.bottom, v);
      for (const auto& [du, dv] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const int nu = u + du, nv = v + dv;
        if (nu < 0 || nv < 0 || nu >= image_.width || nv >= image_.height) continue;
        if (std::abs(nu - peak.u) > reach_ || std::abs(nv - peak.v) > reach_) continue;
        std::uint8_t& mark = seen_[static_cast<std::size_t>((nv - peak.v + reach_) * side + nu - peak.u + reach_)];
        if (mark != 0 || y_(nu, nv) <= threshold) continue;
        mark = 1;
        queue_.push_back({nu, nv});
      }
    }
    spot.area = static_cast<int>(queue_.size());
    return spot;
  }

 private:
  const Brightness& y_;
  const capture::Image& image_;
  const int reach_;
  std::vector<std::array<int, 2>> queue_;
  std::vector<std::uint8_t> seen_;
};

}  // namespace

std::vector<LedBlob> find_led_blobs(const capture::Image& image) {
  const Brightness y(image);
  const int dark = dark_of(y, image);
  Growth growth(y, image, largest_diameter_px);
  std::vector<LedBlob> blobs;
  std::vector<Growth::Spot> taken;
  for (const Peak& peak : find_peaks(y, image, dark + least_contrast)) {
    if (blobs.size() >= 4 * most_blobs) break;
    if (std::ranges::any_of(taken, [&](const Growth::Spot& spot) { return spot.contains(peak); })) continue;
    const auto& spot = taken.emplace_back(growth.around(peak, dark + threshold * (peak.brightness - dark)));
    const bool too_large =
        spot.right - spot.left >= largest_diameter_px || spot.bottom - spot.top >= largest_diameter_px;
    const bool cut =  // by the image's border: the centroid is biased
        spot.left == 0 || spot.top == 0 || spot.right == image.width - 1 || spot.bottom == image.height - 1;
    if (too_large || cut || !(spot.weight > 0)) continue;
    blobs.push_back({spot.weighted / spot.weight, peak.brightness, spot.area});
  }
  std::ranges::stable_sort(blobs, std::ranges::greater{}, [](const LedBlob& b) { return b.peak * b.area_px; });
  if (blobs.size() > most_blobs) blobs.resize(most_blobs);
  return blobs;
}

}  // namespace huetrack::leds
