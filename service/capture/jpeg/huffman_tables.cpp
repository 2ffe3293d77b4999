#include "capture/jpeg/huffman_tables.h"

#include <algorithm>
#include <span>

namespace huetrack::capture {
namespace {

constexpr std::uint32_t beyond_index = 0xFF;  // progress
constexpr unsigned most_advance = 63;         // of an entry's symbols, so that sums of progress are unambiguous

// Calls of(symbol) for each code of up to `longest` bits, in ascending order of the codes.
template <typename Of>
void for_each_symbol(const HuffmanCode& code, int longest, Of&& of) {
  std::size_t index = 0;
  for (unsigned bits = 1; bits <= static_cast<unsigned>(longest); ++bits)
    for (int n = code.counts[bits - 1]; n > 0; --n) of(HuffmanSymbol{bits, code.symbols[index++]});
}

// The largest absolute value of a coefficient that `bits` bits code, of which the first `seen` are `value`.
std::uint16_t most_amplitude(unsigned value, unsigned seen, unsigned bits) {
  if (seen > bits) value >>= seen - bits, seen = bits;
  const unsigned unseen = bits - seen;
  const bool is_negative = seen > 0 && value >> (seen - 1) == 0;
  const unsigned most = is_negative || seen == 0 ? ~value & ((1U << seen) - 1) : value;
  return static_cast<std::uint16_t>(most << unseen | ((1U << unseen) - 1));
}

// Entries of ComponentTables::skip, and their amplitudes, for all indices of up to `longest` bits; those of `w` bits
// begin at 1 << w. Entry 0: no symbol. Where a symbol leaves bits of the index, the entry of these bits is added to it.
class SkipLevels {
 public:
  static constexpr int longest = ComponentTables::skip_window;
  explicit SkipLevels(const HuffmanCode& ac) {
    for (int w = 1; w <= longest; ++w) make(w, ac);
  }
  std::span<const std::uint32_t> level(int w) const { return std::span(entries_).subspan(begin(w), begin(w)); }
  std::span<const std::uint16_t> amplitudes(int w) const { return std::span(amplitudes_).subspan(begin(w), begin(w)); }

 private:
  static std::size_t begin(int w) { return std::size_t{1} << w; }

  void make(int w, const HuffmanCode& ac) {
    std::size_t next = begin(w);
    for_each_symbol(ac, w, [&](const HuffmanSymbol& symbol) {
      const std::uint32_t all = ac_symbol_entry(symbol);
      const unsigned bits = all & 255, advance = all >> 16 & 255, of_value = all >> 24;
      const int left = w - static_cast<int>(bits);
      const std::uint32_t entry = bits | advance << 16;
      if (left <= 0 || advance == jpeg_block_end) {
        const unsigned seen = static_cast<unsigned>(w) - symbol.bits;
        for (unsigned value = 0; value < 1U << seen; ++value, ++next)
          entries_[next] = entry, amplitudes_[next] = most_amplitude(value, seen, of_value);
        return;
      }
      for (unsigned value = 0; value < 1U << of_value; ++value) {
        const std::uint16_t own = most_amplitude(value, of_value, of_value);
        for (std::size_t rest = begin(left); rest < 2 * begin(left); ++rest, ++next) {
          const bool fits = (entries_[rest] >> 16 & 127U) <= most_advance - advance;
          entries_[next] = entry + (fits ? entries_[rest] : 0);
          amplitudes_[next] = static_cast<std::uint16_t>(own + (fits ? amplitudes_[rest] : 0));
        }
      }
    });
  }

  std::array<std::uint32_t, std::size_t{2} << longest> entries_{};
  std::array<std::uint16_t, std::size_t{2} << longest> amplitudes_{};
};

}  // namespace

bool CanonicalCode::make(const HuffmanCode& code) {
  std::uint32_t next = 0;  // with 16 bits
  int index = 0;
  for (std::size_t length = 1; length <= 16; ++length) {
    const int n = code.counts[length - 1];
    const std::uint32_t one = std::uint32_t{1} << (16 - length);
    first_[length] = index - static_cast<int>(next / one);
    next += static_cast<std::uint32_t>(n) * one;
    index += n;
    if (n > 0 && next + one > (1U << 16)) return false;
    end_[length] = next;
  }
  if (index > 256) return false;
  symbols_ = code.symbols;
  return true;
}

bool ComponentTables::make(const HuffmanCode& dc, const HuffmanCode& ac) {
  if (is_made_ && dc == dc_ && ac == ac_) return true;
  is_made_ = false;
  if (!dc_code.make(dc) || !ac_code.make(ac)) return false;
  const SkipLevels levels(ac);
  std::ranges::transform(levels.level(skip_window), skip.begin(), [](std::uint32_t entry) {
    return entry == 0 ? static_cast<std::uint32_t>(long_code) : entry;
  });
  std::ranges::copy(levels.amplitudes(skip_window), skip_amplitude.begin());

  symbol.fill(0);
  auto* next_symbol = symbol.data();
  for_each_symbol(ac, symbol_window, [&](const HuffmanSymbol& s) {
    next_symbol =
        std::fill_n(next_symbol, std::size_t{1} << (symbol_window - static_cast<int>(s.bits)), ac_symbol_entry(s));
  });

  start.fill(beyond_index << 8);
  start_amplitude.fill(0);
  std::size_t next = 0;
  bool is_valid = true;
  for_each_symbol(dc, 16, [&](const HuffmanSymbol& s) {
    is_valid = is_valid && s.value <= 15;
    if (!is_valid || s.bits > start_window) return;
    const std::uint32_t entry = (s.bits + s.value) | 1U << 8 | s.bits << 16 | std::uint32_t{s.value} << 24;
    const int left = start_window - static_cast<int>(s.bits) - s.value;
    if (left <= 0) {
      const std::size_t count = std::size_t{1} << (start_window - static_cast<int>(s.bits));
      std::fill_n(start.begin() + static_cast<std::ptrdiff_t>(next), count, entry);
      next += count;
      return;
    }
    const auto rest = levels.level(left);
    const auto amplitudes = levels.amplitudes(left);
    for (int value = 0; value < 1 << s.value; ++value)
      for (std::size_t i = 0; i < rest.size(); ++i, ++next) {
        start[next] = entry + (rest[i] & 255) + (rest[i] >> 16 << 8);
        start_amplitude[next] = amplitudes[i];
      }
  });
  if (!is_valid) return false;
  dc_ = dc;
  ac_ = ac;
  is_made_ = true;
  return true;
}

}  // namespace huetrack::capture
