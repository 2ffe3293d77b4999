// A progress display of one or more lines on stderr: on a terminal redrawn in place, elsewhere written again every few
// seconds. thread-compatible.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace huetrack::files {

class TerminalLine {
 public:
  explicit TerminalLine(bool wanted);  // false: draws nothing
  ~TerminalLine() { clear(); }
  TerminalLine(const TerminalLine&) = delete;
  TerminalLine& operator=(const TerminalLine&) = delete;

  bool due() const;                     // ask before gathering the content: at most ten times a second
  void draw(const std::string& lines);  // replaces what was drawn; separated by \n
  void clear();

 private:
  std::string to_start() const;  // moves the cursor to the first line drawn

  const bool wanted_, on_terminal_;
  int drawn_ = 0;  // lines, on a terminal
  std::chrono::steady_clock::time_point last_;
};

// "[#####-----]  50 %  120/240"; only the count when the total is unknown.
std::string progress_bar(std::uint64_t done, std::optional<std::int64_t> total);

}  // namespace huetrack::files
