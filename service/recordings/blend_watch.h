// Detects films that a program made of others, by where their pictures lie between their neighbours. Where something
// moves, a picture that is the mean of two is that to the coder's noise; one that a camera took is not. And of what
// changes from the picture before to the one after, a camera's pictures show about half on average; those of a film
// that was converted to another frame rate show more and less of it, periodically. Private to this module.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::recordings {

// thread-compatible.
class BlendWatch {
 public:
  // The film's pictures in their order; some may be left out. Ones that are decoded on demand are not looked at.
  void see(std::int64_t index, const capture::Image& image);
  // What is wrong and what to do. nullopt: nothing is known to be.
  std::optional<std::string> problem() const;

  // Of pixels that change once, the mean share of the change that a picture shows.
  struct Share {
    std::int64_t index = 0;
    double mean = 0, pixels = 0;
  };

 private:
  struct Picture {
    std::int64_t index = -1;
    capture::Image image;
  };
  void compare(const Picture& before, const Picture& now, const Picture& after);

  std::array<Picture, 5> last_;
  std::array<std::int64_t, 2> moving_{0, 0}, means_{0, 0};  // of even and odd pictures
  std::vector<Share> shares_;
};

}  // namespace huetrack::recordings
