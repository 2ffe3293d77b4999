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

  // knows_bounds: of the samples, and those are as narrow as can be.
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
  void find_luma_bounds(std::span<const std::uint32_t> wanted, SampleBounds* out) const override {
    std::vector<SampleBounds> all(units(), none);
    for_each_pixel([&](std::size_t unit, Yuv p) { add(all[unit], p.y); });
    for (const std::uint32_t unit : wanted) *out++ = all[unit];
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

  std::vector<ChromaBounds> find_chroma_bounds() const override {
    if (!knows_bounds_ || whole_.format == PixelFormat::bgr) return {};
    std::vector<ChromaBounds> bounds(units(), {.u = none, .v = none});
    for_each_pixel([&](std::size_t unit, Yuv p) {
      add(bounds[unit].u, p.u);
      add(bounds[unit].v, p.v);
    });
    return bounds;
  }

  static constexpr SampleBounds none{.min = 255, .max = 0};
  static void add(SampleBounds& to, std::uint8_t value) {
    to = {.min = std::min(to.min, value), .max = std::max(to.max, value)};
  }
  template <typename Of>
  void for_each_pixel(const Of& of) const {
    for (int v = 0; v < whole_.height; ++v)
      for (int u = 0; u < whole_.width; ++u)
        of(static_cast<std::size_t>((v >> shift) * columns() + (u >> shift)), yuv_at(whole_, u, v));
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
