// Rows of samples in fewer bytes, none of them changed: a sample is hardly other than the one above it. What a camera
// host sends of the pixels around an object fits into one network packet so, and with it into one waking of who tracks.
//
// Each sample is told as its difference from the one above it (of the first row, from 128), modulo 256, signs folded:
// 0, -1, 1, -2, ... are 0, 1, 2, 3, ... Of eight such numbers the largest has so many bits, 0 to 8; each is told in
// these, the first in the lowest of as many bytes. Two eights share a byte before them: its low half says the bits of
// the first, its high half those of the second. After the last number zeros fill a pair up.
//
// Pure; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace huetrack::capture {

inline constexpr std::size_t most_samples_per_byte = 16;

// samples: rows of per_row > 0, one after the other. Appends to `out`.
void put_samples(std::span<const std::uint8_t> samples, std::size_t per_row, std::vector<std::uint8_t>& out);

// The reverse: as many as `samples` has, which are taken off the front of `coded`. False: it has too few bytes, or
// makes no sense; what is in both then says nothing.
bool take_samples(std::span<const std::uint8_t>& coded, std::size_t per_row, std::span<std::uint8_t> samples);

}  // namespace huetrack::capture
