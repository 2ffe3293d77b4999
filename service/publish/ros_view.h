// Messages for RViz: scene and targets as markers, previews as compressed images with camera_info. Pure functions;
// frames as in ros_messages.h. A camera's frame is its optical frame, with the camera's name.
#pragma once

#include <span>
#include <string>

#include "capture/frames/frame.h"
#include "idl/huetrack_view.h"
#include "idl/ros2_messages.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::publish {

// Per target a ball of its radius, its 95 % ellipsoid and its name; per camera its field of view and its name; the
// volume. Deletes the markers of a target without a position.
//   scene       has the targets of the estimates (ObjectEstimate::target)
//   captured    capture time, UNIX
//   tracked_camera  name of the moving camera, if any; its lines are in its own frame
visualization_msgs::msg::dds_::MarkerArray_ to_markers(const msg::Scene& scene,
                                                       std::span<const object_tracking::ObjectEstimate> estimates,
                                                       capture::Timestamp captured, const std::string& frame_id,
                                                       const std::string& tracked_camera = "");

sensor_msgs::msg::dds_::CompressedImage_ to_ros_image(const msg::Preview& preview);

// For the preview's size: K and P are scaled.
sensor_msgs::msg::dds_::CameraInfo_ to_camera_info(const msg::Preview& preview, const msg::SceneCamera& camera);

// world from camera, for tf_static, without the tracked camera, which is on /tf.
tf2_msgs::msg::dds_::TFMessage_ to_static_tf(const msg::Scene& scene, const std::string& frame_id,
                                             const std::string& tracked_camera = "");

// A camera's name for a topic: letters, digits and single underscores.
std::string ros_name(const std::string& camera);

}  // namespace huetrack::publish
