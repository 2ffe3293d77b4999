#include "daemon/played_source.h"

#include <algorithm>
#include <utility>

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

constexpr int most_steps = 1'000'000;

}  // namespace

PlayedSource::PlayedSource(std::unique_ptr<capture::FrameSource> source, const PlayedSourceOptions& options)
    : source_(std::move(source)), speed_(options.speed), seen_(options.cameras, false) {}

void PlayedSource::hold_beyond(capture::Timestamp at) {
  const std::scoped_lock lock(mutex_);
  is_paused_ = true;
  held_beyond_ = at;
}

std::optional<capture::Frame> PlayedSource::next(std::stop_token stop) {
  if (!ahead_) ahead_ = source_->next(stop);
  if (!ahead_) return std::nullopt;
  wait_for_turn(*ahead_, stop);
  return std::exchange(ahead_, std::nullopt);
}

void PlayedSource::wait_for_turn(const capture::Frame& frame, const std::stop_token& stop) {
  constexpr auto poll_period = 200ms;  // for a stop; other changes notify
  const auto camera = std::size_t(frame.camera);
  const auto began = Clock::now();
  std::unique_lock lock(mutex_);
  bool was_paused = false;
  while (!stop.stop_requested()) {
    const auto now = Clock::now();
    auto until = now + poll_period;
    was_paused |= is_paused_;
    if (is_paused_) {
      if (held_beyond_ || !seen_.at(camera)) break;
      if (steps_ > 0) {
        --steps_;
        seen_.assign(seen_.size(), false);
        break;
      }
    } else {
      if (speed_ <= 0) break;
      if (!anchor_) anchor_ = {now, frame.captured_at};
      const auto due =
          anchor_->wall + std::chrono::duration_cast<Clock::duration>((frame.captured_at - anchor_->recorded) / speed_);
      if (now >= due) break;
      until = std::min(until, due);
    }
    news_.wait_until(lock, stop, until, [this, asked = requests_] { return requests_ != asked; });
  }
  // Published times stay as even as the recording's: it is later by what was waited for while it was paused, and by
  // what it is played slower. As fast as possible, time is the recording's own.
  const capture::Duration waited = Clock::now() - began;
  waited_ += waited;
  if (was_paused && !stop.stop_requested()) paused_ += waited;
  const capture::Duration played =
      first_ && frame.captured_at > last_ ? frame.captured_at - last_ : capture::Duration{0};
  if (was_paused) {
    lag_ns_ += std::chrono::nanoseconds(waited - played).count();
  } else if (speed_ > 0) {
    lag_ns_ += std::int64_t(double(played.count()) * (1 / speed_ - 1));
  }
  seen_.at(camera) = true;
  if (!first_) first_ = frame.captured_at;
  if (frame.captured_at > last_) at_last_ = 0;
  last_ = std::max(last_, frame.captured_at);
  at_last_ += frame.captured_at == last_ ? 1 : 0;
  if (held_beyond_ && (last_ > *held_beyond_ || at_last_ == seen_.size())) {
    held_beyond_.reset();
    seen_.assign(seen_.size(), true);  // the next frame of any camera waits
  }
}

page::PlaybackState PlayedSource::state() const {
  const std::scoped_lock lock(mutex_);
  return {.is_paused = is_paused_,
          .speed = speed_,
          .position_s = first_ ? std::chrono::duration<double>(last_ - *first_).count() : 0};
}

void PlayedSource::pause() {
  const std::scoped_lock lock(mutex_);
  if (!is_paused_) seen_.assign(seen_.size(), true);  // the next frame of any camera waits
  is_paused_ = true;
  steps_ = 0;
  ++requests_;
  news_.notify_all();
}

void PlayedSource::go_on() {
  const std::scoped_lock lock(mutex_);
  is_paused_ = false;
  held_beyond_.reset();
  steps_ = 0;
  anchor_.reset();
  ++requests_;
  news_.notify_all();
}

void PlayedSource::step(int sets) {
  const std::scoped_lock lock(mutex_);
  if (!is_paused_) seen_.assign(seen_.size(), true);
  is_paused_ = true;
  steps_ = std::min(steps_ + std::max(sets, 1), most_steps);
  ++requests_;
  news_.notify_all();
}

void PlayedSource::set_speed(double speed) {
  const std::scoped_lock lock(mutex_);
  speed_ = std::max(speed, 0.0);
  anchor_.reset();
  ++requests_;
  news_.notify_all();
}

}  // namespace huetrack::daemon
