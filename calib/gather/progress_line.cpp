#include "calib/gather/progress_line.h"

#include <algorithm>
#include <cstdio>

namespace huetrack::gather {
namespace {

bool is_machine_readable_output = false;  // set before there is a second thread

constexpr auto send_interval = std::chrono::milliseconds(400);

}  // namespace

void send_to_program(const std::string& kind, const std::vector<std::string>& fields) {
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

ProgressLine::ProgressLine(bool wanted) : line_(wanted && !is_machine_readable_output) {}

void ProgressLine::set_machine_readable() {
  is_machine_readable_output = true;
}

bool ProgressLine::is_machine_readable() {
  return is_machine_readable_output;
}

bool ProgressLine::due() const {
  if (is_machine_readable_output) return std::chrono::steady_clock::now() - last_ >= send_interval;
  return line_.due();
}

void ProgressLine::show(const std::string& what, int done, std::optional<int> total, const std::string& details) {
  if (!is_machine_readable_output) return draw(progress_text(what, done, total, details));
  if (what == last_sent_ && !due()) return;
  last_sent_ = what;
  last_ = std::chrono::steady_clock::now();
  send_to_program("progress", {what, std::to_string(done), total ? std::to_string(*total) : "", details});
}

void ProgressLine::draw(const std::string& lines) {
  if (is_machine_readable_output && lines != last_sent_) {  // an operation without steps
    last_sent_ = lines;
    send_to_program("progress", {lines, "", "", ""});
  }
  line_.draw(lines);
}

solver::Progress ProgressLine::progress() {
  return [this](const std::string& step, int done, int total) {
    show(step, done, total > 0 ? std::optional(total) : std::nullopt, {});
  };
}

}  // namespace huetrack::gather
