#include "calib/files/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace huetrack::files {
namespace {

constexpr std::size_t beginning = 4096;    // capacity: bytes that FileKind::begins() sees
constexpr std::size_t buffer_size = 4096;  // capacity: bytes of buffered lines; one page per write

std::system_error cannot_write(const std::filesystem::path& file, int error) {
  return {error != 0 ? error : EIO, std::generic_category(), "cannot write " + file.string()};
}

}  // namespace

std::size_t write_all(int fd, std::string_view text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = ::write(fd, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count == 0) errno = ENOSPC;
    if (count <= 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

namespace {

// Into a device or a pipe.
void write_into(const std::filesystem::path& file, std::string_view text) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) throw cannot_write(file, errno);
  const bool is_written = write_all(fd, text) == text.size();
  const int error = errno;
  if (::close(fd) != 0 && is_written) throw cannot_write(file, errno);
  if (!is_written) throw cannot_write(file, error);
}

}  // namespace

void refuse_other_kind(const std::filesystem::path& file, const FileKind& kind) {
  struct stat there {};
  if (::stat(file.c_str(), &there) != 0 || !S_ISREG(there.st_mode) || there.st_size == 0) return;
  std::array<char, beginning> bytes{};
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  const ssize_t count = fd < 0 ? -1 : ::read(fd, bytes.data(), bytes.size());
  if (fd >= 0) ::close(fd);
  if (count < 0 || !kind.begins({bytes.data(), static_cast<std::size_t>(count)}))
    throw std::runtime_error(file.string() + " exists and holds no " + std::string(kind.name) +
                             ": it is not replaced. Give another name, or remove it");
}

std::filesystem::path resolved_link(const std::filesystem::path& file) {
  constexpr int most_links = 40;  // capacity: the kernel's own limit
  std::filesystem::path at = file;
  std::error_code none;
  for (int i = 0; i < most_links && std::filesystem::is_symlink(at, none); ++i)
    at = at.parent_path() / std::filesystem::read_symlink(at, none);  // an absolute link replaces the folder
  return at;
}

void write_whole_file(const std::filesystem::path& file, std::string_view text) {
  const std::filesystem::path real = resolved_link(file);
  struct stat there {};
  const bool is_there = ::stat(real.c_str(), &there) == 0;
  if (is_there && !S_ISREG(there.st_mode)) return write_into(file, text);
  WholeFile whole(file);
  whole.write(text);
  whole.finish();
}

WholeFile::WholeFile(std::filesystem::path file)
    : file_(std::move(file)), real_(resolved_link(file_)), name_(real_.string() + ".XXXXXX") {
  struct stat there {};
  const bool is_there = ::stat(real_.c_str(), &there) == 0;
  if (is_there && !S_ISREG(there.st_mode)) throw cannot_write(file_, ESPIPE);
  fd_ = ::mkostemp(name_.data(), O_CLOEXEC);
  if (fd_ < 0) throw cannot_write(file_, errno);
  constexpr mode_t usual = 0644;
  if (::fchmod(fd_, is_there ? there.st_mode & 07777 : usual) == 0) return;
  const int error = errno;
  ::close(fd_);
  ::unlink(name_.c_str());
  throw cannot_write(file_, error);
}

WholeFile::~WholeFile() {
  if (fd_ >= 0) ::close(fd_);
  if (!name_.empty()) ::unlink(name_.c_str());
}

void WholeFile::write(std::string_view bytes) {
  if (write_all(fd_, bytes) != bytes.size()) throw cannot_write(file_, errno);
}

void WholeFile::finish() {
  // fsync before the rename: a power cut must not leave an empty file.
  if (::fsync(fd_) != 0) throw cannot_write(file_, errno);
  if (::close(std::exchange(fd_, -1)) != 0) throw cannot_write(file_, errno);
  if (::rename(name_.c_str(), real_.c_str()) != 0) throw cannot_write(file_, errno);
  name_.clear();
}

LineFile::LineFile(std::filesystem::path file, const FileKind& kind, std::string_view header) : file_(std::move(file)) {
  refuse_other_kind(file_, kind);
  fd_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd_ < 0) throw cannot_write(file_, errno);
  struct stat there {};
  is_regular_ = ::fstat(fd_, &there) == 0 && S_ISREG(there.st_mode);
  if (!header.empty()) write(header);
}

LineFile::~LineFile() {
  if (!buffered_.empty()) {
    try {
      flush();
    } catch (const std::system_error&) {  // a caller that needs to know calls flush()
    }
  }
  ::close(fd_);
}

void LineFile::write(std::string_view line) {
  if (!buffered_.empty() && buffered_.size() + line.size() >= buffer_size) flush();
  buffered_.append(line).append("\n");
}

void LineFile::flush() {
  const std::size_t written = write_all(fd_, buffered_);
  if (written < buffered_.size()) fail(errno, written);
  length_ += written;
  buffered_.clear();
}

// Truncates the file to its last complete line, or removes it if it has none.
void LineFile::fail(int error, std::size_t written) {
  const auto end = written == 0 ? std::string::npos : buffered_.rfind('\n', written - 1);
  length_ += end == std::string::npos ? 0 : end + 1;
  buffered_.clear();
  if (is_regular_ && length_ == 0) {
    ::unlink(file_.c_str());
  } else if (is_regular_ && (::ftruncate(fd_, static_cast<off_t>(length_)) != 0 || ::lseek(fd_, 0, SEEK_END) < 0)) {
    error = errno;  // a second error: report this one
  }
  throw cannot_write(file_, error);
}

}  // namespace huetrack::files
