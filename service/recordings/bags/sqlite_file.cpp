// A file of a rosbag2 with storage sqlite3: the tables topics and messages. Messages may be compressed one by one.
#include <sqlite3.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/text_file.h"
#include "recordings/bags/bag_file.h"
#include "recordings/bags/byte_file.h"
#include "recordings/bags/decompress.h"

namespace huetrack::bags {
namespace {

struct CloseDatabase {
  void operator()(sqlite3* p) const { ::sqlite3_close(p); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* p) const { ::sqlite3_finalize(p); }
};
using StatementPtr = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

class SqliteFile final : public BagFile {
 public:
  SqliteFile(const std::filesystem::path& path, std::string_view wanted) : path_(path) {
    sqlite3* opened = nullptr;
    const int error = ::sqlite3_open_v2(path.c_str(), &opened, SQLITE_OPEN_READONLY, nullptr);
    database_.reset(opened);
    if (error != SQLITE_OK) fail();
    ::sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, static_cast<int>(largest_bytes));
    const StatementPtr topics = prepared("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    while (stepped(topics.get())) {
      BagTopic topic{text(topics.get(), 1), plain_type(text(topics.get(), 2)), text(topics.get(), 3), 0};
      if (wanted.empty() || topic.name == wanted)
        wanted_.emplace_back(::sqlite3_column_int64(topics.get(), 0), topics_.size());
      topics_.push_back(std::move(topic));
    }
    if (!warnings.empty()) fail();
    count_messages();
    // By number: in order of time the database would be sorted, where it has no index.
    messages_ = prepared("SELECT topic_id, timestamp, data FROM messages ORDER BY id");
  }

  const std::vector<BagTopic>& topics() const override { return topics_; }
  bool has_index() const override { return has_counts_; }

  std::optional<BagMessage> next() override {
    while (stepped(messages_.get())) {
      const auto wanted = std::ranges::find(wanted_, ::sqlite3_column_int64(messages_.get(), 0),
                                            &std::pair<std::int64_t, std::size_t>::first);
      if (wanted == wanted_.end()) continue;
      BagTopic& topic = topics_[wanted->second];
      if (!has_counts_) ++topic.messages;
      const auto* data = static_cast<const std::uint8_t*>(::sqlite3_column_blob(messages_.get(), 2));
      const auto size = static_cast<std::size_t>(::sqlite3_column_bytes(messages_.get(), 2));
      const std::span<const std::uint8_t> blob(data, data == nullptr ? 0 : size);
      Buffer buffer = make_buffer(blob.size());
      std::ranges::copy(blob, buffer->begin());
      const std::span<const std::uint8_t> own = std::span(*buffer).first(blob.size());
      return BagMessage{::sqlite3_column_int64(messages_.get(), 1), topic.type, topic.encoding, own, buffer};
    }
    return std::nullopt;
  }

 private:
  // Of a damaged file they are counted as they come.
  void count_messages() {
    const StatementPtr count = prepared("SELECT COUNT(*) FROM messages WHERE topic_id = ?");
    for (const auto& [id, topic] : wanted_) {
      ::sqlite3_bind_int64(count.get(), 1, id);
      has_counts_ = has_counts_ && ::sqlite3_step(count.get()) == SQLITE_ROW;
      topics_[topic].messages = has_counts_ ? ::sqlite3_column_int64(count.get(), 0) : 0;
      ::sqlite3_reset(count.get());
    }
    if (!has_counts_)
      for (BagTopic& topic : topics_) topic.messages = 0;
  }

  // False at the end, and at damage, with a warning.
  bool stepped(sqlite3_stmt* statement) {
    if (has_ended_) return false;
    const int result = ::sqlite3_step(statement);
    if (result != SQLITE_ROW && result != SQLITE_DONE) {
      has_ended_ = true;
      warn(path_.string() + ": is cut off or damaged: " + ::sqlite3_errmsg(database_.get()));
    }
    return result == SQLITE_ROW;
  }

  StatementPtr prepared(const char* sql) {
    sqlite3_stmt* made = nullptr;
    if (::sqlite3_prepare_v2(database_.get(), sql, -1, &made, nullptr) != SQLITE_OK) fail();
    return StatementPtr(made);
  }

  static std::string text(sqlite3_stmt* statement, int column) {
    const auto* own = reinterpret_cast<const char*>(::sqlite3_column_text(statement, column));
    return own == nullptr ? std::string() : std::string(own);
  }

  [[noreturn]] void fail() const {
    throw files::ConfigError(
        path_, 0, std::string("is not a rosbag2 that SQLite can read: ") + ::sqlite3_errmsg(database_.get()));
  }

  const std::filesystem::path path_;
  std::unique_ptr<sqlite3, CloseDatabase> database_;
  StatementPtr messages_;
  std::vector<BagTopic> topics_;
  std::vector<std::pair<std::int64_t, std::size_t>> wanted_;  // topic_id, index in topics_
  bool has_counts_ = true;
  bool has_ended_ = false;
};

}  // namespace

std::unique_ptr<BagFile> open_sqlite(const std::filesystem::path& file, std::string_view wanted) {
  return std::make_unique<SqliteFile>(file, wanted);
}

}  // namespace huetrack::bags
