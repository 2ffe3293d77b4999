#include "capture/v4l2_source.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <future>
#include <mutex>
#include <set>
#include <span>
#include <stdexcept>
#include <thread>
#include <utility>

#include "capture/frames/file_descriptor.h"
#include "capture/frames/recycler.h"
#include "capture/jpeg/jpeg_reader.h"
#include "capture/timing/camera_clock.h"
#include "capture/timing/capture_clock.h"

namespace huetrack::capture {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr auto heartbeat = 500ms;          // longest wait within next()
constexpr auto shortest_stall = 1s;        // and ten periods
constexpr auto longest_stall = 8s;         // after several failed restarts: some cameras need seconds to start
constexpr int restarts_before_reopen = 3;  // failed ones
constexpr auto hanging_after = 2s;
constexpr auto patience_at_end = 500ms;  // with a camera that does not answer: the service must end within 1 s
constexpr double most_fps = 10000;

std::string fps_text(double fps) {
  return fmt::format("{:.4g}", fps);
}

std::string seconds_text(Clock::duration d) {
  return fmt::format("{:.1f} s", std::chrono::duration<double>(d).count());
}

std::size_t image_bytes(const StreamFormat& stream) {
  const auto rows = static_cast<std::size_t>(stream.height);
  return stream.stride * (stream.format == CaptureFormat::nv12 ? rows + rows / 2 : rows);
}

PixelFormat pixel_format_of(CaptureFormat format) {
  switch (format) {
    case CaptureFormat::yuyv:
      return PixelFormat::yuyv;
    case CaptureFormat::nv12:
      return PixelFormat::nv12;
    case CaptureFormat::grey:
    case CaptureFormat::mjpeg:
      break;
  }
  return PixelFormat::grey;
}

// A pause that another thread can end.
class Alarm {
 public:
  Alarm() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (fd_.get() < 0)
      throw CaptureError({errno, std::generic_category()}, "eventfd: " + std::generic_category().message(errno));
  }

  void ring() {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(fd_.get(), &one, sizeof one);
  }
  void pause(Clock::duration longest) {
    pollfd waiting{fd_.get(), POLLIN, 0};
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(longest).count();
    std::uint64_t count = 0;
    if (::poll(&waiting, 1, static_cast<int>(std::max<std::int64_t>(ms, 0))) > 0) [[maybe_unused]]
      const auto drained = ::read(fd_.get(), &count, sizeof count);
  }

 private:
  FileDescriptor fd_;
};

bool is_absence(const CaptureError& error) {
  const int code = error.code().value();
  return code == ENOENT || code == ENODEV || code == ENXIO;
}

struct Abandoned {
  std::mutex mutex;
  std::vector<std::string> names;  // guarded by mutex
};
Abandoned& abandoned() {
  static Abandoned all;
  return all;
}

// ---- Work in a thread of its own, because the camera may not answer; it shares nothing with the source

enum class Doing : std::uint8_t { nothing, opening, restarting, closing };

struct Work {
  std::unique_ptr<V4l2Device> device;  // opened or restarted
  StreamFormat stream;
  std::vector<ControlResult> controls;
  std::optional<CaptureError> error;  // opening failed
  std::string problem;                // restarting failed
};

// The camera that we had: the same serial number, or for a camera without one the same model in the same port.
bool is_same(const V4l2Identity& found, const V4l2Identity& known) {
  if (!found.is_same_camera(known)) return false;
  const bool has_serial = found.usb && !found.usb->serial.empty();
  return has_serial || found.bus_info == known.bus_info;
}

// Opens the configured device; or, when that name is gone or taken, the known camera at its former port. throws
// CaptureError
V4l2Device right_camera(const fs::path& configured, const std::optional<V4l2Identity>& known) {
  std::optional<CaptureError> error;
  const auto try_node = [&](const fs::path& node, bool is_configured) -> std::optional<V4l2Device> {
    try {
      V4l2Device opened(node);
      if (!known || is_same(opened.identity(), *known)) return opened;
      error.emplace(std::make_error_code(std::errc::address_in_use),
                    "another camera is in its place: " + opened.identity().to_string() + " instead of " +
                        known->to_string() + ". Plug the right one in, or start anew with another configuration");
    } catch (const CaptureError& e) {
      // another node at the port: its metadata node, or it is just being plugged in
      if (is_configured) error.emplace(e);
    }
    return std::nullopt;
  };
  if (auto opened = try_node(configured, true)) return std::move(*opened);
  if (known && known->usb)
    for (const auto& node : v4l2_nodes_at(known->usb->port))
      if (auto opened = try_node(node, false)) return std::move(*opened);
  throw CaptureError(*error);
}

Work opened(const V4l2SourceOptions& options, const std::optional<V4l2Identity>& known) {
  Work work;
  try {
    auto device = std::make_unique<V4l2Device>(right_camera(options.device, known));
    // Set controls only after claim(): until then another program may be using the camera.
    work.stream = device->claim({.format = options.format,
                                 .width = options.width,
                                 .height = options.height,
                                 .fps = options.fps,
                                 .buffers = options.buffers});
    work.controls = device->set_controls(options.controls);
    if (const auto mute = std::ranges::find(work.controls, true, &ControlResult::is_unanswered);
        mute != work.controls.end())
      throw CaptureError({ETIMEDOUT, std::generic_category()},
                         options.device.string() + ": " + mute->problem + ": " + advice_for(ETIMEDOUT));
    try {
      device->stream();
    } catch (const CaptureError&) {
      if (options.restore_controls) device->set_controls_plainly(device->previous_controls());
      throw;
    }
    work.device = std::move(device);
  } catch (const CaptureError& e) {
    work.error = e;
  }
  return work;
}

}  // namespace

std::vector<std::string> abandoned_cameras() {
  const std::scoped_lock lock(abandoned().mutex);
  return abandoned().names;
}

std::vector<std::string> V4l2SourceOptions::problems() const {
  std::vector<std::string> found;
  const auto check = [&](bool is_fine, const std::string& sentence) {
    if (!is_fine) found.push_back(sentence);
  };
  check(camera >= 0, "camera is " + std::to_string(camera) + ", but must be >= 0");
  check(!device.empty(), "device is empty: give one of /dev/v4l/by-path/*-video-index0");
  check(width > 0 && height > 0,
        "the size is " + std::to_string(width) + "x" + std::to_string(height) + ", but must be positive");
  check(fps >= 0 && fps <= most_fps, "fps is " + std::to_string(fps) + ", but must be 0 to 10000");
  check(buffers >= 4 && buffers <= 32, "buffers is " + std::to_string(buffers) + ", but must be 4 to 32");
  check(retry > 0ms, "retry must be positive");
  check(first_patience > 0ms, "first_patience must be positive");
  for (const auto& control : controls) check(!control.name.empty(), "a control has no name");
  return found;
}

std::vector<std::string> V4l2SourceOptions::warnings() const {
  std::error_code error;
  const std::string file = device.filename().string();
  const bool is_index =
      device.parent_path() == "/dev" && file.starts_with("video") && !fs::is_symlink(fs::symlink_status(device, error));
  if (!is_index) return {};
  return {device.string() +
          " is not stable: the next boot may give this name to another camera. Use its name in /dev/v4l/by-path/ (the "
          "port) or /dev/v4l/by-id/ (the camera); huetrackd doctor lists them"};
}

namespace {

// Uses a second handle: drivers accept controls from any.
class V4l2Controls final : public CameraControls {
 public:
  explicit V4l2Controls(std::vector<ControlSetting> kept) : kept_(std::move(kept)) {}

  std::vector<Control> read() const override { return open_again().controls(); }
  std::vector<ControlResult> set(std::span<const ControlSetting> settings) override {
    V4l2Device device = open_again();
    auto results = device.set_controls(settings);
    const std::scoped_lock lock(mutex_);
    for (const ControlSetting& was : device.previous_controls())
      if (!has(changed_, was.name)) changed_.push_back(was);
    return results;
  }
  void keep(std::vector<ControlSetting> settings) override {
    const std::scoped_lock lock(mutex_);
    kept_ = std::move(settings);
  }

  // ---- For the source
  void is_at(std::optional<fs::path> node) {
    const std::scoped_lock lock(mutex_);
    node_ = std::move(node);
  }
  std::vector<ControlSetting> kept() const {
    const std::scoped_lock lock(mutex_);
    return kept_;
  }
  // The original values of all changed controls. before: those that the source changed when it opened the camera.
  std::vector<ControlSetting> with_changed(std::vector<ControlSetting> before) const {
    const std::scoped_lock lock(mutex_);
    for (const ControlSetting& was : changed_)
      if (!has(before, was.name)) before.push_back(was);
    return before;
  }

 private:
  static bool has(const std::vector<ControlSetting>& settings, const std::string& name) {
    return std::ranges::find(settings, name, &ControlSetting::name) != settings.end();
  }
  V4l2Device open_again() const {
    std::optional<fs::path> node;
    {
      const std::scoped_lock lock(mutex_);
      node = node_;
    }
    if (!node) throw CaptureError(std::make_error_code(std::errc::no_such_device), "the camera is not there");
    return V4l2Device(*node);
  }

  mutable std::mutex mutex_;
  std::optional<fs::path> node_;         // guarded by mutex_; nullopt: it is not open
  std::vector<ControlSetting> kept_;     // guarded by mutex_
  std::vector<ControlSetting> changed_;  // guarded by mutex_; original values of what set() changed
};

}  // namespace

struct V4l2Source::Impl {
  explicit Impl(V4l2SourceOptions o)
      : options(std::move(o)), controls(std::make_shared<V4l2Controls>(options.controls)) {
    health.last_progress = Clock::now();
    for (const auto& warning : options.warnings()) report(CaptureState::waiting, true, warning);
  }

  // ---- State and events

  // Adds an event and changes the state.
  void report(CaptureState state, bool is_problem, const std::string& message) {
    const std::scoped_lock lock(mutex);
    health.state = state;
    health.message = message;
    events.push_back({.at = unix_now(), .state = state, .is_problem = is_problem, .message = message});
  }
  // Adds an event only if there was none of this kind since the last undamaged frame.
  void report_once(const std::string& kind, CaptureState state, const std::string& message) {
    if (reported.insert(kind).second) return report(state, true, message);
    const std::scoped_lock lock(mutex);
    health.state = state;
    health.message = message;
  }
  void note(bool is_problem, const std::string& message) {
    const std::scoped_lock lock(mutex);
    events.push_back({.at = unix_now(), .state = health.state, .is_problem = is_problem, .message = message});
  }
  CaptureState state() const {
    const std::scoped_lock lock(mutex);
    return health.state;
  }
  void progress() {
    const std::scoped_lock lock(mutex);
    health.last_progress = Clock::now();
  }

  // ---- Work that may take long

  template <typename F>
  void begin(Doing what, F&& task_body) {
    doing = what;
    work_since = Clock::now();
    std::packaged_task<Work()> task(std::forward<F>(task_body));
    work = task.get_future();
    std::thread([task = std::move(task), rings = alarm]() mutable {
      task();
      rings->ring();
    }).detach();
  }
  bool is_working() const { return doing != Doing::nothing && work.wait_for(0s) != std::future_status::ready; }
  // True: the work is done.
  bool wait_until(Clock::time_point end, const std::stop_token& stop = {}) {
    while (is_working() && Clock::now() < end && !stop.stop_requested())
      alarm->pause(std::min<Clock::duration>(end - Clock::now(), heartbeat));
    return !is_working();
  }
  void report_hanging() {
    if (Clock::now() - work_since < hanging_after) return;
    const bool is_opening = doing == Doing::opening;
    const CaptureState then = state();
    const bool is_reported = then == CaptureState::absent || then == CaptureState::stalled;
    report_once("hanging",
                is_reported  ? then
                : is_opening ? CaptureState::absent
                             : CaptureState::stalled,
                std::string("does not answer, since it was to be ") +
                    (is_opening                   ? "opened"
                     : doing == Doing::restarting ? "restarted"
                                                  : "closed") +
                    ": " + advice_for(ETIMEDOUT));
  }

  std::unique_ptr<V4l2Device> taken_device() {
    const std::scoped_lock lock(mutex);
    return std::move(device);
  }

  // ---- Opening and closing

  void begin_opening() {
    V4l2SourceOptions now = options;
    now.controls = controls->kept();
    begin(Doing::opening, [now = std::move(now), known = known] { return opened(now, known); });
  }
  void begin_closing(bool restores) {
    auto closing = taken_device();
    if (!closing) return;
    controls->is_at(std::nullopt);
    begin(Doing::closing, [closing = std::move(closing), restores = restores && options.restore_controls && before,
                           values = controls->with_changed(before.value_or(std::vector<ControlSetting>{}))]() mutable {
      if (restores) closing->set_controls_plainly(values);
      closing.reset();
      return Work{};
    });
  }

  // throws CaptureError when it could not be opened.
  void finish_opening(Work done) {
    if (done.error) throw CaptureError(*done.error);
    if (!before) before = done.device->previous_controls();
    known = done.device->identity();
    controls->is_at(known->node);
    stream = done.stream;
    last_of_driver.reset();
    silent_since = sound_since = Clock::now();
    damage_since_sound.clear();
    restarts_in_vain = 0;
    {
      const std::scoped_lock lock(mutex);
      device = std::move(done.device);
      health.identity = known;
      health.stream = done.stream;
      health.controls = done.controls;
      if (health.state == CaptureState::absent) health.state = CaptureState::waiting;
    }
    std::string results;
    for (const auto& control : done.controls) results += to_string(control) + "\n";
    if (std::exchange(reported_controls, results) != results)
      for (const auto& control : done.controls)
        if (!control.problem.empty() || control.is_implied) note(!control.problem.empty(), to_string(control));
    if (std::exchange(stream_reported, true)) return;
    const double fps = done.stream.fps;
    if (options.fps > 0 && fps > 0 && std::abs(fps - options.fps) > 0.02 * options.fps)
      note(true, "was asked for " + fps_text(options.fps) + " frames/s and says that it does " + fps_text(fps));
  }

  void finish_restart(Work done) {
    if (done.device) {
      {
        const std::scoped_lock lock(mutex);
        device = std::move(done.device);
      }
      if (done.problem.empty()) {
        ++restarts_in_vain;
        silent_since = sound_since = Clock::now();
        damage_since_sound.clear();
        last_of_driver.reset();
        return;
      }
    }
    if (reported.insert("no restart").second)
      note(true, "its stream does not restart: " + done.problem + "; it is opened anew");
    open_anew();
  }

  void finish_work() {
    Work done = work.get();
    switch (std::exchange(doing, Doing::nothing)) {
      case Doing::opening:
        try {
          finish_opening(std::move(done));
        } catch (const CaptureError& e) {
          report_absence(e);
          next_attempt = Clock::now() + options.retry;
        }
        break;
      case Doing::restarting:
        finish_restart(std::move(done));
        break;
      case Doing::closing:
      case Doing::nothing:
        break;
    }
  }

  // Reports each reason once, not at every attempt; "lost" covers a lost camera that is still not there.
  void report_absence(const CaptureError& error) {
    const std::string why = is_absence(error) ? "lost" : error.what();
    report_once(why, CaptureState::absent, "not available: " + std::string(error.what()));
    if (!absent_since) absent_since = Clock::now();
  }

  // ---- Trouble

  void lose(const std::string& why) {
    begin_closing(false);
    report_once("lost", CaptureState::absent, why);
    if (!absent_since) absent_since = Clock::now();
  }

  Clock::duration patience() const {
    Clock::duration limit = shortest_stall;
    if (stream.fps > 0)
      limit = std::max<Clock::duration>(
          limit, std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(10 / stream.fps)));
    if (!last_of_driver) limit = std::max<Clock::duration>(limit, 2s);  // some cameras take their time to start
    return std::min<Clock::duration>(limit * (1 << restarts_in_vain), std::max<Clock::duration>(longest_stall, limit));
  }

  // After no undamaged frame for too long, or an error of the driver.
  void restart(const std::string& why) {
    report_once("stalled", CaptureState::stalled, why + ": its stream is restarted");
    {
      const std::scoped_lock lock(mutex);
      ++health.restarts;
    }
    if (restarts_in_vain >= restarts_before_reopen) return open_anew();
    begin(Doing::restarting, [restarted = taken_device()]() mutable {
      Work done;
      std::string problem;
      if (!restarted->restart(problem)) done.problem = problem;
      done.device = std::move(restarted);
      return done;
    });
  }

  // The state stays stalled until opening fails, too.
  void open_anew() {
    begin_closing(true);
    if (!absent_since) absent_since = Clock::now();
    next_attempt = Clock::now();
  }

  // ---- Frames

  // Our number for a frame, and the number of frames lost before it. Some drivers do not count.
  std::pair<std::uint32_t, std::uint32_t> number(std::uint32_t of_driver) {
    const auto step = last_of_driver ? static_cast<std::int32_t>(of_driver - *last_of_driver) : 1;
    last_of_driver = of_driver;
    const std::uint32_t lost = step > 1 ? static_cast<std::uint32_t>(step - 1) : 0;
    const std::uint32_t ours = next_sequence + lost;
    next_sequence = ours + 1;
    return {ours, lost};
  }

  Frame frame_from(Dequeued&& raw) {
    Frame frame;
    frame.camera = options.camera;
    frame.stamped_at = unix_time_of(raw.at);
    frame.arrived_at = unix_now();
    frame.latency = options.timing.latency;
    frame.readout = options.timing.readout;
    const auto [sequence, lost] = number(raw.sequence);
    frame.sequence = sequence;
    const StampKind stamp = raw.stamp;

    bool is_copied = false;
    std::string problem;
    if (raw.has_error)
      problem = "the driver flags it as damaged";
    else if (stream.format == CaptureFormat::mjpeg)
      problem = decode(std::move(raw), frame);
    else if (raw.bytes.size() < image_bytes(stream))
      problem =
          "it has " + std::to_string(raw.bytes.size()) + " bytes instead of " + std::to_string(image_bytes(stream));
    else
      is_copied = take_image(std::move(raw), frame);
    frame.status = problem.empty() ? FrameStatus::ok : FrameStatus::corrupted;
    const Timestamp at = frame.status == FrameStatus::ok ? clock.smoothed(frame.stamped_at) : frame.stamped_at;
    frame.captured_at = at - frame.latency;

    const bool is_back = state() != CaptureState::delivering;
    {
      const std::scoped_lock lock(mutex);
      ++(problem.empty() ? health.frames : health.corrupted);
      health.dropped += lost;
      health.copied += is_copied ? 1 : 0;
      health.stamp = stamp;
      health.last_frame = frame.captured_at;
    }
    // A damaged frame ends silence, but not a stall.
    silent_since = Clock::now();
    watch_damage(problem);
    if (!problem.empty()) return frame;
    if (is_back) report_delivery(stamp);
    reported.clear();
    sound_since = silent_since;
    damage_since_sound.clear();
    restarts_in_vain = 0;
    return frame;
  }

  void watch_damage(const std::string& problem) {
    damage.add(!problem.empty());
    if (!problem.empty()) {
      damage_since_sound = problem;
      if (!std::exchange(damage_reported, true))
        note(true, "a frame is damaged and not used (" + problem + "); further ones are only counted");
    }
    std::string warning;
    if (damage.is_high())
      warning =
          fmt::format("{:.0f} % of its frames are damaged and not used: try another cable or port, or a lower rate",
                      100 * damage.share());
    const std::scoped_lock lock(mutex);
    health.warning = std::move(warning);
  }

  void report_delivery(StampKind stamp) {
    std::string text = "delivers " + std::string(name(stream.format)) + " " + std::to_string(stream.width) + "x" +
                       std::to_string(stream.height);
    if (stream.fps > 0) text += " at " + fps_text(stream.fps) + " frames/s";
    text += ", time stamps: " + std::string(name(stamp)) + "; " + known->to_string();
    const bool was_absent = absent_since && was_delivering;
    if (was_absent) text = "is back after " + seconds_text(Clock::now() - *absent_since) + ", " + text;
    if (!was_absent && was_delivering) text = "delivers again";
    if (was_absent) {
      const std::scoped_lock lock(mutex);
      ++health.reconnects;
    }
    absent_since.reset();
    was_delivering = true;
    report(CaptureState::delivering, false, text);
  }

  // The image in the driver's buffer, or a copy of it. True: copied.
  bool take_image(Dequeued&& raw, Frame& frame) {
    const bool copies = device->is_short_of_buffers();
    const std::uint8_t* data = raw.bytes.data();
    std::shared_ptr<const void> owner;
    if (copies) {
      auto memory = copies_memory.take();
      std::uint8_t* const copied = memory->bytes(image_bytes(stream));
      std::memcpy(copied, data, image_bytes(stream));
      data = copied;
      owner = std::move(memory);
      raw.owner.reset();
    } else {
      owner = std::move(raw.owner);
    }
    frame.pixels = {.format = pixel_format_of(stream.format),
                    .range = stream.range,
                    .width = stream.width,
                    .height = stream.height,
                    .planes = {},
                    .owner = std::move(owner)};
    const auto stride = static_cast<std::ptrdiff_t>(stream.stride);
    frame.pixels.planes[0] = {data, stride};
    if (stream.format == CaptureFormat::nv12) frame.pixels.planes[1] = {data + stride * stream.height, stride};
    return copies;
  }

  // By its first marker, SOI (ITU-T T.81, B.1.1.3).
  static bool looks_like_jpeg(std::span<const std::uint8_t> bytes) {
    return bytes.size() > 4 && bytes[0] == 0xFF && bytes[1] == 0xD8;
  }

  // Returns the problem; empty: none.
  std::string decode(Dequeued&& raw, Frame& frame) {
    auto bytes = jpeg.keep(raw.bytes);
    raw.owner.reset();  // returns the buffer to the driver while we decode
    if (!options.decodes) {
      if (!looks_like_jpeg(*bytes)) return "it is no JPEG";
      frame.pixels.width = stream.width, frame.pixels.height = stream.height;
      frame.encoded = std::move(bytes);
      return {};
    }
    auto result = jpeg.read(bytes);
    if (!result.image) return result.problem;
    if (result.image->width != stream.width || result.image->height != stream.height)
      return "its JPEG is " + std::to_string(result.image->width) + "x" + std::to_string(result.image->height);
    frame.pixels = std::move(*result.image);
    frame.encoded = std::move(bytes);
    return {};
  }

  // ---- The loop

  std::optional<Frame> next(std::stop_token stop) {
    const std::stop_callback wakes(stop, [this] {
      alarm->ring();
      const std::scoped_lock lock(mutex);
      if (device) device->wake();
    });
    while (!stop.stop_requested()) {
      progress();
      if (doing != Doing::nothing) {
        if (is_working()) {
          report_hanging();
          alarm->pause(heartbeat);
        } else {
          finish_work();
        }
        continue;
      }
      if (!device) {
        if (Clock::now() >= next_attempt)
          begin_opening();
        else
          alarm->pause(std::min<Clock::duration>(next_attempt - Clock::now(), heartbeat));
        continue;
      }
      if (!damage_since_sound.empty() && Clock::now() - sound_since > patience()) {
        restart("only damaged frames for " + seconds_text(Clock::now() - sound_since) + " (" + damage_since_sound +
                ")");
        continue;
      }
      auto result = device->dequeue(heartbeat);
      switch (result.outcome) {
        case DequeueOutcome::frame:
          return frame_from(std::move(result.frame));
        case DequeueOutcome::stopped:
          break;
        case DequeueOutcome::timeout:
          if (Clock::now() - silent_since > patience())
            restart("no frame for " + seconds_text(Clock::now() - silent_since));
          break;
        case DequeueOutcome::unplugged:
          lose("unplugged: " + result.message + "; waiting for its return");
          next_attempt = Clock::now() + options.retry;
          break;
        case DequeueOutcome::failed:
          if (restarts_in_vain > 0) alarm->pause(std::min<Clock::duration>(options.retry, heartbeat));
          restart("the driver reports " + result.message);
          break;
      }
    }
    return std::nullopt;
  }

  void end() {
    const auto deadline = Clock::now() + patience_at_end;
    if (wait_until(deadline)) {
      if (doing != Doing::nothing) {
        Work done = work.get();
        if (done.device) device = std::move(done.device);
        if (std::exchange(doing, Doing::nothing) == Doing::opening && device && !before)
          before = device->previous_controls();
      }
      begin_closing(true);
      if (wait_until(deadline)) return;
    }
    const std::scoped_lock lock(abandoned().mutex);
    abandoned().names.push_back(options.name);
  }

  const V4l2SourceOptions options;
  const std::shared_ptr<V4l2Controls> controls;
  const std::shared_ptr<Alarm> alarm = std::make_shared<Alarm>();  // shared with threads that may outlive this
  mutable std::mutex mutex;
  std::unique_ptr<V4l2Device> device;  // changed under mutex; the capturing thread reads it without
  CameraHealth health;                 // guarded by mutex
  std::vector<CameraEvent> events;     // guarded by mutex

  // of the capturing thread
  JpegReader jpeg;
  Recycler<FrameMemory> copies_memory;
  StreamFormat stream;
  std::optional<V4l2Identity> known;                  // the camera that was opened first, and its port
  std::optional<std::vector<ControlSetting>> before;  // original values of the controls that opening changed
  Clock::time_point next_attempt{};
  Clock::time_point silent_since{};  // the last frame
  Clock::time_point sound_since{};   // the last undamaged one
  std::string damage_since_sound;    // the problem of damaged ones since then; empty: there were none
  DamageWatch damage;
  Doing doing = Doing::nothing;
  std::future<Work> work;
  Clock::time_point work_since{};
  std::optional<Clock::time_point> absent_since;
  int restarts_in_vain = 0;
  bool was_delivering = false;
  std::set<std::string> reported;  // kinds of trouble since the last undamaged frame
  bool damage_reported = false;
  bool stream_reported = false;
  std::string reported_controls;
  std::optional<std::uint32_t> last_of_driver;  // sequence number in this stream
  std::uint32_t next_sequence = 0;
  CameraClock clock;
};

V4l2Source::V4l2Source(V4l2SourceOptions options, const std::stop_token& stop) {
  for (const auto& problem : options.problems()) throw std::invalid_argument("V4l2Source: " + problem);
  impl_ = std::make_unique<Impl>(std::move(options));
  const std::stop_callback wakes(stop, [this] { impl_->alarm->ring(); });
  impl_->begin_opening();
  if (!impl_->wait_until(Clock::now() + impl_->options.first_patience, stop)) {
    impl_->report_hanging();
    return;
  }
  Work done = impl_->work.get();
  impl_->doing = Doing::nothing;
  try {
    impl_->finish_opening(std::move(done));
  } catch (const CaptureError& e) {
    if (e.code() == std::errc::invalid_argument && !impl_->options.may_be_wrong) throw;
    impl_->report_absence(e);
    impl_->next_attempt = Clock::now() + impl_->options.retry;
  }
}

V4l2Source::~V4l2Source() {
  impl_->end();
  impl_->controls->is_at(std::nullopt);
}

std::shared_ptr<CameraControls> V4l2Source::controls() const {
  return impl_->controls;
}

std::optional<Frame> V4l2Source::next(std::stop_token stop) {
  return impl_->next(stop);
}

CameraHealth V4l2Source::health() const {
  const std::scoped_lock lock(impl_->mutex);
  return impl_->health;
}

std::vector<CameraEvent> V4l2Source::take_events() {
  const std::scoped_lock lock(impl_->mutex);
  return std::exchange(impl_->events, {});
}

}  // namespace huetrack::capture
