// A frame source that can be paused, stepped and run at any speed. The track does not depend on it.
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
  double speed = 0;  // initial PlaybackState::speed
};

// next(): one thread; all else is thread-safe.
class PlayedSource final : public capture::FrameSource, public page::Playback {
 public:
  PlayedSource(std::unique_ptr<capture::FrameSource> source, const PlayedSourceOptions& options);

  // Before next(): pauses after the first frame later than this, or after frames of one time from all cameras; either
  // completes a set of all cameras.
  void hold_beyond(capture::Timestamp at);

  // Waits until the frame is due or a step is requested; not after a stop.
  std::optional<capture::Frame> next(std::stop_token stop) override;
  bool ended(int camera) const override { return !ahead_ && source_->ended(camera); }
  capture::Duration waited() const override { return waited_; }
  // Part of it during pauses. After the last next().
  capture::Duration paused() const { return paused_; }

  page::PlaybackState state() const override;
  void pause() override;
  void go_on() override;
  void step(int sets) override;
  void set_speed(double speed) override;

  // Current delay relative to the recording's own times since the first frame; < 0 if played faster.
  const std::atomic<std::int64_t>& lag_ns() const { return lag_ns_; }

 private:
  using Clock = std::chrono::steady_clock;
  void wait_for_turn(const capture::Frame& frame, const std::stop_token& stop);

  std::unique_ptr<capture::FrameSource> source_;
  std::optional<capture::Frame> ahead_;  // used by next() only, as the following
  capture::Duration waited_{0}, paused_{0};
  std::atomic<std::int64_t> lag_ns_ = 0;

  mutable std::mutex mutex_;  // guards all members below
  std::condition_variable_any news_;
  bool is_paused_ = false;
  std::optional<capture::Timestamp> held_beyond_;  // while paused, releases frames up to this and one later
  double speed_;
  int steps_ = 0;               // pending
  std::uint64_t requests_ = 0;  // counter
  std::vector<bool> seen_;      // per camera: had its frame of this step
  struct Anchor {               // from here on plays at speed_
    Clock::time_point wall;
    capture::Timestamp recorded;
  };
  std::optional<Anchor> anchor_;
  std::optional<capture::Timestamp> first_;
  capture::Timestamp last_{};  // of released frames
  std::size_t at_last_ = 0;    // number of cameras with a frame of that time
};

}  // namespace huetrack::daemon
