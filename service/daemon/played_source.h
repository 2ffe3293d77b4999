// A replay that can be held, stepped, slowed down and hurried, so that a colour can be taught on its first pictures,
// and what happened be looked at. What is tracked does not depend on it.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "capture/frames/frame_source.h"
#include "page/playback.h"

namespace huetrack::daemon {

struct PlayedSourceOptions {
  std::size_t cameras = 0;
  double speed = 0;  // PlaybackState::speed, to begin with
};

// next() is one thread's; the rest is thread-safe.
class PlayedSource final : public capture::FrameSource, public page::Playback {
 public:
  PlayedSource(std::unique_ptr<capture::FrameSource> source, const PlayedSourceOptions& options);

  // Before next(): it is paused as soon as a frame later than this was let through, or all cameras gave one of the same
  // time: by either it is known that a set of them all is whole.
  void hold_beyond(capture::Timestamp at);

  // Waits until the frame is due, or to be stepped to; not after a stop.
  std::optional<capture::Frame> next(std::stop_token stop) override;
  bool ended(int camera) const override { return !ahead_ && source_->ended(camera); }
  capture::Duration waited() const override { return waited_; }
  // Of that, while it was paused and went on after it. When nobody calls next() any more.
  capture::Duration paused() const { return paused_; }

  page::PlaybackState state() const override;
  void pause() override;
  void go_on() override;
  void step(int sets) override;
  void set_speed(double speed) override;

  // By how much what is played now is later than the first frame, beside the recording's own times; less than 0 where
  // it was hurried.
  const std::atomic<std::int64_t>& lag_ns() const { return lag_ns_; }

 private:
  using Clock = std::chrono::steady_clock;
  void wait_for_turn(const capture::Frame& frame, const std::stop_token& stop);

  std::unique_ptr<capture::FrameSource> source_;
  std::optional<capture::Frame> ahead_;  // next()'s, as is what follows
  capture::Duration waited_{0}, paused_{0};
  std::atomic<std::int64_t> lag_ns_ = 0;

  mutable std::mutex mutex_;  // guards all that follows
  std::condition_variable_any news_;
  bool is_paused_ = false;
  std::optional<capture::Timestamp> held_beyond_;  // what is paused lets frames through up to this, and one later one
  double speed_;
  int steps_ = 0;            // that are still to be made
  std::uint64_t asked_ = 0;  // how often something was
  std::vector<bool> seen_;   // per camera: it had its frame of this step
  struct Anchor {            // from here on it is played at speed_
    Clock::time_point wall;
    capture::Timestamp recorded;
  };
  std::optional<Anchor> anchor_;
  std::optional<capture::Timestamp> first_;
  capture::Timestamp last_{};  // of those that were let through
  std::size_t at_last_ = 0;    // so many cameras gave a frame of that time
};

}  // namespace huetrack::daemon
