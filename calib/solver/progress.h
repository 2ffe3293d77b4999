// How far a long piece of work is.
#pragma once

#include <functional>
#include <string>

namespace huetrack::solver {

// Told while it is done, always from one thread at a time: which step, and how many of its parts are done; total 0:
// not known. May be empty; then nobody is told.
using Progress = std::function<void(const std::string& step, int done, int total)>;

}  // namespace huetrack::solver
