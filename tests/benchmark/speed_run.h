// What the speed benchmarks share: sets that are played there and back, and how long something takes.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::figures {

// Plays the sets there and back, with times that go on. They outlive it.
class Player {
 public:
  explicit Player(const std::vector<capture::FrameSet>& sets) : sets_(sets) {}
  const capture::FrameSet& next() {
    const std::size_t n = sets_.size();
    const std::size_t k = count_ % (2 * n - 2);
    set_ = sets_[k < n ? k : 2 * n - 2 - k];
    set_.number = count_;
    set_.at = capture::Timestamp(capture::duration_of(static_cast<double>(count_++) / 30));
    for (auto& frame : set_.frames) frame->captured_at = set_.at;
    return set_;
  }

 private:
  const std::vector<capture::FrameSet>& sets_;
  std::uint64_t count_ = 0;
  capture::FrameSet set_;
};

inline double microseconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace huetrack::figures
