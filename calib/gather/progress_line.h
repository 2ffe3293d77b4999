// Progress of a long operation: on a terminal, or as lines for a calling program. thread-compatible.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "calib/files/terminal_line.h"
#include "calib/solver/progress.h"

namespace huetrack::gather {

// Writes one line to standard output for a calling program: '@', kind and fields, separated by tabs; flushed. Kinds:
// calib/reference.md. A tab or line end within a field becomes a blank.
void send_to_program(const std::string& kind, const std::vector<std::string>& fields);

class ProgressLine {
 public:
  // wanted: as TerminalLine. Machine-readable: always writes.
  explicit ProgressLine(bool wanted);
  // From now on calls send_to_program() instead of drawing. Call before a second thread starts.
  static void set_machine_readable();
  static bool is_machine_readable();

  // As TerminalLine.
  bool due() const;
  void draw(const std::string& lines);
  void clear() { line_.clear(); }
  // Draws progress_text(), or sends "progress".
  void show(const std::string& what, int done, std::optional<int> total, const std::string& details);
  // A callback that calls show(); valid while this lives.
  solver::Progress progress();

 private:
  files::TerminalLine line_;
  std::string last_sent_;                         // last text for the program
  std::chrono::steady_clock::time_point last_{};  // time of last_sent_
};

// "looking for the board [#####-----]  50 %  120/240  left 118, right 97": only the count if the
// total is unknown.
std::string progress_text(const std::string& what, int done, std::optional<int> total, const std::string& details);

}  // namespace huetrack::gather
