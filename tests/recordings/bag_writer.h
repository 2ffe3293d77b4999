// Bags of ROS for the tests to read back: messages as CDR or as ROS 1 writes them, in MCAP, rosbag2 and ROS 1's
// container.
#pragma once

#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "capture/clips.h"

namespace huetrack::recordings {

struct Wire {
  bool is_big_endian = false;
  bool is_ros1 = false;
};

// A message's bytes, field by field.
class MessageBytes {
 public:
  explicit MessageBytes(Wire wire) : wire_(wire) {}
  template <typename Number>
  MessageBytes& number(Number value) {
    if (!wire_.is_ros1)
      while (bytes_.size() % sizeof value != 0) bytes_ += '\0';
    std::string raw(reinterpret_cast<const char*>(&value), sizeof value);
    if (wire_.is_big_endian) std::ranges::reverse(raw);
    bytes_ += raw;
    return *this;
  }
  MessageBytes& counted(const std::string& content) {
    number(static_cast<std::uint32_t>(content.size()));
    bytes_ += content;
    return *this;
  }
  MessageBytes& text(const std::string& content) { return counted(wire_.is_ros1 ? content : content + '\0'); }
  MessageBytes& header(std::int64_t stamp_ns, const std::string& frame_id) {
    if (wire_.is_ros1) number(std::uint32_t{7});
    number(static_cast<std::int32_t>(stamp_ns / 1'000'000'000))
        .number(static_cast<std::uint32_t>(stamp_ns % 1'000'000'000));
    return text(frame_id);
  }
  template <typename Numbers>
  MessageBytes& numbers(const Numbers& values) {
    for (const auto value : values) number(value);
    return *this;
  }
  std::string done() const {
    if (wire_.is_ros1) return bytes_;
    return std::string({'\0', wire_.is_big_endian ? '\0' : '\1', '\0', '\0'}) + bytes_;
  }

 private:
  Wire wire_;
  std::string bytes_;  // CDR aligns from here, behind the encapsulation
};

inline std::string compressed_image(Wire wire, std::int64_t stamp_ns, const std::string& format,
                                    const std::string& data) {
  return MessageBytes(wire).header(stamp_ns, "optical").text(format).counted(data).done();
}
inline std::string raw_image(Wire wire, std::int64_t stamp_ns, int width, int height, const std::string& encoding,
                             std::uint32_t step, const std::string& data, bool is_big_endian = false) {
  return MessageBytes(wire)
      .header(stamp_ns, "optical")
      .number(static_cast<std::uint32_t>(height))
      .number(static_cast<std::uint32_t>(width))
      .text(encoding)
      .number(static_cast<std::uint8_t>(is_big_endian))
      .number(step)
      .counted(data)
      .done();
}

struct WrittenMessage {
  std::string topic, type;  // "sensor_msgs/msg/Image"
  std::int64_t at_ns = 0;
  std::string data;
};

inline std::string compressed_bytes(const std::string& method, const std::string& bytes) {
  std::string out;
  if (method == "zstd") {
    out.resize(::ZSTD_compressBound(bytes.size()));
    out.resize(::ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 1));
  } else if (method == "lz4") {
    out.resize(::LZ4F_compressFrameBound(bytes.size(), nullptr));
    out.resize(::LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), nullptr));
  } else if (method == "bz2") {
    auto size = static_cast<unsigned>(bytes.size() + bytes.size() / 50 + 1000);
    out.resize(size);
    ::BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(bytes.data()), static_cast<unsigned>(bytes.size()),
                               1, 0, 0);
    out.resize(size);
  } else {
    return bytes;
  }
  return out;
}

template <typename Number>
void put(std::string& out, Number value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}
inline void put_text(std::string& out, const std::string& text) {
  put(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

struct McapStyle {
  std::string compression = {};
  bool has_index = true;  // the summary
  bool has_chunks = true;
  bool has_checksums = true;
  std::size_t messages_per_chunk = 5;
  std::string encoding = "cdr";
};

// As rosbag2 writes it: schemas and channels in the chunks that need them first, and again in the summary.
inline std::string mcap_of(const std::vector<WrittenMessage>& messages, const McapStyle& style = {}) {
  const auto record = [](std::string& to, int opcode, const std::string& content) {
    to += static_cast<char>(opcode);
    put(to, static_cast<std::uint64_t>(content.size()));
    to += content;
  };
  const auto crc = [&](const std::string& bytes) {
    return style.has_checksums
               ? static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()))
               : 0U;
  };
  std::string out = "\x89MCAP0\r\n", head;
  put_text(head, "ros2");
  put_text(head, "test");
  record(out, 1, head);
  std::map<std::string, std::uint16_t> channels;
  std::map<std::uint16_t, std::uint64_t> counts;
  std::string definitions, chunk_indexes, records;
  std::map<std::uint16_t, std::uint64_t> in_chunk;  // any message's offset, by channel
  std::uint32_t chunks = 0;
  const auto end_chunk = [&] {
    if (records.empty()) return;
    std::string chunk;
    put(chunk, std::uint64_t{0});
    put(chunk, std::uint64_t{0});
    put(chunk, static_cast<std::uint64_t>(records.size()));
    put(chunk, crc(records));
    put_text(chunk, style.compression);
    const std::string stored = compressed_bytes(style.compression, records);
    put(chunk, static_cast<std::uint64_t>(stored.size()));
    chunk += stored;
    const std::uint64_t start = out.size();
    record(out, 6, chunk);
    const std::uint64_t length = out.size() - start;
    std::string offsets;
    for (const auto& [channel, offset] : in_chunk) {
      put(offsets, channel);
      put(offsets, static_cast<std::uint64_t>(out.size()));
      std::string index, entries;
      put(index, channel);
      put(entries, std::uint64_t{0});
      put(entries, offset);
      put_text(index, entries);
      record(out, 7, index);
    }
    std::string index;
    put(index, std::uint64_t{0});
    put(index, std::uint64_t{0});
    put(index, start);
    put(index, length);
    put_text(index, offsets);
    put(index, static_cast<std::uint64_t>(out.size() - start - length));
    put_text(index, style.compression);
    put(index, static_cast<std::uint64_t>(stored.size()));
    put(index, static_cast<std::uint64_t>(records.size()));
    record(chunk_indexes, 8, index);
    ++chunks;
    records.clear();
    in_chunk.clear();
  };
  std::size_t in_this = 0;
  for (const WrittenMessage& message : messages) {
    std::string& to = style.has_chunks ? records : out;
    if (!channels.contains(message.topic)) {
      const auto id = static_cast<std::uint16_t>(channels.size() + 1);
      channels[message.topic] = id;
      std::string schema, channel, both;
      put(schema, id);
      put_text(schema, message.type);
      put_text(schema, "ros2msg");
      put_text(schema, "");
      put(channel, id);
      put(channel, id);
      put_text(channel, message.topic);
      put_text(channel, style.encoding);
      put_text(channel, "");
      record(both, 3, schema);
      record(both, 4, channel);
      to += both;
      definitions += both;
    }
    const std::uint16_t id = channels[message.topic];
    std::string content;
    put(content, id);
    put(content, static_cast<std::uint32_t>(counts[id]++));
    put(content, static_cast<std::uint64_t>(message.at_ns));
    put(content, static_cast<std::uint64_t>(message.at_ns));
    content += message.data;
    in_chunk[id] = to.size();
    record(to, 5, content);
    if (style.has_chunks && ++in_this % style.messages_per_chunk == 0) end_chunk();
  }
  end_chunk();
  std::string end;
  put(end, std::uint32_t{0});
  record(out, 15, end);
  const std::uint64_t summary_at = out.size();
  std::string footer;
  put(footer, style.has_index ? summary_at : std::uint64_t{0});
  put(footer, std::uint64_t{0});
  std::string summary;
  if (style.has_index) {
    summary = definitions;
    std::string statistics, per_channel;
    put(statistics, static_cast<std::uint64_t>(messages.size()));
    put(statistics, static_cast<std::uint16_t>(channels.size()));
    put(statistics, static_cast<std::uint32_t>(channels.size()));
    put(statistics, std::uint32_t{0});
    put(statistics, std::uint32_t{0});
    put(statistics, chunks);
    put(statistics, std::uint64_t{0});
    put(statistics, std::uint64_t{0});
    for (const auto& [channel, count] : counts) {
      put(per_channel, channel);
      put(per_channel, count);
    }
    put_text(statistics, per_channel);
    record(summary, 11, statistics);
    summary += chunk_indexes;
  }
  std::string checked = summary;
  checked += '\2';
  put(checked, std::uint64_t{20});
  checked += footer;
  put(footer, style.has_index ? crc(checked) : 0U);
  record(summary, 2, footer);
  return out + summary + "\x89MCAP0\r\n";
}

// A ROS 1 bag; messages must be of Wire::is_ros1. Types as "sensor_msgs/Image".
inline std::string ros1_bag_of(const std::vector<WrittenMessage>& messages, const std::string& compression = "none",
                               bool has_index = true, std::size_t messages_per_chunk = 5) {
  const auto field = [](const std::string& name, const std::string& value) {
    std::string out;
    put_text(out, name + "=" + value);
    return out;
  };
  const auto number = [](auto value) {
    std::string out;
    put(out, value);
    return out;
  };
  const auto record = [](std::string& to, const std::string& header, const std::string& data) {
    put_text(to, header);
    put_text(to, data);
  };
  std::map<std::string, std::uint32_t> connections;
  std::string definitions, chunk_infos, chunk;
  std::map<std::uint32_t, std::uint32_t> counts;
  std::string body;
  std::uint32_t chunk_count = 0;
  constexpr std::size_t body_at = 13 + 4096;
  const auto end_chunk = [&] {
    if (chunk.empty()) return;
    std::string info, of_connections;
    for (const auto& [id, count] : counts) {
      put(of_connections, id);
      put(of_connections, count);
    }
    record(chunk_infos,
           field("op", "\6") + field("ver", number(std::uint32_t{1})) +
               field("chunk_pos", number(std::uint64_t{body_at + body.size()})) +
               field("count", number(static_cast<std::uint32_t>(counts.size()))),
           of_connections);
    record(body,
           field("op", "\5") + field("compression", compression) +
               field("size", number(static_cast<std::uint32_t>(chunk.size()))),
           compressed_bytes(compression, chunk));
    ++chunk_count;
    chunk.clear();
    counts.clear();
  };
  std::size_t k = 0;
  for (const WrittenMessage& message : messages) {
    if (!connections.contains(message.topic)) {
      const auto id = static_cast<std::uint32_t>(connections.size());
      connections[message.topic] = id;
      std::string both;
      record(both, field("op", "\7") + field("conn", number(id)) + field("topic", message.topic),
             field("topic", message.topic) + field("type", message.type) + field("md5sum", "*") +
                 field("message_definition", ""));
      chunk += both;
      definitions += both;
    }
    const std::uint32_t id = connections[message.topic];
    const std::uint64_t time = static_cast<std::uint64_t>(message.at_ns / 1'000'000'000) |
                               static_cast<std::uint64_t>(message.at_ns % 1'000'000'000) << 32;
    record(chunk, field("op", "\2") + field("conn", number(id)) + field("time", number(time)), message.data);
    ++counts[id];
    if (++k % messages_per_chunk == 0) end_chunk();
  }
  end_chunk();
  std::string out = "#ROSBAG V2.0\n";
  const std::string header =
      field("op", "\3") +
      field("index_pos", number(has_index ? std::uint64_t{body_at + body.size()} : std::uint64_t{0})) +
      field("conn_count", number(static_cast<std::uint32_t>(has_index ? connections.size() : 0))) +
      field("chunk_count", number(has_index ? chunk_count : 0U));
  record(out, header, std::string(body_at - out.size() - 8 - header.size(), ' '));
  return out + body + (has_index ? definitions + chunk_infos : std::string());
}

// One file of a rosbag2 of storage sqlite3.
inline void write_db3(const std::filesystem::path& file, const std::vector<WrittenMessage>& messages) {
  sqlite3* db = nullptr;
  ::sqlite3_open(file.c_str(), &db);
  ::sqlite3_exec(
      db,
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format "
      "TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data "
      "BLOB NOT NULL); CREATE INDEX timestamp_idx ON messages (timestamp ASC); BEGIN;",
      nullptr, nullptr, nullptr);
  std::map<std::string, std::int64_t> topics;
  for (const WrittenMessage& message : messages) {
    if (!topics.contains(message.topic)) {
      topics[message.topic] = static_cast<std::int64_t>(topics.size() + 1);
      const std::string sql = "INSERT INTO topics VALUES(" + std::to_string(topics[message.topic]) + ", '" +
                              message.topic + "', '" + message.type + "', 'cdr', '')";
      ::sqlite3_exec(db, sql.c_str(), nullptr, nullptr, nullptr);
    }
    sqlite3_stmt* insert = nullptr;
    ::sqlite3_prepare_v2(db, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &insert, nullptr);
    ::sqlite3_bind_int64(insert, 1, topics[message.topic]);
    ::sqlite3_bind_int64(insert, 2, message.at_ns);
    ::sqlite3_bind_blob(insert, 3, message.data.data(), static_cast<int>(message.data.size()), SQLITE_TRANSIENT);
    ::sqlite3_step(insert);
    ::sqlite3_finalize(insert);
  }
  ::sqlite3_exec(db, "COMMIT", nullptr, nullptr, nullptr);
  if (::sqlite3_close(db) != SQLITE_OK) throw std::runtime_error("the database cannot be written");
}

}  // namespace huetrack::recordings
