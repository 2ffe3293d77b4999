// Samples of 16 bits of which a camera fills only the lower ones: 12 bits, stored as 0 to 4095, are nearly black.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace huetrack::capture {

struct SampleRows {  // of a plane
  std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;  // bytes
  std::size_t samples = 0;    // in a row
  int rows = 0;
  std::endian order = std::endian::native;
  std::size_t alpha_every = 0;  // samples, of which the last one is opacity; 0: none is
};

// What is known of a film's samples; decided at its first picture. thread-compatible.
class SampleDepth {
 public:
  void state(int bits) { stated_bits_ = bits; }  // by the user: 1 to 16; 0: not stated
  void tag(int bits) { tagged_bits_ = bits; }    // by the file; 0: not tagged. Tagged bits may be the upper ones.
  // Shifts the samples of a picture to the upper bits.
  void fit(std::span<const SampleRows> planes);
  // The largest sample of the first picture, if its two upper bits are empty and nothing explains that.
  std::optional<int> unexplained_largest() const { return unexplained_largest_; }

 private:
  int shift_for(int largest);

  int stated_bits_ = 0, tagged_bits_ = 0;
  std::optional<int> shift_;  // of all pictures
  std::optional<int> unexplained_largest_;
};

}  // namespace huetrack::capture
