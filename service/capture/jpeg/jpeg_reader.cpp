#include "capture/jpeg/jpeg_reader.h"

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <utility>

namespace huetrack::capture {
namespace {

std::atomic<JpegReading> reading_of_all = JpegReading::on_demand;

class JpegPixels final : public PixelsOnDemand {
 public:
  // Both sides of its MCUs must be powers of two.
  JpegPixels(std::shared_ptr<const JpegIndex> index, std::shared_ptr<FrameMemory> memory, bool is_poisoned)
      : PixelsOnDemand(index->width(), index->height(), std::countr_zero(static_cast<unsigned>(index->mcu_width())),
                       std::countr_zero(static_cast<unsigned>(index->mcu_height()))),
        index_(std::move(index)),
        memory_(std::move(memory)) {
    const int width = index_->mcu_columns() * index_->mcu_width(), height = index_->mcu_rows() * index_->mcu_height();
    std::array<std::size_t, 3> offsets{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      offsets[i] = count;
      strides_[i] = static_cast<std::ptrdiff_t>(plane_row_bytes(index_->format(), static_cast<int>(i), width));
      count += static_cast<std::size_t>(strides_[i]) *
               static_cast<std::size_t>(plane_rows(index_->format(), static_cast<int>(i), height));
    }
    std::uint8_t* const bytes = memory_->bytes(count);
    for (std::size_t i = 0; i < 3; ++i) planes_[i] = strides_[i] > 0 ? bytes + offsets[i] : nullptr;
    if (!is_poisoned) return;
    std::minstd_rand random;
    for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>(random() >> 8);
  }

  Plane plane(std::size_t i) const { return {planes_[i], strides_[i]}; }
  Image eighth() const override { return index_->eighth(); }
  void narrow_chroma(std::size_t unit, PixelBounds& bounds) const override { index_->narrow_chroma(unit, bounds); }

 private:
  void decode(int row, int first, int count) const override {
    index_->decode(row, first, first + count, planes_, strides_);
  }
  std::vector<PixelBounds> find_bounds() const override { return index_->bounds(); }

  const std::shared_ptr<const JpegIndex> index_;
  const std::shared_ptr<FrameMemory> memory_;
  std::array<std::uint8_t*, 3> planes_{};
  std::array<std::ptrdiff_t, 3> strides_{};
};

}  // namespace

void JpegReader::set_reading(JpegReading reading) {
  reading_of_all = reading;
}

std::shared_ptr<const std::vector<std::uint8_t>> JpegReader::keep(std::span<const std::uint8_t> jpeg) {
  auto bytes = bytes_.take();
  bytes->assign(jpeg.begin(), jpeg.end());
  return bytes;
}

JpegResult JpegReader::read(std::shared_ptr<const std::vector<std::uint8_t>> jpeg, int width, int height) {
  const JpegReading reading = reading_of_all;
  const auto index = reading == JpegReading::whole ? nullptr : JpegIndex::build(jpeg, width, height, &indices_);
  const auto is_power_of_two = [](int n) { return std::has_single_bit(static_cast<unsigned>(n)); };
  if (!index || !is_power_of_two(index->mcu_width()) || !is_power_of_two(index->mcu_height()))
    return decoder_.decode(*jpeg, width, height);
  auto pixels = std::make_shared<JpegPixels>(index, memory_.take(), reading == JpegReading::poisoned);
  Image image{.format = index->format(),
              .range = index->range(),
              .width = index->width(),
              .height = index->height(),
              .planes = {pixels->plane(0), pixels->plane(1), pixels->plane(2)},
              .owner = pixels};
  image.on_demand = std::move(pixels);
  return {.image = std::move(image), .is_unsupported = false, .problem = {}};
}

}  // namespace huetrack::capture
