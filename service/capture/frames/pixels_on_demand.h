// Pixels of a compressed image that are decoded where and when a reader needs them.
#pragma once

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
};
struct ChromaBounds {
  SampleBounds u, v;
};

// Belongs to one image. thread-safe: tracker, watches and previews share a frame. Decoding happens in the reader's
// thread.
class PixelsOnDemand {
 public:
  virtual ~PixelsOnDemand() = default;
  PixelsOnDemand(const PixelsOnDemand&) = delete;
  PixelsOnDemand& operator=(const PixelsOnDemand&) = delete;

  // Makes the pixels of columns u0 .. u1 - 1 of rows v0 .. v1 - 1 readable in all planes; clipped to the image.
  void require(int u0, int v0, int u1, int v1) const;
  void require_all() const { require(0, 0, width_, height_); }

  // The image at 1/8 of its size: means of 8x8 samples, known without decoding anything. Without planes: not known.
  virtual Image eighth() const = 0;

  // Pixels are decoded in units of 2^column_shift() columns and 2^row_shift() rows.
  int column_shift() const { return column_shift_; }
  int row_shift() const { return row_shift_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  // Bounds of each unit's chroma, row by row; empty: not known. All of its pixels lie within them, so what looks for a
  // colour in the whole image need not decode most of it. Computed by the first call, at some 5 % of the cost of
  // decoding.
  std::span<const ChromaBounds> chroma_bounds() const;
  // Bounds of these units' luma (units are counted row by row), one for each. Costs some 15 % of decoding them.
  virtual void find_luma_bounds(std::span<const std::uint32_t> units, SampleBounds* out) const = 0;

  // For benchmarks and tests.
  std::size_t decoded_units() const { return decoded_.load(std::memory_order_relaxed); }
  std::size_t units() const { return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_); }

 protected:
  // Of an image of this size, nothing decoded. 2^shift columns and rows of pixels are decoded together.
  PixelsOnDemand(int width, int height, int column_shift, int row_shift);

 private:
  // Units first .. first + count - 1 of a row of them. Called once for each unit, by one thread at a time. Writes their
  // pixels and no others.
  virtual void decode(int row, int first, int count) const = 0;
  virtual std::vector<ChromaBounds> find_chroma_bounds() const { return {}; }
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
  mutable std::vector<ChromaBounds> bounds_;  // once they are found
};

}  // namespace huetrack::capture
