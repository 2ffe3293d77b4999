#include "calib/gather/progress_line.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace huetrack::gather {

std::string progress_text(const std::string& what, int done, std::optional<int> total, const std::string& details) {
  std::string text = what + " ";
  if (total && *total > 0) {
    constexpr std::size_t cells = 24;
    const double share = std::min(1.0, static_cast<double>(done) / *total);
    const auto full = static_cast<std::size_t>(share * cells);
    text += '[';
    text.append(full, '#').append(cells - full, '-').append("] ");
    text += fmt::format("{:3.0f} %  {}/{}", 100 * share, done, *total);
  } else {
    text += std::to_string(done);
  }
  if (!details.empty()) text.append("  ").append(details);
  return text;
}

ProgressLine::ProgressLine(bool wanted) : on_terminal_(wanted && isatty(STDERR_FILENO) == 1) {}

bool ProgressLine::due() const {
  return on_terminal_ && std::chrono::steady_clock::now() - last_ >= std::chrono::milliseconds(100);
}

void ProgressLine::draw(const std::string& lines) {
  if (!on_terminal_) return;
  last_ = std::chrono::steady_clock::now();
  // With line wrap off: a line that wraps could not be drawn over.
  std::string text = to_start() + "\x1b[?7l";
  for (const char c : lines) text += c == '\n' ? "\x1b[K\n" : std::string(1, c);
  text += "\x1b[?7h\x1b[J";
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
  drawn_ = 1 + static_cast<int>(std::ranges::count(lines, '\n'));
}

void ProgressLine::clear() {
  if (drawn_ == 0) return;
  std::fputs((to_start() + "\x1b[J").c_str(), stderr);
  std::fflush(stderr);
  drawn_ = 0;
}

solver::Progress ProgressLine::progress() {
  return [this](const std::string& step, int done, int total) {
    draw(progress_text(step, done, total > 0 ? std::optional(total) : std::nullopt, {}));
  };
}

std::string ProgressLine::to_start() const {
  return drawn_ > 1 ? "\r\x1b[" + std::to_string(drawn_ - 1) + "A" : "\r";
}

}  // namespace huetrack::gather
