#include "calib/gather/progress_line.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace huetrack::gather {
namespace {

bool programs_are_told = false;  // set before there is a second thread

constexpr auto drawn_every = std::chrono::milliseconds(100), told_every = std::chrono::milliseconds(400);

}  // namespace

void tell_program(const std::string& kind, const std::vector<std::string>& fields) {
  std::string line = "@" + kind;
  for (std::string field : fields) {
    std::ranges::replace_if(
        field, [](char c) { return c == '\t' || c == '\n' || c == '\r'; }, ' ');
    line += '\t' + field;
  }
  line += '\n';
  std::fwrite(line.data(), 1, line.size(), stdout);
  std::fflush(stdout);
}

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

ProgressLine::ProgressLine(bool wanted) : on_terminal_(wanted && !programs_are_told && isatty(STDERR_FILENO) == 1) {}

void ProgressLine::tell_programs() {
  programs_are_told = true;
}

bool ProgressLine::tells_programs() {
  return programs_are_told;
}

bool ProgressLine::due() const {
  if (programs_are_told) return std::chrono::steady_clock::now() - last_ >= told_every;
  return on_terminal_ && std::chrono::steady_clock::now() - last_ >= drawn_every;
}

void ProgressLine::show(const std::string& what, int done, std::optional<int> total, const std::string& details) {
  if (!programs_are_told) return draw(progress_text(what, done, total, details));
  if (what == told_ && !due()) return;
  told_ = what;
  last_ = std::chrono::steady_clock::now();
  tell_program("progress", {what, std::to_string(done), total ? std::to_string(*total) : "", details});
}

void ProgressLine::draw(const std::string& lines) {
  if (programs_are_told && lines != told_) {  // some work that tells no parts
    told_ = lines;
    tell_program("progress", {lines, "", "", ""});
  }
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
    show(step, done, total > 0 ? std::optional(total) : std::nullopt, {});
  };
}

std::string ProgressLine::to_start() const {
  return drawn_ > 1 ? "\r\x1b[" + std::to_string(drawn_ - 1) + "A" : "\r";
}

}  // namespace huetrack::gather
