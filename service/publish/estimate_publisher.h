// Estimates to the bus: the native topics, and beside them the ROS 2 view of the same. README.md has the topics and
// QoS.
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
  std::optional<int> domain;                  // 0..232; nullopt: ROS_DOMAIN_ID, and 0 without it
  std::string frame_id = "world";             // not empty, no leading '/'; the world frame's name on the ROS 2 topics
  std::vector<std::string> targets;           // unique; idl::is_target_name(); none only with a tracked camera
  std::vector<int> counts;                    // by target: how many objects it may be; those that are missing: 1
  std::string tracked_camera;                 // whose pose is published, named like a target; empty: none
  std::vector<std::string> cameras;           // names in rig order: per_view[i] is what cameras[i] says
  std::vector<std::string> interfaces;        // use only these, and loopback: names or IPv4 addresses; empty: all
  std::filesystem::path profiles;             // Fast DDS XML profiles; empty: none
  bool has_other_hosts = false;               // cameras may be of other hosts: their clocks are published
  bool ros2 = true;                           // publish the ROS 2 topics too
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
  // As whom and how to join the bus: name, domain, interfaces, profiles.
  idl::ParticipantOptions transport(std::string name) const { return {std::move(name), domain, interfaces, profiles}; }
};

// thread-safe as far as it is needed: one thread at a time per target, one for the camera, and another for the status.
class EstimatePublisher {
 public:
  // throws std::invalid_argument on invalid options, a domain, interface or XML file that is wrong (naming it);
  // std::runtime_error when Fast DDS refuses.
  explicit EstimatePublisher(EstimatePublisherOptions options);
  // Whether the bus can be joined so, without joining it: throws std::invalid_argument as the constructor does. What
  // may be right on another host, an interface that this one lacks, is returned, one sentence each.
  static std::vector<std::string> check(const EstimatePublisherOptions& options);
  // The domain, and the network interfaces of this host that would be used: "eth0 192.168.0.5". Those that the options
  // name, or all. throws std::invalid_argument: a domain that is wrong.
  struct Network {
    int domain = 0;
    std::vector<std::string> interfaces;
  };
  static Network network(const EstimatePublisherOptions& options);
  ~EstimatePublisher();  // leaves the bus: subscribers see it within 50 ms

  // A DDS write, by unix_now(): when it began, and when the sample had been sent.
  struct Writing {
    capture::Timestamp begun, sent;
  };

  // Writes one native sample, in every state, and the ROS 2 messages while there is a position: never a stale or a zero
  // one. Synchronous: when it returns, the sample has been sent.
  //   target     index into options.targets. An object of several (estimate.object) has an instance and a ROS 2
  //              topic of its own, made with its first sample and gone with its last one
  //   estimate   per_view is empty or has one entry per camera
  //   captured   capture time, UNIX (a replay adds its clock offset to estimate.at)
  //   received   when the last frame of the set had arrived, UNIX
  //   writing    out, may be null: of the native sample; its ROS 2 copies follow
  // false, and counters().failures is one more, when something could not be written.
  bool publish(std::size_t target, const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured,
               capture::Timestamp received, Writing* writing = nullptr) noexcept;

  // Of a target of several objects (options.counts), after those of each in this set: one sample with all of them. The
  // estimates are the target's, as ObjectTracker::update() gives them.
  bool publish_set(std::size_t target, std::span<const object_tracking::ObjectEstimate> estimates,
                   capture::Timestamp captured, capture::Timestamp received) noexcept;

  // The pose of options.tracked_camera: in every state natively, for ROS 2 while there is a pose.
  bool publish(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured,
               capture::Timestamp received) noexcept;

  // Host, process id, frame_id and the counters of published samples are added here. Call it about once a second: when
  // the host's network addresses have changed (Wi-Fi or DHCP came up after us), it joins the bus anew, which takes this
  // call 0.1-0.7 s, while publish() on another thread goes on; where that is not possible, warnings() says why.
  bool publish_status(const ServiceStatus& status) noexcept;

  // Beside it: when each camera exposes its rows. times: one per camera, or none, when nothing is known of them.
  bool publish_times(capture::Timestamp at, std::span<const object_tracking::CameraTimingEstimate> times) noexcept;

  struct Counters {
    std::uint64_t published = 0;  // native samples written: positions and poses
    std::uint64_t failures = 0;   // calls of publish() and publish_status() that could not write everything
  };
  Counters counters() const;  // any thread

  // What an operator should know, one sentence each; for the log and for ServiceStatus::warnings: another publisher has
  // one of our targets. Any thread.
  std::vector<std::string> warnings() const;

  // How many readers of the native positions and poses there are. A reader that is not counted yet misses what is
  // written now: a replay that must not lose its beginning waits for it. Any thread.
  int subscribers() const;

  int domain() const;
  std::string description() const;  // one line for the log: domain, interfaces in use, XML profiles in use

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::publish
