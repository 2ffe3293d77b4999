// One line on a terminal that says how far a long piece of work is. thread-compatible.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace huetrack {

class ProgressLine {
 public:
  explicit ProgressLine(bool wanted);  // draws only when stderr is a terminal and `wanted`
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  bool due() const;  // it is drawn at most ten times a second: ask before gathering what it shows
  void draw(const std::string& line);
  void clear();

 private:
  const bool on_terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

// "looking for the board [#####-----]  50 %  120/240  left 118, right 97": what is drawn; the bare count when the total
// is not known.
std::string progress_text(const std::string& what, int done, std::optional<int> total, const std::string& details);

}  // namespace huetrack
