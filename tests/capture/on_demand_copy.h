// Any image as one whose pixels come only where they are required: a test double of what JpegReader makes. Until then
// its bytes are random, so a reader that forgot require() sees other pixels.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "capture/frames/image_copy.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

class CopyOnDemand final : public PixelsOnDemand {
 public:
  static constexpr int side = 16, shift = 4;  // pixels of a unit

  // knows_bounds: of the samples.
  explicit CopyOnDemand(Image whole, bool knows_bounds = false)
      : PixelsOnDemand(whole.width, whole.height, shift, shift),
        whole_(std::move(whole)),
        knows_bounds_(knows_bounds),
        target_(make_image(whole_.format, whole_.range, whole_.width, whole_.height)) {
    std::minstd_rand random;
    for (std::size_t i = 0; i < packed_bytes(whole_); ++i)
      target_.data[0][i] = static_cast<std::uint8_t>(random() >> 8);
  }

  Image eighth() const override { return {}; }
  void narrow_chroma(std::size_t unit, PixelBounds& bounds) const override {
    const PixelBounds exact = exact_bounds(unit);
    bounds.u = exact.u, bounds.v = exact.v;
  }
  const Image& target() const { return target_.image; }
  int calls() const { return calls_; }

 private:
  void decode(int row, int first, int count) const override {
    ++calls_;
    const int u1 = std::min((first + count) * side, whole_.width);
    const int v1 = std::min((row + 1) * side, whole_.height);
    for (int p = 0; p < 3; ++p) {
      const auto i = static_cast<std::size_t>(p);
      const std::size_t begin = plane_row_bytes(whole_.format, p, first * side);
      const std::size_t end = plane_row_bytes(whole_.format, p, u1);
      for (int v = plane_rows(whole_.format, p, row * side); begin < end && v < plane_rows(whole_.format, p, v1); ++v)
        std::memcpy(target_.data[i] + v * target_.image.planes[i].stride + begin,
                    whole_.planes[i].data + v * whole_.planes[i].stride + begin, end - begin);
    }
  }

  // Those of chroma are wider than they need be, as a JPEG's are.
  std::vector<PixelBounds> find_bounds() const override {
    if (!knows_bounds_ || whole_.format == PixelFormat::bgr) return {};
    constexpr int excess = 40;
    std::vector<PixelBounds> bounds;
    for (std::size_t unit = 0; unit < units(); ++unit) {
      PixelBounds& of_unit = bounds.emplace_back(exact_bounds(unit));
      for (SampleBounds* const chroma : {&of_unit.u, &of_unit.v})
        *chroma = {.min = static_cast<std::uint8_t>(std::max(chroma->min - excess, 0)),
                   .max = static_cast<std::uint8_t>(std::min(chroma->max + excess, 255))};
    }
    return bounds;
  }
  PixelBounds exact_bounds(std::size_t unit) const {
    const int u0 = static_cast<int>(unit) % columns() * side, v0 = static_cast<int>(unit) / columns() * side;
    PixelBounds bounds{.y = no_sample, .u = no_sample, .v = no_sample};
    for (int v = v0; v < std::min(v0 + side, whole_.height); ++v)
      for (int u = u0; u < std::min(u0 + side, whole_.width); ++u) {
        const Yuv p = yuv_at(whole_, u, v);
        bounds.y.include({p.y, p.y});
        bounds.u.include({p.u, p.u});
        bounds.v.include({p.v, p.v});
      }
    return bounds;
  }

  const Image whole_;
  const bool knows_bounds_;
  const WritableImage target_;
  mutable std::atomic<int> calls_ = 0;
};

inline Image on_demand_copy(const Image& whole, bool knows_bounds = false) {
  const auto pixels = std::make_shared<const CopyOnDemand>(whole, knows_bounds);
  Image image = pixels->target();
  image.owner = pixels;
  image.on_demand = pixels;
  return image;
}

}  // namespace huetrack::capture
