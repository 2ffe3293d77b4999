// What RViz shows: the scene and the targets as markers, previews as compressed images with their camera_info. Pure
// functions; frames as in ros_messages.h. A camera's own frame is its optical one, named as the camera.
#pragma once

#include <span>
#include <string>

#include "capture/frames/frame.h"
#include "idl/huetrack_view.h"
#include "idl/ros2_messages.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::publish {

// Per target a ball of its radius, its 95 % ellipsoid and its name; per camera what it sees as lines, and its name; the
// volume. Where a target has no position its markers are deleted: RViz shows no stale one.
//   scene       its targets are those that the estimates name (ObjectEstimate::target)
//   captured    capture time, UNIX
//   tracked_camera  the name of the one that moves, if any: its lines are in its own frame, which /tf moves
visualization_msgs::msg::dds_::MarkerArray_ to_markers(const msg::Scene& scene,
                                                       std::span<const object_tracking::ObjectEstimate> estimates,
                                                       capture::Timestamp captured, const std::string& frame_id,
                                                       const std::string& tracked_camera = "");

sensor_msgs::msg::dds_::CompressedImage_ to_ros_image(const msg::Preview& preview);

// For the picture's size, which is smaller than the camera's image: K and P are scaled with it.
sensor_msgs::msg::dds_::CameraInfo_ to_camera_info(const msg::Preview& preview, const msg::SceneCamera& camera);

// world from camera, for tf_static. Not of the tracked camera: /tf says where that is, and a frame has but one parent.
tf2_msgs::msg::dds_::TFMessage_ to_static_tf(const msg::Scene& scene, const std::string& frame_id,
                                             const std::string& tracked_camera = "");

// A camera's name in a topic's: letters, digits and single underscores.
std::string ros_name(const std::string& camera);

}  // namespace huetrack::publish
