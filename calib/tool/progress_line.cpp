#include "calib/tool/progress_line.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

namespace huetrack {

std::string progress_text(const std::string& what, int done, std::optional<int> total, const std::string& details) {
  std::string text = what + " ";
  std::array<char, 64> figures{};
  if (total && *total > 0) {
    constexpr std::size_t cells = 24;
    const double share = std::min(1.0, static_cast<double>(done) / *total);
    const auto full = static_cast<std::size_t>(share * cells);
    text += '[';
    text.append(full, '#').append(cells - full, '-').append("] ");
    std::snprintf(figures.data(), figures.size(), "%3.0f %%  %d/%d", 100 * share, done, *total);
  } else {
    std::snprintf(figures.data(), figures.size(), "%d", done);
  }
  text += figures.data();
  if (!details.empty()) text.append("  ").append(details);
  return text;
}

ProgressLine::ProgressLine(bool wanted) : on_terminal_(wanted && isatty(STDERR_FILENO) == 1) {}

bool ProgressLine::due() const {
  return on_terminal_ && std::chrono::steady_clock::now() - last_ >= std::chrono::milliseconds(100);
}

void ProgressLine::draw(const std::string& line) {
  if (!on_terminal_) return;
  last_ = std::chrono::steady_clock::now();
  // With line wrap off: a line that wraps could not be drawn over.
  std::fprintf(stderr, "\r\x1b[?7l%s\x1b[?7h\x1b[K", line.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void ProgressLine::clear() {
  if (!drawn_) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  drawn_ = false;
}

}  // namespace huetrack
