// Several MPEG transport streams as one file for FFmpeg. Parts of a film that were written separately begin their
// continuity counters anew, which would look like lost packets: the counters of later parts are shifted so that they go
// on. Where a part begins in the middle of a picture, or is not what it follows, nothing is changed. Private to this
// module.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <vector>

#include "capture/ffmpeg/ffmpeg_objects.h"

namespace huetrack::recordings {

// thread-compatible.
class JoinedParts {
 public:
  explicit JoinedParts(const std::vector<std::filesystem::path>& parts);  // throws ConfigError: one cannot be read
  ~JoinedParts();
  JoinedParts(const JoinedParts&) = delete;
  JoinedParts& operator=(const JoinedParts&) = delete;

  AVIOContext* io() const { return io_; }  // must not outlive this

  // As fread() and fseek() on the joined file; at the end 0 bytes.
  std::size_t read(std::span<std::uint8_t> to);
  void seek(std::uint64_t at) { at_ = at; }
  std::uint64_t size() const { return size_; }
  std::uint64_t at() const { return at_; }

  static constexpr std::size_t pids = 8192;        // 13 bits
  using Counters = std::array<std::int8_t, pids>;  // of continuity, by PID; unknown: not there
  static constexpr std::int8_t unknown = -1;
  struct Layout {
    std::size_t packet = 0, header = 0;  // bytes of a packet, and where its header begins in it; 0: not recognised
  };

 private:
  struct Part {
    std::filesystem::path file;
    std::uint64_t begin = 0, size = 0;
    Layout layout = {};
    std::unique_ptr<Counters> shift = {};  // null: as stored
  };
  void shift_counters();
  std::size_t read_raw(const Part& part, std::uint64_t from, std::span<std::uint8_t> to);

  std::vector<Part> parts_;
  std::uint64_t size_ = 0, at_ = 0;
  std::ifstream open_;
  std::size_t open_part_ = 0;
  std::vector<std::uint8_t> packets_;  // whole ones, for read()
  AVIOContext* io_ = nullptr;
};

}  // namespace huetrack::recordings
