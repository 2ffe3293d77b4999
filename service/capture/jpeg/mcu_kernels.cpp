#include "capture/jpeg/mcu_kernels.h"

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

// What is left of a block, symbol by symbol.
[[gnu::noinline]] bool skip_symbols(BitReader& reader, const CanonicalCode& code, unsigned done) {
  while (done < 64) {
    reader.refill();
    const HuffmanSymbol symbol = code.symbol(reader.next(16));
    if (symbol.bits == 0) return false;
    const unsigned bits = symbol.value & 15, zeros = symbol.value >> 4;
    reader.take(symbol.bits + bits);
    if (bits == 0 && zeros != 15) return true;
    done += zeros + 1;
  }
  return done == 64;  // more: libjpeg writes them all to the last coefficient
}

[[gnu::noinline]] bool skip_symbols_from_dc(BitReader& reader, const ComponentTables& tables, int& difference) {
  const HuffmanSymbol symbol = tables.dc_code.symbol(reader.next(16));
  if (symbol.bits == 0) return false;
  reader.take(symbol.bits);
  difference = coded_value(reader.bits(), symbol.value);
  reader.take(symbol.value);
  return skip_symbols(reader, tables.ac_code, 1);
}

[[gnu::always_inline]] inline bool skip_block(BitReader& reader, const ComponentTables& tables, int& difference) {
  reader.refill();
  const std::uint32_t start = tables.start[reader.next(ComponentTables::start_window)];
  unsigned done = start >> 8 & 255;
  difference = coded_value(reader.bits() << (start >> 16 & 63), start >> 24);
  if (done >= 64) {
    if (!is_block_complete(done)) return skip_symbols_from_dc(reader, tables, difference);
    reader.take(start & 63);
    return true;
  }
  reader.take(start & 63);  // at most 26 bits; those of `skip` are at most 27
  std::uint32_t entry = tables.skip[reader.next(ComponentTables::skip_window)];
  unsigned next = done + (entry >> 8);
  while (next < 64) {
    reader.take(entry & 63);
    done = next;
    reader.refill();
    entry = tables.skip[reader.next(ComponentTables::skip_window)];
    next = done + (entry >> 8);
    if (next >= 64) break;
    reader.take(entry & 63);
    done = next;
    entry = tables.skip[reader.next(ComponentTables::skip_window)];
    next = done + (entry >> 8);
  }
  if (!is_block_complete(next)) return skip_symbols(reader, tables.ac_code, done);
  reader.take(entry & 63);
  return true;
}

[[gnu::always_inline]] inline bool skip(McuBits& bits, std::span<McuBlock> blocks, std::span<std::uint32_t> positions,
                                        std::array<std::int64_t, 3>& dc) {
  BitReader reader(bits.bytes, bits.bit);
  for (std::uint32_t& position : positions) {
    position = static_cast<std::uint32_t>(reader.bit_after(bits.bytes));
    for (McuBlock& block : blocks) {
      int difference = 0;
      if (!skip_block(reader, *block.tables, difference)) return false;
      dc[block.component] += difference;
      *block.dc = static_cast<std::int16_t>(dc[block.component]);
      block.dc += block.step;
    }
    if (reader.position() > bits.limit + 8) return false;
  }
  bits.bit = reader.bit_after(bits.bytes);
  return true;
}

// The AC coefficients, times their steps. Returns a number of 0 if there are none, of < 8 if they are in the first row.
[[gnu::always_inline]] inline unsigned decode_coefficients(BitReader& reader, const ComponentTables& tables,
                                                           const std::int16_t* steps, JpegBlock& block) {
  unsigned used = 0;
  for (unsigned done = 1; done < 64;) {
    reader.refill();
    std::uint32_t entry = tables.symbol[reader.next(ComponentTables::symbol_window)];
    if (entry == 0) entry = ac_symbol_entry(tables.ac_code.symbol(reader.next(16)));
    const std::uint64_t bits = reader.bits() << (entry >> 8 & 63);
    const unsigned size = entry >> 24;
    reader.take(entry & 63);
    done += entry >> 16 & 255;
    if (done > 64) break;
    const std::size_t place = row_order[done - 1];
    block.coefficients[place] = static_cast<std::int16_t>(coded_value(bits, size) * steps[done - 1]);
    used |= size > 0 ? static_cast<unsigned>(place) : 0;
  }
  return used;
}

[[gnu::always_inline]] inline void decode(const std::uint8_t* bytes, std::span<const std::uint32_t> positions,
                                          std::span<const DecodedBlock> blocks) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    BitReader reader(bytes, positions[i]);
    const auto mcu = static_cast<std::ptrdiff_t>(i);
    for (const DecodedBlock& b : blocks) {
      reader.refill();
      const std::uint32_t start = b.tables->start[reader.next(ComponentTables::start_window)] >> 16;
      const HuffmanSymbol dc = start == 0 ? b.tables->dc_code.symbol(reader.next(16)) : HuffmanSymbol{};
      reader.take(start == 0 ? dc.bits + dc.value : (start & 255) + (start >> 8));
      JpegBlock block;
      block.coefficients[0] = static_cast<std::int16_t>(b.dc[mcu * b.step] * b.steps[0]);
      const unsigned used = decode_coefficients(reader, *b.tables, b.steps, block);
      std::uint8_t* pixels = b.pixels + mcu * b.pixel_step;
      if (used == 0) {
        const std::uint8_t mean = jpeg_mean(block.coefficients[0]);
        for (int v = 0; v < 8; ++v) std::memset(pixels + v * b.stride, mean, 8);
      } else {
        inverse_transform(block, used < 8, pixels, b.stride);
      }
    }
  }
}

#ifdef HUETRACK_BMI2
HUETRACK_BMI2 bool skip_with_bmi2(McuBits& bits, std::span<McuBlock> blocks, std::span<std::uint32_t> positions,
                                  std::array<std::int64_t, 3>& dc) {
  return skip(bits, blocks, positions, dc);
}
HUETRACK_BMI2 void decode_with_bmi2(const std::uint8_t* bytes, std::span<const std::uint32_t> positions,
                                    std::span<const DecodedBlock> blocks) {
  decode(bytes, positions, blocks);
}
bool has_bmi2() {
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2");
  return has;
}
#endif

}  // namespace

bool skip_mcus(McuBits& bits, std::span<McuBlock> blocks, std::span<std::uint32_t> positions,
               std::array<std::int64_t, 3>& dc) {
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return skip_with_bmi2(bits, blocks, positions, dc);
#endif
  return skip(bits, blocks, positions, dc);
}

void decode_mcus(const std::uint8_t* bytes, std::span<const std::uint32_t> positions,
                 std::span<const DecodedBlock> blocks) {
#ifdef HUETRACK_BMI2
  if (has_bmi2()) return decode_with_bmi2(bytes, positions, blocks);
#endif
  decode(bytes, positions, blocks);
}

}  // namespace huetrack::capture
