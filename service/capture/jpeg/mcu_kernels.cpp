#include "capture/jpeg/mcu_kernels.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>

#include "capture/jpeg/bit_reader.h"
#include "capture/jpeg/inverse_transform.h"
#include "particle_filter/vector_clones.h"

// Shifts by a variable number of bits are most of the work; those of BMI2 do not write the flags.
#ifdef HUETRACK_AVX2_VERSION
#define HUETRACK_BMI2 __attribute__((target("avx2,bmi,bmi2,movbe")))
#endif

namespace huetrack::capture {
namespace {

constexpr std::array<std::uint8_t, 64> row_order{0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,
                                                 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6,  7,  14, 21, 28,
                                                 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51,
                                                 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};

constexpr std::uint32_t not_a_symbol = 0xFF;  // progress that completes no block

// Skips a block symbol by symbol. False: it is not decodable, and `bit` is unchanged. swing: see McuLane::swings.
[[gnu::noinline]] bool skip_symbols(const std::uint8_t* bytes, const SkippedBlock& block, std::size_t& bit,
                                    std::int16_t& difference, std::uint64_t& swing) {
  const ComponentTables& tables = *block.tables;
  BitReader reader(bytes, bit);
  const HuffmanSymbol dc = tables.dc_code.symbol(reader.next(16));
  if (dc.bits == 0) return false;
  reader.take(dc.bits);
  difference = static_cast<std::int16_t>(coded_value(reader.bits(), dc.value));
  reader.take(dc.value);
  swing = 0;
  unsigned done = 1;
  while (done < 64) {
    reader.refill();
    std::uint32_t entry = tables.symbol[reader.next(ComponentTables::symbol_window)];
    if (entry == 0) {
      const HuffmanSymbol symbol = tables.ac_code.symbol(reader.next(16));
      if (symbol.bits == 0) return false;
      entry = ac_symbol_entry(symbol);
    }
    reader.take(entry & 255);
    done += entry >> 16 & 255;
    swing += std::uint64_t{(*block.swings)[done % 64]} * ((1U << (entry >> 24)) - 1);
  }
  if (!is_block_complete(done)) return false;  // more than 64 coefficients: libjpeg writes the rest to the last one
  bit = reader.bit_after(bytes);
  return true;
}

[[gnu::always_inline]] inline std::uint64_t bits_at(const std::uint8_t* bytes, std::size_t bit) {  // 57 or more
  std::uint64_t word;
  std::memcpy(&word, bytes + bit / 8, sizeof word);
  if constexpr (std::endian::native == std::endian::little) word = __builtin_bswap64(word);
  return word << bit % 8;
}

struct Entry {
  std::int32_t done;   // see skip_block(): after this entry
  unsigned amplitude;  // upper bound of the sum of its coefficients' absolute values
};
// The symbol with a long code that a lane has stopped at. Arguments by value keep the caller's variables in registers.
[[gnu::noinline]] Entry long_code_at(const std::uint8_t* bytes, const ComponentTables& tables, std::size_t begin,
                                     std::int32_t done) {
  const std::uint64_t bits = bits_at(bytes, begin + static_cast<std::uint16_t>(done));
  const HuffmanSymbol symbol = tables.ac_code.symbol(static_cast<std::uint32_t>(bits >> 48));
  const std::uint32_t entry =
      symbol.bits == 0 ? not_a_symbol << 16 : ac_symbol_entry(symbol) & ~(std::uint32_t{255} << 8);
  return {done - ComponentTables::long_code + static_cast<std::int32_t>(entry & 0xFFFFFF), (1U << (entry >> 24)) - 1};
}

// The state of lanes that skip in step.
template <std::size_t lanes>
struct LaneStates {
  std::array<std::size_t, lanes> bit;
  std::array<std::int16_t*, lanes> difference;
  std::array<std::uint64_t, lanes> swing;  // of the block
};

// Skips one block in each lane. A lane whose block is complete idles until all are, without a branch: a mispredicted
// one would discard the work of all lanes in flight. Returns the lanes whose table entries did not apply, as bits:
// their `bit` is unchanged.
template <bool with_swings, std::size_t lanes>
[[gnu::always_inline]] inline unsigned skip_block(const std::uint8_t* bytes, const SkippedBlock& block,
                                                  LaneStates<lanes>& all) {
  constexpr int start_shift = 64 - ComponentTables::start_window, skip_shift = 64 - ComponentTables::skip_window;
  constexpr std::int32_t least_with_long_code = ComponentTables::long_code - 64 * 65536;
  const ComponentTables& tables = *block.tables;
  const std::array<std::size_t, lanes> begin = all.bit;
  // Of each lane, in one number: the block's bits (low half), and its coefficients - 64: negative while there are more.
  std::array<std::int32_t, lanes> done;
  const auto add_swing = [&](std::size_t i, unsigned amplitude) __attribute__((always_inline)) {
    if constexpr (with_swings) all.swing[i] += std::uint64_t{(*block.swings)[done[i] >> 16 & 63]} * amplitude;
  };
  for (std::size_t i = 0; i < lanes; ++i) {
    const std::uint64_t bits = bits_at(bytes, begin[i]);
    const std::size_t index = bits >> start_shift;
    const std::uint32_t start = tables.start[index];
    *all.difference[i] = static_cast<std::int16_t>(coded_value(bits << (start >> 16 & 63), start >> 24));
    done[i] = (static_cast<std::int32_t>(start >> 8 & 255) - 64) * 65536 + static_cast<std::int32_t>(start & 255);
    if constexpr (with_swings) all.swing[i] = 0;
    add_swing(i, tables.start_amplitude[index]);
  }
  const auto any_of_done = [&]() __attribute__((always_inline)) {
    std::int32_t any = 0;
    for (const std::int32_t d : done) any |= d;
    return any;
  };
  for (;;) {
    while (any_of_done() < 0) {
      for (std::size_t i = 0; i < lanes; ++i) {
        const std::uint64_t bits = bits_at(bytes, begin[i] + static_cast<std::uint16_t>(done[i]));
        const auto add = [&](std::size_t index) __attribute__((always_inline)) {
          const auto open = static_cast<std::uint32_t>(done[i] >> 31);  // 0 if the block is complete
          const std::uint32_t entry = tables.skip[index] & open;
          done[i] += static_cast<std::int32_t>(entry);
          add_swing(i, tables.skip_amplitude[index] & open);
          return entry;
        };
        const std::uint32_t first = add(bits >> skip_shift);
        add(bits << (first & 63) >> skip_shift);
      }
    }
    if (any_of_done() < least_with_long_code) [[likely]]
      break;
    for (std::size_t i = 0; i < lanes; ++i)
      if (done[i] >= least_with_long_code) {
        const Entry entry = long_code_at(bytes, tables, begin[i], done[i]);
        done[i] = entry.done;
        add_swing(i, entry.amplitude);
      }
  }
  unsigned incomplete = 0;
  for (std::size_t i = 0; i < lanes; ++i) {
    const bool is_complete = is_block_complete(static_cast<unsigned>((done[i] >> 16) + 64));
    all.bit[i] = begin[i] + (is_complete ? static_cast<std::uint16_t>(done[i]) : 0);
    incomplete |= (is_complete ? 0U : 1U) << i;
  }
  return incomplete;
}

template <bool with_swings, std::size_t lanes>
[[gnu::always_inline]] inline void skip_while_all(const std::uint8_t* bytes, const McuBlocks& blocks,
                                                  std::span<McuLane*> lane) {
  LaneStates<lanes> all;
  std::array<SkippedMcus, lanes> out;
  std::array<std::size_t, lanes> stop;
  std::size_t most = lane[0]->left;
  for (std::size_t i = 0; i < lanes; ++i) {
    all.bit[i] = lane[i]->bit;
    out[i] = lane[i]->next;
    all.difference[i] = out[i].differences;
    stop[i] = lane[i]->stop;
    most = std::min(most, lane[i]->left);
  }
  std::size_t n = 0;
  const auto skip_blocks = [&](std::span<const SkippedBlock> some) __attribute__((always_inline)) {
    for (const SkippedBlock& block : some) {
      const unsigned incomplete = skip_block<with_swings>(bytes, block, all);
      for (std::size_t i = 0; i < lanes; ++i) {
        if ((incomplete >> i & 1) != 0 && !skip_symbols(bytes, block, all.bit[i], *all.difference[i], all.swing[i]))
            [[unlikely]] {
          out[i].begins[n] |= not_decodable;
          ++all.bit[i];
        }
        ++all.difference[i];
        if constexpr (with_swings)
          *out[i].swings++ = static_cast<std::uint16_t>(std::min<std::uint64_t>(all.swing[i], 65535));
      }
    }
  };
  for (bool is_end = false; n < most && !is_end; ++n) {
    for (std::size_t i = 0; i < lanes; ++i) out[i].begins[n] = static_cast<std::uint32_t>(all.bit[i]);
    skip_blocks(blocks.all.first(blocks.luma));
    for (std::size_t i = 0; i < lanes; ++i) out[i].chroma_begins[n] = static_cast<std::uint32_t>(all.bit[i]);
    skip_blocks(blocks.all.subspan(blocks.luma));
    for (std::size_t i = 0; i < lanes; ++i) is_end |= all.bit[i] >= stop[i];
  }
  for (std::size_t i = 0; i < lanes; ++i) {
    lane[i]->bit = all.bit[i];
    lane[i]->left -= n;
    lane[i]->next = {.begins = out[i].begins + n,
                     .chroma_begins = out[i].chroma_begins + n,
                     .differences = all.difference[i],
                     .swings = out[i].swings};
  }
}

template <bool with_swings, std::size_t lanes>
[[gnu::always_inline]] inline void skip_open(const std::uint8_t* bytes, const McuBlocks& blocks,
                                             std::span<McuLane*> open) {
  if constexpr (lanes > 1)
    if (open.size() < lanes) return skip_open<with_swings, lanes - 1>(bytes, blocks, open);
  skip_while_all<with_swings, lanes>(bytes, blocks, open);
}

template <bool with_swings>
[[gnu::always_inline]] inline void skip(const std::uint8_t* bytes, const McuBlocks& blocks, std::span<McuLane> lanes) {
  std::array<McuLane*, most_mcu_lanes> open;
  for (;;) {
    std::size_t n = 0;
    for (McuLane& lane : lanes)
      if (!lane.is_at_end()) open[n++] = &lane;
    if (n == 0) return;
    skip_open<with_swings, most_mcu_lanes>(bytes, blocks, std::span(open).first(n));
  }
}

// Decodes and dequantises the AC coefficients. Returns 0 if all are 0, less than 8 if only the first row has others.
[[gnu::always_inline]] inline unsigned decode_coefficients(BitReader& reader, const ComponentTables& tables,
                                                           const std::int16_t* steps, JpegBlock& block) {
  unsigned used = 0, done = 1;
  // False: the block is complete. A code in the table's index takes at most 25 bits with its value, another 31.
  const auto take = [&]() __attribute__((always_inline)) {
    std::uint32_t entry = tables.symbol[reader.next(ComponentTables::symbol_window)];
    if (entry == 0) [[unlikely]] {
      reader.refill();
      entry = ac_symbol_entry(tables.ac_code.symbol(reader.next(16)));
    }
    const std::uint64_t bits = reader.bits() << (entry >> 8 & 63);
    const unsigned size = entry >> 24;
    reader.take(entry & 63);
    done += entry >> 16 & 255;
    if (done > 64) return false;
    const std::size_t place = row_order[done - 1];
    block.coefficients[place] = static_cast<std::int16_t>(coded_value(bits, size) * steps[done - 1]);
    used |= size > 0 ? static_cast<unsigned>(place) : 0;
    return done < 64;
  };
  do reader.refill();
  while (take() && take());
  return used;
}

// Transforms blocks in pairs, and those with a short cut singly.
class Blocks {
 public:
  JpegBlock& next() { return blocks_[waiting_] = {}; }
  // The block that next() returned. used: see decode_coefficients().
  [[gnu::always_inline]] void transform(unsigned used, const BlockPixels& to) {
    const JpegBlock& block = blocks_[waiting_];
    if (used == 0) {
      const std::uint8_t mean = jpeg_mean(block.coefficients[0]);
      for (int v = 0; v < 8; ++v) std::memset(to.pixels + v * to.stride, mean, 8);
    } else if (used < 8) {
      inverse_transform(block, true, to.pixels, to.stride);
    } else {
      to_[waiting_++] = to;
      if (waiting_ == 2) {
        inverse_transform_two(blocks_, to_);
        waiting_ = 0;
      }
    }
  }
  void finish() {
    if (waiting_ == 1) inverse_transform(blocks_[0], false, to_[0].pixels, to_[0].stride);
  }

 private:
  std::array<JpegBlock, 2> blocks_;
  std::array<BlockPixels, 2> to_;
  std::size_t waiting_ = 0;
};

[[gnu::always_inline]] inline void decode(const std::uint8_t* bytes, std::span<const std::uint32_t> begins,
                                          std::span<const DecodedBlock> blocks) {
  Blocks transformed;
  for (std::size_t i = 0; i < begins.size(); ++i) {
    BitReader reader(bytes, begins[i]);
    const auto mcu = static_cast<std::ptrdiff_t>(i);
    for (const DecodedBlock& b : blocks) {
      reader.refill();
      const std::uint32_t start = b.tables->start[reader.next(ComponentTables::start_window)] >> 16;
      const HuffmanSymbol dc = start == 0 ? b.tables->dc_code.symbol(reader.next(16)) : HuffmanSymbol{};
      reader.take(start == 0 ? dc.bits + dc.value : (start & 255) + (start >> 8));
      JpegBlock& block = transformed.next();
      block.coefficients[0] = static_cast<std::int16_t>(b.dc[mcu * b.dc_step] * b.steps[0]);
      const unsigned used = decode_coefficients(reader, *b.tables, b.steps, block);
      transformed.transform(used, {b.pixels + mcu * b.pixel_step, b.stride});
    }
  }
  transformed.finish();
}

#ifdef HUETRACK_BMI2
template <bool with_swings>
HUETRACK_BMI2 void skip_with_bmi2(const std::uint8_t* bytes, const McuBlocks& blocks, std::span<McuLane> lanes) {
  skip<with_swings>(bytes, blocks, lanes);
}
HUETRACK_BMI2 void decode_with_bmi2(const std::uint8_t* bytes, std::span<const std::uint32_t> begins,
                                    std::span<const DecodedBlock> blocks) {
  decode(bytes, begins, blocks);
}
bool has_bmi2() {
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2");
  return has;
}
#endif

}  // namespace

void SkippedMcus::append(const SkippedMcus& from, std::size_t mcus, std::size_t blocks) {
  begins = std::copy_n(from.begins, mcus, begins);
  chroma_begins = std::copy_n(from.chroma_begins, mcus, chroma_begins);
  differences = std::copy_n(from.differences, mcus * blocks, differences);
  if (swings != nullptr) swings = std::copy_n(from.swings, mcus * blocks, swings);
}

void skip_mcus(const std::uint8_t* bytes, const McuBlocks& blocks, std::span<McuLane> lanes) {
  const bool with_swings = lanes[0].next.swings != nullptr;
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return (with_swings ? skip_with_bmi2<true> : skip_with_bmi2<false>)(bytes, blocks, lanes);
#endif
  (with_swings ? skip<true> : skip<false>)(bytes, blocks, lanes);
}

void decode_mcus(const std::uint8_t* bytes, std::span<const std::uint32_t> begins,
                 std::span<const DecodedBlock> blocks) {
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return decode_with_bmi2(bytes, begins, blocks);
#endif
  decode(bytes, begins, blocks);
}

Swings swings_of(const std::int16_t* steps) {
  // maths: half of C(u) times the largest |cos((2 x + 1) u pi / 16)|
  constexpr std::array<double, 8> largest{0.353554, 0.490393, 0.461940, 0.490393,
                                          0.353554, 0.490393, 0.461940, 0.490393};
  Swings out{};
  std::uint32_t most = 0;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const std::size_t place = row_order[k];
    if (k > 0)
      most = std::max(
          most, static_cast<std::uint32_t>(64 * largest[place / 8] * largest[place % 8] * std::abs(int{steps[k]})) + 1);
    out[(k + 1) % 64] = most;
  }
  return out;
}

}  // namespace huetrack::capture
