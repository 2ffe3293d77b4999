// The loops over the bits of MCUs: to skip them, and to decode them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "capture/jpeg/huffman_tables.h"

namespace huetrack::capture {

// One block of an MCU, in the order of the scan.
struct McuBlock {
  const ComponentTables* tables = nullptr;
  std::size_t component = 0;
  std::int16_t* dc = nullptr;  // the DC value of this block in the next MCU
  std::ptrdiff_t step = 0;     // to that of the MCU after it
};

struct McuBits {
  const std::uint8_t* bytes = nullptr;  // EntropyBytes: padded
  const std::uint8_t* limit = nullptr;  // of the position: behind the last byte, padding not counted
  std::size_t bit = 0;                  // where the next MCU begins
};

// Skips `positions.size()` MCUs from bits.bit on, which it advances: stores where each MCU begins (in bits) and the
// quantised DC value of each block, modulo 2^16. `dc` is the last value of each component. False: no codes, or blocks
// of more than 64 coefficients. The bits that are skipped may lie beyond the interval: the caller compares.
bool skip_mcus(McuBits& bits, std::span<McuBlock> blocks, std::span<std::uint32_t> positions,
               std::array<std::int64_t, 3>& dc);

// A block's place in the image's planes.
struct DecodedBlock {
  const ComponentTables* tables = nullptr;
  const std::int16_t* steps = nullptr;  // in zigzag order
  const std::int16_t* dc = nullptr;     // as McuBlock's
  std::ptrdiff_t step = 0;
  std::uint8_t* pixels = nullptr;  // of this block in the first MCU
  std::ptrdiff_t stride = 0;
  std::ptrdiff_t pixel_step = 0;  // to the next MCU's
};

// Decodes as many MCUs as there are positions; skip_mcus() has accepted them.
void decode_mcus(const std::uint8_t* bytes, std::span<const std::uint32_t> positions,
                 std::span<const DecodedBlock> blocks);

}  // namespace huetrack::capture
