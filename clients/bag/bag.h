// A bag: serialised ROS 2 messages (CDR) by topic and time, and its two file formats.
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
  std::string definition;  // of the type and its members, as .msg files ("ros2msg" of MCAP)
  // Transient-local: late joiners get the last message, also from `ros2 bag play`.
  bool is_kept_for_latecomers = false;
};

// As rosbag2 of Humble writes it (YAML, rmw's numbers); empty: the defaults of `play`.
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

// Streams messages to the disk. thread-compatible.
class BagWriter {
 public:
  virtual ~BagWriter() = default;
  // In ascending time. Throws std::exception with a one-line message: cannot be written.
  virtual void add(const Message& message) = 0;
  // Completes the bag, after at least one message. Without this call nothing is left on the disk.
  virtual void finish() = 0;
};

// A rosbag2 of storage sqlite3: a new folder with metadata.yaml and a .db3, which `ros2 bag` reads from Foxy on.
// Throws std::runtime_error with a one-line message: the folder is not empty or cannot be written.
std::unique_ptr<BagWriter> rosbag2_writer(std::vector<Topic> topics, const std::filesystem::path& folder);

// One indexed, uncompressed file (https://mcap.dev/spec). Own writer: Debian has no package. Throws std::runtime_error:
// the existing file is no MCAP, or cannot be written.
std::unique_ptr<BagWriter> mcap_writer(std::vector<Topic> topics, const std::filesystem::path& file);

}  // namespace huetrack::bag
