#include "capture/jpeg/mcu_kernels.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "capture/jpeg/bit_reader.h"
#include "capture/jpeg/inverse_transform.h"
#include "particle_filter/vector_clones.h"

// Shifts by a variable number of bits are most of the work, and BMI2 has them without a detour by a register of flags.
#ifdef HUETRACK_AVX2_VERSION
#define HUETRACK_BMI2 __attribute__((target("avx2,bmi,bmi2,movbe")))
#endif

namespace huetrack::capture {
namespace {

constexpr std::array<std::uint8_t, 64> row_order{0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,
                                                 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6,  7,  14, 21, 28,
                                                 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51,
                                                 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};

constexpr std::uint32_t not_a_symbol = 0xFF;  // coefficients, which make no block complete

// A block, symbol by symbol. False: it is not decodable, and `bit` is as before. swing: see find_swings(); may be
// nullptr.
[[gnu::noinline]] bool skip_symbols(const std::uint8_t* bytes, const ComponentTables& tables, std::size_t& bit,
                                    std::int16_t& difference, const Swings* swings, std::uint64_t* swing) {
  BitReader reader(bytes, bit);
  const HuffmanSymbol dc = tables.dc_code.symbol(reader.next(16));
  if (dc.bits == 0) return false;
  reader.take(dc.bits);
  difference = static_cast<std::int16_t>(coded_value(reader.bits(), dc.value));
  reader.take(dc.value);
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
    if (swings != nullptr) *swing += std::uint64_t{(*swings)[done % 64]} * ((1U << (entry >> 24)) - 1);
  }
  if (!is_block_complete(done)) return false;  // more than 64 coefficients: libjpeg writes them all to the last one
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
  std::int32_t done;   // see skip_block(): how far into the block after it
  unsigned amplitude;  // the largest sum of absolute values of its coefficients
};
// The symbol with a long code that `done` has stopped at. By value, so that what it came from stays in registers.
[[gnu::noinline]] Entry long_code_at(const std::uint8_t* bytes, const ComponentTables& tables, std::size_t begin,
                                     std::int32_t done) {
  const std::uint64_t bits = bits_at(bytes, begin + static_cast<std::uint16_t>(done));
  const HuffmanSymbol symbol = tables.ac_code.symbol(static_cast<std::uint32_t>(bits >> 48));
  const std::uint32_t entry =
      symbol.bits == 0 ? not_a_symbol << 16 : ac_symbol_entry(symbol) & ~(std::uint32_t{255} << 8);
  return {done - ComponentTables::long_code + static_cast<std::int32_t>(entry & 0xFFFFFF), (1U << (entry >> 24)) - 1};
}

// One block of each lane. The lanes whose block is complete wait for the others, without a branch that would depend on
// one lane's bits: what could not be predicted would cost all lanes their work under way.
//   each_entry(i, amplitude, done)  after each entry of lane i, with its largest sum of absolute values of coefficients
//   again(i)                        for a lane whose entries did not apply: it reads the block symbol by symbol
template <std::size_t lanes, typename EachEntry, typename Again>
[[gnu::always_inline]] inline void skip_block(const std::uint8_t* bytes, const ComponentTables& tables,
                                              std::array<std::size_t, lanes>& bit,
                                              const std::array<std::int16_t*, lanes>& difference,
                                              const EachEntry& each_entry, const Again& again) {
  constexpr int start_shift = 64 - ComponentTables::start_window, skip_shift = 64 - ComponentTables::skip_window;
  constexpr std::int32_t least_with_long_code = ComponentTables::long_code - 64 * 65536;
  const std::array<std::size_t, lanes> begin = bit;
  // Of each lane, in one number: the block's bits (low half), and its coefficients - 64: negative while there are more.
  std::array<std::int32_t, lanes> done;
  for (std::size_t i = 0; i < lanes; ++i) {
    const std::uint64_t bits = bits_at(bytes, begin[i]);
    const std::size_t index = bits >> start_shift;
    const std::uint32_t start = tables.start[index];
    *difference[i] = static_cast<std::int16_t>(coded_value(bits << (start >> 16 & 63), start >> 24));
    done[i] = (static_cast<std::int32_t>(start >> 8 & 255) - 64) * 65536 + static_cast<std::int32_t>(start & 255);
    each_entry(i, tables.start_amplitude[index], done[i]);
  }
  const auto of_any = [&]() __attribute__((always_inline)) {
    std::int32_t all = 0;
    for (const std::int32_t d : done) all |= d;
    return all;
  };
  for (;;) {
    while (of_any() < 0) {
      for (std::size_t i = 0; i < lanes; ++i) {
        const std::uint64_t bits = bits_at(bytes, begin[i] + static_cast<std::uint16_t>(done[i]));
        const auto add = [&](std::size_t index) __attribute__((always_inline)) {
          const auto open = static_cast<std::uint32_t>(done[i] >> 31);  // 0 if the block is complete
          const std::uint32_t entry = tables.skip[index] & open;
          done[i] += static_cast<std::int32_t>(entry);
          each_entry(i, tables.skip_amplitude[index] & open, done[i]);
          return entry;
        };
        const std::uint32_t first = add(bits >> skip_shift);
        add(bits << (first & 63) >> skip_shift);
      }
    }
    if (of_any() < least_with_long_code) [[likely]]
      break;
    for (std::size_t i = 0; i < lanes; ++i)
      if (done[i] >= least_with_long_code) {
        const Entry entry = long_code_at(bytes, tables, begin[i], done[i]);
        done[i] = entry.done;
        each_entry(i, entry.amplitude, entry.done);
      }
  }
  for (std::size_t i = 0; i < lanes; ++i) {
    bit[i] = begin[i] + static_cast<std::uint16_t>(done[i]);
    if (is_block_complete(static_cast<unsigned>((done[i] >> 16) + 64))) [[likely]]
      continue;
    bit[i] = begin[i];
    again(i);
  }
}

template <std::size_t lanes>
[[gnu::always_inline]] inline void skip_while_all(const std::uint8_t* bytes,
                                                  std::span<const ComponentTables* const> tables, std::size_t luma,
                                                  std::span<McuLane*> all) {
  std::array<std::size_t, lanes> bit, stop;
  std::array<std::int16_t*, lanes> difference;
  std::array<McuBegin*, lanes> position;
  std::size_t most = all[0]->left;
  for (std::size_t i = 0; i < lanes; ++i) {
    bit[i] = all[i]->bit;
    stop[i] = all[i]->stop;
    difference[i] = all[i]->differences;
    position[i] = all[i]->positions;
    most = std::min(most, all[i]->left);
  }
  std::size_t n = 0;
  for (bool is_end = false; n < most && !is_end; ++n) {
    for (std::size_t i = 0; i < lanes; ++i) position[i]->bit = static_cast<std::uint32_t>(bit[i]);
    const auto skip_blocks = [&](std::span<const ComponentTables* const> some) __attribute__((always_inline)) {
      for (const ComponentTables* const of_block : some) {
        skip_block<lanes>(
            bytes, *of_block, bit, difference, [](std::size_t, unsigned, std::int32_t) __attribute__((always_inline)){},
            [&](std::size_t i) __attribute__((always_inline)) {
              if (skip_symbols(bytes, *of_block, bit[i], *difference[i], nullptr, nullptr)) return;
              position[i]->bit |= McuBegin::not_decodable;
              ++bit[i];
            });
        for (auto& d : difference) ++d;
      }
    };
    skip_blocks(tables.first(luma));
    for (std::size_t i = 0; i < lanes; ++i) position[i]->chroma = static_cast<std::uint32_t>(bit[i]);
    skip_blocks(tables.subspan(luma));
    for (std::size_t i = 0; i < lanes; ++i) {
      ++position[i];
      is_end |= bit[i] >= stop[i];
    }
  }
  for (std::size_t i = 0; i < lanes; ++i) {
    all[i]->bit = bit[i];
    all[i]->left -= n;
    all[i]->differences = difference[i];
    all[i]->positions = position[i];
  }
}

template <std::size_t lanes>
[[gnu::always_inline]] inline void skip_open(const std::uint8_t* bytes, std::span<const ComponentTables* const> tables,
                                             std::size_t luma, std::span<McuLane*> open) {
  if constexpr (lanes > 1)
    if (open.size() < lanes) return skip_open<lanes - 1>(bytes, tables, luma, open);
  skip_while_all<lanes>(bytes, tables, luma, open);
}

[[gnu::always_inline]] inline void skip(const std::uint8_t* bytes, std::span<const ComponentTables* const> tables,
                                        std::size_t luma, std::span<McuLane> lanes) {
  std::array<McuLane*, most_mcu_lanes> open;
  for (;;) {
    std::size_t n = 0;
    for (McuLane& lane : lanes)
      if (!lane.is_at_end()) open[n++] = &lane;
    if (n == 0) return;
    skip_open<most_mcu_lanes>(bytes, tables, luma, std::span(open).first(n));
  }
}

// The AC coefficients, times their steps. Returns a number of 0 if there are none, of < 8 if they are in the first row.
[[gnu::always_inline]] inline unsigned decode_coefficients(BitReader& reader, const ComponentTables& tables,
                                                           const std::int16_t* steps, JpegBlock& block) {
  unsigned used = 0, done = 1;
  // False: the block is complete. A code in the window takes 25 bits at most, another 31.
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

// Transforms blocks two by two, the short cuts alone.
class Blocks {
 public:
  JpegBlock& next() { return blocks_[waiting_] = {}; }
  // `used`: see decode_coefficients(), of the block that next() returned.
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

[[gnu::always_inline]] inline void decode(const std::uint8_t* bytes, std::span<const McuBegin> positions,
                                          std::span<const DecodedBlock> blocks) {
  Blocks transformed;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    BitReader reader(bytes, positions[i].bit);
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

template <std::size_t lanes>
[[gnu::always_inline]] inline void find_swings_of(const std::uint8_t* bytes, const std::uint32_t* bits,
                                                  std::span<const BoundedBlock> blocks, std::uint64_t* out) {
  std::array<std::size_t, lanes> bit;
  std::array<std::int16_t, lanes> differences;  // not used
  std::array<std::int16_t*, lanes> difference;
  for (std::size_t i = 0; i < lanes; ++i) bit[i] = bits[i], difference[i] = &differences[i];
  for (const BoundedBlock& block : blocks) {
    std::array<std::uint64_t, lanes> swing{};
    skip_block<lanes>(
        bytes, *block.tables, bit, difference,
        [&](std::size_t i, unsigned amplitude, std::int32_t done)
            __attribute__((always_inline)) { swing[i] += std::uint64_t{(*block.swings)[done >> 16 & 63]} * amplitude; },
        [&](std::size_t i) __attribute__((always_inline)) {
          swing[i] = 0;
          skip_symbols(bytes, *block.tables, bit[i], differences[i], block.swings, &swing[i]);
        });
    for (std::size_t i = 0; i < lanes; ++i) out[i * blocks.size()] = swing[i];
    ++out;
  }
}

[[gnu::always_inline]] inline void find_all_swings(const std::uint8_t* bytes, std::span<const std::uint32_t> bits,
                                                   std::span<const BoundedBlock> blocks, std::uint64_t* out) {
  constexpr std::size_t lanes = 4;
  std::size_t i = 0;
  for (; i + lanes <= bits.size(); i += lanes) find_swings_of<lanes>(bytes, &bits[i], blocks, out + i * blocks.size());
  for (; i < bits.size(); ++i) find_swings_of<1>(bytes, &bits[i], blocks, out + i * blocks.size());
}

#ifdef HUETRACK_BMI2
HUETRACK_BMI2 void find_swings_with_bmi2(const std::uint8_t* bytes, std::span<const std::uint32_t> bits,
                                         std::span<const BoundedBlock> blocks, std::uint64_t* out) {
  find_all_swings(bytes, bits, blocks, out);
}
HUETRACK_BMI2 void skip_with_bmi2(const std::uint8_t* bytes, std::span<const ComponentTables* const> tables,
                                  std::size_t luma, std::span<McuLane> lanes) {
  skip(bytes, tables, luma, lanes);
}
HUETRACK_BMI2 void decode_with_bmi2(const std::uint8_t* bytes, std::span<const McuBegin> positions,
                                    std::span<const DecodedBlock> blocks) {
  decode(bytes, positions, blocks);
}
bool has_bmi2() {
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2");
  return has;
}
#endif

}  // namespace

void skip_mcus(const std::uint8_t* bytes, std::span<const ComponentTables* const> tables, std::size_t luma,
               std::span<McuLane> lanes) {
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return skip_with_bmi2(bytes, tables, luma, lanes);
#endif
  skip(bytes, tables, luma, lanes);
}

void decode_mcus(const std::uint8_t* bytes, std::span<const McuBegin> positions, std::span<const DecodedBlock> blocks) {
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return decode_with_bmi2(bytes, positions, blocks);
#endif
  decode(bytes, positions, blocks);
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
      most = std::max(most, static_cast<std::uint32_t>(64 * largest[place / 8] * largest[place % 8] * steps[k]) + 1);
    out[(k + 1) % 64] = most;
  }
  return out;
}

void find_swings(const std::uint8_t* bytes, std::span<const std::uint32_t> bits, std::span<const BoundedBlock> blocks,
                 std::uint64_t* out) {
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return find_swings_with_bmi2(bytes, bits, blocks, out);
#endif
  find_all_swings(bytes, bits, blocks, out);
}

}  // namespace huetrack::capture
