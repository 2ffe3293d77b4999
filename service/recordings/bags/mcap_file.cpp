// MCAP, version 0 (https://mcap.dev/spec): records of an opcode, a length and content, little-endian. Messages lie in
// chunks, or between them. The summary at the end has the topics, and where which chunk is.
#include <zlib.h>

#include <algorithm>
#include <array>
#include <map>

#include "calib/files/config_error.h"
#include "calib/files/text_file.h"
#include "recordings/bags/bag_file.h"
#include "recordings/bags/byte_file.h"
#include "recordings/bags/decompress.h"

namespace huetrack::bags {
namespace {

constexpr std::string_view mcap_magic = "\x89MCAP0\r\n";
constexpr std::uint64_t record_head = 1 + 8;                     // opcode, length
constexpr std::uint64_t footer_bytes = record_head + 8 + 8 + 4;  // with its head
constexpr std::uint64_t largest_summary = 64U << 20;             // capacity: bytes

enum McapOpcode : std::uint8_t {
  mcap_footer = 0x02,
  mcap_schema = 0x03,
  mcap_channel = 0x04,
  mcap_message = 0x05,
  mcap_chunk = 0x06,
  mcap_chunk_index = 0x08,
  mcap_statistics = 0x0b,
  mcap_data_end = 0x0f,
};

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
}

class McapFile final : public BagFile {
 public:
  McapFile(const std::filesystem::path& path, std::string_view wanted) : path_(path), file_(path), wanted_(wanted) {
    std::array<std::uint8_t, mcap_magic.size()> begin{};
    if (!file_.read(0, begin) || !std::ranges::equal(begin, mcap_magic, {}, {}, [](char c) { return std::uint8_t(c); }))
      throw files::ConfigError(path, 0, "is not an MCAP file of version 0");
    at_ = mcap_magic.size();
    has_index_ = read_summary();
    if (!has_index_) forget();
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
      if (auto message = next_record()) return message;
    }
  }

 private:
  struct Record {
    McapOpcode opcode{};
    std::span<const std::uint8_t> content;
  };
  struct ChunkPlace {
    std::uint64_t end = 0;  // of the chunk and its message indexes
    bool is_wanted = true;
  };

  // ---- Schemas and channels

  void define(const Record& record) {
    Cursor in(record.content);
    const auto id = in.number<std::uint16_t>();
    if (record.opcode == mcap_schema) {
      const std::string name(in.text());
      if (in.ok()) schemas_[id] = plain_type(name);
    } else if (record.opcode == mcap_channel) {
      const auto schema = in.number<std::uint16_t>();
      const std::string topic(in.text()), encoding(in.text());
      if (!in.ok() || channels_.contains(id)) return;
      const std::string type = schemas_.contains(schema) ? schemas_.at(schema) : std::string();
      auto known =
          std::ranges::find(topics_, topic, &BagTopic::name);  // several recorders may have a channel of one topic
      if (known == topics_.end()) known = topics_.insert(topics_.end(), {topic, type, encoding, 0});
      channels_[id] = static_cast<std::size_t>(known - topics_.begin());
    }
  }

  bool is_wanted(std::uint16_t channel) const {
    const auto known = channels_.find(channel);
    return known != channels_.end() && (wanted_.empty() || topics_[known->second].name == wanted_);
  }

  std::optional<BagMessage> message_of(std::span<const std::uint8_t> content,
                                       const std::shared_ptr<const void>& owner) {
    Cursor in(content);
    const auto channel = in.number<std::uint16_t>();
    in.number<std::uint32_t>();  // number
    const auto logged_at = in.number<std::uint64_t>();
    in.number<std::uint64_t>();  // published: ROS 2 has the same there
    if (!in.ok() || !is_wanted(channel)) return std::nullopt;
    BagTopic& topic = topics_[channels_.at(channel)];
    if (!has_index_) ++topic.messages;
    return BagMessage{static_cast<std::int64_t>(logged_at), topic.type, topic.encoding, content.subspan(in.at()),
                      owner};
  }

  // ---- The summary

  // False: there is none, or it does not describe the whole file.
  bool read_summary() {
    if (!file_.has(mcap_magic.size(), footer_bytes + mcap_magic.size())) return false;
    const std::uint64_t footer_at = file_.size() - mcap_magic.size() - footer_bytes;
    const Buffer end = file_.read(footer_at, footer_bytes + mcap_magic.size());
    if (!end) return false;
    Cursor footer{std::span(*end).first(footer_bytes)};
    if (footer.number<std::uint8_t>() != mcap_footer || footer.number<std::uint64_t>() != footer_bytes - record_head ||
        !std::equal(mcap_magic.begin(), mcap_magic.end(), end->begin() + footer_bytes,
                    [](char a, std::uint8_t b) { return std::uint8_t(a) == b; }))
      return false;
    const auto start = footer.number<std::uint64_t>();
    footer.number<std::uint64_t>();  // summary offsets
    const auto checksum = footer.number<std::uint32_t>();
    if (start < mcap_magic.size() || start >= footer_at || footer_at - start > largest_summary) return false;
    const Buffer summary = file_.read(start, footer_at - start + footer_bytes - 4);
    if (!summary) return false;
    const auto bytes = std::span(*summary).first(footer_at - start + footer_bytes - 4);
    if (checksum != 0 && crc_of(bytes) != checksum) return false;

    std::optional<std::uint32_t> chunks;  // by the statistics
    std::map<std::uint16_t, std::uint64_t> counts;
    Cursor in(bytes.first(footer_at - start));
    std::vector<Record> indexes;
    while (in.ok() && !in.at_end()) {
      const auto opcode = static_cast<McapOpcode>(in.number<std::uint8_t>());
      const Record record{opcode, in.bytes(in.number<std::uint64_t>())};
      if (!in.ok()) return false;
      define(record);
      if (opcode == mcap_chunk_index) indexes.push_back(record);
      if (opcode == mcap_statistics) chunks = read_statistics(record.content, counts);
    }
    for (const Record& record : indexes)
      if (!place_chunk(record.content)) return false;
    if (!chunks || *chunks != chunks_.size()) return false;
    for (const auto& [channel, count] : counts) {
      if (!channels_.contains(channel)) return false;
      topics_[channels_.at(channel)].messages += static_cast<std::int64_t>(count);
    }
    return true;
  }

  static std::optional<std::uint32_t> read_statistics(std::span<const std::uint8_t> content,
                                                      std::map<std::uint16_t, std::uint64_t>& counts) {
    Cursor in(content);
    in.bytes(8 + 2 + 4 + 4 + 4);  // messages, schemas, channels, attachments, metadata
    const auto chunks = in.number<std::uint32_t>();
    in.bytes(8 + 8);  // first and last time
    Cursor map(in.counted());
    while (map.ok() && !map.at_end()) {
      const auto channel = map.number<std::uint16_t>();
      counts[channel] = map.number<std::uint64_t>();
    }
    return in.ok() && map.ok() ? std::optional(chunks) : std::nullopt;
  }

  bool place_chunk(std::span<const std::uint8_t> content) {
    Cursor in(content);
    in.bytes(8 + 8);  // first and last time
    const auto start = in.number<std::uint64_t>(), length = in.number<std::uint64_t>();
    Cursor offsets(in.counted());
    const auto index_length = in.number<std::uint64_t>();
    if (!in.ok() || !file_.has(start, length) || !file_.has(start + length, index_length)) return false;
    ChunkPlace place{.end = start + length + index_length, .is_wanted = offsets.at_end()};  // without offsets: unknown
    while (offsets.ok() && !offsets.at_end()) {
      place.is_wanted = is_wanted(offsets.number<std::uint16_t>()) || place.is_wanted;
      offsets.number<std::uint64_t>();
    }
    chunks_[start] = place;
    return offsets.ok();
  }

  void forget() {
    topics_.clear();
    channels_.clear();
    schemas_.clear();
    chunks_.clear();
  }

  // ---- The data

  // A message between the chunks; or none, and then a chunk is open, or the next record follows.
  std::optional<BagMessage> next_record() {
    if (const auto place = chunks_.find(at_); place != chunks_.end() && !place->second.is_wanted) {
      at_ = place->second.end;
      return std::nullopt;
    }
    std::array<std::uint8_t, record_head> head{};
    if (!file_.read(at_, head)) return damaged(cut_off);
    Cursor in(head);
    const auto opcode = static_cast<McapOpcode>(in.number<std::uint8_t>());
    const auto length = in.number<std::uint64_t>();
    const std::uint64_t content_at = at_ + record_head;
    if (opcode == mcap_data_end || opcode == mcap_footer) {
      ended_ = true;
      return std::nullopt;
    }
    if (opcode == 0 || (opcode > mcap_data_end && opcode < 0x80)) return damaged("is damaged: there is no record");
    const bool is_whole = file_.has(content_at, length);
    if (opcode == mcap_chunk) return open_chunk(content_at, is_whole ? length : file_.size() - content_at, is_whole);
    if (!is_whole) return damaged(cut_off);
    at_ = content_at + length;
    if (opcode != mcap_schema && opcode != mcap_channel && opcode != mcap_message) return std::nullopt;
    const Buffer buffer = file_.read(content_at, length);
    if (!buffer) return damaged("has a record of " + std::to_string(length >> 20) + " MiB, which cannot be read");
    const Record record{opcode, std::span(*buffer).first(length)};
    if (opcode == mcap_message) return message_of(record.content, buffer);
    define(record);
    return std::nullopt;
  }

  std::nullopt_t open_chunk(std::uint64_t content_at, std::uint64_t length, bool is_whole) {
    const Buffer buffer = file_.read(content_at, length);
    if (!buffer) return damaged("has a chunk of " + std::to_string(length >> 20) + " MiB, which cannot be read");
    Cursor in{std::span(*buffer).first(length)};
    in.bytes(8 + 8);  // first and last time
    const auto size = in.number<std::uint64_t>();
    const auto checksum = in.number<std::uint32_t>();
    const std::string compression(in.text());
    const auto declared = in.number<std::uint64_t>();
    if (!in.ok()) return damaged(cut_off);
    const auto stored = in.bytes(std::min<std::uint64_t>(declared, length - in.at()));
    std::string problem = is_whole ? "" : cut_off;
    std::span<const std::uint8_t> records = stored;
    chunk_ = buffer;
    if (!compression.empty()) {
      const Decompressed out = decompress(compression, stored, size);
      chunk_ = out.buffer;
      records = std::span(*out.buffer).first(out.size);
      if (is_whole && !out.problem.empty()) problem = "a chunk " + out.problem;
    }
    if (problem.empty() && (records.size() != size || (checksum != 0 && crc_of(records) != checksum))) {
      problem = "is damaged: a chunk has a wrong checksum and is left out";
      records = {};
    }
    records_.emplace(records);
    at_ = content_at + length;
    if (problem.empty()) return std::nullopt;
    return is_whole ? note(problem) : damaged(problem);
  }

  std::optional<BagMessage> next_in_chunk() {
    while (records_->ok() && !records_->at_end()) {
      const auto opcode = static_cast<McapOpcode>(records_->number<std::uint8_t>());
      const Record record{opcode, records_->bytes(records_->number<std::uint64_t>())};
      if (!records_->ok()) break;
      if (opcode == mcap_message) {
        if (auto message = message_of(record.content, chunk_)) return message;
      } else {
        define(record);
      }
    }
    chunk_ = nullptr;
    return std::nullopt;
  }

  std::nullopt_t note(const std::string& problem) {
    warn(path_.string() + ": " + problem);
    return std::nullopt;
  }

  // Goes on at the next chunk that the index knows.
  std::nullopt_t damaged(const std::string& problem) {
    note(problem + " (at byte " + std::to_string(at_) + ")");
    const auto next = chunks_.upper_bound(at_);
    ended_ = next == chunks_.end();
    if (!ended_) at_ = next->first;
    return std::nullopt;
  }

  static constexpr const char* cut_off = "is cut off: it has no end";

  const std::filesystem::path path_;
  const ByteFile file_;
  const std::string wanted_;
  bool has_index_ = false;
  std::vector<BagTopic> topics_;
  std::map<std::uint16_t, std::string> schemas_;   // types
  std::map<std::uint16_t, std::size_t> channels_;  // topics
  std::map<std::uint64_t, ChunkPlace> chunks_;     // by their place in the file
  std::uint64_t at_ = 0;
  bool ended_ = false;
  Buffer chunk_;                   // open
  std::optional<Cursor> records_;  // of chunk_
};

}  // namespace

std::unique_ptr<BagFile> open_mcap(const std::filesystem::path& file, std::string_view wanted) {
  return std::make_unique<McapFile>(file, wanted);
}

}  // namespace huetrack::bags
