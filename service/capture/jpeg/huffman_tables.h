// A component's Huffman codes as tables that are indexed by the next bits: for skipping blocks and for decoding them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "capture/jpeg/jpeg_header.h"

namespace huetrack::capture {

// Progress in a block is the number of its coefficients that are done (1 after the DC coefficient), plus this after an
// end-of-block symbol.
constexpr unsigned jpeg_block_end = 128;

// A block is complete after its end-of-block symbol or its 64th coefficient. Other values of 64 or more mean that a
// table entry did not apply (see ComponentTables).
inline bool is_block_complete(unsigned done) {
  return done == 64 || done - jpeg_block_end < 64;
}

struct HuffmanSymbol {
  unsigned bits = 0;  // of the code; 0: no code begins with these bits
  std::uint8_t value = 0;
};

// Canonical codes by their length: for codes that are longer than a table's index.
class CanonicalCode {
 public:
  // False: not a prefix code, or one that libjpeg refuses (with a code of ones only).
  bool make(const HuffmanCode& code);
  HuffmanSymbol symbol(std::uint32_t next_16_bits) const {
    std::size_t length = 1;  // without a branch, which could not be predicted
    for (std::size_t shorter = 1; shorter <= 16; ++shorter) length += next_16_bits >= end_[shorter] ? 1 : 0;
    if (length > 16) return {};
    const auto index = static_cast<std::size_t>(first_[length] + static_cast<int>(next_16_bits >> (16 - length)));
    return {static_cast<unsigned>(length), symbols_[index]};
  }

 private:
  std::array<std::uint32_t, 17> end_{};  // behind the last code of up to this length, with 16 bits
  std::array<int, 17> first_{};          // a symbol's index is this + its code
  std::array<std::uint8_t, 256> symbols_{};
};

// An AC symbol as four bytes, from the lowest: all its bits; bits of its code; progress (1 and the zeros before it;
// jpeg_block_end at the block's end); bits of its value.
inline std::uint32_t ac_symbol_entry(const HuffmanSymbol& symbol) {
  const unsigned bits = symbol.value & 15, zeros = symbol.value >> 4;
  const bool is_end = bits == 0 && zeros != 15;
  return (symbol.bits + bits) | symbol.bits << 8 | (is_end ? jpeg_block_end : zeros + 1) << 16 | bits << 24;
}

// A longer index holds more symbols in an entry, until the tables no longer fit into the first-level cache: see
// EXPERIMENTS.md.
struct ComponentTables {
  static constexpr int start_window = 11, skip_window = 12, symbol_window = 10;

  // False: see CanonicalCode::make(). Does nothing if the tables are of these codes already.
  bool make(const HuffmanCode& dc, const HuffmanCode& ac);

  // By the next bits of AC coefficients: all symbols whose codes lie in these bits; the last one's value may lie
  // beyond. Low half: bits. High half: progress. An entry applies if only its last symbol may complete the block: if
  // the sum of progress is < 64 or is_block_complete(). long_code: the first code is longer than the index, or invalid.
  std::array<std::uint32_t, std::size_t{1} << skip_window> skip;
  static constexpr std::int32_t long_code = (16384 + 64) << 16;
  // By the first bits of a block: the DC coefficient, and AC coefficients as above. From the lowest byte: bits;
  // progress (0xFF: the code is longer than the index, or invalid); bits of the DC coefficient's code; bits of its
  // value.
  std::array<std::uint32_t, std::size_t{1} << start_window> start;
  // Of each entry of these two: an upper bound of the sum of its AC coefficients' absolute values.
  std::array<std::uint16_t, std::size_t{1} << skip_window> skip_amplitude;
  std::array<std::uint16_t, std::size_t{1} << start_window> start_amplitude;
  // By the next bits of AC coefficients: ac_symbol_entry(). 0: the code is longer than the index, or invalid.
  std::array<std::uint32_t, std::size_t{1} << symbol_window> symbol;
  CanonicalCode dc_code, ac_code;

 private:
  HuffmanCode dc_, ac_;  // of the tables
  bool is_made_ = false;
};

}  // namespace huetrack::capture
