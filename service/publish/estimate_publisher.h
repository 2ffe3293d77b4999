// Publishes estimates over DDS: native topics and ROS 2 topics. Topics and QoS: idl/README.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "camera_tracking/camera_estimate.h"
#include "capture/frames/frame.h"
#include "idl/participant_options.h"
#include "object_tracking/object_estimate.h"
#include "publish/service_status.h"

namespace huetrack::publish {

struct EstimatePublisherOptions {
  std::optional<int> domain;                  // 0..232; nullopt: ROS_DOMAIN_ID, or 0
  std::string frame_id = "world";             // not empty, no leading '/'; name of the world frame in ROS 2
  std::vector<std::string> targets;           // unique; idl::is_target_name(); may be empty with a tracked camera
  std::vector<int> counts;                    // by target: maximum number of objects; missing: 1
  std::string tracked_camera;                 // named like a target; empty: none
  std::vector<std::string> cameras;           // names in rig order: per_view[i] belongs to cameras[i]
  std::vector<std::string> interfaces;        // use only these, and loopback: names or IPv4 addresses; empty: all
  std::filesystem::path profiles;             // Fast DDS XML profiles; empty: none
  bool has_other_hosts = false;               // publish the clocks of remote hosts
  bool ros2 = true;                           // publish the ROS 2 topics too
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
  idl::ParticipantOptions transport(std::string name) const { return {std::move(name), domain, interfaces, profiles}; }
};

// Thread rule: one thread at a time per target, one for the camera, and one for the status.
class EstimatePublisher {
 public:
  // throws std::invalid_argument on invalid options, naming a wrong domain, interface or XML file; std::runtime_error
  // if Fast DDS refuses.
  explicit EstimatePublisher(EstimatePublisherOptions options);
  // Checks options without joining: throws std::invalid_argument as the constructor. Returns interfaces that this host
  // lacks, one sentence each.
  static std::vector<std::string> check(const EstimatePublisherOptions& options);
  // The domain, and the interfaces of this host that would be used: "eth0 192.168.0.5". throws std::invalid_argument
  // for an invalid domain.
  struct Network {
    int domain = 0;
    std::vector<std::string> interfaces;
  };
  static Network network(const EstimatePublisherOptions& options);
  ~EstimatePublisher();  // subscribers notice within 50 ms

  // Begin and end of a DDS write, by unix_now().
  struct Writing {
    capture::Timestamp begun, sent;
  };

  // Writes one native sample, in every state, and ROS 2 messages if there is a position. Synchronous: the sample has
  // been sent on return.
  //   target     index into options.targets. With `count`, each object (estimate.object) has its own instance and ROS 2
  //              topic from its first to its last sample
  //   estimate   per_view is empty or has one entry per camera
  //   captured   capture time, UNIX (a replay adds its clock offset to estimate.at)
  //   received   arrival of the set's last frame, UNIX
  //   writing    out, may be null: of the native sample
  // Returns false, and increments counters().failures, on a write error.
  bool publish(std::size_t target, const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured,
               capture::Timestamp received, Writing* writing = nullptr) noexcept;

  // For a target with options.counts > 1, after publish() of each object: writes one sample with all objects.
  // estimates: all of this target.
  bool publish_set(std::size_t target, std::span<const object_tracking::ObjectEstimate> estimates,
                   capture::Timestamp captured, capture::Timestamp received) noexcept;

  // The pose of options.tracked_camera: natively in every state, for ROS 2 if there is a pose.
  bool publish(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured,
               capture::Timestamp received) noexcept;

  // Adds host, process id, frame_id and counters. Call it about once a second: if the host's addresses have changed, it
  // joins again, which takes 0.1 to 0.7 s while publish() continues on other threads; warnings() reports a failure.
  bool publish_status(const ServiceStatus& status) noexcept;

  // Timing of the cameras; call it with publish_status(). times: one per camera, or empty if unknown.
  bool publish_times(capture::Timestamp at, std::span<const object_tracking::CameraTimingEstimate> times) noexcept;

  struct Counters {
    std::uint64_t published = 0;  // native positions and poses
    std::uint64_t failures = 0;   // calls of publish() and publish_status() with a write error
  };
  Counters counters() const;  // any thread

  // For the log and ServiceStatus::warnings, one sentence each: another publisher has one of our targets. Any thread.
  std::vector<std::string> warnings() const;

  // Number of readers of the native positions and poses. A reader that is not counted yet misses samples. Any thread.
  int subscribers() const;

  int domain() const;
  std::string description() const;  // one line for the log: domain, interfaces in use, XML profiles in use

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::publish
