// A non-negative int as an index of a container.
#pragma once

#include <cstddef>

namespace huetrack::calib {

constexpr std::size_t index(int i) {
  return static_cast<std::size_t>(i);
}

}  // namespace huetrack::calib
