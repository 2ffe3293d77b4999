#include "calib/files/terminal_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace huetrack::files {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds redrawn_after(100), written_after(3000);

}  // namespace

TerminalLine::TerminalLine(bool wanted)
    : wanted_(wanted),
      on_terminal_(wanted && isatty(STDERR_FILENO) == 1),
      last_(on_terminal_ ? Clock::time_point{} : Clock::now()) {}

bool TerminalLine::due() const {
  return wanted_ && Clock::now() - last_ >= (on_terminal_ ? redrawn_after : written_after);
}

void TerminalLine::draw(const std::string& lines) {
  if (!on_terminal_) {
    if (!due()) return;
    last_ = Clock::now();
    std::fputs((lines + '\n').c_str(), stderr);
    return;
  }
  last_ = Clock::now();
  // Line wrap off: a wrapped line could not be overwritten.
  std::string text = to_start() + "\x1b[?7l";
  for (const char c : lines) text += c == '\n' ? "\x1b[K\n" : std::string(1, c);
  text += "\x1b[?7h\x1b[J";
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
  drawn_ = 1 + static_cast<int>(std::ranges::count(lines, '\n'));
}

void TerminalLine::clear() {
  if (drawn_ == 0) return;
  std::fputs((to_start() + "\x1b[J").c_str(), stderr);
  std::fflush(stderr);
  drawn_ = 0;
}

std::string TerminalLine::to_start() const {
  return drawn_ > 1 ? "\r\x1b[" + std::to_string(drawn_ - 1) + "A" : "\r";
}

std::string progress_bar(std::uint64_t done, std::optional<std::int64_t> total) {
  if (!total || *total <= 0) return std::to_string(done);
  constexpr std::size_t cells = 24;
  const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(*total));
  const auto full = static_cast<std::size_t>(share * cells);
  return fmt::format("[{}{}] {:3.0f} %  {}/{}", std::string(full, '#'), std::string(cells - full, '-'), 100 * share,
                     done, *total);
}

}  // namespace huetrack::files
