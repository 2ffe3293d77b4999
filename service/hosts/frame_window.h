// Whether a camera's next frame goes to the network: one that is too slow for all of them carries fewer, each of them
// whole and soon. Else each lost a part of itself to the others in the network's queues, and none came.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

namespace huetrack::hosts {

// How many frames may be on their way is a window as TCP has one: halved while what was sent stays unacknowledged for
// long, wider by one frame after a while without that. Pure; thread-compatible.
class FrameWindow {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr int most = 8;  // frames: repairs of a network that loses packets never reach it
  // A window of so many frames lasts at least as many times this, whatever the camera's rate: of one that gives 120
  // frames a second the next is always on its way, and the moment at which all have come is seldom seen.
  static constexpr std::chrono::milliseconds of_a_frame{33};
  // A frame is acknowledged within 25 ms, one that is sent again within 60.
  static constexpr std::chrono::milliseconds long_ago{100}, wider_after{150}, soon{100};
  // A tracker that went without a word acknowledges nothing until DDS misses it (its lease is 3 s). Another one's
  // frames wait no longer than that for it; longer for one that was not missed: it is the network that is so slow.
  static constexpr std::chrono::milliseconds usual_patience{400}, longest_patience{3000}, until_missed{3500};

  // For each frame. have_all: every tracker has said that it has all that was sent. False: leave this one out.
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

  // Half a frame before the time is over, so that of 30 frames a second the count alone decides.
  bool is_full(Clock::time_point now) const {
    return count_ >= window_ && now - sent_at_ > window_ * of_a_frame - of_a_frame / 2;
  }

  // Whether who does not answer is held to be gone.
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
  int count_ = 0;                   // frames sent since all had come
  Clock::time_point sent_at_{};     // the first of them
  Clock::time_point judged_at_{};   // whether that was long ago
  // Since when frames are left out, and since when nobody is waited for; both since all had come.
  std::optional<Clock::time_point> closed_at_, gone_at_;
  std::chrono::milliseconds patience_ = usual_patience;
};

}  // namespace huetrack::hosts
