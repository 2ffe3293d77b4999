// A rosbag2 of storage sqlite3: metadata.yaml and a database, both as rosbag2 of Humble writes them, without what newer
// ones add and older ones would not know (rosbag2_storage, sqlite_storage.cpp).
#include <fmt/format.h>
#include <sqlite3.h>

#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "calib/files/output_file.h"
#include "clients/bag/bag.h"

namespace huetrack::bag {
namespace {

class Database {
 public:
  explicit Database(const std::filesystem::path& file) : file_(file) {
    sqlite3* opened = nullptr;
    const int failed = ::sqlite3_open(file.c_str(), &opened);
    db_.reset(opened);
    check(failed);
  }
  void run(const std::string& sql) { check(::sqlite3_exec(db_.get(), sql.c_str(), nullptr, nullptr, nullptr)); }
  void check(int result) const {
    if (result != SQLITE_OK && result != SQLITE_DONE)
      throw std::runtime_error(file_.string() + ": cannot be written: " + ::sqlite3_errmsg(db_.get()));
  }
  sqlite3* get() const { return db_.get(); }

 private:
  struct Close {
    void operator()(sqlite3* db) const { ::sqlite3_close(db); }
  };
  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> db_;
};

// One INSERT, for any number of rows.
class Insertion {
 public:
  Insertion(Database& db, const char* sql) : db_(db) {
    sqlite3_stmt* prepared = nullptr;
    db.check(::sqlite3_prepare_v2(db.get(), sql, -1, &prepared, nullptr));
    statement_.reset(prepared);
  }
  Insertion& bind(int column, std::int64_t value) {
    db_.check(::sqlite3_bind_int64(statement_.get(), column, value));
    return *this;
  }
  Insertion& bind(int column, const std::string& text) {
    db_.check(::sqlite3_bind_text(statement_.get(), column, text.data(), int(text.size()), SQLITE_TRANSIENT));
    return *this;
  }
  Insertion& bind_bytes(int column, const std::string& bytes) {
    db_.check(::sqlite3_bind_blob(statement_.get(), column, bytes.data(), int(bytes.size()), SQLITE_TRANSIENT));
    return *this;
  }
  void run() {
    db_.check(::sqlite3_step(statement_.get()));
    db_.check(::sqlite3_reset(statement_.get()));
  }

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { ::sqlite3_finalize(statement); }
  };
  Database& db_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

// A YAML scalar in double quotes; text must not contain any.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text)
    if (c == '\n')
      out += "\\n";
    else
      out += c;
  return out + '"';
}

constexpr const char* database = "track_0.db3";

// Removes an unfinished bag.
struct Unfinished {
  explicit Unfinished(std::filesystem::path of) : folder(std::move(of)) {}
  ~Unfinished() {
    if (is_finished) return;
    std::error_code none;  // the folder is new, or was empty
    std::filesystem::remove(folder / database, none);
    std::filesystem::remove(folder, none);
  }
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

  const std::filesystem::path folder;
  bool is_finished = false;
};

class Rosbag2Writer final : public BagWriter {
 public:
  Rosbag2Writer(std::vector<Topic> topics, const std::filesystem::path& folder)
      : topics_(std::move(topics)), counts_(topics_.size(), 0), bag_(folder), db_(folder / database) {
    db_.run(
        "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT "
        "NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);CREATE "
        "TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT "
        "NULL);BEGIN;");
    Insertion insertion(db_, "INSERT INTO topics VALUES(?, ?, ?, 'cdr', ?)");
    for (std::size_t t = 0; t < topics_.size(); ++t)
      insertion.bind(1, std::int64_t(t) + 1)
          .bind(2, topics_[t].name)
          .bind(3, topics_[t].type)
          .bind(4, offered_qos_profiles(topics_[t]))
          .run();
    messages_.emplace(db_, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)");
  }

  void add(const Message& message) override {
    messages_->bind(1, std::int64_t(message.topic) + 1).bind(2, message.at_ns).bind_bytes(3, message.data).run();
    if (count_++ == 0) from_ns_ = message.at_ns;
    to_ns_ = message.at_ns;
    ++counts_[message.topic];
  }

  void finish() override {
    messages_.reset();
    db_.run("CREATE INDEX timestamp_idx ON messages (timestamp ASC); COMMIT;");
    files::write_whole_file(bag_.folder / "metadata.yaml", metadata());  // last: completes the bag
    bag_.is_finished = true;
  }

 private:
  std::string metadata() const {
    std::string topics;
    for (std::size_t t = 0; t < topics_.size(); ++t)
      topics += fmt::format(
          "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n"
          "        offered_qos_profiles: {}\n      message_count: {}\n",
          topics_[t].name, topics_[t].type, quoted(offered_qos_profiles(topics_[t])), counts_[t]);
    return fmt::format(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  duration:\n    nanoseconds: {1}\n"
        "  starting_time:\n    nanoseconds_since_epoch: {0}\n  message_count: {2}\n  topics_with_message_count:\n{3}  "
        "compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {4}\n  files:\n    - path: "
        "{4}\n"
        "      starting_time:\n        nanoseconds_since_epoch: {0}\n      duration:\n        nanoseconds: {1}\n"
        "      message_count: {2}\n",
        from_ns_, to_ns_ - from_ns_, count_, topics, database);
  }

  const std::vector<Topic> topics_;
  std::vector<std::size_t> counts_;  // messages, by topic
  Unfinished bag_;                   // before the database, which is closed first
  Database db_;
  std::optional<Insertion> messages_;
  std::size_t count_ = 0;
  std::int64_t from_ns_ = 0, to_ns_ = 0;
};

}  // namespace

std::unique_ptr<BagWriter> rosbag2_writer(std::vector<Topic> topics, const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  std::error_code none;
  if (fs::exists(folder, none) && !(fs::is_directory(folder, none) && fs::is_empty(folder, none)))
    throw std::runtime_error(folder.string() + " exists; a rosbag2 is a new folder: give another name");
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  return std::make_unique<Rosbag2Writer>(std::move(topics), folder);
}

}  // namespace huetrack::bag
