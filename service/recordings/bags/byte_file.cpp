#include "recordings/bags/byte_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "calib/files/config_error.h"
#include "recordings/bags/bag.h"

namespace huetrack::bags {

Buffer make_buffer(std::size_t size) {
  return std::make_shared<std::vector<std::uint8_t>>(size + buffer_padding);
}

ByteFile::ByteFile(const std::filesystem::path& file)
    : fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {  // a pipe would block
  if (fd_ < 0) throw files::ConfigError(file, 0, std::string("cannot be read: ") + std::strerror(errno));
  struct stat about {};
  if (::fstat(fd_, &about) != 0 || !S_ISREG(about.st_mode)) {
    ::close(fd_);
    throw files::ConfigError(file, 0, "is not a file");
  }
  size_ = static_cast<std::uint64_t>(about.st_size);
}

ByteFile::~ByteFile() {
  ::close(fd_);
}

bool ByteFile::read(std::uint64_t at, std::span<std::uint8_t> to) const {
  if (!has(at, to.size())) return false;
  while (!to.empty()) {
    const ssize_t count = ::pread(fd_, to.data(), to.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    to = to.subspan(static_cast<std::size_t>(count));
    at += static_cast<std::uint64_t>(count);
  }
  return true;
}

Buffer ByteFile::read(std::uint64_t at, std::uint64_t count) const {
  if (count > largest_bytes || !has(at, count)) return nullptr;
  Buffer buffer = make_buffer(count);
  return read(at, std::span(*buffer).first(count)) ? buffer : nullptr;
}

}  // namespace huetrack::bags
