// ObjectEstimate as ROS 2 messages: REP-103 (metres, right-handed, z up), stamped with the capture time. Pure
// functions.
#pragma once

#include <span>
#include <string>

#include "camera_tracking/camera_estimate.h"
#include "capture/frames/frame.h"
#include "idl/ros2_messages.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::publish {

// The orientation of a target is unknown: the identity with a variance of 1e6 rad^2 about each axis, uncorrelated with
// the position. Both require estimate.has_position().
//   captured   capture time, UNIX: the header's stamp
//   frame_id   the world frame; child frame of the transform: the target's name
// They reuse an existing message, to avoid allocation.
void to_ros(const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            geometry_msgs::msg::dds_::PoseWithCovarianceStamped_& message);
void to_ros(const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            const std::string& target, tf2_msgs::msg::dds_::TFMessage_& message);

// Pose of a camera's optical frame (x right, y down, z forward); require estimate.has_pose(). Child frame: the camera's
// name.
void to_ros(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            geometry_msgs::msg::dds_::PoseWithCovarianceStamped_& message);
void to_ros(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured, const std::string& frame_id,
            const std::string& camera, tf2_msgs::msg::dds_::TFMessage_& message);

// Poses of the estimates with a position, in order; captured: of the frame set, UNIX.
void to_ros(std::span<const object_tracking::ObjectEstimate> estimates, capture::Timestamp captured,
            const std::string& frame_id, geometry_msgs::msg::dds_::PoseArray_& message);

}  // namespace huetrack::publish
