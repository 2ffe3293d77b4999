#include "recordings/mpeg4_clock.h"

#include <algorithm>
#include <array>
#include <bit>

namespace huetrack::recordings {
namespace {

// The four bytes behind a start code, the first one of its kind.
std::optional<std::uint32_t> behind(std::span<const std::uint8_t> packet, std::uint8_t kind) {
  const std::array<std::uint8_t, 4> start_code{0, 0, 1, kind};
  const auto found = std::ranges::search(packet, start_code);
  if (packet.end() - found.end() < 4) return std::nullopt;
  std::uint32_t bytes = 0;
  for (int k = 0; k < 4; ++k) bytes = bytes << 8 | found.end()[k];
  return bytes;
}

// How many bits the time of the first picture of a packet has, if it is at a full second, and its group's. ISO/IEC
// 14496-2, 6.2.5: 2 bits of its kind, a 1 for every second that has passed and a 0, a marker (1), the time within its
// second in a length that the stream has once, a marker. 0: it is another time, or there is no picture.
int bits_of_time_0(std::span<const std::uint8_t> packet) {
  const std::uint32_t bits = behind(packet, 0xB6).value_or(0) << 2;
  const bool is_second_0 = bits >> 30 == 0b01;
  return is_second_0 ? std::countl_zero(bits << 2) : 0;
}

// Hours, minutes and a marker, seconds (6.2.4), from which a group's pictures count, if there is a group.
std::uint32_t time_of_group(std::span<const std::uint8_t> packet) {
  return behind(packet, 0xB3).value_or(0) >> 14;
}

}  // namespace

bool Mpeg4Clock::begins_again(std::span<const std::uint8_t> packet) {
  const Time time{bits_of_time_0(packet), time_of_group(packet)};
  if (first_) return time.bits > 0 && time == *first_;
  first_ = time;
  return false;
}

}  // namespace huetrack::recordings
