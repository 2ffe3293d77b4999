#include "clients/bag/static_tf.h"

#include "clients/bag/ros_messages.h"
#include "idl/topics.h"

namespace huetrack::bag {

Topic static_tf_topic() {
  return {.name = std::string(idl::ros2_tf_static_topic).substr(rtps_prefix),
          .type = "tf2_msgs/msg/TFMessage",
          .definition = tf_definition(),
          .is_kept_for_latecomers = true};
}

Message static_tf_of(const calib::CameraRig& rig, const std::set<std::string>& moving, const std::string& frame_id,
                     std::int64_t at_ns) {
  tf2_msgs::msg::dds_::TFMessage_ message;
  for (const calib::Camera& camera : rig.cameras) {
    if (moving.contains(camera.name)) continue;
    const calib::Rigid3d world_from_cam = calib::inverse(camera.cam_from_world);
    auto& transform = message.transforms().emplace_back();
    transform.header(ros_header(at_ns, frame_id));
    transform.child_frame_id(camera.name);
    transform.transform().translation().x(world_from_cam.translation.x());
    transform.transform().translation().y(world_from_cam.translation.y());
    transform.transform().translation().z(world_from_cam.translation.z());
    transform.transform().rotation().x(world_from_cam.rotation.x());
    transform.transform().rotation().y(world_from_cam.rotation.y());
    transform.transform().rotation().z(world_from_cam.rotation.z());
    transform.transform().rotation().w(world_from_cam.rotation.w());
  }
  return {.topic = 0, .at_ns = at_ns, .data = cdr_of(message)};
}

}  // namespace huetrack::bag
