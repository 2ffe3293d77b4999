// Writing files. A file of another kind is never replaced, so that a slip in a command line does not destroy a
// recording or a rig. A whole file appears complete or not at all; a growing file ends with a complete line even after
// a crash or on a full disk, and no empty file is left behind. (A kill inside the kernel's write may still cut a line
// at a page boundary: readers skip a last line without a line end.)
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace huetrack::files {

// The kind of a file, recognised by its beginning.
struct FileKind {
  std::string_view name;                  // "tracks"; for the message
  bool (*begins)(std::string_view text);  // whether the first 4 KiB are the beginning of such a file
};

// throws std::runtime_error, naming the file, unless `file` is absent, empty, of this kind, or not a regular file (a
// pipe, /dev/null).
void refuse_other_kind(const std::filesystem::path& file, const FileKind& kind);

// Returns the number of bytes written: all, or fewer and errno is set.
std::size_t write_all(int fd, std::string_view bytes);

// The target of a symbolic link, which need not exist; otherwise `file`.
std::filesystem::path resolved_link(const std::filesystem::path& file);

// Replaces `file` atomically: a temporary file in the same folder, fsync, rename. Keeps its permissions; a link stays a
// link. Writes directly into a device or a pipe. throws std::system_error, naming the file; the old file is then
// intact.
void write_whole_file(const std::filesystem::path& file, std::string_view text);

// The same for content that is written in parts: `file` changes only in finish(); without it the destructor removes the
// temporary file. Not for a device or a pipe. thread-compatible.
class WholeFile {
 public:
  explicit WholeFile(std::filesystem::path file);  // throws std::system_error, as do write() and finish()
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  void write(std::string_view bytes);
  void finish();

 private:
  std::filesystem::path file_, real_;
  std::string name_;  // of the temporary file; empty after finish()
  int fd_ = -1;
};

// A file that grows by lines. thread-compatible.
class LineFile {
 public:
  // header: the first line; empty: none. throws std::runtime_error (refuse_other_kind()); this and the other members
  // throw std::system_error. Messages name the file.
  LineFile(std::filesystem::path file, const FileKind& kind, std::string_view header = "");
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  void write(std::string_view line);  // without line end; may be buffered
  void flush();                       // to the kernel: what was written survives a crash of the program

 private:
  [[noreturn]] void fail(int error, std::size_t written);

  std::filesystem::path file_;
  int fd_ = -1;
  bool is_regular_ = false;
  std::string buffered_;    // whole lines
  std::size_t length_ = 0;  // of the file, in whole lines
};

}  // namespace huetrack::files
