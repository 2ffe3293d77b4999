#include "capture/timing/frame_synchronizer.h"

#include <algorithm>
#include <cassert>
#include <stdexcept>
#include <utility>

namespace huetrack::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration least_clock_jump = 1s;  // a larger difference is another clock, not lateness
constexpr Duration unknown_camera_stopped_after = 1s;
constexpr std::size_t frames_that_confirm_a_clock = 10;
constexpr Duration longest_lag = 200ms;
constexpr int stopped_after_periods = 3;

}  // namespace

std::vector<std::string> FrameSynchronizerOptions::problems() const {
  std::vector<std::string> problems;
  if (camera_count < 1) problems.push_back("camera_count is " + std::to_string(camera_count) + ", but must be >= 1");
  if (cameras_in_use < 0 || cameras_in_use > camera_count)
    problems.push_back("cameras_in_use is " + std::to_string(cameras_in_use) + ", but must be 0 to camera_count");
  if (tolerance <= Duration::zero()) problems.push_back("tolerance must be > 0");
  return problems;
}

Duration suggested_tolerance(std::span<const Duration> frame_periods) {
  std::optional<Duration> fastest;
  for (const Duration period : frame_periods)
    if (period > Duration::zero()) fastest = fastest ? std::min(*fastest, period) : period;
  if (!fastest) return FrameSynchronizerOptions{}.tolerance;
  const double cameras = std::max(2.0, static_cast<double>(frame_periods.size()));
  const double share = std::min(1.0 - 1.0 / cameras + 0.05, 0.8);
  return std::max(Duration(1), std::chrono::round<Duration>(*fastest * share));
}

FrameSynchronizer::FrameSynchronizer(FrameSynchronizerOptions options) : options_(options) {
  for (const auto& problem : options_.problems()) throw std::invalid_argument("FrameSynchronizer: " + problem);
  cameras_.resize(static_cast<std::size_t>(options_.camera_count));
}

std::vector<FrameSet> FrameSynchronizer::push(Frame frame) {
  assert(frame.camera >= 0 && frame.camera < options_.camera_count);
  std::vector<FrameSet> out;
  if (!is_off_time(frame)) {
    drop_off_time_frames();
    admit(std::move(frame));
  } else {
    off_time_.push_back(std::move(frame));
    if (!is_confirmed()) return out;
    auto confirmed = std::exchange(off_time_, {});
    if (confirmed.front().captured_at < *newest_) {
      while (auto set = flush()) out.push_back(std::move(*set));
      cameras_.assign(cameras_.size(), {});
      first_.reset();
      newest_.reset();
      closed_until_.reset();
      ++counters_.clock_jumps;
    }
    for (auto& f : confirmed) admit(std::move(f));
  }
  output_proven(out);
  return out;
}

std::optional<FrameSet> FrameSynchronizer::flush() {
  if (!off_time_.empty() && off_time_.front().captured_at > *newest_) {  // nothing contradicts them any more
    for (auto& frame : std::exchange(off_time_, {})) admit(std::move(frame));
  }
  drop_off_time_frames();
  while (const auto oldest = oldest_waiting())
    if (auto set = take_set(*oldest)) return set;
  return std::nullopt;
}

// Cameras may be slower than a frame per second (time lapse).
Duration FrameSynchronizer::clock_jump() const {
  Duration shortest_period{0};
  for (const CameraQueue& camera : cameras_)
    if (camera.period > Duration::zero() && (shortest_period == Duration::zero() || camera.period < shortest_period))
      shortest_period = camera.period;
  return std::max(least_clock_jump, stopped_after_periods * shortest_period);
}

bool FrameSynchronizer::is_off_time(const Frame& frame) const {
  if (!newest_ || options_.ascending_input) return false;
  return std::chrono::abs(frame.captured_at - *newest_) > clock_jump();
}

bool FrameSynchronizer::is_confirmed() const {
  if (off_time_.size() >= frames_that_confirm_a_clock) return true;
  const Frame& latest = off_time_.back();
  return std::ranges::any_of(off_time_, [&](const Frame& f) {
    const bool is_another = cameras_.size() > 1 ? f.camera != latest.camera : &f != &latest;
    return is_another && std::chrono::abs(f.captured_at - latest.captured_at) <= clock_jump();
  });
}

void FrameSynchronizer::drop_off_time_frames() {
  for (const Frame& f : std::exchange(off_time_, {}))
    ++(f.captured_at > *newest_ ? counters_.early_frames : counters_.late_frames);
}

void FrameSynchronizer::admit(Frame frame) {
  CameraQueue& camera = cameras_[static_cast<std::size_t>(frame.camera)];
  const Timestamp at = frame.captured_at;

  if (!first_) first_ = at;
  newest_ = newest_ ? std::max(*newest_, at) : at;
  camera.lag = std::clamp<Duration>(*newest_ - at, camera.lag - camera.lag / 32, longest_lag);
  const bool is_duplicate =
      at == camera.newest || std::ranges::find(camera.waiting, at, &Frame::captured_at) != camera.waiting.end();
  if (!camera.newest || at > *camera.newest) {
    if (camera.newest) {
      const Duration interval = at - *camera.newest;
      camera.period = camera.last_interval > Duration::zero() ? std::min(interval, camera.last_interval) : interval;
      camera.last_interval = interval;
    }
    camera.newest = at;
  }

  if (is_duplicate) {
    ++counters_.duplicate_frames;
  } else if (closed_until_ && at <= *closed_until_) {
    ++counters_.late_frames;
  } else {
    const auto place = std::ranges::upper_bound(camera.waiting, at, {}, &Frame::captured_at);
    camera.waiting.insert(place, std::move(frame));
  }
}

bool FrameSynchronizer::has_stopped(const CameraQueue& camera) const {
  const Duration patience = camera.period > Duration::zero()
                                ? stopped_after_periods * camera.period + camera.lag + options_.tolerance
                                : unknown_camera_stopped_after;
  return *newest_ - camera.newest.value_or(*first_) > patience;
}

bool FrameSynchronizer::is_waited_for(const CameraQueue& camera, Timestamp end_of_set) const {
  if (!camera.waiting.empty() || has_stopped(camera)) return false;  // its next frame is in or beyond the set
  return std::ranges::any_of(cameras_, [&](const CameraQueue& other) {
    return &other != &camera && other.newest && !has_stopped(other) && *other.newest <= end_of_set + camera.lag;
  });
}

bool FrameSynchronizer::may_still_change(Timestamp end_of_set) const {
  if (!options_.ascending_input)
    return std::ranges::any_of(cameras_, [&](const CameraQueue& camera) { return is_waited_for(camera, end_of_set); });
  if (*newest_ > end_of_set) return false;
  // A set with every camera is not final yet: a camera's next frame may have the newest time, too, within the set's
  // span, and would be late if the set were closed now.
  return std::ranges::any_of(cameras_, [&](const CameraQueue& camera) { return camera.newest != newest_; });
}

std::optional<Timestamp> FrameSynchronizer::oldest_waiting() const {
  std::optional<Timestamp> oldest;
  for (const CameraQueue& camera : cameras_)
    if (!camera.waiting.empty())
      oldest = std::min(oldest.value_or(Timestamp::max()), camera.waiting.front().captured_at);
  return oldest;
}

// The frames within the tolerance of the oldest one, one per camera; nullopt when all of them are corrupted.
std::optional<FrameSet> FrameSynchronizer::take_set(Timestamp oldest) {
  // If a camera has two frames in the span, the second may fit the others' next frames better, and set times must
  // ascend: so the set ends before it.
  Timestamp end = oldest + options_.tolerance;
  for (const CameraQueue& camera : cameras_)
    if (camera.waiting.size() >= 2) end = std::min(end, camera.waiting[1].captured_at - Duration(1));

  FrameSet set;
  set.frames.resize(cameras_.size());
  std::size_t views = 0;
  closed_until_ = oldest;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    auto& waiting = cameras_[i].waiting;
    if (waiting.empty() || waiting.front().captured_at > end) continue;
    Frame frame = std::move(waiting.front());
    waiting.pop_front();
    closed_until_ = std::max(*closed_until_, frame.captured_at);
    if (frame.status != FrameStatus::ok) {
      ++counters_.corrupted_frames;
      continue;
    }
    set.at = views == 0 ? frame.captured_at : std::max(set.at, frame.captured_at);
    set.frames[i] = std::move(frame);
    ++views;
  }
  if (views == 0) return std::nullopt;
  set.number = counters_.sets++;
  const int complete = options_.cameras_in_use > 0 ? options_.cameras_in_use : options_.camera_count;
  if (views < static_cast<std::size_t>(complete)) ++counters_.incomplete_sets;
  return set;
}

void FrameSynchronizer::output_proven(std::vector<FrameSet>& out) {
  while (const auto oldest = oldest_waiting()) {
    if (may_still_change(*oldest + options_.tolerance)) return;
    if (auto set = take_set(*oldest)) out.push_back(std::move(*set));
  }
}

}  // namespace huetrack::capture
