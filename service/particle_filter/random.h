// Randomness is an argument: no global engine, no std::random_device. Same seed and stream: same numbers, on every
// machine and at every vector width.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace huetrack::particle_filter {

// 16 interleaved xoshiro128++ generators (Blackman and Vigna 2021), so that noise for a whole particle set is drawn at
// vector speed. thread-compatible. Several fills give the same numbers as one, if all but the last are of whole
// batches: a multiple of 16 for uniform numbers, of 256 for normal ones.
class Rng {
 public:
  // Each use has its own stream of the user's one seed, for example stream = index of the target.
  explicit Rng(std::uint64_t seed, std::uint64_t stream = 0);

  double uniform();                         // [0, 1)
  void fill_uniform(std::span<float> out);  // [0, 1)
  void fill_normal(std::span<float> out);   // N(0, 1), by Box-Muller; |z| < 6.7

 private:
  static constexpr std::size_t lanes = 16;
  using Block = std::array<std::uint32_t, lanes>;
  void advance(Block& out);

  std::array<Block, 4> state_;
};

}  // namespace huetrack::particle_filter
