// Files that we write. None takes the place of a file of another kind, so that a slip in a command line does not cost
// the recording, the truth or the rig that it names. A file is there whole or not at all; where rows are added to one,
// each is whole, whatever ends the program, and no empty file is left behind by a full disk.
// What is killed inside the kernel's own write, some microseconds, may yet end at a page's end: readers of such files
// leave out a last row without its end.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace huetrack::yaml {

// What a file holds, told by its beginning.
struct FileKind {
  std::string_view name;                  // "tracks"; for the message
  bool (*begins)(std::string_view text);  // whether this is the beginning of one; of its first 4 KiB
};

// What is at `file` may be replaced by a file of this kind: there is nothing, or one of this kind, or an empty one, or
// no file at all (a pipe, /dev/null). throws std::runtime_error, naming the file.
void refuse_other_kind(const std::filesystem::path& file, const FileKind& kind);

// How many of these bytes were written: all, or fewer with errno.
std::size_t write_all(int fd, std::string_view bytes);

// Where a link leads that is there or will be; otherwise the file itself.
std::filesystem::path followed(const std::filesystem::path& file);

// By a temporary file beside it, and on the disk when it returns, with the permissions of the one that it replaces. A
// link stays one: the file is where it leads. A device or a pipe is written into. throws std::system_error, naming the
// file; what was there is then still there.
void write_whole_file(const std::filesystem::path& file, std::string_view text);

// A whole file in parts, of what is too large for memory: at `file` nothing changes before finish(). Whoever does not
// get that far leaves nothing behind. Not into a device or a pipe. thread-compatible.
class WholeFile {
 public:
  explicit WholeFile(std::filesystem::path file);  // throws std::system_error, as the others do
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  void write(std::string_view bytes);
  void finish();

 private:
  std::filesystem::path file_, real_;
  std::string name_;  // of the temporary file; empty: it has taken its place
  int fd_ = -1;
};

// A file that grows by lines. thread-compatible.
class LineFile {
 public:
  // header: its first line; empty: none. throws std::runtime_error (refuse_other_kind()), std::system_error; both name
  // the file, and so do the others.
  LineFile(std::filesystem::path file, const FileKind& kind, std::string_view header = "");
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  void write(std::string_view line);  // without its end; may wait for others
  void flush();                       // to the system: from here on the program's end loses nothing

 private:
  [[noreturn]] void fail(int error, std::size_t written);

  std::filesystem::path file_;
  int fd_ = -1;
  bool is_regular_ = false;
  std::string waiting_;     // whole lines
  std::size_t length_ = 0;  // of the file, in whole lines
};

}  // namespace huetrack::yaml
