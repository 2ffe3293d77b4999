// Detects films in which every second picture was made of its neighbours, as programs do that double a frame rate:
// where something moves, such a picture is the mean of the two, to the coder's noise; one that a camera took is not.
// Private to this module.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "capture/frames/frame.h"

namespace huetrack::recordings {

// thread-compatible.
class BlendWatch {
 public:
  // The film's pictures in their order; some may be left out. Ones that are decoded on demand are not looked at.
  void see(std::int64_t index, const capture::Image& image);
  // What is wrong and what to do. nullopt: nothing is known to be.
  std::optional<std::string> problem() const;

 private:
  struct Picture {
    std::int64_t index = -1;
    capture::Image image;
  };
  std::array<Picture, 2> before_;                           // the last ones
  std::array<std::int64_t, 2> moving_{0, 0}, means_{0, 0};  // of even and odd pictures
};

}  // namespace huetrack::recordings
