#include "capture/jpeg/huffman_tables.h"

#include <algorithm>
#include <memory>
#include <utility>

namespace huetrack::capture {
namespace {

constexpr std::uint32_t beyond_window = 0xFF;  // coefficients
constexpr unsigned most_advance = 63;  // of the symbols of one entry, so that sums of coefficients are unambiguous

// Calls of(symbol) for each code of up to `longest` bits, in ascending order of the codes.
template <typename Of>
void for_each_symbol(const HuffmanCode& code, int longest, Of&& of) {
  std::size_t index = 0;
  for (unsigned bits = 1; bits <= static_cast<unsigned>(longest); ++bits)
    for (int n = code.counts[bits - 1]; n > 0; --n) of(HuffmanSymbol{bits, code.symbols[index++]});
}

// Entries of ComponentTables::skip for all windows up to `longest`; that of `w` bits begins at 1 << w. Entry 0: no
// symbol. A symbol that leaves bits in its window is followed by whatever follows in a window of those bits.
class SkipLevels {
 public:
  static constexpr int longest = ComponentTables::skip_window;
  explicit SkipLevels(const HuffmanCode& ac) {
    for (int w = 1; w <= longest; ++w) make(w, ac);
  }
  const std::uint32_t* level(int w) const { return entries_.data() + (std::size_t{1} << w); }

 private:
  void make(int w, const HuffmanCode& ac) {
    std::uint32_t* next = entries_.data() + (std::size_t{1} << w);
    for_each_symbol(ac, w, [&](const HuffmanSymbol& symbol) {
      const std::uint32_t all = ac_symbol_entry(symbol);
      const unsigned bits = all & 255, advance = all >> 16 & 255, of_value = all >> 24;
      const int left = w - static_cast<int>(bits);
      const std::uint32_t entry = bits | advance << 16;
      if (left <= 0 || advance == jpeg_block_end) {
        next = std::fill_n(next, std::size_t{1} << (w - static_cast<int>(symbol.bits)), entry);
        return;
      }
      const std::uint32_t* rest = level(left);
      for (int i = 0; i < 1 << of_value; ++i)
        next = std::transform(rest, rest + (std::size_t{1} << left), next, [&](std::uint32_t r) {
          return (r >> 16 & 127U) > most_advance - advance ? entry : entry + r;
        });
    });
  }

  std::array<std::uint32_t, std::size_t{2} << longest> entries_{};
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

std::int32_t ComponentTables::long_symbol(std::uint64_t bits) const {
  const HuffmanSymbol symbol = ac_code.symbol(static_cast<std::uint32_t>(bits >> 48));
  if (symbol.bits == 0) return static_cast<std::int32_t>(beyond_window << 16);
  const std::uint32_t entry = ac_symbol_entry(symbol);
  return static_cast<std::int32_t>((entry & 255) | (entry >> 16 & 255) << 16);
}

bool ComponentTables::make(const HuffmanCode& dc, const HuffmanCode& ac) {
  if (is_made_ && dc == dc_ && ac == ac_) return true;
  is_made_ = false;
  if (!dc_code.make(dc) || !ac_code.make(ac)) return false;
  const SkipLevels levels(ac);
  std::transform(levels.level(skip_window), levels.level(skip_window + 1), skip.begin(),
                 [](std::uint32_t entry) { return entry == 0 ? static_cast<std::uint32_t>(long_code) : entry; });

  symbol.fill(0);
  auto* next_symbol = symbol.data();
  for_each_symbol(ac, symbol_window, [&](const HuffmanSymbol& s) {
    next_symbol =
        std::fill_n(next_symbol, std::size_t{1} << (symbol_window - static_cast<int>(s.bits)), ac_symbol_entry(s));
  });

  start.fill(beyond_window << 8);
  auto* next = start.data();
  bool is_valid = true;
  for_each_symbol(dc, 16, [&](const HuffmanSymbol& s) {
    is_valid = is_valid && s.value <= 15;
    if (!is_valid || s.bits > start_window) return;
    const std::uint32_t entry = (s.bits + s.value) | 1U << 8 | s.bits << 16 | std::uint32_t{s.value} << 24;
    const int left = start_window - static_cast<int>(s.bits) - s.value;
    if (left <= 0) {
      next = std::fill_n(next, std::size_t{1} << (start_window - static_cast<int>(s.bits)), entry);
      return;
    }
    const std::uint32_t* rest = levels.level(left);
    for (int i = 0; i < 1 << s.value; ++i)
      next = std::transform(rest, rest + (std::size_t{1} << left), next,
                            [&](std::uint32_t r) { return entry + (r & 255) + (r >> 16 << 8); });
  });
  if (!is_valid) return false;
  dc_ = dc;
  ac_ = ac;
  is_made_ = true;
  return true;
}

}  // namespace huetrack::capture
