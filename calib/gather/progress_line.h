// A line (or a few) on a terminal that says how far a long piece of work is; or lines for the program that has started
// this one. thread-compatible.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "calib/files/terminal_line.h"
#include "calib/solver/progress.h"

namespace huetrack::gather {

// For another program that reads standard output: '@', a kind, and fields, with tabs between them; on a line of its own
// and at once. The kinds are in calib/reference.md. A tab or line end within a field becomes a blank.
void tell_program(const std::string& kind, const std::vector<std::string>& fields);

class ProgressLine {
 public:
  // Draws only when stderr is a terminal and `wanted`; or where programs are told, tells them in any case.
  explicit ProgressLine(bool wanted);
  // From now on nothing is drawn, and tell_program() is told instead. Before there is a second thread.
  static void tell_programs();
  static bool tells_programs();

  // As of a TerminalLine.
  bool due() const;
  void draw(const std::string& lines);
  void clear() { line_.clear(); }
  // Draws how far something is, as progress_text() says it; a program is told as "progress".
  void show(const std::string& what, int done, std::optional<int> total, const std::string& details);
  // Draws what it is told; to be used while this lives.
  solver::Progress progress();

 private:
  files::TerminalLine line_;
  std::string told_;                              // what the program was told last that is done
  std::chrono::steady_clock::time_point last_{};  // when
};

// "looking for the board [#####-----]  50 %  120/240  left 118, right 97": what is drawn; the bare count when the total
// is not known.
std::string progress_text(const std::string& what, int done, std::optional<int> total, const std::string& details);

}  // namespace huetrack::gather
