#include "publish/ros_messages.h"

#include <gtest/gtest.h>

#include "publish/known_samples.h"

namespace huetrack::publish {
namespace {

using namespace testing;

TEST(RosMessages, PoseHasPositionItsCovarianceAndAnUnknownOrientation) {
  geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ pose;
  const object_tracking::ObjectEstimate estimate = known_estimate(object_tracking::TrackState::tracking);
  to_ros(estimate, captured_at(object_tracking::TrackState::tracking), "world", pose);
  EXPECT_EQ(pose.header().stamp().sec(), 1'700'000'000);
  EXPECT_EQ(pose.header().stamp().nanosec(), 223'456'789U);
  EXPECT_EQ(pose.header().frame_id(), "world");
  EXPECT_EQ(pose.pose().pose().position().x(), 1.125);
  EXPECT_EQ(pose.pose().pose().position().y(), -1.5);
  EXPECT_EQ(pose.pose().pose().position().z(), 2.1);
  EXPECT_EQ(pose.pose().pose().orientation().x(), 0);
  EXPECT_EQ(pose.pose().pose().orientation().w(), 1);
  for (int row = 0; row < 6; ++row)
    for (int col = 0; col < 6; ++col) {
      const double expected = row < 3 && col < 3 ? estimate.covariance(row, col) : row == col ? 1e6 : 0;
      EXPECT_EQ(pose.pose().covariance()[static_cast<std::size_t>(6 * row + col)], expected) << row << ' ' << col;
    }
}

TEST(RosMessages, StampBefore1970IsStillNormalised) {
  geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ pose;
  to_ros(known_estimate(object_tracking::TrackState::tracking), capture::Timestamp(std::chrono::nanoseconds(-1)),
         "world", pose);
  EXPECT_EQ(pose.header().stamp().sec(), -1);
  EXPECT_EQ(pose.header().stamp().nanosec(), 999'999'999U);
}

TEST(RosMessages, TransformIsFromWorldToTheTarget) {
  tf2_msgs::msg::dds_::TFMessage_ tf;
  for (int twice = 0; twice < 2; ++twice)  // the message is reused
    to_ros(known_estimate(object_tracking::TrackState::coasting), captured_at(object_tracking::TrackState::coasting),
           "map", "ball", tf);
  ASSERT_EQ(tf.transforms().size(), 1U);
  const auto& transform = tf.transforms()[0];
  EXPECT_EQ(transform.header().frame_id(), "map");
  EXPECT_EQ(transform.child_frame_id(), "ball");
  EXPECT_EQ(transform.transform().translation().x(), 2.125);
  EXPECT_EQ(transform.transform().translation().y(), -1.5);
  EXPECT_EQ(transform.transform().translation().z(), 2.1);
  EXPECT_EQ(transform.transform().rotation().w(), 1);
}

}  // namespace
}  // namespace huetrack::publish
