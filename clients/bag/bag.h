// What a bag holds: messages of ROS 2 as they go over the wire (CDR), by topic and time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace huetrack::bag {

struct Topic {
  std::string name;        // "/huetrack/ball/pose"
  std::string type;        // "geometry_msgs/msg/PoseWithCovarianceStamped"
  std::string definition;  // of the type and all that it is made of, as .msg files say it ("ros2msg" of MCAP)
  // Who begins to listen later gets its last message, too (transient-local), also from `ros2 bag play`.
  bool is_kept_for_latecomers = false;
};

// As rosbag2 of Humble writes it (YAML, rmw's numbers): empty where play's own defaults will do.
std::string offered_qos_profiles(const Topic& topic);

struct Message {
  std::size_t topic = 0;   // index into Bag::topics
  std::int64_t at_ns = 0;  // >= 0
  std::string data;        // CDR with its encapsulation
};

struct Bag {
  std::vector<Topic> topics;
  std::vector<Message> messages;  // ascending in time
};

// Pictures of minutes are more than memory holds: messages go to the disk as they come. thread-compatible.
class BagWriter {
 public:
  virtual ~BagWriter() = default;
  // In ascending time. throws std::exception of one readable line: it cannot be written.
  virtual void add(const Message& message) = 0;
  // After one message or more. Before, there is no bag yet, and where this is never called none is left behind.
  virtual void finish() = 0;
};

// A rosbag2 of storage sqlite3: a new folder with metadata.yaml and a .db3, which `ros2 bag` reads from Foxy on.
// throws std::runtime_error, one readable line: the folder is there and not empty, or cannot be written.
std::unique_ptr<BagWriter> rosbag2_writer(std::vector<Topic> topics, const std::filesystem::path& folder);

// One file, indexed, as https://mcap.dev/spec says; not compressed. By hand: Debian has no package of a writer. throws
// std::runtime_error: what is there is no MCAP, or it cannot be written.
std::unique_ptr<BagWriter> mcap_writer(std::vector<Topic> topics, const std::filesystem::path& file);

}  // namespace huetrack::bag
