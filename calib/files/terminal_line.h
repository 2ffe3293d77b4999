// A line (or a few) on a terminal that is drawn over while a long piece of work goes on. thread-compatible.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace huetrack::yaml {

class TerminalLine {
 public:
  explicit TerminalLine(bool wanted);  // draws only when stderr is a terminal and `wanted`
  ~TerminalLine() { clear(); }
  TerminalLine(const TerminalLine&) = delete;
  TerminalLine& operator=(const TerminalLine&) = delete;

  bool due() const;                     // it is drawn at most ten times a second: ask before gathering what it shows
  void draw(const std::string& lines);  // over what was drawn before; lines end with \n, but for the last
  void clear();

 private:
  std::string to_start() const;  // the cursor's way to where the drawing begins

  const bool on_terminal_;
  int drawn_ = 0;  // lines
  std::chrono::steady_clock::time_point last_{};
};

// "[#####-----]  50 %  120/240"; the bare count when the total is not known.
std::string progress_bar(std::uint64_t done, std::optional<std::int64_t> total);

}  // namespace huetrack::yaml
