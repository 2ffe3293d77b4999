#include "publish/ros_messages.h"

#include <cassert>

#include "idl/ros_fields.h"

namespace huetrack::publish {

namespace {

constexpr double unknown_orientation_variance = 1e6;  // rad^2

std::int64_t ns_of(capture::Timestamp t) {
  return t.time_since_epoch().count();
}

}  // namespace

void to_ros(const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            geometry_msgs::msg::dds_::PoseWithCovarianceStamped_& message) {
  assert(estimate.has_position());
  idl::set_header(message.header(), ns_of(captured), frame_id);
  idl::set_xyz(message.pose().pose().position(), estimate.position);
  idl::set_rotation(message.pose().pose().orientation(), idl::no_rotation);
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
  idl::set_header(message.transforms().front().header(), ns_of(captured), frame_id);
  idl::set_transform(message.transforms().front(), target, estimate.position, idl::no_rotation);
}

void to_ros(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            geometry_msgs::msg::dds_::PoseWithCovarianceStamped_& message) {
  assert(estimate.has_pose());
  idl::set_header(message.header(), ns_of(captured), frame_id);
  idl::set_xyz(message.pose().pose().position(), estimate.world_from_camera.translation);
  idl::set_rotation(message.pose().pose().orientation(), estimate.world_from_camera.rotation.coeffs());
  for (int i = 0; i < 36; ++i)
    message.pose().covariance()[static_cast<std::size_t>(i)] = estimate.covariance(i / 6, i % 6);
}

void to_ros(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            const std::string& camera, tf2_msgs::msg::dds_::TFMessage_& message) {
  assert(estimate.has_pose());
  message.transforms().resize(1);
  const auto& [rotation, translation] = estimate.world_from_camera;
  idl::set_header(message.transforms().front().header(), ns_of(captured), frame_id);
  idl::set_transform(message.transforms().front(), camera, translation, rotation.coeffs());
}

void to_ros(std::span<const object_tracking::ObjectEstimate> estimates, capture::Timestamp captured,
            const std::string& frame_id, geometry_msgs::msg::dds_::PoseArray_& message) {
  idl::set_header(message.header(), ns_of(captured), frame_id);
  message.poses().clear();
  for (const auto& estimate : estimates) {
    if (!estimate.has_position()) continue;
    geometry_msgs::msg::dds_::Pose_& pose = message.poses().emplace_back();
    idl::set_xyz(pose.position(), estimate.position);
    idl::set_rotation(pose.orientation(), idl::no_rotation);
  }
}

}  // namespace huetrack::publish
