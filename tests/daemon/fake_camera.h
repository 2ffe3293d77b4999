// A live camera that is none: the pictures of a recording, in real time, stamped as a driver would.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "capture/timing/capture_clock.h"
#include "pipeline/live_cameras.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::daemon {

using pipeline::LiveCamera;

// thread-safe where LiveCamera asks for it.
class FakeCamera {
 public:
  // Frames of one camera on the recording's clock, whose zero is at `start`, UNIX; at the end it ends, or goes silent.
  FakeCamera(int camera, std::vector<capture::Frame> frames, capture::Timestamp start, bool goes_silent)
      : state_(std::make_shared<State>()), camera_(camera) {
    state_->frames = std::move(frames);
    state_->start = start;
    state_->goes_silent = goes_silent;
    state_->health.last_progress = std::chrono::steady_clock::now();
    if (!state_->frames.empty()) {
      const capture::Image& image = state_->frames.front().pixels;
      state_->health.stream = capture::StreamFormat{
          .width = image.width, .height = image.height, .stride = 0, .fps = 30, .range = image.range};
    }
  }

  LiveCamera live() const {
    LiveCamera live;
    live.camera = camera_;
    live.source = std::make_unique<Source>(state_);
    live.health = [state = state_] {
      const std::scoped_lock lock(state->mutex);
      return state->health;
    };
    live.take_events = [state = state_] {
      const std::scoped_lock lock(state->mutex);
      return std::exchange(state->events, {});
    };
    return live;
  }

 private:
  struct State {
    std::vector<capture::Frame> frames;
    capture::Timestamp start;
    bool goes_silent = false;
    std::mutex mutex;
    capture::CameraHealth health;              // guarded by mutex
    std::vector<capture::CameraEvent> events;  // guarded by mutex
  };
  class Source final : public capture::FrameSource {
   public:
    explicit Source(std::shared_ptr<State> state) : state_(std::move(state)) {}
    std::optional<capture::Frame> next(std::stop_token stop) override {
      using namespace std::chrono_literals;
      const bool at_end = next_ == state_->frames.size();
      if (at_end && !state_->goes_silent) return std::nullopt;
      capture::Frame frame = at_end ? capture::Frame{} : state_->frames[next_];
      frame.captured_at = state_->start + frame.captured_at.time_since_epoch();
      frame.stamped_at = frame.captured_at;
      while (!stop.stop_requested() && (at_end || capture::unix_now() < frame.captured_at)) {
        {
          const std::scoped_lock lock(state_->mutex);
          state_->health.last_progress = std::chrono::steady_clock::now();
        }
        std::this_thread::sleep_for(2ms);
      }
      if (stop.stop_requested()) return std::nullopt;
      ++next_;
      const std::scoped_lock lock(state_->mutex);
      state_->health.state = capture::CaptureState::delivering;
      ++state_->health.frames;
      state_->health.last_progress = std::chrono::steady_clock::now();
      return frame;
    }

   private:
    std::shared_ptr<State> state_;
    std::size_t next_ = 0;
  };

  std::shared_ptr<State> state_;
  int camera_;
};

// The first `count` frames of each camera of a recording.
inline std::vector<std::vector<capture::Frame>> first_frames(const std::filesystem::path& recording,
                                                             const std::vector<std::string>& cameras,
                                                             std::size_t count) {
  recordings::ReplaySource source(recordings::read_recording(recording), cameras);
  std::vector<std::vector<capture::Frame>> frames(cameras.size());
  while (std::ranges::any_of(frames, [&](const auto& f) { return f.size() < count; })) {
    auto frame = source.next({});
    if (!frame) break;
    auto& of_camera = frames[std::size_t(frame->camera)];
    if (of_camera.size() < count) of_camera.push_back(std::move(*frame));
  }
  return frames;
}

// The same frames over and over, at 30 a second, for so many seconds.
inline std::vector<capture::Frame> looped(const std::vector<capture::Frame>& frames, int seconds) {
  std::vector<capture::Frame> out(std::size_t(30 * seconds));
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = frames[i % frames.size()];
    out[i].sequence = static_cast<std::uint32_t>(i);
    out[i].captured_at = capture::Timestamp(std::int64_t(i) * capture::Duration(33'333'333));
  }
  return out;
}

// Such cameras with the first `count` frames of these of a recording, all from 50 ms from now on.
inline std::vector<LiveCamera> fake_cameras(const std::filesystem::path& recording,
                                            const std::vector<std::string>& cameras, std::size_t count,
                                            bool go_silent) {
  auto pictures = first_frames(recording, cameras, count);
  const capture::Timestamp start = capture::unix_now() + std::chrono::milliseconds(50);
  std::vector<LiveCamera> list;
  for (std::size_t c = 0; c < pictures.size(); ++c)
    list.push_back(FakeCamera(int(c), std::move(pictures[c]), start, go_silent).live());
  return list;
}

}  // namespace huetrack::daemon
