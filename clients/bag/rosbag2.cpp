// A rosbag2 of storage sqlite3: metadata.yaml and a database, both as rosbag2 of Humble writes them, without what newer
// ones add and older ones would not know (rosbag2_storage, sqlite_storage.cpp).
#include <fmt/format.h>
#include <sqlite3.h>

#include <memory>
#include <stdexcept>

#include "calib/yaml/output_file.h"
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

void write_database(const Bag& bag, const std::filesystem::path& file) {
  Database db(file);
  db.run(
      "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;"
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT "
      "NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL);"
      "BEGIN;");
  Insertion topics(db, "INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')");
  for (std::size_t t = 0; t < bag.topics.size(); ++t)
    topics.bind(1, std::int64_t(t) + 1).bind(2, bag.topics[t].name).bind(3, bag.topics[t].type).run();
  Insertion messages(db, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)");
  for (const Message& message : bag.messages)
    messages.bind(1, std::int64_t(message.topic) + 1).bind(2, message.at_ns).bind_bytes(3, message.data).run();
  db.run("CREATE INDEX timestamp_idx ON messages (timestamp ASC); COMMIT;");
}

std::string metadata_of(const Bag& bag, const std::string& database) {
  const std::int64_t from = bag.messages.front().at_ns, duration = bag.messages.back().at_ns - from;
  std::vector<std::size_t> counts(bag.topics.size(), 0);
  for (const Message& message : bag.messages) ++counts[message.topic];
  std::string topics;
  for (std::size_t t = 0; t < bag.topics.size(); ++t)
    topics += fmt::format(
        "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n"
        "        offered_qos_profiles: \"\"\n      message_count: {}\n",
        bag.topics[t].name, bag.topics[t].type, counts[t]);
  return fmt::format(
      "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  duration:\n    nanoseconds: {1}\n"
      "  starting_time:\n    nanoseconds_since_epoch: {0}\n  message_count: {2}\n  topics_with_message_count:\n{3}"
      "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {4}\n  files:\n    - path: "
      "{4}\n"
      "      starting_time:\n        nanoseconds_since_epoch: {0}\n      duration:\n        nanoseconds: {1}\n"
      "      message_count: {2}\n",
      from, duration, bag.messages.size(), topics, database);
}

}  // namespace

void write_rosbag2(const Bag& bag, const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  std::error_code none;
  if (fs::exists(folder, none) && !(fs::is_directory(folder, none) && fs::is_empty(folder, none)))
    throw std::runtime_error(folder.string() + " exists; a rosbag2 is a new folder: give another name");
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  const std::string database = "track_0.db3";
  write_database(bag, folder / database);
  yaml::write_whole_file(folder / "metadata.yaml", metadata_of(bag, database));  // last: without it, it is no bag yet
}

}  // namespace huetrack::bag
