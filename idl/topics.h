// Topic names, type hashes and QoS, for service and clients; table in README.md. Pure functions and constants;
// thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::idl {

// Native, types of huetrack.idl.
inline constexpr const char* object_position_topic =
    "huetrack/object_position";                                           // huetrack::msg::ObjectPosition, keyed
inline constexpr const char* camera_pose_topic = "huetrack/camera_pose";  // huetrack::msg::CameraPose, keyed
inline constexpr const char* status_topic = "huetrack/status";            // huetrack::msg::ServiceStatus, keyed

// Native, the type of camera_times.idl.
inline constexpr const char* camera_times_topic = "huetrack/camera_times";  // huetrack::msg::CameraTimes, keyed

// Native, the type of object_set.idl: of targets with `count`.
inline constexpr const char* object_set_topic = "huetrack/object_set";  // huetrack::msg::ObjectSet, keyed

// Native, types of huetrack_view.idl: for the web page.
inline constexpr const char* scene_topic = "huetrack/scene";                      // huetrack::msg::Scene, keyed
inline constexpr const char* preview_topic = "huetrack/preview";                  // huetrack::msg::Preview, keyed
inline constexpr const char* camera_map_topic = "huetrack/camera_map";            // huetrack::msg::CameraMap, keyed
inline constexpr const char* teach_request_topic = "huetrack/teach_request";      // huetrack::msg::TeachRequest
inline constexpr const char* teach_reply_topic = "huetrack/teach_reply";          // huetrack::msg::TeachReply
inline constexpr const char* control_request_topic = "huetrack/control_request";  // huetrack::msg::ControlRequest
inline constexpr const char* control_reply_topic = "huetrack/control_reply";      // huetrack::msg::ControlReply

// Native, types of camera_host.idl: between a camera host and the trackers that use its cameras.
inline constexpr const char* camera_host_topic = "huetrack/camera_host";  // huetrack::msg::CameraHost, keyed
inline constexpr const char* clock_probe_topic = "huetrack/clock_probe";  // huetrack::msg::ClockProbe
inline constexpr const char* clock_echo_topic = "huetrack/clock_echo";    // huetrack::msg::ClockEcho
inline constexpr const char* host_clocks_topic = "huetrack/host_clocks";  // huetrack::msg::HostClocks, keyed
inline constexpr const char* looked_for_topic = "huetrack/looked_for";    // huetrack::msg::LookedForColors, keyed
// huetrack::msg::CameraFrame
inline std::string camera_frames_topic(const std::string& host, const std::string& camera) {
  return "huetrack/frames/" + host + "/" + camera;
}
// huetrack::msg::CameraMatches, huetrack::msg::ExpectedOutlines
inline std::string camera_matches_topic(const std::string& host) {
  return "huetrack/matches/" + host;
}
inline std::string camera_outlines_topic(const std::string& host) {
  return "huetrack/outlines/" + host;
}

// ROS 2, types of ros2_messages.idl. A ROS 2 topic /x is the DDS topic rt/x.
inline constexpr const char* ros2_tf_topic = "rt/tf";  // tf2_msgs/msg/TFMessage
// geometry_msgs/msg/PoseWithCovarianceStamped, PoseArray, and the first one again
inline std::string ros2_pose_topic(const std::string& target) {
  return "rt/huetrack/" + target + "/pose";
}
inline std::string ros2_poses_topic(const std::string& target) {
  return "rt/huetrack/" + target + "/poses";
}
inline std::string ros2_camera_pose_topic(const std::string& name) {
  return "rt/huetrack/camera/" + name + "/pose";
}

inline constexpr const char* ros2_tf_static_topic = "rt/tf_static";       // tf2_msgs/msg/TFMessage, transient local
inline constexpr const char* ros2_markers_topic = "rt/huetrack/markers";  // visualization_msgs/msg/MarkerArray
// sensor_msgs/msg/CompressedImage, and CameraInfo of the image's size
inline std::string ros2_image_topic(const std::string& name) {
  return "rt/huetrack/" + name + "/image/compressed";
}
inline std::string ros2_camera_info_topic(const std::string& name) {
  return "rt/huetrack/" + name + "/camera_info";
}

// REP-2011 type hashes, which ROS 2 Iron and later expect in an endpoint's USER_DATA.
inline constexpr const char* ros2_pose_type_hash =
    "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
inline constexpr const char* ros2_poses_type_hash =
    "RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0";
inline constexpr const char* ros2_tf_type_hash =
    "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
inline constexpr const char* ros2_image_type_hash =
    "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a";
inline constexpr const char* ros2_camera_info_type_hash =
    "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275";
inline constexpr const char* ros2_markers_type_hash =
    "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf";
// "typehash=RIHS01_...;"
inline std::string ros2_user_data(const std::string& type_hash) {
  return "typehash=" + type_hash + ";";
}

// USER_DATA of the writers of object_position and camera_pose, readable before the first sample. On camera_pose,
// targets is the camera's name.
struct PublisherIdentity {
  std::string host;
  std::uint32_t pid = 0;
  std::vector<std::string> targets;

  static PublisherIdentity of_this_process(std::vector<std::string> targets);
  std::string user_data() const;                                             // "host=h;pid=1;targets=a,b;"
  static std::optional<PublisherIdentity> from(std::string_view user_data);  // nullopt: not written by user_data()
};

// A target's name is part of ROS 2 topic names: [A-Za-z][A-Za-z0-9_]* without "__", and short enough for topic names
// with an object's number (Fast DDS: 255 characters).
inline constexpr std::size_t longest_name = 64;
bool is_target_name(std::string_view name);

// The largest sample of a native topic that our readers accept, in bytes; larger ones are rejected before allocation.
// The types are unbounded, so without this limit any participant could exhaust a reader's memory. Each limit is several
// times what huetrackd sends with 16 cameras and 100 targets. nullopt: a topic that we do not read.
std::optional<std::uint32_t> largest_sample(std::string_view topic);

// Limits the instances of a native topic in a reader, for the same reason. Leaves the QoS of other topics unchanged.
void limit_instances(std::string_view topic, eprosima::fastdds::dds::DataReaderQos& qos);

// The QoS unless the user's XML has a profile of the topic's name.
//   object_position  reliable, volatile, keep-last 10; liveliness automatic, lease 1 s, so that a
//                    killed service is noticed within 1.5 s. A reader keeps more samples, for slow terminals.
//   object_set       as object_position
//   camera_pose      as object_position
//   status           reliable, transient-local, keep-last 1; heartbeat 200 ms: late joiners have it within that time.
//   camera_times     as status.
//   scene            as status.
//   camera_map       as status.
//   preview          best effort, volatile, keep-last 1: a lost picture is not sent again (few datagrams).
//   teach_*          reliable, volatile, keep-last 10; control_* too.
//   camera_host      as status; host_clocks too.
//   frames/...       reliable, volatile, keep-last 4, asynchronous (many datagrams a frame); losses are requested
//                    again within 20 ms. The writer limits the frames in flight (hosts/frame_window.h): a network that
//                    is too slow would lose nearly all.
//   matches/...      as frames/..., but synchronous and keep-last 8; losses requested again within 40 ms: a heartbeat
//                    with its answer costs a third of a small frame. Readers accept 32 cameras of a host.
//   looked_for       as status.
//   outlines/...     as clock_*: each frame set brings a new one.
//   clock_*          best effort, volatile, keep-last 4, readers 64: all hosts answer at the same time.
//   ROS 2            reliable, volatile, keep-last 10: compatible with `ros2 topic echo`, RViz and best-effort readers.
// A reader preallocates samples of largest_sample() bytes; new samples replace those that were not taken in time.
// All but frames/... are published synchronously, which has the lowest measured latency. No deadline is
// offered, so readers must request none.
eprosima::fastdds::dds::DataWriterQos object_position_writer_qos();
// depth: samples per target between two polls; small for a program that takes samples on arrival.
eprosima::fastdds::dds::DataReaderQos object_position_reader_qos(int depth = 1000);
eprosima::fastdds::dds::DataWriterQos status_writer_qos();
eprosima::fastdds::dds::DataReaderQos status_reader_qos();
eprosima::fastdds::dds::DataWriterQos preview_writer_qos();
eprosima::fastdds::dds::DataReaderQos preview_reader_qos();
eprosima::fastdds::dds::DataWriterQos teach_writer_qos();
eprosima::fastdds::dds::DataReaderQos teach_reader_qos();
eprosima::fastdds::dds::DataWriterQos camera_frames_writer_qos();
eprosima::fastdds::dds::DataReaderQos camera_frames_reader_qos();
// For all cameras of a host; each has its own history.
eprosima::fastdds::dds::DataWriterQos camera_matches_writer_qos();
eprosima::fastdds::dds::DataReaderQos camera_matches_reader_qos();
eprosima::fastdds::dds::DataWriterQos clock_writer_qos();
eprosima::fastdds::dds::DataReaderQos clock_reader_qos();
eprosima::fastdds::dds::DataWriterQos ros2_writer_qos();

}  // namespace huetrack::idl
