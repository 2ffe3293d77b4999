// A line (or a few) on a terminal that says how far a long piece of work is. thread-compatible.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "calib/solver/progress.h"

namespace huetrack::gather {

class ProgressLine {
 public:
  explicit ProgressLine(bool wanted);  // draws only when stderr is a terminal and `wanted`
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  bool due() const;                     // it is drawn at most ten times a second: ask before gathering what it shows
  void draw(const std::string& lines);  // over what was drawn before; lines end with \n, but for the last
  void clear();
  // Draws what it is told; to be used while this lives.
  solver::Progress progress();

 private:
  std::string to_start() const;  // the cursor's way to where the drawing begins

  const bool on_terminal_;
  int drawn_ = 0;  // lines
  std::chrono::steady_clock::time_point last_{};
};

// "looking for the board [#####-----]  50 %  120/240  left 118, right 97": what is drawn; the bare count when the total
// is not known.
std::string progress_text(const std::string& what, int done, std::optional<int> total, const std::string& details);

}  // namespace huetrack::gather
