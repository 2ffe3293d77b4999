#include "daemon/played_source.h"

#include <algorithm>

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

constexpr int most_steps = 1'000'000;
constexpr std::size_t most_lags = 512;  // frames that may wait: eight cameras, eight sets in the queue, and reserve

}  // namespace

PlayedSource::PlayedSource(std::unique_ptr<LoopingSource> source, const PlayedSourceOptions& options)
    : options_(options), source_(std::move(source)), speed_(options.speed), seen_(options.cameras, false) {}

void PlayedSource::hold_beyond(capture::Timestamp at) {
  const std::scoped_lock lock(mutex_);
  is_paused_ = true;
  held_beyond_ = at;
}

std::optional<capture::Frame> PlayedSource::next(std::stop_token stop) {
  for (;;) {
    jump_if_asked();
    if (!ahead_) ahead_ = source_->next(stop);
    if (!ahead_) return std::nullopt;
    if (!waiting_since_) waiting_since_ = Clock::now();
    if (!wait_for_turn(*ahead_, stop)) continue;
    release(*ahead_, stop.stop_requested());
    return std::exchange(ahead_, std::nullopt);
  }
}

void PlayedSource::jump_if_asked() {
  std::optional<double> to_s;
  {
    const std::scoped_lock lock(mutex_);
    to_s = std::exchange(seek_to_s_, std::nullopt);
    if (!to_s) return;
    // While paused, the set there, and the frame that shows that it is whole.
    held_beyond_ = is_paused_ && has_begun_ ? std::optional(last_ + source_->step() + options_.set_span) : std::nullopt;
    if (!has_begun_) seen_.assign(seen_.size(), false);
    anchor_.reset();
  }
  if (ahead_) source_->take_back(*ahead_);
  ahead_.reset();
  has_paused_ = true;
  if (!waiting_since_) waiting_since_ = Clock::now();
  source_->seek(capture::duration_of(*to_s));  // reads, perhaps for seconds: without the lock
}

// False: a jump is asked for, and this frame is not to be released.
bool PlayedSource::wait_for_turn(const capture::Frame& frame, const std::stop_token& stop) {
  constexpr auto poll_period = 200ms;  // for a stop; other changes notify
  const auto camera = std::size_t(frame.camera);
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    due_.reset();
    if (seek_to_s_) return false;
    const auto now = Clock::now();
    auto until = now + poll_period;
    has_paused_ |= is_paused_;
    if (is_paused_) {
      if (held_beyond_ || !seen_.at(camera)) break;
      if (steps_ > 0) {
        --steps_;
        seen_.assign(seen_.size(), false);
        break;
      }
    } else {
      if (speed_ <= 0) break;
      const bool is_anchor = !anchor_;
      if (is_anchor) anchor_ = {now, frame.captured_at};
      const auto due =
          anchor_->wall + std::chrono::duration_cast<Clock::duration>((frame.captured_at - anchor_->recorded) / speed_);
      due_ = is_anchor ? std::nullopt : std::optional(due);
      if (now >= due) break;
      until = std::min(until, due);
    }
    news_.wait_until(lock, stop, until, [this, asked = requests_] { return requests_ != asked; });
  }
  return true;
}

void PlayedSource::release(const capture::Frame& frame, bool is_stopped) {
  const std::scoped_lock lock(mutex_);
  const auto now = Clock::now();
  const capture::Duration waited = now - *std::exchange(waiting_since_, std::nullopt);
  const bool was_paused = std::exchange(has_paused_, false);
  waited_ += waited;
  if (was_paused && !is_stopped) paused_ += waited;
  const capture::Duration played =
      has_begun_ && frame.captured_at > last_ ? frame.captured_at - last_ : capture::Duration{0};
  // Published times stay as even as the recording's while it is paced; a pause, a jump and a change of the speed take
  // as long as they take. As fast as possible, time is the recording's own.
  capture::Duration lag = lags_.empty() ? capture::Duration{0} : lags_.back().second;
  const bool is_even = due_ && !was_paused;
  if (is_even) {
    lag += capture::Duration(std::int64_t(double(played.count()) * (1 / speed_ - 1)));
  } else if (has_begun_ && (was_paused || speed_ > 0)) {
    lag += (now - released_at_) - played;
  }
  released_at_ = is_even ? *due_ : now;
  if (lags_.empty() || frame.captured_at > lags_.back().first) {
    lags_.emplace_back(frame.captured_at, lag);
    if (lags_.size() > most_lags) lags_.pop_front();
  } else {
    lags_.back().second = lag;  // of a frame of the same time
  }
  seen_.at(std::size_t(frame.camera)) = true;
  has_begun_ = true;
  if (frame.captured_at > last_) at_last_ = 0;
  last_ = std::max(last_, frame.captured_at);
  position_ = source_->position_of(last_);
  at_last_ += frame.captured_at == last_ ? 1 : 0;
  if (held_beyond_ && (last_ > *held_beyond_ || at_last_ == seen_.size())) {
    held_beyond_.reset();
    seen_.assign(seen_.size(), true);  // the next frame of any camera waits
  }
}

capture::Duration PlayedSource::lag_at(capture::Timestamp captured_at) const {
  const std::scoped_lock lock(mutex_);
  if (lags_.empty()) return capture::Duration{0};
  const auto later = std::ranges::upper_bound(lags_, captured_at, {}, &decltype(lags_)::value_type::first);
  return later == lags_.begin() ? lags_.front().second : std::prev(later)->second;
}

page::PlaybackState PlayedSource::state() const {
  const std::scoped_lock lock(mutex_);
  return {.is_paused = is_paused_,
          .speed = speed_,
          .position_s = capture::seconds(position_),
          .length_s = options_.length_s,
          .loops = options_.loops,
          .why_no_seek = options_.why_no_seek};
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

void PlayedSource::seek(double position_s) {
  const std::scoped_lock lock(mutex_);
  seek_to_s_ = std::max(position_s, 0.0);
  steps_ = 0;
  ++requests_;
  news_.notify_all();
}

}  // namespace huetrack::daemon
