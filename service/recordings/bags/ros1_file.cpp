// ROS 1's bags, version 2.0 (http://wiki.ros.org/Bags/Format/2.0): records of a header, which is a list of NAME=VALUE,
// and data. Messages lie in chunks, or, in an unfinished bag's last part, chunks are cut off. The connections are
// listed at the end.
#include <algorithm>
#include <array>
#include <map>

#include "calib/files/config_error.h"
#include "recordings/bags/bag_file.h"
#include "recordings/bags/byte_file.h"
#include "recordings/bags/decompress.h"

namespace huetrack::bags {
namespace {

constexpr std::string_view ros1_magic = "#ROSBAG V2.0\n";
constexpr std::uint64_t largest_header = 1U << 20;  // capacity: bytes; a connection's has the message's definition

enum Ros1Op : std::uint8_t { ros1_message = 2, ros1_bag = 3, ros1_chunk = 5, ros1_chunk_info = 6, ros1_connection = 7 };

using HeaderFields = std::map<std::string, std::span<const std::uint8_t>, std::less<>>;

// nullopt: damaged.
std::optional<HeaderFields> fields_of(std::span<const std::uint8_t> header) {
  HeaderFields fields;
  Cursor in(header);
  while (in.ok() && !in.at_end()) {
    const auto text = in.counted();
    const std::string_view field(reinterpret_cast<const char*>(text.data()), text.size());
    const auto equals = field.find('=');
    if (equals == std::string_view::npos) return std::nullopt;
    fields.emplace(field.substr(0, equals), text.subspan(equals + 1));
  }
  return in.ok() ? std::optional(fields) : std::nullopt;
}

template <typename Number>
Number number_in(const HeaderFields& fields, std::string_view name) {
  const auto field = fields.find(name);
  return field == fields.end() ? Number{} : Cursor(field->second).number<Number>();
}

std::string text_in(const HeaderFields& fields, std::string_view name) {
  const auto field = fields.find(name);
  return field == fields.end() ? std::string() : std::string(field->second.begin(), field->second.end());
}

class Ros1File final : public BagFile {
 public:
  Ros1File(const std::filesystem::path& path, std::string_view wanted) : path_(path), file_(path), wanted_(wanted) {
    std::array<std::uint8_t, ros1_magic.size()> begin{};
    if (!file_.read(0, begin) ||
        std::string_view(reinterpret_cast<const char*>(begin.data()), begin.size()) != ros1_magic)
      throw files::ConfigError(path, 0,
                               "is a bag of ROS 1, but not of version 2.0: convert it with `rosbag fix` of ROS 1");
    at_ = ros1_magic.size();
    has_index_ = read_index();
    if (has_index_) return;
    topics_.clear();
    connections_.clear();
  }

  const std::vector<BagTopic>& topics() const override { return topics_; }
  bool has_index() const override { return has_index_; }

  std::optional<BagMessage> next() override {
    while (true) {
      if (chunk_) {
        if (auto message = next_in_chunk()) return message;
        continue;
      }
      if (ended_) return std::nullopt;
      next_record();
    }
  }

 private:
  struct Record {
    HeaderFields header;
    std::span<const std::uint8_t> data;
  };

  void define(const Record& record) {
    const auto data = fields_of(record.data);
    const auto id = number_in<std::uint32_t>(record.header, "conn");
    if (!data || connections_.contains(id)) return;
    const std::string topic = text_in(record.header, "topic");
    auto known =
        std::ranges::find(topics_, topic, &BagTopic::name);  // several publishers may have a connection of one topic
    if (known == topics_.end()) known = topics_.insert(topics_.end(), {topic, text_in(*data, "type"), "ros1", 0});
    connections_[id] = static_cast<std::size_t>(known - topics_.begin());
  }

  // The connections and chunks at the end. False: the recorder did not come to write them.
  bool read_index() {
    const auto bag = read_head(at_);
    if (!bag || number_in<std::uint8_t>(bag->fields, "op") != ros1_bag) return false;
    auto at = number_in<std::uint64_t>(bag->fields, "index_pos");
    auto left = std::uint64_t{number_in<std::uint32_t>(bag->fields, "conn_count")} +
                number_in<std::uint32_t>(bag->fields, "chunk_count");
    if (at == 0) return false;
    index_at_ = at;
    for (; left > 0; --left) {
      const auto head = read_head(at);
      if (!head || !file_.has(head->data_at, head->data_bytes)) return false;
      const Buffer data = file_.read(head->data_at, head->data_bytes);
      if (!data) return false;
      const auto bytes = std::span<const std::uint8_t>(*data).first(head->data_bytes);
      const auto op = number_in<std::uint8_t>(head->fields, "op");
      if (op == ros1_connection) define({head->fields, bytes});
      if (op == ros1_chunk_info) count(Cursor(bytes));
      at = head->data_at + head->data_bytes;
    }
    return true;
  }

  void count(Cursor in) {
    while (in.ok() && !in.at_end()) {
      const auto known = connections_.find(in.number<std::uint32_t>());
      const auto messages = in.number<std::uint32_t>();
      if (known != connections_.end()) topics_[known->second].messages += messages;
    }
  }

  struct Head {
    Buffer header;
    HeaderFields fields;  // of header
    std::uint64_t data_at = 0, data_bytes = 0;
  };

  // nullopt: there is no whole head.
  std::optional<Head> read_head(std::uint64_t at) const {
    std::array<std::uint8_t, 4> length{};
    if (!file_.read(at, length)) return std::nullopt;
    const auto header_bytes = Cursor(length).number<std::uint32_t>();
    if (header_bytes > largest_header) return std::nullopt;
    Head head;
    head.header = file_.read(at + 4, header_bytes);
    if (!head.header || !file_.read(at + 4 + header_bytes, length)) return std::nullopt;
    const auto fields = fields_of(std::span(*head.header).first(header_bytes));
    if (!fields || !fields->contains("op")) return std::nullopt;
    head.fields = *fields;
    head.data_at = at + 4 + header_bytes + 4;
    head.data_bytes = Cursor(length).number<std::uint32_t>();
    return head;
  }

  void next_record() {
    if (at_ == file_.size() || (has_index_ && at_ >= index_at_)) {
      ended_ = true;
      if (!has_index_) warn(path_.string() + ": has no index: its recorder did not finish it");
      return;
    }
    const auto head = read_head(at_);
    if (!head) return damaged(at_ + 4 > file_.size() ? cut_off : "is damaged: there is no record");
    const bool is_whole = file_.has(head->data_at, head->data_bytes);
    const auto op = number_in<std::uint8_t>(head->fields, "op");
    const std::uint64_t bytes = is_whole ? head->data_bytes : file_.size() - head->data_at;
    if (op == ros1_chunk || op == ros1_connection) {
      const Buffer data = file_.read(head->data_at, bytes);
      if (!data) return damaged("has a chunk of " + std::to_string(bytes >> 20) + " MiB, which cannot be read");
      const auto content = std::span<const std::uint8_t>(*data).first(bytes);
      if (op == ros1_connection)
        define({head->fields, content});
      else
        open_chunk(head->fields, data, content);
    }
    if (!is_whole) return damaged(cut_off);
    at_ = head->data_at + head->data_bytes;
  }

  void open_chunk(const HeaderFields& header, const Buffer& data, std::span<const std::uint8_t> content) {
    const std::string compression = text_in(header, "compression");
    chunk_ = data;
    if (compression != "none") {
      const Decompressed out = decompress(compression, content, number_in<std::uint32_t>(header, "size"));
      chunk_ = out.buffer;
      content = std::span(*out.buffer).first(out.size);
      if (!out.problem.empty()) warn(path_.string() + ": a chunk " + out.problem);
    }
    records_.emplace(content);
  }

  std::optional<BagMessage> next_in_chunk() {
    while (records_->ok() && !records_->at_end()) {
      const auto header = fields_of(records_->counted());
      const auto data = records_->counted();
      if (!header || !records_->ok()) break;
      const auto op = number_in<std::uint8_t>(*header, "op");
      if (op == ros1_connection) define({*header, data});
      if (op != ros1_message) continue;
      const auto known = connections_.find(number_in<std::uint32_t>(*header, "conn"));
      if (known == connections_.end()) continue;
      BagTopic& topic = topics_[known->second];
      if (!wanted_.empty() && topic.name != wanted_) continue;
      if (!has_index_) ++topic.messages;
      const auto time =
          number_in<std::uint64_t>(*header, "time");  // seconds in the lower half, nanoseconds in the upper
      return BagMessage{static_cast<std::int64_t>((time & 0xffff'ffff) * 1'000'000'000 + (time >> 32)), topic.type,
                        topic.encoding, data, chunk_};
    }
    chunk_ = nullptr;
    return std::nullopt;
  }

  void damaged(const std::string& problem) {
    warn(path_.string() + ": " + problem + " (at byte " + std::to_string(at_) + ")");
    ended_ = true;
  }

  static constexpr const char* cut_off = "is cut off: it has no end";

  const std::filesystem::path path_;
  const ByteFile file_;
  const std::string wanted_;
  bool has_index_ = false;
  std::uint64_t index_at_ = 0;
  std::vector<BagTopic> topics_;
  std::map<std::uint32_t, std::size_t> connections_;  // topics
  std::uint64_t at_ = 0;
  bool ended_ = false;
  Buffer chunk_;                   // open
  std::optional<Cursor> records_;  // of chunk_
};

}  // namespace

std::unique_ptr<BagFile> open_ros1(const std::filesystem::path& file, std::string_view wanted) {
  return std::make_unique<Ros1File>(file, wanted);
}

}  // namespace huetrack::bags
