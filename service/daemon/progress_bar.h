// One line on a terminal that says how far a replay is. thread-compatible.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "capture/frame.h"

namespace huetrack::daemon {

class ProgressBar {
 public:
  // Draws only when stderr is a terminal and `wanted`.
  explicit ProgressBar(bool wanted);
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  bool due() const;  // it is drawn at most ten times a second: ask before gathering what it shows
  void draw(std::uint64_t done, std::optional<std::int64_t> total, double times_real_time, const std::string& details);
  void clear();

 private:
  const bool on_terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

// "[#####-----]  50 %", or the bare count when the total is not known: what is drawn, without the terminal.
std::string progress_text(std::uint64_t done, std::optional<std::int64_t> total, double times_real_time,
                          const std::string& details);

}  // namespace huetrack::daemon
