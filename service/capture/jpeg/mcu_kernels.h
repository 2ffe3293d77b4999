// The loops over the bits of MCUs: to skip them, and to decode them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "capture/jpeg/huffman_tables.h"

namespace huetrack::capture {

// For each n: the largest deviation of a sample from its block's mean that a coefficient of 1 causes, over the AC
// coefficients before the n-th in zigzag order (the DC coefficient is the 0th; 64 is stored in [0]). 1/64 grey values,
// rounded up.
using Swings = std::array<std::uint32_t, 64>;
Swings swings_of(const std::int16_t* steps);

struct SkippedBlock {
  std::size_t component = 0;
  const ComponentTables* tables = nullptr;
  const Swings* swings = nullptr;
};
// The blocks of an MCU, component by component.
struct McuBlocks {
  std::span<const SkippedBlock> all;
  std::size_t luma = 0;  // the first so many are of the first component
};

// Added to the begin of an MCU with an unknown code or more than 64 coefficients.
constexpr std::uint32_t not_decodable = std::uint32_t{1} << 31;
constexpr bool is_decodable(std::uint32_t begin) {
  return (begin & not_decodable) == 0;
}

// Where the properties of skipped MCUs are written, MCU by MCU.
struct SkippedMcus {
  std::uint32_t* begins = nullptr;         // its first bit
  std::uint32_t* chroma_begins = nullptr;  // the first bit of its first block of chroma
  std::int16_t* differences = nullptr;     // of each block: the DC coefficient's difference to the preceding one
  // Of each block: a bound of its samples' deviation from its mean, 1/64 grey values, at most 65535. nullptr in all
  // lanes: not computed.
  std::uint16_t* swings = nullptr;

  // Copies MCUs and advances behind them.
  void append(const SkippedMcus& from, std::size_t mcus, std::size_t blocks);
};

// Consecutive MCUs that are skipped.
struct McuLane {
  std::size_t bit = 0;   // where the next MCU begins
  std::size_t stop = 0;  // skips no MCU that begins at this bit or later
  std::size_t left = 0;  // skips at most so many MCUs
  SkippedMcus next;

  bool is_at_end() const { return bit >= stop || left == 0; }
};
constexpr std::size_t most_mcu_lanes = 6;

// Skips the MCUs of up to most_mcu_lanes lanes, until all are at their end. Lanes are interleaved, so that the latency
// of one lane's table look-ups is hidden behind the others. Behind an MCU that is not decodable the content of its lane
// is arbitrary. May read EntropyBytes::padding bytes behind `stop`.
void skip_mcus(const std::uint8_t* bytes, const McuBlocks& blocks, std::span<McuLane> lanes);

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

// Decodes these blocks of as many MCUs as there are `begins`: the bits of the first of these blocks. skip_mcus() has
// accepted the MCUs.
void decode_mcus(const std::uint8_t* bytes, std::span<const std::uint32_t> begins,
                 std::span<const DecodedBlock> blocks);

}  // namespace huetrack::capture
