// Pixels of a compressed image that are decoded when and where a reader requires them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

namespace huetrack::capture {

struct Image;

// Inclusive.
struct SampleBounds {
  std::uint8_t min = 0, max = 255;

  void include(SampleBounds other) { min = std::min(min, other.min), max = std::max(max, other.max); }
};
constexpr SampleBounds no_sample{.min = 255, .max = 0};
struct PixelBounds {
  SampleBounds y, u, v;
};

// The pixels of one image. thread-safe: tracker, watches and previews share a frame. The reader's thread decodes.
class PixelsOnDemand {
 public:
  virtual ~PixelsOnDemand() = default;
  PixelsOnDemand(const PixelsOnDemand&) = delete;
  PixelsOnDemand& operator=(const PixelsOnDemand&) = delete;

  // Makes the pixels of columns u0 .. u1 - 1 of rows v0 .. v1 - 1 readable in all planes; clipped to the image.
  void require(int u0, int v0, int u1, int v1) const;
  void require_all() const { require(0, 0, width_, height_); }

  // The image at 1/8 of its size: means of 8x8 samples, known without decoding. Without planes: not known.
  virtual Image eighth() const = 0;

  // Pixels are decoded in units of 2^column_shift() columns and 2^row_shift() rows.
  int column_shift() const { return column_shift_; }
  int row_shift() const { return row_shift_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  // Bounds of the samples of each unit, row by row; empty: not known. A search for a colour need not decode a unit
  // whose bounds exclude it. Computed by the first call.
  std::span<const PixelBounds> bounds() const;
  // Narrows the bounds of a unit's chroma to the range of its samples, at about a third of the cost of decoding it.
  virtual void narrow_chroma(std::size_t unit, PixelBounds& bounds) const = 0;

  // For benchmarks and tests.
  std::size_t decoded_units() const { return decoded_.load(std::memory_order_relaxed); }
  std::size_t units() const { return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_); }

 protected:
  // An image of this size, in which nothing is decoded. A unit has 2^shift columns and rows.
  PixelsOnDemand(int width, int height, int column_shift, int row_shift);

 private:
  // Writes the pixels of the units first .. first + count - 1 of a row of units, and no others. Called once for each
  // unit, by one thread at a time.
  virtual void decode(int row, int first, int count) const = 0;
  virtual std::vector<PixelBounds> find_bounds() const { return {}; }
  void decode_missing(int row, int first, int last) const;
  std::atomic<std::uint64_t>& word(int row, int column) const {
    return done_[static_cast<std::size_t>(row * words_of_row_ + column / 64)];
  }

  const int width_, height_, column_shift_, row_shift_;
  const int columns_, rows_, words_of_row_;
  const std::unique_ptr<std::atomic<std::uint64_t>[]> done_;  // a bit per unit, set when its pixels are readable
  mutable std::mutex mutex_;                                  // held while decoding
  mutable std::atomic<std::size_t> decoded_ = 0;
  mutable std::once_flag bounds_once_;
  mutable std::vector<PixelBounds> bounds_;  // result of find_bounds()
};

}  // namespace huetrack::capture
