#include "huetrack/osc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "client/osc_reader.h"

namespace huetrack::client {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatEq;

msg::ObjectPosition ball() {
  msg::ObjectPosition s;
  s.target("ball 1/x");
  s.captured_at(1'500'000'000);  // 1.5 s after 1970
  s.state(msg::TRACK_STATE_TRACKING);
  s.position({0.5, -1.25, 2});
  s.velocity({1, 2.5, -3});
  s.covariance({1e-6, 0, 0, 0, 4e-6, 0, 0, 0, 9e-6});
  return s;
}

TEST(Osc, PositionIsABundleOfFourMessages) {
  const OscBundle bundle = read_osc(osc_bundle(ball()));
  EXPECT_EQ(bundle.time_tag >> 32U, 2'208'988'801U);      // the specification's example: 1970 is 2208988800
  EXPECT_EQ(bundle.time_tag & 0xffffffffU, 0x80000000U);  // half a second
  ASSERT_EQ(bundle.messages.size(), 4U);
  EXPECT_EQ(bundle.messages[0].address, "/huetrack/ball_1_x/state");
  EXPECT_EQ(bundle.messages[0].tags, ",s");
  EXPECT_EQ(bundle.messages[0].text, "tracking");
  EXPECT_EQ(bundle.messages[1].address, "/huetrack/ball_1_x/position");
  EXPECT_EQ(bundle.messages[1].tags, ",fff");
  EXPECT_THAT(bundle.messages[1].values, ElementsAre(0.5F, -1.25F, 2.0F));
  EXPECT_THAT(bundle.messages[2].values, ElementsAre(1.0F, 2.5F, -3.0F));
  EXPECT_THAT(bundle.messages[3].values, ElementsAre(FloatEq(1e-3F), FloatEq(2e-3F), FloatEq(3e-3F)));
}

TEST(Osc, WithoutAPositionOnlyTheState) {
  msg::ObjectPosition lost = ball();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  lost.state(msg::TRACK_STATE_LOST);
  lost.position({nan, nan, nan});
  const OscBundle bundle = read_osc(osc_bundle(lost));
  ASSERT_EQ(bundle.messages.size(), 1U);
  EXPECT_EQ(bundle.messages[0].text, "lost");
}

// Byte by byte, as the specification has it: no reader of ours in between.
TEST(Osc, EncodesMessages) {
  msg::ObjectPosition lost = ball();
  lost.target("a");
  lost.state(msg::TRACK_STATE_LOST);
  lost.position({std::numeric_limits<double>::infinity(), 0, 0});
  lost.captured_at(0);
  using namespace std::string_literals;
  EXPECT_EQ(osc_bundle(lost),
            "#bundle\0\x83\xaa\x7e\x80\0\0\0\0\0\0\0\x20"s  // a size of 32
            "/huetrack/a/state\0\0\0,s\0\0lost\0\0\0\0"s);
}

TEST(Osc, CameraBundleHasAnOrientation) {
  msg::CameraPose pose;
  pose.camera("cam0");
  pose.state(msg::CAMERA_STATE_TRACKING);
  pose.position({1, 2, 3});
  pose.orientation({0, 0, 0, 1});
  const OscBundle bundle = read_osc(osc_bundle(pose));
  ASSERT_EQ(bundle.messages.size(), 4U);
  EXPECT_EQ(bundle.messages[2].address, "/huetrack/camera/cam0/orientation");
  EXPECT_THAT(bundle.messages[2].values, ElementsAre(0, 0, 0, 1));
}

}  // namespace
}  // namespace huetrack::client
