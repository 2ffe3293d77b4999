// Lossless compression of image rows: a sample rarely differs much from the one above it. It makes the pixels around an
// object, as a camera host sends them, fit into one network packet, which wakes the tracker once.
//
// Each sample is coded as its difference from the one above it (in the first row, from 128), modulo 256, zigzag: 0, -1,
// 1, -2, ... are 0, 1, 2, 3, ... The largest of eight such numbers sets their width, 0 to 8 bits; the eight follow in
// as many bytes, the first number in the lowest bits. A byte before each two groups of eight has the widths: the low
// half that of the first group, the high half that of the second. Zeros fill up the last pair.
//
// Pure; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace huetrack::capture {

inline constexpr std::size_t most_samples_per_byte = 16;

// samples: rows of per_row > 0 samples, one after the other. Appends to `out`.
void put_samples(std::span<const std::uint8_t> samples, std::size_t per_row, std::vector<std::uint8_t>& out);

// The reverse: fills `samples` and removes what it read from the front of `coded`. False: too few bytes, or invalid
// ones; the content of both is then undefined.
bool take_samples(std::span<const std::uint8_t>& coded, std::size_t per_row, std::span<std::uint8_t> samples);

}  // namespace huetrack::capture
