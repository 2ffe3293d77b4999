// Figures of a service that runs as a process of its own.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "end_to_end/process.h"

namespace huetrack::figures {

inline double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(q * static_cast<double>(values.size())))];
}

// CPU time of all threads, user and kernel.
inline double cpu_s(pid_t pid) {
  std::istringstream stat(end_to_end::contents("/proc/" + std::to_string(pid) + "/stat"));
  std::string word;
  for (int i = 0; i < 13; ++i) stat >> word;
  double user = 0, system = 0;
  stat >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace huetrack::figures
