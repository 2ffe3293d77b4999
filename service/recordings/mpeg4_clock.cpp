#include "recordings/mpeg4_clock.h"

#include <algorithm>
#include <array>
#include <bit>

namespace huetrack::recordings {
namespace {

// How many bits the time of the first picture of a packet has, if it is 0. ISO/IEC 14496-2, 6.2.5: behind the start
// code 2 bits of its kind, a 1 for every second and a 0, a marker (1), the time within its second in a length that the
// stream has once, a marker. 0: it is another time, or there is no picture.
int bits_of_time_0(std::span<const std::uint8_t> packet) {
  static constexpr std::array<std::uint8_t, 4> start_code{0, 0, 1, 0xB6};
  const auto found = std::ranges::search(packet, start_code);
  if (packet.end() - found.end() < 4) return 0;
  std::uint32_t bits = 0;
  for (int k = 0; k < 4; ++k) bits = bits << 8 | found.end()[k];
  bits <<= 2;
  const bool is_second_0 = bits >> 30 == 0b01;
  return is_second_0 ? std::countl_zero(bits << 2) : 0;
}

}  // namespace

bool Mpeg4Clock::begins_again(std::span<const std::uint8_t> packet) {
  const int bits = bits_of_time_0(packet);
  if (zero_) return bits > 0 && bits == *zero_;
  zero_ = bits;
  return false;
}

}  // namespace huetrack::recordings
