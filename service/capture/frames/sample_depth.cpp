#include "capture/frames/sample_depth.h"

#include <algorithm>

namespace huetrack::capture {
namespace {

constexpr int all_bits = 16, all = (1 << all_bits) - 1;
// Two empty bits: a picture that no camera makes with a usual exposure; sensors have 10, 12 or 14 bits.
constexpr int usual_bits = 14;

template <typename Change>
void for_each_sample(const SampleRows& plane, Change change) {
  const std::size_t low = plane.order == std::endian::little ? 0 : 1;
  for (int row = 0; row < plane.rows; ++row) {
    std::uint8_t* at = plane.data + row * plane.stride;
    for (std::size_t i = 1; i <= plane.samples; ++i, at += 2)
      if (plane.alpha_every == 0 || i % plane.alpha_every != 0) change(at[low], at[1 - low]);
  }
}

int largest_of(std::span<const SampleRows> planes) {
  int largest = 0;
  for (const SampleRows& plane : planes)
    for_each_sample(plane, [&](std::uint8_t low, std::uint8_t high) { largest = std::max(largest, high << 8 | low); });
  return largest;
}

}  // namespace

int SampleDepth::shift_for(int largest) {
  if (stated_bits_ > 0) return all_bits - stated_bits_;
  const auto fits = [&](int bits) { return largest < 1 << bits; };
  if (tagged_bits_ > 0 && fits(tagged_bits_)) return all_bits - tagged_bits_;
  if (largest > 0 && fits(usual_bits)) unexplained_largest_ = largest;
  return 0;
}

void SampleDepth::fit(std::span<const SampleRows> planes) {
  if (!shift_) shift_ = shift_for(largest_of(planes));
  if (*shift_ == 0) return;
  for (const SampleRows& plane : planes)
    for_each_sample(plane, [&](std::uint8_t& low, std::uint8_t& high) {
      const int sample = std::min((high << 8 | low) << *shift_, all);
      low = static_cast<std::uint8_t>(sample & 0xff), high = static_cast<std::uint8_t>(sample >> 8);
    });
}

}  // namespace huetrack::capture
