// What a page shows beside positions and status: the scene, previews, and the teaching of colours asked for over the
// bus. The messages are those of idl/huetrack_view.idl. It has its own place on the bus, apart from that of the
// positions, so that nothing here can hold those up.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "idl/huetrack_view.h"
#include "publish/estimate_publisher.h"

namespace huetrack::publish {

// thread-compatible: one thread, which is not the tracking one.
class PagePublisher {
 public:
  // Of the options: domain, interfaces, profiles, frame_id, ros2, cameras (names in rig order), tracked_camera.
  // throws as EstimatePublisher's constructor does.
  explicit PagePublisher(EstimatePublisherOptions options);
  ~PagePublisher();

  // Each fills in what identifies this process where the message has it. False when it could not be written.
  bool publish(msg::Scene scene) noexcept;  // kept, and sent to who comes late
  bool publish(const msg::Preview& preview) noexcept;
  bool publish(const camera_tracking::CameraMap& map,
               capture::Timestamp captured) noexcept;  // of options.tracked_camera, which must be given
  bool publish(const msg::TeachReply& reply) noexcept;
  bool publish(const msg::ControlReply& reply) noexcept;
  // For RViz: the markers of these targets (those of the last scene, in its order). Nothing without ROS 2.
  bool publish(std::span<const object_tracking::ObjectEstimate> estimates, capture::Timestamp captured) noexcept;

  std::optional<msg::TeachRequest> next_request();            // those to this process; does not wait
  std::optional<msg::ControlRequest> next_control_request();  // to this process; does not wait

  int picture_subscribers() const;  // of previews, and of ROS 2's images and camera_info
  int marker_subscribers() const;   // of ROS 2's markers

  // About once a second: joins anew when the host's addresses have changed, as EstimatePublisher does.
  void look_after_network();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::publish
