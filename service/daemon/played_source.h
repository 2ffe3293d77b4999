// A frame source that can be paused, stepped, run at any speed, and played from any position. The track depends on
// jumps only.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "capture/frames/frame_source.h"
#include "daemon/looping_source.h"
#include "page/playback.h"

namespace huetrack::daemon {

struct PlayedSourceOptions {
  std::size_t cameras = 0;
  double speed = 0;                     // initial PlaybackState::speed
  std::optional<double> length_s = {};  // PlaybackState::length_s
  bool loops = false;                   // PlaybackState::loops
  std::string why_no_seek = {};         // PlaybackState::why_no_seek
  capture::Duration set_span{0};        // longest time between frames of a set
};

// next(): one thread; all else is thread-safe.
class PlayedSource final : public capture::FrameSource, public page::Playback {
 public:
  PlayedSource(std::unique_ptr<LoopingSource> source, const PlayedSourceOptions& options);

  // Before next(): pauses after the first frame later than this, or after frames of one time from all cameras; either
  // completes a set of all cameras.
  void hold_beyond(capture::Timestamp at);

  // Waits until the frame is due or a step is requested; not after a stop.
  std::optional<capture::Frame> next(std::stop_token stop) override;
  bool ended(int camera) const override { return !ahead_ && source_->ended(camera); }
  capture::Duration waited() const override { return waited_; }
  std::uint64_t jumps() const override { return source_->jumps(); }
  // Part of it during pauses. After the last next().
  capture::Duration paused() const { return paused_; }

  page::PlaybackState state() const override;
  void pause() override;
  void go_on() override;
  void step(int sets) override;
  void set_speed(double speed) override;
  void seek(double position_s) override;

  // Delay of the release of the frame of this capture time, relative to the recording's own times since the first
  // frame; < 0 if played faster. Frames may still wait for their tracking: the last ones are remembered.
  capture::Duration lag_at(capture::Timestamp captured_at) const;
  capture::Duration lag() const { return lag_at(capture::Timestamp::max()); }  // of the newest

 private:
  using Clock = std::chrono::steady_clock;
  void jump_if_asked();
  bool wait_for_turn(const capture::Frame& frame, const std::stop_token& stop);
  void release(const capture::Frame& frame, bool is_stopped);

  const PlayedSourceOptions options_;
  std::unique_ptr<LoopingSource> source_;
  std::optional<capture::Frame> ahead_;             // used by next() only, as the following
  std::optional<Clock::time_point> waiting_since_;  // for the next frame to be released
  bool has_paused_ = false;                         // since then; a jump counts
  std::optional<Clock::time_point> due_;  // of the frame that waits, if it is paced and not the first after a change
  Clock::time_point released_at_;         // the last frame; if it was paced, when it was due
  capture::Duration waited_{0}, paused_{0};

  mutable std::mutex mutex_;  // guards all members below
  std::condition_variable_any news_;
  bool is_paused_ = false;
  std::optional<capture::Timestamp> held_beyond_;  // while paused, releases frames up to this and one later
  std::optional<double> seek_to_s_;                // pending
  double speed_;
  int steps_ = 0;               // pending
  std::uint64_t requests_ = 0;  // counter
  std::vector<bool> seen_;      // per camera: had its frame of this step
  struct Anchor {               // from here on plays at speed_
    Clock::time_point wall;
    capture::Timestamp recorded;
  };
  std::optional<Anchor> anchor_;
  std::deque<std::pair<capture::Timestamp, capture::Duration>> lags_;  // by capture time, ascending
  bool has_begun_ = false;
  capture::Duration position_{0};
  capture::Timestamp last_{};  // of released frames
  std::size_t at_last_ = 0;    // number of cameras with a frame of that time
};

}  // namespace huetrack::daemon
