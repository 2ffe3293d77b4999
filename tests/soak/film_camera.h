// A live camera that is none: it plays a film of raw YUYV frames in a loop, in real time, into eight buffers that are
// handed out and taken back, as a V4L2 driver does; and fails, when asked, in the ways in which cameras fail.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "capture/frames/jpeg_encoder.h"
#include "capture/timing/capture_clock.h"
#include "pipeline/live_cameras.h"

namespace huetrack::soak {

struct FilmCameraOptions {
  int camera = 0;
  std::filesystem::path film;  // frames of width x height YUYV, back to back
  int width = 0, height = 0;
  double fps = 30;
  std::chrono::steady_clock::time_point start;                // when frame 0 is captured; the same for all cameras
  capture::Duration phase{0};                                 // later than that
  capture::Duration transfer = std::chrono::milliseconds(5);  // from a frame's capture until it can be dequeued
  std::optional<std::uint64_t> faults;                        // seed; nullopt: none
  bool is_mjpeg = false;                                      // frames carry JPEG bytes, too, as from an MJPEG camera
  bool decodes = true;                                        // of is_mjpeg; capture::V4l2SourceOptions
};

class FilmCamera {
 public:
  explicit FilmCamera(FilmCameraOptions options) : state_(std::make_shared<State>(std::move(options))) {}

  pipeline::LiveCamera live() const {
    return {.camera = state_->options.camera,
            .source = std::make_unique<Source>(state_),
            .health =
                [state = state_] {
                  const std::scoped_lock lock(state->mutex);
                  return state->health;
                },
            .take_events =
                [state = state_] {
                  const std::scoped_lock lock(state->mutex);
                  return std::exchange(state->events, {});
                },
            .controls = state_->controls};
  }

 private:
  using Clock = std::chrono::steady_clock;

  // As a webcam has them: the exposure, which an automatic one rules until a manual value is asked for, and the mains.
  // Of all that, the exposure is seen in the film.
  class Controls final : public capture::CameraControls {
   public:
    static constexpr int usual_exposure = 200;

    std::vector<capture::Control> read() const override {
      const std::scoped_lock lock(mutex_);
      auto all = controls_;
      all[1].is_inactive = all[0].value != 1;
      return all;
    }
    std::vector<capture::ControlResult> set(std::span<const capture::ControlSetting> settings) override {
      const std::scoped_lock lock(mutex_);
      std::vector<capture::ControlResult> results;
      for (const auto& [name, value] : settings) {
        capture::ControlResult& result = results.emplace_back();
        result.name = name;
        const auto* const number = std::get_if<std::int64_t>(&value);
        result.asked = number != nullptr ? std::to_string(*number) : std::get<std::string>(value);
        const auto control = std::ranges::find(controls_, name, &capture::Control::name);
        if (control == controls_.end() || number == nullptr || *number < control->min || *number > control->max) {
          result.problem = control == controls_.end() ? "the camera has no such control" : "is out of range";
          continue;
        }
        control->value = result.got = *number;
        if (name == "exposure_time_absolute") controls_[0].value = 1;  // the automatic one is switched off
      }
      exposure_ = controls_[0].value == 1 ? int(*controls_[1].value) : usual_exposure;
      return results;
    }
    void keep(std::vector<capture::ControlSetting>) override {}
    int exposure() const { return exposure_; }

   private:
    mutable std::mutex mutex_;
    std::vector<capture::Control> controls_{
        {.name = "auto_exposure",
         .min = 0,
         .max = 3,
         .default_value = 3,
         .value = 3,
         .menu = {{1, "Manual Mode"}, {3, "Aperture Priority Mode"}}},
        {.name = "exposure_time_absolute",
         .min = 1,
         .max = 1000,
         .default_value = usual_exposure,
         .value = usual_exposure,
         .menu = {}},
        {.name = "power_line_frequency",
         .min = 0,
         .max = 2,
         .default_value = 2,
         .value = 2,
         .menu = {{0, "Disabled"}, {1, "50 Hz"}, {2, "60 Hz"}}}};  // guarded by mutex_
    std::atomic<int> exposure_ = usual_exposure;
  };

  struct Buffer {
    std::unique_ptr<std::uint8_t[]> bytes;
    std::atomic<bool> is_out = false;  // a reader has it
  };
  struct State {
    explicit State(FilmCameraOptions o)
        : options(std::move(o)), file(::open(options.film.c_str(), O_RDONLY | O_CLOEXEC)) {
      struct stat status {};
      if (file < 0 || ::fstat(file, &status) != 0) throw std::runtime_error(options.film.string() + ": cannot be read");
      frame_bytes = std::size_t(options.width) * std::size_t(options.height) * 2;
      frames = std::int64_t(std::size_t(status.st_size) / frame_bytes);
      if (frames == 0) throw std::runtime_error(options.film.string() + ": has no frame of that size");
      for (auto& buffer : buffers) buffer.bytes = std::make_unique<std::uint8_t[]>(frame_bytes);
      if (options.is_mjpeg) encode();
      health.stream = capture::StreamFormat{.width = options.width,
                                            .height = options.height,
                                            .stride = 2 * std::size_t(options.width),
                                            .fps = options.fps};
      health.last_progress = Clock::now();
    }
    ~State() { ::close(file); }
    State(const State&) = delete;
    State& operator=(const State&) = delete;

    void encode() {
      const capture::PictureSize size{.width = options.width, .height = options.height};
      for (std::int64_t k = 0; k < frames; ++k) {
        auto* const bytes = buffers[0].bytes.get();
        if (::pread(file, bytes, frame_bytes, off_t(std::size_t(k) * frame_bytes)) != ssize_t(frame_bytes))
          throw std::runtime_error(options.film.string() + ": cannot be read");
        capture::Image image;
        image.format = capture::PixelFormat::yuyv;
        image.width = options.width, image.height = options.height;
        image.planes[0] = {bytes, 2 * options.width};
        jpegs.push_back(std::make_shared<const std::vector<std::uint8_t>>(capture::encode_picture(image, size, 90)));
      }
    }
    void tell(capture::CaptureState state, bool is_problem, const std::string& message) {
      const std::scoped_lock lock(mutex);
      health.state = state;
      health.message = message;
      events.push_back({capture::unix_now(), state, is_problem, message});
    }

    const FilmCameraOptions options;
    const int file;
    std::size_t frame_bytes = 0;
    std::int64_t frames = 0;
    std::vector<std::shared_ptr<const std::vector<std::uint8_t>>> jpegs;  // of every frame, or none
    std::array<Buffer, 8> buffers;
    const std::shared_ptr<Controls> controls = std::make_shared<Controls>();
    std::mutex mutex;
    capture::CameraHealth health;              // guarded by mutex
    std::vector<capture::CameraEvent> events;  // guarded by mutex
  };

  class Source final : public capture::FrameSource {
   public:
    explicit Source(std::shared_ptr<State> state)
        : state_(std::move(state)),
          random_(state_->options.faults.value_or(0) + std::uint64_t(state_->options.camera)) {
      period_ = capture::duration_of(1 / state_->options.fps);
    }

    std::optional<capture::Frame> next(std::stop_token stop) override {
      const FilmCameraOptions& options = state_->options;
      for (;;) {
        // A program that was away for long finds the newest frames, and a gap in their numbers.
        const auto due_of = [&](std::int64_t k) {
          return options.start + options.phase + options.transfer + k * period_;
        };
        const auto newest = (Clock::now() - due_of(0)) / period_;
        if (next_ < newest - 4) next_ = newest - 4;
        const std::int64_t k = next_++;
        if (!sleep_until(due_of(k), stop)) return std::nullopt;
        if (options.faults && !is_delivered(stop)) {
          if (stop.stop_requested()) return std::nullopt;
          continue;
        }
        auto frame = frame_of(k);
        if (frame) return frame;
      }
    }

   private:
    bool sleep_until(Clock::time_point due, const std::stop_token& stop) {
      for (auto now = Clock::now(); now < due && !stop.stop_requested(); now = Clock::now()) {
        {
          const std::scoped_lock lock(state_->mutex);
          state_->health.last_progress = now;
        }
        std::this_thread::sleep_for(std::min<Clock::duration>(due - now, std::chrono::milliseconds(200)));
      }
      return !stop.stop_requested();
    }

    std::optional<capture::Frame> frame_of(std::int64_t k) {
      const FilmCameraOptions& options = state_->options;
      const auto buffer = std::ranges::find_if(
          state_->buffers, [](const Buffer& b) { return !b.is_out.load(std::memory_order_acquire); });
      if (buffer == state_->buffers.end()) return std::nullopt;  // the readers hold all of them: this frame is lost
      const bool has_pixels = options.decodes || !options.is_mjpeg;
      const auto got = has_pixels ? ::pread(state_->file, buffer->bytes.get(), state_->frame_bytes,
                                            off_t(std::size_t(k % state_->frames) * state_->frame_bytes))
                                  : ssize_t(state_->frame_bytes);
      if (got != ssize_t(state_->frame_bytes)) throw std::runtime_error(options.film.string() + ": cannot be read");
      if (const int exposure = state_->controls->exposure(); exposure != Controls::usual_exposure)
        for (std::size_t i = 0; i < state_->frame_bytes; i += 2) {  // the luma of YUYV
          const int y = 16 + (buffer->bytes[i] - 16) * exposure / Controls::usual_exposure;
          buffer->bytes[i] = std::uint8_t(std::clamp(y, 16, 235));
        }
      capture::Frame frame;
      frame.camera = options.camera;
      frame.sequence = std::uint32_t(k);
      frame.captured_at =
          capture::unix_time_of((options.start + options.phase + k * period_).time_since_epoch()) + clock_jump_;
      frame.stamped_at = frame.captured_at;
      if (is_damaged_) {
        frame.status = capture::FrameStatus::corrupted;
      } else {
        frame.pixels = {.format = capture::PixelFormat::yuyv,
                        .range = capture::ColorRange::limited,
                        .width = options.width,
                        .height = options.height,
                        .planes = {},
                        .owner = {buffer->bytes.get(), [state = state_, buffer](const std::uint8_t*) {
                                    buffer->is_out.store(false, std::memory_order_release);
                                  }}};
        frame.pixels.planes[0] = {buffer->bytes.get(), 2 * options.width};
        buffer->is_out.store(true, std::memory_order_relaxed);
        if (!has_pixels) frame.pixels = {.width = options.width, .height = options.height, .planes = {}, .owner = {}};
        if (options.is_mjpeg) frame.encoded = state_->jpegs[std::size_t(k % state_->frames)];
      }
      const std::scoped_lock lock(state_->mutex);
      if (state_->health.state != capture::CaptureState::delivering)
        state_->events.push_back({capture::unix_now(), capture::CaptureState::delivering, false, "delivers"});
      state_->health.state = capture::CaptureState::delivering;
      ++(is_damaged_ ? state_->health.corrupted : state_->health.frames);
      state_->health.last_frame = frame.captured_at;
      state_->health.last_progress = Clock::now();
      return frame;
    }

    // One frame's chance of trouble. False: the frame did not come.
    bool is_delivered(const std::stop_token& stop) {
      const auto one_in = [&](int n) { return std::uniform_int_distribution<int>(1, n)(random_) == 1; };
      const auto some = [&](int least_ms, int most_ms) {
        return std::chrono::milliseconds(std::uniform_int_distribution<int>(least_ms, most_ms)(random_));
      };
      is_damaged_ = one_in(100);
      if (one_in(600)) {  // the driver stops delivering
        state_->tell(capture::CaptureState::stalled, true, "no frame: its stream is restarted");
        sleep_until(Clock::now() + some(200, 3000), stop);
      }
      if (one_in(900)) {
        state_->tell(capture::CaptureState::absent, true, "unplugged; waiting for its return");
        sleep_until(Clock::now() + some(300, 6000), stop);
      }
      if (one_in(1500)) clock_jump_ = some(-3000, 3000);
      if (clock_jump_ != capture::Duration{0} && one_in(60)) clock_jump_ = capture::Duration{0};
      return !one_in(80);
    }

    std::shared_ptr<State> state_;
    std::mt19937_64 random_;
    capture::Duration period_{0};
    capture::Duration clock_jump_{0};
    std::int64_t next_ = 0;
    bool is_damaged_ = false;
  };

  std::shared_ptr<State> state_;
};

}  // namespace huetrack::soak
