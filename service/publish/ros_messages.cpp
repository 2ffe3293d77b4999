#include "publish/ros_messages.h"

#include <cassert>

namespace huetrack::publish {

namespace {

constexpr double unknown_orientation_variance = 1e6;  // rad^2

void fill(std_msgs::msg::dds_::Header_& header, capture::Timestamp captured, const std::string& frame_id) {
  const auto since_epoch = captured.time_since_epoch();
  const auto whole = std::chrono::floor<std::chrono::seconds>(since_epoch);
  header.stamp().sec(static_cast<std::int32_t>(whole.count()));
  header.stamp().nanosec(static_cast<std::uint32_t>((since_epoch - whole).count()));
  header.frame_id(frame_id);
}

template <typename Xyz>
void fill(Xyz& to, const Eigen::Vector3d& from) {
  to.x(from.x());
  to.y(from.y());
  to.z(from.z());
}

void fill_identity(geometry_msgs::msg::dds_::Quaternion_& q) {
  q.x(0);
  q.y(0);
  q.z(0);
  q.w(1);
}

void fill(geometry_msgs::msg::dds_::Quaternion_& to, const Eigen::Quaterniond& from) {
  to.x(from.x());
  to.y(from.y());
  to.z(from.z());
  to.w(from.w());
}

}  // namespace

void to_ros(const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            geometry_msgs::msg::dds_::PoseWithCovarianceStamped_& message) {
  assert(estimate.has_position());
  fill(message.header(), captured, frame_id);
  fill(message.pose().pose().position(), estimate.position);
  fill_identity(message.pose().pose().orientation());
  auto& covariance = message.pose().covariance();
  covariance.fill(0);
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col)
      covariance[static_cast<std::size_t>(6 * row + col)] = estimate.covariance(row, col);
    covariance[static_cast<std::size_t>(7 * (row + 3))] = unknown_orientation_variance;
  }
}

void to_ros(const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            const std::string& target, tf2_msgs::msg::dds_::TFMessage_& message) {
  assert(estimate.has_position());
  message.transforms().resize(1);
  auto& transform = message.transforms().front();
  fill(transform.header(), captured, frame_id);
  transform.child_frame_id(target);
  fill(transform.transform().translation(), estimate.position);
  fill_identity(transform.transform().rotation());
}

void to_ros(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            geometry_msgs::msg::dds_::PoseWithCovarianceStamped_& message) {
  assert(estimate.has_pose());
  fill(message.header(), captured, frame_id);
  fill(message.pose().pose().position(), estimate.world_from_camera.translation);
  fill(message.pose().pose().orientation(), estimate.world_from_camera.rotation);
  for (int i = 0; i < 36; ++i)
    message.pose().covariance()[static_cast<std::size_t>(i)] = estimate.covariance(i / 6, i % 6);
}

void to_ros(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            const std::string& camera, tf2_msgs::msg::dds_::TFMessage_& message) {
  assert(estimate.has_pose());
  message.transforms().resize(1);
  auto& transform = message.transforms().front();
  fill(transform.header(), captured, frame_id);
  transform.child_frame_id(camera);
  fill(transform.transform().translation(), estimate.world_from_camera.translation);
  fill(transform.transform().rotation(), estimate.world_from_camera.rotation);
}

void to_ros(std::span<const object_tracking::ObjectEstimate> estimates, capture::Timestamp captured,
            const std::string& frame_id, geometry_msgs::msg::dds_::PoseArray_& message) {
  fill(message.header(), captured, frame_id);
  message.poses().clear();
  for (const auto& estimate : estimates) {
    if (!estimate.has_position()) continue;
    geometry_msgs::msg::dds_::Pose_& pose = message.poses().emplace_back();
    fill(pose.position(), estimate.position);
    fill_identity(pose.orientation());
  }
}

}  // namespace huetrack::publish
