// MCAP, version 0 (https://mcap.dev/spec): records of an opcode, a length and content, little-endian. Messages are in
// chunks, each followed by an index of its messages; the summary at the end has everything that a reader needs to seek.
#include <zlib.h>

#include <algorithm>
#include <map>
#include <utility>

#include "calib/files/output_file.h"
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

std::uint32_t checksum(const std::string& bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
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

class McapWriter final : public BagWriter {
 public:
  McapWriter(std::vector<Topic> topics, const std::filesystem::path& file) : topics_(std::move(topics)), file_(file) {
    std::string begin = magic, about;
    add_sized(about, "ros2");
    add_sized(about, "huetrack");
    add_record(begin, header, about);
    add_definitions(begin);
    put(begin);
  }

  void add(const Message& m) override {
    const auto id = static_cast<std::uint16_t>(m.topic + 1);
    const auto at = static_cast<std::uint64_t>(m.at_ns);
    if (counts_.empty()) first_ = at;
    if (records_.empty()) chunk_from_ = at;
    last_ = at;
    index_[id].emplace_back(at, records_.size());
    ++counts_[id];
    std::string content;
    bag::add(content, id);
    bag::add(content, static_cast<std::uint32_t>(counts_[id] - 1));
    bag::add(content, at);  // logged
    bag::add(content, at);  // published
    content += m.data;
    add_record(records_, message, content);
    if (records_.size() >= chunk_bytes) end_chunk();
  }

  void finish() override {
    if (!records_.empty()) end_chunk();
    std::string end, record;
    bag::add(end, checksum_);
    add_record(record, data_end, end);
    put(record);
    put_summary();
    put(magic);
    file_.finish();
  }

 private:
  void put(const std::string& bytes) {
    file_.write(bytes);
    at_ += bytes.size();
    checksum_ =
        static_cast<std::uint32_t>(::crc32_z(checksum_, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
  }

  // Schemas, one for each type, and channels, one for each topic; both are numbered from 1.
  void add_definitions(std::string& to) const {
    std::vector<std::string> types;
    std::string channels;
    for (std::size_t t = 0; t < topics_.size(); ++t) {
      const Topic& topic = topics_[t];
      auto type = std::ranges::find(types, topic.type);
      if (type == types.end()) {
        types.push_back(topic.type);
        type = types.end() - 1;
        std::string content;
        bag::add(content, static_cast<std::uint16_t>(types.size()));
        add_sized(content, topic.type);
        add_sized(content, "ros2msg");
        add_sized(content, topic.definition);
        add_record(to, schema, content);
      }
      std::string content;
      bag::add(content, static_cast<std::uint16_t>(t + 1));
      bag::add(content, static_cast<std::uint16_t>(type - types.begin() + 1));
      add_sized(content, topic.name);
      add_sized(content, "cdr");
      std::string metadata;
      if (const std::string qos = offered_qos_profiles(topic); !qos.empty()) {
        add_sized(metadata, "offered_qos_profiles");
        add_sized(metadata, qos);
      }
      add_sized(content, metadata);
      add_record(channels, channel, content);
    }
    to += channels;
  }

  void end_chunk() {
    std::string content;
    bag::add(content, chunk_from_);
    bag::add(content, last_);
    bag::add(content, static_cast<std::uint64_t>(records_.size()));
    bag::add(content, checksum(records_));
    add_sized(content, "");  // not compressed
    bag::add(content, static_cast<std::uint64_t>(records_.size()));
    content += records_;
    const std::uint64_t start = at_;
    std::string out;
    add_record(out, chunk, content);
    const std::uint64_t length = out.size();

    std::string offsets;  // of the message indexes
    const std::uint64_t indexes_from = out.size();
    for (const auto& [id, entries] : index_) {
      bag::add(offsets, id);
      bag::add(offsets, static_cast<std::uint64_t>(start + out.size()));
      std::string entry;
      bag::add(entry, id);
      add_sized(entry, times_and_offsets(entries));
      add_record(out, message_index, entry);
    }
    std::string summary;
    bag::add(summary, chunk_from_);
    bag::add(summary, last_);
    bag::add(summary, start);
    bag::add(summary, length);
    add_sized(summary, offsets);
    bag::add(summary, static_cast<std::uint64_t>(out.size()) - indexes_from);
    add_sized(summary, "");
    bag::add(summary, static_cast<std::uint64_t>(records_.size()));
    bag::add(summary, static_cast<std::uint64_t>(records_.size()));
    add_record(chunk_indexes_, chunk_index, summary);
    put(out);
    ++chunks_;
    records_.clear();
    index_.clear();
  }

  std::string statistics_of() const {
    std::string content, counts;
    std::uint64_t messages = 0;
    for (const auto& [id, count] : counts_) messages += count;
    bag::add(content, messages);
    std::vector<std::string> types;
    for (const Topic& topic : topics_)
      if (std::ranges::find(types, topic.type) == types.end()) types.push_back(topic.type);
    bag::add(content, static_cast<std::uint16_t>(types.size()));
    bag::add(content, static_cast<std::uint32_t>(topics_.size()));
    bag::add(content, std::uint32_t{0});  // attachments
    bag::add(content, std::uint32_t{0});  // metadata
    bag::add(content, chunks_);
    bag::add(content, first_);
    bag::add(content, last_);
    for (const auto& [id, count] : counts_) {
      bag::add(counts, id);
      bag::add(counts, count);
    }
    add_sized(content, counts);
    return content;
  }

  void put_summary() {
    const std::uint64_t start = at_;
    std::string out;
    add_definitions(out);
    const std::uint64_t statistics_at = start + out.size();
    add_record(out, statistics, statistics_of());
    const std::uint64_t indexes_at = start + out.size();
    out += chunk_indexes_;
    const std::uint64_t offsets_at = start + out.size();
    for (const auto& [opcode, from, to] :
         {std::tuple{statistics, statistics_at, indexes_at}, {chunk_index, indexes_at, offsets_at}}) {
      std::string content(1, static_cast<char>(opcode));
      bag::add(content, from);
      bag::add(content, to - from);
      add_record(out, summary_offset, content);
    }
    std::string content;
    bag::add(content, start);
    bag::add(content, offsets_at);
    // Of the summary, and of this record up to here.
    constexpr std::uint64_t footer_length = 8 + 8 + 4;
    std::string checked = out;
    checked += static_cast<char>(footer);
    bag::add(checked, footer_length);
    checked += content;
    bag::add(content, checksum(checked));
    add_record(out, footer, content);
    put(out);
  }

  const std::vector<Topic> topics_;
  files::WholeFile file_;
  std::uint64_t at_ = 0;        // bytes that are written
  std::uint32_t checksum_ = 0;  // of them
  std::string records_;         // of the chunk that is not written yet, from the beginning of which:
  Index index_;
  std::uint64_t chunk_from_ = 0, first_ = 0, last_ = 0;
  std::string chunk_indexes_;
  std::map<std::uint16_t, std::uint64_t> counts_;  // messages, by channel
  std::uint32_t chunks_ = 0;
};

constexpr files::FileKind mcap_kind{"MCAP", [](std::string_view text) { return text.starts_with("\x89MCAP"); }};

}  // namespace

std::unique_ptr<BagWriter> mcap_writer(std::vector<Topic> topics, const std::filesystem::path& file) {
  files::refuse_other_kind(file, mcap_kind);
  return std::make_unique<McapWriter>(std::move(topics), file);
}

}  // namespace huetrack::bag
