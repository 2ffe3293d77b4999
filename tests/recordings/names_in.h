// What a recording is made of, for tests.
#pragma once

#include <string>
#include <vector>

#include "recordings/recording.h"

namespace huetrack::recordings {

// The names of its cameras, in their order.
inline std::vector<std::string> names_in(const Recording& recording) {
  std::vector<std::string> names;
  for (const auto& camera : recording.cameras) names.push_back(camera.name);
  return names;
}

}  // namespace huetrack::recordings
