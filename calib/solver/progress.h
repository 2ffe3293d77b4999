// Progress of long computations.
#pragma once

#include <functional>
#include <string>

namespace huetrack::solver {

// Called during the work, by one thread at a time: step, finished parts, all parts (0: not known). May be empty.
using Progress = std::function<void(const std::string& step, int done, int total)>;

}  // namespace huetrack::solver
