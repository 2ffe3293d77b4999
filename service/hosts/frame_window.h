// Congestion control of a camera's frames: a network that is too slow for all frames carries fewer, each complete and
// with low delay. Otherwise frames would lose packets in full queues, and none would arrive complete.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

namespace huetrack::hosts {

// A window of frames in flight, as in TCP (additive increase, multiplicative decrease): halved while frames stay
// unacknowledged for long, one frame wider after a while without that. Pure; thread-compatible.
class FrameWindow {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr int most = 8;  // frames; retransmissions of lost packets never fill it
  // A window of n frames lasts at least n times this, whatever the camera's rate: at 120 frames a second the next frame
  // is always in flight, and "all acknowledged" is seldom observed.
  static constexpr std::chrono::milliseconds of_a_frame{33};
  // A frame is acknowledged within 25 ms, a retransmitted one within 60.
  static constexpr std::chrono::milliseconds long_ago{100}, wider_after{150}, soon{100};
  // A tracker that vanished acknowledges nothing until its DDS lease ends (3 s). Frames for the other trackers wait for
  // it at most usual_patience; longest_patience if it turned out to be still there, on a very slow network.
  static constexpr std::chrono::milliseconds usual_patience{400}, longest_patience{3000}, until_missed{3500};

  // Call for each frame. have_all: every tracker has acknowledged everything. False: skip this frame.
  bool may_send(bool have_all, Clock::time_point now) {
    if (have_all) note_all(now);
    if (count_ > 0 && !gone_at_ && now - judged_at_ > long_ago) {
      window_ = std::max(1, window_ / 2);
      judged_at_ = changed_at_ = now;
    } else if (window_ < most && now - changed_at_ > wider_after) {
      ++window_;
      changed_at_ = now;
    }
    if (is_full(now) && !is_given_up(now)) return false;
    if (count_++ == 0) sent_at_ = judged_at_ = now;
    return true;
  }

  int window() const { return window_; }

 private:
  void note_all(Clock::time_point now) {
    if (gone_at_)
      patience_ = longest_patience;
    else if (now - sent_at_ < soon)
      patience_ = usual_patience;
    count_ = 0;
    gone_at_.reset();
    closed_at_.reset();
  }

  // Half a frame early, so that at 30 frames a second only the count matters.
  bool is_full(Clock::time_point now) const {
    return count_ >= window_ && now - sent_at_ > window_ * of_a_frame - of_a_frame / 2;
  }

  // True: a tracker that does not answer is assumed to be gone.
  bool is_given_up(Clock::time_point now) {
    if (gone_at_ && now - *gone_at_ >= until_missed) {
      patience_ = longest_patience;
      gone_at_.reset();
      closed_at_.reset();
      judged_at_ = now;
    }
    if (!closed_at_) closed_at_ = now;
    if (!gone_at_ && now - *closed_at_ >= patience_) gone_at_ = now;
    return gone_at_.has_value();
  }

  int window_ = most;
  Clock::time_point changed_at_{};  // the window
  int count_ = 0;                   // frames sent since all were acknowledged
  Clock::time_point sent_at_{};     // of the first of them
  Clock::time_point judged_at_{};   // last comparison with long_ago
  // Start of skipping frames, and of no longer waiting for acknowledgments; reset when all are acknowledged.
  std::optional<Clock::time_point> closed_at_, gone_at_;
  std::chrono::milliseconds patience_ = usual_patience;
};

}  // namespace huetrack::hosts
