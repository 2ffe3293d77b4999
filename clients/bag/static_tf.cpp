#include "clients/bag/static_tf.h"

#include "clients/bag/ros_messages.h"
#include "idl/ros_fields.h"
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
    idl::set_header(transform.header(), at_ns, frame_id);
    idl::set_transform(transform, camera.name, world_from_cam.translation, world_from_cam.rotation.coeffs());
  }
  return {.topic = 0, .at_ns = at_ns, .data = cdr_of(message)};
}

}  // namespace huetrack::bag
