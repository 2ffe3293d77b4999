// MCAP, version 0 (https://mcap.dev/spec): records of an opcode, a length and content, little-endian. Messages are in
// chunks, each followed by an index of its messages; the summary at the end has everything that a reader needs to seek.
#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <map>

#include "calib/yaml/output_file.h"
#include "clients/bag/bag.h"

namespace huetrack::bag {
namespace {

static_assert(std::endian::native == std::endian::little);
const std::string magic = "\x89MCAP0\r\n";
constexpr std::size_t chunk_bytes = 1 << 20;

enum Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0b,
  summary_offset = 0x0e,
  data_end = 0x0f,
};

template <typename Unsigned>
void add(std::string& out, Unsigned value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// A string, and everything else that has its length before it.
void add_sized(std::string& out, const std::string& text) {
  add(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

void add_record(std::string& out, Opcode opcode, const std::string& content) {
  out += static_cast<char>(opcode);
  add(out, static_cast<std::uint64_t>(content.size()));
  out += content;
}

// CRC-32 as zlib has it.
std::uint32_t crc32(const std::string& bytes, std::size_t from = 0) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> made{};
    for (std::uint32_t i = 0; i < made.size(); ++i) {
      made[i] = i;
      for (int bit = 0; bit < 8; ++bit) made[i] = made[i] >> 1U ^ (made[i] & 1U ? 0xedb88320U : 0U);
    }
    return made;
  }();
  std::uint32_t crc = 0xffffffffU;
  for (std::size_t i = from; i < bytes.size(); ++i)
    crc = table[(crc ^ static_cast<unsigned char>(bytes[i])) & 0xffU] ^ crc >> 8U;
  return ~crc;
}

using Index = std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>>;  // channel: time, offset

std::string times_and_offsets(const std::vector<std::pair<std::uint64_t, std::uint64_t>>& entries) {
  std::string out;
  for (const auto& [at, offset] : entries) {
    add(out, at);
    add(out, offset);
  }
  return out;
}

class Writer {
 public:
  explicit Writer(const Bag& bag) : bag_(bag) {
    out_ = magic;
    std::string about;
    add_sized(about, "ros2");
    add_sized(about, "huetrack");
    add_record(out_, header, about);
    add_definitions(out_);
    for (std::size_t i = 0; i < bag.messages.size();) i = add_chunk(i);
    std::string end;
    add(end, crc32(out_));
    add_record(out_, data_end, end);
    add_summary();
    out_ += magic;
  }
  const std::string& bytes() const { return out_; }

 private:
  // Schemas, one for each type, and channels, one for each topic; both are numbered from 1.
  void add_definitions(std::string& to) const {
    std::vector<std::string> types;
    std::string channels;
    for (std::size_t t = 0; t < bag_.topics.size(); ++t) {
      const Topic& topic = bag_.topics[t];
      auto type = std::ranges::find(types, topic.type);
      if (type == types.end()) {
        types.push_back(topic.type);
        type = types.end() - 1;
        std::string content;
        add(content, static_cast<std::uint16_t>(types.size()));
        add_sized(content, topic.type);
        add_sized(content, "ros2msg");
        add_sized(content, topic.definition);
        add_record(to, schema, content);
      }
      std::string content;
      add(content, static_cast<std::uint16_t>(t + 1));
      add(content, static_cast<std::uint16_t>(type - types.begin() + 1));
      add_sized(content, topic.name);
      add_sized(content, "cdr");
      add(content, std::uint32_t{0});  // no metadata
      add_record(channels, channel, content);
    }
    to += channels;
  }

  // From this message on; returns the first that is not in it.
  std::size_t add_chunk(std::size_t first) {
    std::string records;
    Index index;
    std::size_t i = first;
    for (; i < bag_.messages.size() && records.size() < chunk_bytes; ++i) {
      const Message& m = bag_.messages[i];
      const auto id = static_cast<std::uint16_t>(m.topic + 1);
      const auto at = static_cast<std::uint64_t>(m.at_ns);
      index[id].emplace_back(at, records.size());
      ++counts_[id];
      std::string content;
      add(content, id);
      add(content, static_cast<std::uint32_t>(counts_[id] - 1));
      add(content, at);  // logged
      add(content, at);  // published
      content += m.data;
      add_record(records, message, content);
    }
    const auto from = static_cast<std::uint64_t>(bag_.messages[first].at_ns);
    const auto to = static_cast<std::uint64_t>(bag_.messages[i - 1].at_ns);
    std::string content;
    add(content, from);
    add(content, to);
    add(content, static_cast<std::uint64_t>(records.size()));
    add(content, crc32(records));
    add_sized(content, "");  // not compressed
    add(content, static_cast<std::uint64_t>(records.size()));
    content += records;
    const std::uint64_t start = out_.size();
    add_record(out_, chunk, content);
    const std::uint64_t length = out_.size() - start;

    std::string offsets;  // of the message indexes
    const std::uint64_t indexes_from = out_.size();
    for (const auto& [id, entries] : index) {
      add(offsets, id);
      add(offsets, static_cast<std::uint64_t>(out_.size()));
      std::string entry;
      add(entry, id);
      add_sized(entry, times_and_offsets(entries));
      add_record(out_, message_index, entry);
    }
    std::string summary;
    add(summary, from);
    add(summary, to);
    add(summary, start);
    add(summary, length);
    add_sized(summary, offsets);
    add(summary, static_cast<std::uint64_t>(out_.size()) - indexes_from);
    add_sized(summary, "");
    add(summary, static_cast<std::uint64_t>(records.size()));
    add(summary, static_cast<std::uint64_t>(records.size()));
    add_record(chunk_indexes_, chunk_index, summary);
    ++chunks_;
    return i;
  }

  std::string statistics_of() const {
    std::string content, counts;
    add(content, static_cast<std::uint64_t>(bag_.messages.size()));
    std::vector<std::string> types;
    for (const Topic& topic : bag_.topics)
      if (std::ranges::find(types, topic.type) == types.end()) types.push_back(topic.type);
    add(content, static_cast<std::uint16_t>(types.size()));
    add(content, static_cast<std::uint32_t>(bag_.topics.size()));
    add(content, std::uint32_t{0});  // attachments
    add(content, std::uint32_t{0});  // metadata
    add(content, chunks_);
    add(content, static_cast<std::uint64_t>(bag_.messages.front().at_ns));
    add(content, static_cast<std::uint64_t>(bag_.messages.back().at_ns));
    for (const auto& [id, count] : counts_) {
      add(counts, id);
      add(counts, count);
    }
    add_sized(content, counts);
    return content;
  }

  void add_summary() {
    const std::uint64_t start = out_.size();
    add_definitions(out_);
    const std::uint64_t statistics_at = out_.size();
    add_record(out_, statistics, statistics_of());
    const std::uint64_t indexes_at = out_.size();
    out_ += chunk_indexes_;
    const std::uint64_t offsets_at = out_.size();
    for (const auto& [opcode, from, to] :
         {std::tuple{statistics, statistics_at, indexes_at}, {chunk_index, indexes_at, offsets_at}}) {
      std::string content(1, static_cast<char>(opcode));
      add(content, from);
      add(content, to - from);
      add_record(out_, summary_offset, content);
    }
    std::string content;
    add(content, start);
    add(content, offsets_at);
    // Of the summary, and of this record up to here.
    constexpr std::uint64_t footer_length = 8 + 8 + 4;
    std::string checked = out_.substr(start);
    checked += static_cast<char>(footer);
    add(checked, footer_length);
    checked += content;
    add(content, crc32(checked));
    add_record(out_, footer, content);
  }

  const Bag& bag_;
  std::string out_, chunk_indexes_;
  std::map<std::uint16_t, std::uint64_t> counts_;  // messages, by channel
  std::uint32_t chunks_ = 0;
};

constexpr yaml::FileKind mcap_kind{"MCAP", [](std::string_view text) { return text.starts_with("\x89MCAP"); }};

}  // namespace

void write_mcap(const Bag& bag, const std::filesystem::path& file) {
  yaml::refuse_other_kind(file, mcap_kind);
  yaml::write_whole_file(file, Writer(bag).bytes());
}

}  // namespace huetrack::bag
