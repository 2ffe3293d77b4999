// Headers of pictures as XviD and FFmpeg write them at 30 frames a second: 5 bits of time.
#include "recordings/mpeg4_clock.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace huetrack::recordings {
namespace {

// seconds: since the picture before, or since the group; frame: within the second. group: its seconds, or none
std::vector<std::uint8_t> key_picture(int seconds, unsigned frame, int group = -1) {
  std::vector<std::uint8_t> packet{0, 0, 1, 0x20, 0xFF};
  const auto add_bits = [&](const std::string& bits) {
    for (std::size_t at = 0; at < bits.size(); at += 8)
      packet.push_back(static_cast<std::uint8_t>(std::stoul((bits + "0000000").substr(at, 8), nullptr, 2)));
  };
  const auto binary = [](unsigned value, int digits) {
    std::string bits;
    while (digits-- > 0) bits += (value >> digits & 1) != 0 ? '1' : '0';
    return bits;
  };
  if (group >= 0) {
    packet.insert(packet.end(), {0, 0, 1, 0xB3});
    add_bits(binary(0, 5) + binary(0, 6) + "1" + binary(unsigned(group), 6) + "00" + std::string(12, '1'));
  }
  packet.insert(packet.end(), {0, 0, 1, 0xB6});
  add_bits("00" + std::string(std::size_t(seconds), '1') + "01" + binary(frame, 5) + "1100000010111100");
  return packet;
}

TEST(Mpeg4Clock, BeginsAgainAtTime0Only) {
  Mpeg4Clock clock;
  EXPECT_FALSE(clock.begins_again(key_picture(0, 0)));
  for (int k = 1; k < 90; ++k) EXPECT_FALSE(clock.begins_again(key_picture(k % 30 == 0 ? 1 : 0, k % 30))) << k;
  EXPECT_FALSE(clock.begins_again(std::vector<std::uint8_t>{0, 0, 1, 0xB6}));
  EXPECT_TRUE(clock.begins_again(key_picture(0, 0)));
  EXPECT_FALSE(clock.begins_again(key_picture(0, 12)));
}

// Then pictures count from their group's time.
TEST(Mpeg4Clock, GroupsHaveATime) {
  Mpeg4Clock clock;
  for (int second = 0; second < 60; ++second) EXPECT_FALSE(clock.begins_again(key_picture(0, 0, second))) << second;
  EXPECT_TRUE(clock.begins_again(key_picture(0, 0, 0)));
}

// A film that was cut does not begin at 0.
TEST(Mpeg4Clock, OfAnotherBeginningIsNotKnown) {
  Mpeg4Clock clock;
  EXPECT_FALSE(clock.begins_again(key_picture(0, 12)));
  EXPECT_FALSE(clock.begins_again(key_picture(0, 0)));
}

}  // namespace
}  // namespace huetrack::recordings
