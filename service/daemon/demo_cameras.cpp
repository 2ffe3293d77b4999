#include "daemon/demo_cameras.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "capture/timing/capture_clock.h"
#include "recordings/replay_source.h"

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

// What a camera's source and its functions for other threads share.
struct DemoState {
  std::shared_ptr<const DemoFilm> film;
  std::size_t camera = 0;
  capture::Timestamp start;  // capture time of the first frame, UNIX
  std::mutex mutex;
  capture::CameraHealth health;  // guarded by mutex
};

class DemoSource final : public capture::FrameSource {
 public:
  explicit DemoSource(std::shared_ptr<DemoState> state) : state_(std::move(state)) {}

  std::optional<capture::Frame> next(std::stop_token stop) override {
    const capture::Duration period = state_->film->period();
    const auto now = std::uint64_t(std::max<std::int64_t>(0, (capture::unix_now() - state_->start) / period));
    const std::uint64_t missed = now > next_ ? now - next_ : 0;
    next_ += missed;
    const capture::Timestamp due = state_->start + std::int64_t(next_) * period;
    while (capture::unix_now() < due) {
      if (stop.stop_requested()) return std::nullopt;
      std::this_thread::sleep_for(std::min<capture::Duration>(due - capture::unix_now(), 20ms));
    }
    capture::Frame frame = state_->film->at(state_->camera, next_);
    frame.sequence = static_cast<std::uint32_t>(next_++);
    frame.captured_at = frame.stamped_at = due;
    frame.arrived_at = capture::unix_now();
    const std::scoped_lock lock(state_->mutex);
    state_->health.state = capture::CaptureState::delivering;
    ++state_->health.frames;
    state_->health.dropped += missed;
    state_->health.last_frame = due;
    state_->health.last_progress = std::chrono::steady_clock::now();
    return frame;
  }

 private:
  const std::shared_ptr<DemoState> state_;
  std::uint64_t next_ = 0;
};

}  // namespace

DemoFilm::DemoFilm(const recordings::Recording& recording, std::vector<std::string> cameras,
                   const std::stop_token& stop)
    : cameras_(std::move(cameras)), frames_(cameras_.size()) {
  recordings::ReplaySource source(recording, cameras_, {.keeps_encoded = true});
  while (auto frame = source.next(stop)) frames_[std::size_t(frame->camera)].push_back(std::move(*frame));
  if (stop.stop_requested()) throw std::runtime_error("stopped while the recording was being read");
  period_ = source.cameras().front().frame_period;
  for (std::size_t c = 0; c < cameras_.size(); ++c)
    if (frames_[c].size() < 2 || frames_[c].size() != length() || source.cameras()[c].frame_period != period_ ||
        period_ <= 0ns)
      throw std::runtime_error(recording.file.string() +
                               ": the demo needs as many frames of each camera, two at least, at one rate");
}

const capture::Frame& DemoFilm::at(std::size_t camera, std::uint64_t k) const {
  const std::uint64_t last = length() - 1, step = k % (2 * last);
  return frames_[camera][std::size_t(step <= last ? step : 2 * last - step)];
}

std::vector<capture::LiveCamera> demo_cameras(const std::shared_ptr<const DemoFilm>& film,
                                              std::span<const std::string> rig_cameras) {
  const capture::Timestamp start = capture::unix_now();
  std::vector<capture::LiveCamera> list;
  for (std::size_t c = 0; c < film->cameras().size(); ++c) {
    const auto in_rig = std::ranges::find(rig_cameras, film->cameras()[c]);
    if (in_rig == rig_cameras.end()) continue;
    const auto state = std::make_shared<DemoState>();
    state->film = film;
    state->camera = c;
    state->start = start;
    const capture::Image& image = film->at(c, 0).pixels;
    state->health.stream = capture::StreamFormat{.format = capture::CaptureFormat::mjpeg,
                                                 .width = image.width,
                                                 .height = image.height,
                                                 .fps = 1 / capture::seconds(film->period()),
                                                 .range = image.range};
    state->health.stamp = capture::StampKind::start_of_exposure;
    state->health.last_progress = std::chrono::steady_clock::now();
    list.push_back({.camera = int(in_rig - rig_cameras.begin()),
                    .source = std::make_unique<DemoSource>(state),
                    .health =
                        [state] {
                          const std::scoped_lock lock(state->mutex);
                          return state->health;
                        },
                    .take_events = [] { return std::vector<capture::CameraEvent>(); }});
  }
  return list;
}

}  // namespace huetrack::daemon
