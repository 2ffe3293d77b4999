#include "calib/gather/progress_line.h"

#include <algorithm>
#include <cstdio>

namespace huetrack::gather {
namespace {

bool programs_are_told = false;  // set before there is a second thread

constexpr auto told_every = std::chrono::milliseconds(400);

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
  return what + " " + files::progress_bar(static_cast<std::uint64_t>(done), total) +
         (details.empty() ? "" : "  " + details);
}

ProgressLine::ProgressLine(bool wanted) : line_(wanted && !programs_are_told) {}

void ProgressLine::tell_programs() {
  programs_are_told = true;
}

bool ProgressLine::tells_programs() {
  return programs_are_told;
}

bool ProgressLine::due() const {
  if (programs_are_told) return std::chrono::steady_clock::now() - last_ >= told_every;
  return line_.due();
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
  line_.draw(lines);
}

solver::Progress ProgressLine::progress() {
  return [this](const std::string& step, int done, int total) {
    show(step, done, total > 0 ? std::optional(total) : std::nullopt, {});
  };
}

}  // namespace huetrack::gather
