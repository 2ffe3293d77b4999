// Reads the bits of entropy-coded bytes that have no stuffing and markers, from the highest bit of a byte on.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace huetrack::capture {

// Reads up to 8 bytes beyond the last bit that is taken: the caller pads the memory.
class BitReader {
 public:
  // Bits that can be taken after refill().
  static constexpr int refilled = 56;

  BitReader(const std::uint8_t* bytes, std::size_t bit) : next_(bytes + bit / 8) {
    refill();
    take(static_cast<unsigned>(bit % 8));
  }

  [[gnu::always_inline]] void refill() {
    std::uint64_t word;
    std::memcpy(&word, next_, sizeof word);
    if constexpr (std::endian::native == std::endian::little) word = __builtin_bswap64(word);
    bits_ |= word >> left_;
    next_ += (63 - left_) >> 3;
    left_ |= refilled;
  }
  [[gnu::always_inline]] void take(unsigned n) {
    bits_ <<= n;
    left_ -= n;
  }
  std::uint64_t bits() const { return bits_; }  // the next bits, from the highest on
  std::uint32_t next(int n) const { return static_cast<std::uint32_t>(bits_ >> (64 - n)); }
  const std::uint8_t* position() const { return next_; }
  std::size_t bit_after(const std::uint8_t* bytes) const { return static_cast<std::size_t>(next_ - bytes) * 8 - left_; }

 private:
  std::uint64_t bits_ = 0;
  const std::uint8_t* next_;
  unsigned left_ = 0;
};

// The value of a coefficient that the highest `n` of `bits` code; n: 0 to 15.
[[gnu::always_inline]] inline int coded_value(std::uint64_t bits, unsigned n) {
  const int value = static_cast<int>(bits >> 1 >> (63 - n));
  const int is_negative = static_cast<int>(~static_cast<std::int64_t>(bits) >> 63);
  return value + (is_negative & (1 - (1 << n)));
}

}  // namespace huetrack::capture
