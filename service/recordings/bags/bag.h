// ROS bags as messages: MCAP (.mcap), rosbag2 of storage sqlite3 (.db3), ROS 1 (.bag), and rosbag2 folders of the first
// two.
//
// Files may be damaged or hostile: every length is checked, memory is bounded by largest_bytes, and no file is loaded
// as a whole. Messages come in the order of the file, which for one topic is the order of publication. A damaged bag is
// read up to the damage, and beyond it where its index says where the next part begins; take_warnings() reports it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace huetrack::bags {

inline constexpr std::size_t largest_bytes = 256U << 20;  // capacity: bytes of a message or a decompressed chunk

struct BagTopic {
  std::string name;      // "/left/image_raw"
  std::string type;      // "sensor_msgs/Image": ROS 2's without its "/msg"
  std::string encoding;  // of its messages: cdr (ROS 2), ros1, protobuf, ...
  std::int64_t messages = 0;
};

struct BagMessage {
  std::int64_t logged_at_ns = 0;  // when it was recorded
  std::string type, encoding;     // its topic's
  std::span<const std::uint8_t> data;
  std::shared_ptr<const void> owner;  // of data, with at least 64 readable bytes behind it
};

// By the first bytes of a file; a folder by the files in it. False if it cannot be read, and for a folder with a
// recording.yaml.
bool is_bag(const std::filesystem::path& path);

// Of a file that is called like a bag, and is none: cut off at its beginning, or overwritten. Empty: it is called
// otherwise, or is one.
std::string problem_of_beginning(const std::filesystem::path& file);

// The files of a bag, in order: the file itself, or the folder's .mcap or .db3 files by their numbers.
std::vector<std::filesystem::path> parts_of(const std::filesystem::path& bag);

struct Contents {
  std::vector<BagTopic> topics;
  std::vector<std::string> warnings;  // one line each
};
// Reads a file without an index as a whole. throws ConfigError: not a bag, or nothing of it can be read.
Contents contents_of(const std::filesystem::path& bag);

// The messages of one topic. thread-compatible.
class TopicReader {
 public:
  TopicReader(const std::filesystem::path& bag, std::string topic);  // throws ConfigError as contents_of()
  ~TopicReader();
  TopicReader(const TopicReader&) = delete;
  TopicReader& operator=(const TopicReader&) = delete;

  std::optional<BagMessage> next();              // nullopt at the end. Never throws.
  std::optional<std::int64_t> messages() const;  // of the whole bag, by its index; nullopt: it has none
  std::vector<std::string> take_warnings();      // since the last call, one line each

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::bags
