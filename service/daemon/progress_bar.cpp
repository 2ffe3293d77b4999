#include "daemon/progress_bar.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace huetrack::daemon {

std::string progress_text(std::uint64_t done, std::optional<std::int64_t> total, double times_real_time,
                          const std::string& details) {
  std::string bar;
  if (total && *total > 0) {
    constexpr std::size_t cells = 24;
    const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(*total));
    const auto full = static_cast<std::size_t>(share * cells);
    bar = fmt::format("[{}{}] {:3.0f} %  {}/{} frames", std::string(full, '#'), std::string(cells - full, '-'),
                      100 * share, done, *total);
  } else {
    bar = fmt::format("{} frames", done);
  }
  bar += fmt::format("  {:.1f}x real time", times_real_time);
  if (!details.empty()) bar.append("  ").append(details);
  return bar;
}

ProgressBar::ProgressBar(bool wanted) : on_terminal_(wanted && isatty(STDERR_FILENO) == 1) {}

bool ProgressBar::due() const {
  return on_terminal_ && std::chrono::steady_clock::now() - last_ >= std::chrono::milliseconds(100);
}

void ProgressBar::draw(std::uint64_t done, std::optional<std::int64_t> total, double times_real_time,
                       const std::string& details) {
  if (!on_terminal_) return;
  last_ = std::chrono::steady_clock::now();
  // With line wrap off: a line that wraps could not be drawn over.
  std::fprintf(stderr, "\r\x1b[?7l%s\x1b[?7h\x1b[K", progress_text(done, total, times_real_time, details).c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void ProgressBar::clear() {
  if (!drawn_) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  drawn_ = false;
}

}  // namespace huetrack::daemon
