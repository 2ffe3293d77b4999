// The clock of an MPEG-4 encoder (DivX, XviD, FFmpeg): every picture has its time in it, from 0 on. Where it begins
// again at 0, films were joined. Private to this module.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace huetrack::recordings {

// thread-compatible.
class Mpeg4Clock {
 public:
  // Every packet that begins with a key picture. True: not the first one at time 0.
  bool begins_again(std::span<const std::uint8_t> packet);

 private:
  struct Time {
    int bits = 0;  // of a picture's time, if it is 0; 0: it is another one
    std::uint32_t group = 0;
    bool operator==(const Time&) const = default;
  };
  std::optional<Time> first_;
};

}  // namespace huetrack::recordings
