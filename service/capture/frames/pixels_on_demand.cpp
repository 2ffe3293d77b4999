#include "capture/frames/pixels_on_demand.h"

#include <bit>

namespace huetrack::capture {
namespace {

constexpr int word_bits = 64;

// Of the word that begins at bit `begin`: the bits first .. last, which may lie outside of it.
std::uint64_t bits_between(int first, int last, int begin) {
  const int from = std::max(first - begin, 0), to = std::min(last - begin, word_bits - 1);
  return ~std::uint64_t{0} >> (word_bits - 1 - (to - from)) << from;
}

}  // namespace

PixelsOnDemand::PixelsOnDemand(int width, int height, int column_shift, int row_shift)
    : width_(width),
      height_(height),
      column_shift_(column_shift),
      row_shift_(row_shift),
      columns_(((width - 1) >> column_shift) + 1),
      rows_(((height - 1) >> row_shift) + 1),
      words_of_row_((columns_ + word_bits - 1) / word_bits),
      done_(std::make_unique<std::atomic<std::uint64_t>[]>(static_cast<std::size_t>(words_of_row_ * rows_))) {}

std::span<const PixelBounds> PixelsOnDemand::bounds() const {
  std::call_once(bounds_once_, [this] { bounds_ = find_bounds(); });
  return bounds_;
}

void PixelsOnDemand::require(int u0, int v0, int u1, int v1) const {
  u0 = std::max(u0, 0), v0 = std::max(v0, 0), u1 = std::min(u1, width_), v1 = std::min(v1, height_);
  if (u0 >= u1 || v0 >= v1) return;
  const int first = u0 >> column_shift_, last = (u1 - 1) >> column_shift_;
  for (int row = v0 >> row_shift_; row <= (v1 - 1) >> row_shift_; ++row) {
    for (int begin = first / word_bits * word_bits; begin <= last; begin += word_bits) {
      const std::uint64_t wanted = bits_between(first, last, begin);
      if ((word(row, begin).load(std::memory_order_acquire) & wanted) == wanted) continue;
      decode_missing(row, std::max(first, begin), std::min(last, begin + word_bits - 1));
    }
  }
}

// first, last: of one word.
void PixelsOnDemand::decode_missing(int row, int first, int last) const {
  const int begin = first / word_bits * word_bits;
  const std::scoped_lock lock(mutex_);
  std::uint64_t missing = bits_between(first, last, begin) & ~word(row, begin).load(std::memory_order_relaxed);
  while (missing != 0) {
    const int from = std::countr_zero(missing), count = std::countr_one(missing >> from);
    decode(row, begin + from, count);
    const std::uint64_t run = bits_between(begin + from, begin + from + count - 1, begin);
    word(row, begin).fetch_or(run, std::memory_order_release);
    decoded_.fetch_add(static_cast<std::size_t>(count), std::memory_order_relaxed);
    missing &= ~run;
  }
}

}  // namespace huetrack::capture
