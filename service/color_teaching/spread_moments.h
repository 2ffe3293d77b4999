// Selects moments of a recording of any length, spread over all of it, as many as a ColorTeacher keeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::color_teaching {

// Keeps some of what is added, evenly spread, however many that is. thread-compatible.
template <typename T>
class Spread {
 public:
  explicit Spread(std::size_t most) : most_(most) {}

  void add(const T& one) {
    if (count_++ % every_ != 0) return;
    kept_.push_back(one);
    bound(most_);
  }
  // Also thins out what was kept.
  void bound(std::size_t most) {
    most_ = most;
    if (most_ == 0) kept_.clear();
    while (kept_.size() > most_) {
      for (std::size_t i = 1; 2 * i < kept_.size(); ++i) kept_[i] = std::move(kept_[2 * i]);
      kept_.resize((kept_.size() + 1) / 2);
      every_ *= 2;
    }
  }
  std::vector<T> take() { return std::move(kept_); }

 private:
  std::vector<T> kept_;
  std::size_t most_;
  std::uint64_t count_ = 0, every_ = 8;  // neighbours show nearly the same
};

// Sets of a recording's frames: a frame of the first camera with the newest ones of the others.
// ColorTeacher::add_moment() takes all of them, besides the pictures with points. thread-compatible.
class SpreadMoments {
 public:
  explicit SpreadMoments(std::size_t cameras);
  void add(const capture::Frame& frame);  // sound ones, in the order of time
  std::vector<capture::FrameSet> take() { return sets_.take(); }

 private:
  capture::FrameSet newest_;
  std::vector<std::size_t> bytes_;  // per camera, of its largest frame
  Spread<capture::FrameSet> sets_;
};

}  // namespace huetrack::color_teaching
