// The loops over the bits of MCUs: to skip them, and to decode them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "capture/jpeg/huffman_tables.h"

namespace huetrack::capture {

// The bit where an MCU begins, and where its first block of chroma does.
struct McuBegin {
  std::uint32_t bit = 0, chroma = 0;

  static constexpr std::uint32_t not_decodable = std::uint32_t{1} << 31;  // added to `bit`
  bool is_decodable() const { return (bit & not_decodable) == 0; }
};

// Some MCUs that follow one another, whose bits are skipped.
struct McuLane {
  std::size_t bit = 0;                  // where the next MCU begins
  std::size_t stop = 0;                 // skips no MCU that begins at this bit or later
  std::size_t left = 0;                 // nor more MCUs than these
  McuBegin* positions = nullptr;        // of the next MCU
  std::int16_t* differences = nullptr;  // of the next MCU: each block's difference to the last DC value

  bool is_at_end() const { return bit >= stop || left == 0; }
};
constexpr std::size_t most_mcu_lanes = 6;

// Skips the MCUs of up to most_mcu_lanes lanes, until all are at their end. Independent lanes take turns, which hides
// the time that each waits for its tables. An MCU that is not decodable (no codes, or more than 64 coefficients) is
// stored as such, and what follows is arbitrary. May read EntropyBytes::padding behind `stop`. tables: of the blocks of
// an MCU, of which the first `luma` are of the first component.
void skip_mcus(const std::uint8_t* bytes, std::span<const ComponentTables* const> tables, std::size_t luma,
               std::span<McuLane> lanes);

// A block's place in the image's planes.
struct DecodedBlock {
  const ComponentTables* tables = nullptr;
  const std::int16_t* steps = nullptr;  // in zigzag order
  const std::int16_t* dc = nullptr;     // in the first MCU
  std::ptrdiff_t dc_step = 0;           // to the next MCU's
  std::uint8_t* pixels = nullptr;       // of this block in the first MCU
  std::ptrdiff_t stride = 0;
  std::ptrdiff_t pixel_step = 0;  // to the next MCU's
};

// Decodes as many MCUs as there are positions; skip_mcus() has accepted them.
void decode_mcus(const std::uint8_t* bytes, std::span<const McuBegin> positions, std::span<const DecodedBlock> blocks);

// How far a coefficient of 1, times its step, takes a sample from the block's mean at most, 1/64 grey values, rounded
// up: of all AC coefficients up to the n-th in zigzag order (the DC coefficient is the first one), in [n % 64].
using Swings = std::array<std::uint32_t, 64>;
Swings swings_of(const std::int16_t* steps);

// A block whose samples' range is computed.
struct BoundedBlock {
  const ComponentTables* tables = nullptr;
  const Swings* swings = nullptr;
};
// A bound of how far a block's samples are from its mean, 1/64 grey values: of the blocks from each of these bits on,
// which skip_mcus() has accepted.
void find_swings(const std::uint8_t* bytes, std::span<const std::uint32_t> bits, std::span<const BoundedBlock> blocks,
                 std::uint64_t* out);

}  // namespace huetrack::capture
