// Publishes scene, previews and maps for web pages, and receives their requests (idl/huetrack_view.idl). Its
// participant is separate from that of the positions, so that it cannot delay them.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "idl/huetrack_view.h"
#include "publish/estimate_publisher.h"

namespace huetrack::publish {

// thread-compatible; not for the tracking thread.
class PagePublisher {
 public:
  // Uses of the options: domain, interfaces, profiles, frame_id, ros2, cameras (names in rig order), tracked_camera.
  // throws as EstimatePublisher's constructor.
  explicit PagePublisher(EstimatePublisherOptions options);
  ~PagePublisher();

  // Each adds the identity of this process if the message has it. Returns false on a write error.
  bool publish(msg::Scene scene) noexcept;  // late joiners receive it
  bool publish(const msg::Preview& preview) noexcept;
  bool publish(const camera_tracking::CameraMap& map,
               capture::Timestamp captured) noexcept;  // of options.tracked_camera
  bool publish(const msg::TeachReply& reply) noexcept;
  bool publish(const msg::ControlReply& reply) noexcept;
  // Markers of the targets for RViz (in the order of the last scene). No effect without ROS 2.
  bool publish(std::span<const object_tracking::ObjectEstimate> estimates, capture::Timestamp captured) noexcept;

  std::optional<msg::TeachRequest> next_request();            // to this process; does not wait
  std::optional<msg::ControlRequest> next_control_request();  // to this process; does not wait

  int picture_subscribers() const;  // of previews, and of ROS 2's images and camera_info
  int marker_subscribers() const;   // of ROS 2's markers

  // Call it about once a second: joins again if the host's addresses have changed.
  void check_network();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::publish
