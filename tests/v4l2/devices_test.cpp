// V4l2Device, V4l2Source and RecordingWriter against real V4L2 drivers. Runs as root in the VM that tests/v4l2/run.sh
// boots: v4l2loopback (a known film at known times), vivid (a driver that fails on demand), and uvcvideo with emulated
// USB cameras (what webcams use). Elsewhere everything is skipped.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <random>
#include <thread>

#include "capture/clips.h"
#include "capture/frames/jpeg_decoder.h"
#include "capture/timing/capture_clock.h"
#include "capture/v4l2_source.h"
#include "pipeline/bounded_queue.h"
#include "recordings/recording_writer.h"
#include "recordings/replay_source.h"
#include "v4l2/vm.h"

namespace huetrack::v4l2 {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using capture::hash_of;
using capture::read_bytes;
using capture::TemporaryFolder;
using capture::write_text;
using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// What a control stands at, by its name or its older one.
std::optional<std::int64_t> value_of(const capture::V4l2Device& device, std::string_view name) {
  const std::vector<capture::Control> controls = device.controls();
  const capture::Control* found = capture::find_control(controls, name);
  return found != nullptr ? found->value : std::nullopt;
}

// Reads a source for a while.
struct Take {
  std::vector<capture::Frame> frames;
  std::vector<capture::CameraEvent> events;
  int count(capture::FrameStatus status) const {
    return static_cast<int>(std::ranges::count(frames, status, &capture::Frame::status));
  }
  std::vector<std::string> messages() const {
    std::vector<std::string> texts;
    for (const auto& event : events) texts.push_back(std::string(capture::name(event.state)) + ": " + event.message);
    return texts;
  }
};
void take(capture::V4l2Source& source, Take& result, std::size_t frames, std::chrono::milliseconds patience,
          const std::function<bool(const Take&)>& until = {}, bool keeps_images = false) {
  std::stop_source stop;
  const std::jthread clock([&](std::stop_token ended) {
    const auto end = std::chrono::steady_clock::now() + patience;
    while (!ended.stop_requested() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(10ms);
    stop.request_stop();
  });
  for (std::size_t got = 0; got < frames;) {
    auto frame = source.next(stop.get_token());
    for (auto& event : source.take_events()) result.events.push_back(std::move(event));
    if (!frame) break;
    ++got;
    if (!keeps_images) frame->pixels = capture::Image{};
    result.frames.push_back(std::move(*frame));
    if (until && until(result)) break;
  }
}
Take take(capture::V4l2Source& source, std::size_t frames, std::chrono::milliseconds patience = 20s,
          const std::function<bool(const Take&)>& until = {}, bool keeps_images = false) {
  Take result;
  take(source, result, frames, patience, until, keeps_images);
  return result;
}

// Random frames, which no decoder and no wrong buffer can give by chance.
constexpr int width = 320, height = 240, film_frames = 60;
constexpr std::size_t frame_bytes = std::size_t{width} * height * 2;
const std::string& film() {
  static const std::string bytes = [] {
    std::mt19937_64 random(7);
    std::string all(frame_bytes * film_frames, '\0');
    for (std::size_t i = 0; i < all.size(); i += 8) {
      const std::uint64_t word = random();
      std::memcpy(all.data() + i, &word, 8);
    }
    return all;
  }();
  return bytes;
}
// Which frame of the film it is; -1: none, bit for bit.
int film_index(const capture::Image& image) {
  if (image.format != capture::PixelFormat::yuyv || image.width != width || image.height != height ||
      image.planes[0].stride != 2 * width)
    return -1;
  for (int k = 0; k < film_frames; ++k)
    if (std::memcmp(film().data() + k * frame_bytes, image.planes[0].data, frame_bytes) == 0) return k;
  return -1;
}

capture::V4l2SourceOptions options_for(const fs::path& device, int w = width, int h = height, double fps = 30) {
  capture::V4l2SourceOptions options;
  options.name = "left";
  options.device = device;
  options.width = w;
  options.height = h;
  options.fps = fps;
  return options;
}

// ---- v4l2loopback

class Loopback : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_OUTSIDE_VM();
    node = node_of("v4l2 loopback");
    ASSERT_FALSE(node.empty());
    std::ofstream(folder / "film.yuyv", std::ios::binary) << film();
  }
  std::unique_ptr<Program> play(int frames) {
    fs::remove(folder / "go");
    fs::remove(folder / "go.ready");
    auto player = std::make_unique<Program>(std::vector<std::string>{
        tool("v4l2play"), "-w", "320", "-h", "240", "-r", "30", "-m", "-n", std::to_string(frames), "-g",
        (folder / "go").string(), node.string() + "=" + (folder / "film.yuyv").string()});
    EXPECT_TRUE(comes_true([&] { return fs::exists(folder / "go.ready"); }));
    return player;
  }
  void go() { write_text(folder / "go", ""); }

  TemporaryFolder folder;
  fs::path node;
};

TEST_F(Loopback, FramesAreBitExactWithTheDriversTimes) {
  const auto player = play(120);
  capture::V4l2Source source(options_for(node));
  go();
  auto got = take(source, 100, 20s, {}, true);
  ASSERT_GE(got.frames.size(), 5U);
  const int first = film_index(got.frames[0].pixels);
  for (const capture::Frame& frame : got.frames) {
    const int index = film_index(frame.pixels);
    ASSERT_GE(index, 0) << "frame " << frame.sequence << " is not bit-exact";
    ASSERT_EQ(static_cast<unsigned>(index), (static_cast<unsigned>(first) + frame.sequence) % film_frames);
    // the player's schedule, in whole microseconds
    const double expected_s = frame.sequence / 30.0;
    EXPECT_NEAR(capture::seconds(frame.captured_at - got.frames[0].captured_at), expected_s, 3e-6);
    EXPECT_EQ(frame.status, capture::FrameStatus::ok);
  }
  EXPECT_NEAR(capture::seconds(std::chrono::system_clock::now() - got.frames.back().captured_at), 0, 5.0);
  const auto health = source.health();
  EXPECT_EQ(health.state, capture::CaptureState::delivering);
  EXPECT_EQ(health.stamp, capture::StampKind::end_of_frame);
  EXPECT_EQ(health.dropped, got.frames.back().sequence + 1 - got.frames.size());
  EXPECT_EQ(health.copied, health.frames) << "its player writes into buffers that are held";
  std::printf("loopback: %zu frames, %u numbers, %llu copied\n", got.frames.size(), got.frames.back().sequence + 1,
              static_cast<unsigned long long>(health.copied));
}

TEST_F(Loopback, RecordingReplaysTheLiveFrames) {
  for (const auto storage : {recordings::RawStorage::uncompressed, recordings::RawStorage::huffyuv}) {
    const auto player = play(60);
    capture::V4l2Source source(options_for(node));
    const fs::path out = folder / (storage == recordings::RawStorage::huffyuv ? "huffyuv" : "raw");
    recordings::RecordingWriter writer(
        {.folder = out, .cameras = {"left"}, .rig_yaml = {}, .config_yaml = {}, .raw_storage = storage});
    go();
    std::vector<int> indices;
    std::vector<capture::Timestamp> times;
    for (auto& frame : take(source, 30, 20s, {}, true).frames) {
      frame.arrival = indices.size() + 1;
      ASSERT_TRUE(writer.write(frame)) << *writer.failure();
      indices.push_back(film_index(frame.pixels));
      times.push_back(frame.captured_at);
    }
    ASSERT_GE(indices.size(), 5U);
    writer.finish();
    const std::vector<std::string> cameras{"left"};
    recordings::ReplaySource replay(recordings::read_recording(out), cameras);
    for (std::size_t i = 0; i < indices.size(); ++i) {
      const auto frame = replay.next({});
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->captured_at, times[i]);
      if (storage == recordings::RawStorage::uncompressed) {
        EXPECT_EQ(film_index(frame->pixels), indices[i]);
      }
      // the same values, wherever they lie
      const auto* raw =
          reinterpret_cast<const std::uint8_t*>(film().data()) + static_cast<std::size_t>(indices[i]) * frame_bytes;
      for (int v = 0; v < height; v += 7)
        for (int u = 0; u < width; ++u) {
          const capture::Yuv yuv = capture::yuv_at(frame->pixels, u, v);
          const std::uint8_t* pair = raw + v * 2 * width + (u & ~1) * 2;
          ASSERT_TRUE(yuv.y == pair[(u & 1) * 2] && yuv.u == pair[1] && yuv.v == pair[3]);
        }
    }
    EXPECT_FALSE(replay.next({}));
  }
}

TEST_F(Loopback, PlayerMayComeGoAndReturn) {
  capture::V4l2Source source(options_for(node));
  EXPECT_EQ(source.health().state, capture::CaptureState::absent);
  EXPECT_THAT(source.health().message, HasSubstr("nothing plays"));
  EXPECT_THAT(take(source, 1, 2s).frames, IsEmpty());
  {
    const auto player = play(100000);
    go();
    EXPECT_EQ(take(source, 10).frames.size(), 10U);
    EXPECT_EQ(source.health().state, capture::CaptureState::delivering);
  }
  auto gone = take(source, 1000, 9s);
  EXPECT_NE(source.health().state, capture::CaptureState::delivering);
  EXPECT_THAT(gone.messages(), Contains(HasSubstr("stalled: ")));
  EXPECT_LE(gone.events.size(), 4U) << testing::PrintToString(gone.messages());
  const auto player = play(100000);
  go();
  const auto back = take(source, 10, 30s);
  EXPECT_EQ(back.frames.size(), 10U) << source.health().message;
  EXPECT_EQ(source.health().state, capture::CaptureState::delivering);
}

// ---- vivid

class Vivid : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_OUTSIDE_VM();
    node = node_of("vivid");
    ASSERT_FALSE(node.empty());
    knobs.emplace(node);
    set("percentage_of_dropped_buffers", 0);
  }
  void set(const std::string& control, std::int64_t value) {
    const std::vector<capture::ControlSetting> settings{{control, value}};
    for (const auto& result : knobs->set_controls(settings))
      ASSERT_EQ(result.problem, "") << capture::to_string(result);
  }
  capture::V4l2SourceOptions options() const { return options_for(node, 320, 180, 30); }

  fs::path node;
  std::optional<capture::V4l2Device> knobs;  // a second opener, to turn the driver's knobs
};

TEST_F(Vivid, ListsItsOffersAndRefusesOthers) {
  EXPECT_EQ(knobs->identity().driver, "vivid");
  const auto formats = knobs->formats();
  const auto yuyv = std::ranges::find(formats, capture::CaptureFormat::yuyv, &capture::OfferedFormat::format);
  ASSERT_NE(yuyv, formats.end());
  EXPECT_EQ(capture::fourcc_text(yuyv->fourcc), "YUYV");
  EXPECT_THAT(yuyv->sizes,
              Contains(AllOf(Field(&capture::OfferedSize::width, 640), Field(&capture::OfferedSize::height, 480))));
  const auto refused = [&](capture::V4l2SourceOptions wrong, const char* why) {
    try {
      const capture::V4l2Source source(std::move(wrong));
      ADD_FAILURE() << "taken: " << why;
    } catch (const capture::CaptureError& e) {
      EXPECT_EQ(e.code(), std::errc::invalid_argument);
      EXPECT_THAT(std::string(e.what()), HasSubstr(why));
    }
  };
  auto odd = options();
  odd.width = 321;
  refused(odd, (node.string() + ": has no 321x180: it offers yuyv 320x180@").c_str());
  auto jpeg = options();
  jpeg.format = capture::CaptureFormat::mjpeg;
  refused(jpeg, "has no mjpeg 320x180");
  auto nothing = options();
  nothing.device = "/dev/null";
  refused(nothing, "/dev/null: is not a video device");
}

TEST_F(Vivid, EveryRawFormatArrives) {
  for (const auto& [format, pixels] : {std::pair{capture::CaptureFormat::yuyv, capture::PixelFormat::yuyv},
                                       std::pair{capture::CaptureFormat::nv12, capture::PixelFormat::nv12},
                                       std::pair{capture::CaptureFormat::grey, capture::PixelFormat::grey}}) {
    auto wanted = options();
    wanted.format = format;
    capture::V4l2Source source(wanted);
    const auto got = take(source, 3, 20s, {}, true);
    ASSERT_EQ(got.frames.size(), 3U) << capture::name(format);
    for (const auto& frame : got.frames) {
      EXPECT_EQ(frame.pixels.format, pixels);
      EXPECT_EQ(frame.pixels.width, 320);
      EXPECT_EQ(frame.pixels.height, 180);
      EXPECT_GT(hash_of(frame.pixels), 0U);  // touches every byte, under the sanitizers
    }
  }
}

TEST_F(Vivid, StampKindsAreRight) {
  for (const auto& [source_of_stamps, kind] :
       {std::pair{1, capture::StampKind::start_of_exposure}, std::pair{0, capture::StampKind::end_of_frame}}) {
    set("timestamp_source", source_of_stamps);
    capture::V4l2Source source(options());
    ASSERT_EQ(take(source, 3).frames.size(), 3U);
    EXPECT_EQ(source.health().stamp, kind);
  }
  set("timestamp_source", 1);
  auto late = options();
  late.timing.latency = 1h;
  capture::V4l2Source source(late);
  const auto got = take(source, 1);
  ASSERT_EQ(got.frames.size(), 1U);
  EXPECT_NEAR(capture::seconds(capture::unix_now() - got.frames[0].captured_at), 3600, 1);
}

TEST_F(Vivid, FlaggedFramesAreCorrupted) {
  capture::V4l2Source source(options());
  ASSERT_EQ(take(source, 3).frames.size(), 3U);
  set("inject_v4l2_buf_flag_error", 1);
  const auto got = take(
      source, 60, 20s, [](const Take& t) { return t.count(capture::FrameStatus::corrupted) > 0; }, true);
  ASSERT_EQ(got.count(capture::FrameStatus::corrupted), 1);
  const auto& marked = *std::ranges::find(got.frames, capture::FrameStatus::corrupted, &capture::Frame::status);
  EXPECT_EQ(marked.pixels.width, 0);
  EXPECT_EQ(source.health().corrupted, 1U);
  EXPECT_THAT(got.messages(), Contains(HasSubstr("flags it as damaged")));
  const auto after = take(source, 10);
  EXPECT_EQ(after.count(capture::FrameStatus::ok), 10);
}

TEST_F(Vivid, GapsInTheSequenceAreDrops) {
  capture::V4l2Source source(options());
  set("percentage_of_dropped_buffers", 30);
  const auto got = take(source, 60, 30s);
  set("percentage_of_dropped_buffers", 0);
  ASSERT_EQ(got.frames.size(), 60U);
  EXPECT_EQ(got.frames.front().sequence, 0U);
  EXPECT_GE(source.health().dropped, 5U);
  EXPECT_EQ(source.health().dropped, got.frames.back().sequence - 59U);
}

TEST_F(Vivid, InputErrorEndsNothing) {
  capture::V4l2Source source(options());
  ASSERT_EQ(take(source, 3).frames.size(), 3U);
  set("inject_fatal_streaming_error", 1);
  Take got;
  take(source, got, 300, 30s,
       [](const Take& t) { return !t.events.empty() && t.events.back().state == capture::CaptureState::delivering; });
  EXPECT_THAT(got.messages(), Contains(HasSubstr("stalled: the driver reports Input/output error")));
  EXPECT_THAT(got.messages(), Contains(HasSubstr("delivering: delivers again")));
  EXPECT_EQ(take(source, 10).frames.size(), 10U);
  EXPECT_GE(source.health().restarts, 1U);
}

TEST_F(Vivid, SilentDriverIsRestarted) {
  capture::V4l2Source source(options());
  ASSERT_EQ(take(source, 3).frames.size(), 3U);
  set("percentage_of_dropped_buffers", 100);
  const auto silent = take(source, 1000, 6s);
  EXPECT_EQ(source.health().state, capture::CaptureState::stalled) << source.health().message;
  EXPECT_GE(source.health().restarts, 1U);
  EXPECT_LE(silent.events.size(), 2U) << testing::PrintToString(silent.messages());
  EXPECT_LT(std::chrono::steady_clock::now() - source.health().last_progress, 2s) << "the watchdog would bark";
  set("percentage_of_dropped_buffers", 0);
  const auto back = take(source, 10, 30s);
  EXPECT_EQ(back.frames.size(), 10U);
  EXPECT_EQ(source.health().state, capture::CaptureState::delivering);
}

TEST_F(Vivid, FailuresAtStartAreRetried) {
  for (const char* knob : {"inject_vidioc_streamon_error", "inject_vidioc_qbuf_error", "inject_vidioc_reqbufs_error"}) {
    set(knob, 1);
    capture::V4l2Source source(options());
    EXPECT_EQ(source.health().state, capture::CaptureState::absent) << knob;
    EXPECT_THAT(source.health().message, HasSubstr("Invalid argument")) << knob;
    EXPECT_EQ(take(source, 5).frames.size(), 5U) << knob;
  }
}

TEST_F(Vivid, FailingRestartReopensTheDevice) {
  capture::V4l2Source source(options());
  ASSERT_EQ(take(source, 3).frames.size(), 3U);
  set("inject_vidioc_streamon_error", 1);
  set("inject_fatal_streaming_error", 1);
  const auto got = take(source, 1000, 30s, [](const Take& t) {
    return t.frames.size() > 20 && !t.events.empty() && t.events.back().state == capture::CaptureState::delivering;
  });
  EXPECT_GT(got.frames.size(), 20U) << testing::PrintToString(got.messages());
  EXPECT_EQ(source.health().state, capture::CaptureState::delivering);
}

TEST_F(Vivid, BusyCameraIsAwaited) {
  auto first = std::make_unique<capture::V4l2Source>(options());
  ASSERT_EQ(take(*first, 3).frames.size(), 3U);
  capture::V4l2Source second(options());
  EXPECT_EQ(second.health().state, capture::CaptureState::absent);
  EXPECT_THAT(second.health().message, HasSubstr("another program uses it"));
  auto waiting = take(second, 1, 2500ms);
  EXPECT_THAT(waiting.frames, IsEmpty());
  EXPECT_EQ(waiting.events.size(), 2U) << "said once, beside the unstable name: "
                                       << testing::PrintToString(waiting.messages());
  first.reset();
  EXPECT_EQ(take(second, 3).frames.size(), 3U);
}

TEST_F(Vivid, ControlsOfABusyCameraAreUnchanged) {
  auto mine = options(), others = options();
  others.controls = {{"brightness", 100}};
  mine.controls = {{"brightness", 200}};
  mine.restore_controls = true;
  capture::V4l2Source first(others);
  ASSERT_EQ(take(first, 3).frames.size(), 3U);
  {
    capture::V4l2Source second(mine);
    EXPECT_THAT(second.health().message, HasSubstr("another program uses it"));
    EXPECT_THAT(take(second, 1, 2s).frames, IsEmpty());
    EXPECT_EQ(value_of(*knobs, "brightness"), 100);
  }
  EXPECT_EQ(value_of(*knobs, "brightness"), 100);
  set("brightness", 128);
}

TEST_F(Vivid, DisconnectedCameraComesBack) {
  const fs::path other = node_of("vivid", 1);
  ASSERT_FALSE(other.empty());
  capture::V4l2Source source(options_for(other, 320, 180, 30));
  ASSERT_EQ(take(source, 3).frames.size(), 3U);
  {
    capture::V4l2Device knob(other);
    const std::vector<capture::ControlSetting> pull{{"disconnect", 1}};
    knob.set_controls(pull);
  }
  const auto got = take(source, 1000, 20s, [](const Take& t) {
    return t.frames.size() > 10 && !t.events.empty() && t.events.back().state == capture::CaptureState::delivering;
  });
  EXPECT_THAT(got.messages(), Contains(HasSubstr("absent: unplugged: No such device")));
  EXPECT_GT(got.frames.size(), 10U) << testing::PrintToString(got.messages());
  EXPECT_EQ(source.health().reconnects, 1U);
}

TEST_F(Vivid, StopWakesItAtOnce) {
  set("percentage_of_dropped_buffers", 100);
  capture::V4l2Source source(options());
  std::stop_source stop;
  std::chrono::steady_clock::time_point asked;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(300ms);
    asked = std::chrono::steady_clock::now();
    stop.request_stop();
  });
  while (source.next(stop.get_token())) {
  }
  stopper.join();
  EXPECT_LT(std::chrono::steady_clock::now() - asked, 200ms);
  set("percentage_of_dropped_buffers", 0);
}

TEST_F(Vivid, OtherThreadsReleaseFramesDuringARestart) {
  auto source = std::make_unique<capture::V4l2Source>(options());
  pipeline::BoundedQueue<capture::Frame> queue(4, pipeline::WhenFull::drop_oldest);
  std::uint64_t sum = 0;
  int read = 0;
  std::jthread reader([&] {
    std::deque<capture::Frame> held;
    while (auto frame = queue.pop()) {
      if (frame->status == capture::FrameStatus::ok) sum += hash_of(frame->pixels);
      held.push_back(std::move(*frame));
      if (held.size() > 3) held.pop_front();
      ++read;
    }
  });
  for (int k = 0; k < 60; ++k) {
    if (k == 20 || k == 40) set("inject_fatal_streaming_error", 1);
    auto got = take(*source, 1, 20s, {}, true);
    ASSERT_EQ(got.frames.size(), 1U);
    queue.push(std::move(got.frames[0]));
  }
  source.reset();  // the reader still holds some
  queue.close();
  reader.join();
  EXPECT_GT(read, 40);
  EXPECT_NE(sum, 0U);
}

TEST_F(Vivid, ControlsByNameRangeAndKind) {
  const std::vector<capture::ControlSetting> settings{{"brightness", 100},
                                                      {"brightnes", 1},
                                                      {"contrast", 1000000},
                                                      {"menu", std::string("menu item 4")},
                                                      {"boolean", std::string("off")},
                                                      {"gain", 77}};
  const auto results = knobs->set_controls(settings);
  ASSERT_GE(results.size(), settings.size());
  EXPECT_EQ(results[0].got, 100);
  EXPECT_EQ(results[0].problem, "");
  EXPECT_THAT(results[1].problem, HasSubstr("did you mean brightness?"));
  EXPECT_THAT(results[2].problem, HasSubstr("out of range: it takes 0 to 255"));
  EXPECT_EQ(results[4].problem, "");
  EXPECT_EQ(results[4].got, 0);
  EXPECT_EQ(results[5].got, 77) << capture::to_string(results[5]);
  for (const auto& result : results) std::printf("%s\n", capture::to_string(result).c_str());
  knobs->set_controls_plainly(knobs->previous_controls());
  EXPECT_EQ(value_of(*knobs, "brightness"), 128);
}

// ---- UVC

class Uvc : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_OUTSIDE_VM();
    std::ofstream(folder / "film.yuyv", std::ios::binary) << film();
  }
  void TearDown() override {
    camera.reset();
    comes_true([] { return node_of("uvcvideo").empty(); });
  }
  // Plugged in and playing when it returns.
  void plug_in(const std::string& program = "uvccam", const std::string& jpegs = "") {
    std::string films = (folder / "film.yuyv").string();
    if (!jpegs.empty()) films += "," + jpegs;
    for (int attempt = 0; attempt < 20; ++attempt) {
      camera = std::make_unique<Program>(
          std::vector<std::string>{tool(program), "-w", "320", "-h", "240", "-r", "15", "-l", log().string(), films});
      if (comes_true([] { return !node_of("uvcvideo").empty(); }, 3s)) return;
      camera.reset();  // the port was not free yet
    }
    FAIL() << "the emulated camera cannot be plugged in";
  }
  void unplug() { camera.reset(); }
  fs::path log() const { return folder / "controls.log"; }

  TemporaryFolder folder;
  std::unique_ptr<Program> camera;
};

TEST_F(Uvc, FramesAreBitExactAndTheCameraIsIdentified) {
  plug_in();
  capture::V4l2Source source(options_for(node_of("uvcvideo"), width, height, 15));
  const auto got = take(source, 30, 20s, {}, true);
  ASSERT_EQ(got.frames.size(), 30U);
  for (const auto& frame : got.frames) EXPECT_GE(film_index(frame.pixels), 0);
  const auto health = source.health();
  EXPECT_EQ(health.copied, 25U) << "five of eight buffers can be held, and this test holds every frame";
  EXPECT_EQ(health.stamp, capture::StampKind::start_of_exposure);
  ASSERT_TRUE(health.identity && health.identity->usb);
  EXPECT_EQ(health.identity->usb->serial, "EMU0000");
  EXPECT_EQ(health.identity->usb->id, "1d6b:0102");
  EXPECT_GT(health.identity->usb->speed_mbps, 0);
  std::printf("uvc: %s, usb port %s\n", health.identity->to_string().c_str(), health.identity->usb->port.c_str());
  // the metadata node is distinguished
  bool has_metadata_node = false;
  for (const auto& node : capture::list_v4l2_nodes()) {
    if (node.identity.driver != "uvcvideo" || node.is_capture) continue;
    has_metadata_node = true;
    EXPECT_THROW(capture::V4l2Device(node.identity.node), capture::CaptureError);
  }
  EXPECT_TRUE(has_metadata_node);
}

TEST_F(Uvc, StableNamesAreFoundAndFollowed) {
  plug_in();
  const fs::path link = "/dev/v4l/by-path/platform-vhci_hcd.0-usb-0:1:1.0-video-index0";  // the VM has no udev
  fs::create_directories(link.parent_path());
  fs::remove(link);
  fs::create_symlink(node_of("uvcvideo"), link);
  {
    capture::V4l2Source source(options_for(link, width, height, 15));
    EXPECT_THAT(source.take_events(), Each(Field(&capture::CameraEvent::message, Not(HasSubstr("not stable")))));
    EXPECT_EQ(take(source, 3).frames.size(), 3U);
    EXPECT_THAT(source.health().identity->by_path, testing::ElementsAre(link));
    EXPECT_EQ(source.health().identity->node, node_of("uvcvideo"));
  }
  fs::remove(link);
}

TEST_F(Uvc, ManualValuesSwitchOffTheirAutomaticsFirst) {
  plug_in();
  capture::V4l2Device device(node_of("uvcvideo"));
  const std::vector<capture::ControlSetting> settings{
      {"exposure_absolute", 200}, {"white_balance_temperature", 5000}, {"gain", 30}};
  const auto results = device.set_controls(settings);
  for (const auto& result : results) std::printf("%s\n", capture::to_string(result).c_str());
  ASSERT_EQ(results.size(), 5U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(results[i].problem, "");
    EXPECT_EQ(results[i].got, std::get<std::int64_t>(settings[i].value));
  }
  EXPECT_TRUE(results[3].is_implied && results[4].is_implied);
  EXPECT_EQ(results[3].name, "auto_exposure");
  EXPECT_EQ(results[3].got, 1);
  EXPECT_EQ(read_bytes(log()),
            "cam 0 auto_exposure 1\ncam 0 white_balance_automatic 0\ncam 0 exposure_time_absolute 200\n"
            "cam 0 white_balance_temperature 5000\ncam 0 gain 30\n");
  device.set_controls_plainly(device.previous_controls());
  EXPECT_EQ(value_of(device, "auto_exposure"), 3);
  EXPECT_EQ(value_of(device, "exposure_time_absolute"), 157);
  EXPECT_EQ(value_of(device, "gain"), 0);
}

TEST_F(Uvc, RefusalIsReported) {
  plug_in();
  capture::V4l2Device device(node_of("uvcvideo"));
  const std::vector<capture::ControlSetting> settings{{"exposure_time_absolute", 200},
                                                      {"auto_exposure", std::string("Aperture Priority Mode")}};
  const auto results = device.set_controls(settings);
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[1].problem, "");
  EXPECT_THAT(results[0].problem,
              AllOf(HasSubstr("refuses it"),
                    HasSubstr("auto_exposure is 3 (Aperture Priority Mode), set it to 1 (Manual Mode)")));
  EXPECT_EQ(results[0].got, 157);
  std::printf("%s\n", capture::to_string(results[0]).c_str());
}

TEST_F(Uvc, UnplugAnotherAndReplug) {
  plug_in();
  const fs::path node = node_of("uvcvideo");
  auto wanted = options_for(node, width, height, 15);
  wanted.controls = {{"exposure_time_absolute", 300}};
  wanted.restore_controls = true;
  auto source = std::make_unique<capture::V4l2Source>(wanted);
  auto before = take(*source, 5, 20s, {}, true);
  ASSERT_EQ(before.frames.size(), 5U);
  unplug();
  auto gone = take(*source, 1000, 3s);
  EXPECT_EQ(source->health().state, capture::CaptureState::absent);
  EXPECT_THAT(gone.messages(), Contains(HasSubstr("absent: unplugged: No such device")));
  EXPECT_EQ(gone.events.size(), 1U) << testing::PrintToString(gone.messages());
  for (const auto& frame : before.frames) EXPECT_GE(film_index(frame.pixels), 0) << "held over the unplug";

  plug_in("uvccam_other");
  auto other = take(*source, 1000, 4s);
  EXPECT_THAT(other.frames, IsEmpty());
  EXPECT_EQ(source->health().state, capture::CaptureState::absent);
  EXPECT_THAT(other.messages(), Contains(AllOf(HasSubstr("another camera is in its place"), HasSubstr("XMU0000"))));
  EXPECT_LE(other.events.size(), 2U) << testing::PrintToString(other.messages());
  unplug();
  comes_true([] { return node_of("uvcvideo").empty(); });

  write_text(log(), "");
  plug_in();
  const auto back = take(*source, 10, 30s, {}, true);
  ASSERT_EQ(back.frames.size(), 10U) << source->health().message;
  for (const auto& frame : back.frames) EXPECT_GE(film_index(frame.pixels), 0);
  EXPECT_THAT(back.messages(), Contains(HasSubstr("delivering: is back after")));
  EXPECT_EQ(source->health().reconnects, 1U);
  EXPECT_EQ(back.frames.front().sequence,
            before.frames.back().sequence + 1 + static_cast<unsigned>(gone.frames.size()));
  EXPECT_THAT(read_bytes(log()), HasSubstr("exposure_time_absolute 300"));
  for (const auto& message : back.messages()) std::printf("%s\n", message.c_str());
  source.reset();
  capture::V4l2Device device(node_of("uvcvideo"));
  EXPECT_EQ(value_of(device, "auto_exposure"), 3) << "as it was found";
}

TEST_F(Uvc, JpegsAreDecodedAndTheirBytesKept) {
  capture::write_clip(folder / "film.mjpg", {.codec = "mjpeg",
                                             .format = AV_PIX_FMT_YUVJ422P,
                                             .range = AVCOL_RANGE_JPEG,
                                             .width = width,
                                             .height = height,
                                             .frames = 8});
  std::string jpegs = read_bytes(folder / "film.mjpg");
  std::vector<std::string> pictures;
  for (std::size_t begin = 0; begin < jpegs.size();) {
    const auto end = std::min(jpegs.find("\xFF\xD8\xFF", begin + 3), jpegs.size());
    pictures.push_back(jpegs.substr(begin, end - begin));
    begin = end;
  }
  ASSERT_EQ(pictures.size(), 8U);
  // the third is cut off in the middle
  pictures[2] = pictures[2].substr(0, pictures[2].size() / 2) + "\xFF\xD9";
  jpegs.clear();
  for (const auto& picture : pictures) jpegs += picture;
  write_text(folder / "damaged.mjpg", jpegs);

  plug_in("uvccam", (folder / "damaged.mjpg").string());
  auto wanted = options_for(node_of("uvcvideo"), width, height, 15);
  wanted.format = capture::CaptureFormat::mjpeg;
  capture::V4l2Source source(wanted);
  auto got = take(source, 24, 20s, {}, true);
  ASSERT_EQ(got.frames.size(), 24U);
  EXPECT_GE(got.count(capture::FrameStatus::corrupted), 1);
  EXPECT_EQ(source.health().corrupted, static_cast<unsigned>(got.count(capture::FrameStatus::corrupted)));
  capture::JpegDecoder decoder;
  recordings::RecordingWriter writer(
      {.folder = folder / "out", .cameras = {"left"}, .rig_yaml = {}, .config_yaml = {}});
  for (auto& frame : got.frames) {
    ASSERT_TRUE(writer.write(frame));
    if (frame.status != capture::FrameStatus::ok) continue;
    const std::string bytes(frame.encoded->begin(), frame.encoded->end());
    EXPECT_NE(std::ranges::find(pictures, bytes), pictures.end()) << "not the camera's own bytes";
    EXPECT_NE(bytes, pictures[2]);
  }
  writer.finish();
  const std::vector<std::string> cameras{"left"};
  recordings::ReplaySource replay(recordings::read_recording(folder / "out"), cameras);
  for (const auto& frame : got.frames) {
    const auto again = replay.next({});
    ASSERT_TRUE(again);
    EXPECT_EQ(again->status, frame.status);
    EXPECT_EQ(again->captured_at, frame.captured_at);
    EXPECT_EQ(again->sequence, frame.sequence);
    if (frame.status == capture::FrameStatus::ok) {
      EXPECT_EQ(hash_of(again->pixels), hash_of(frame.pixels));
    }
  }
}

TEST_F(Uvc, AbsentAtStartIsUsedWhenPluggedIn) {
  plug_in();
  const fs::path node = node_of("uvcvideo");
  unplug();
  ASSERT_TRUE(comes_true([&] { return !fs::exists(node); }));
  capture::V4l2Source source(options_for(node, width, height, 15));
  EXPECT_EQ(source.health().state, capture::CaptureState::absent);
  EXPECT_THAT(source.health().message, HasSubstr("it is not plugged in"));
  EXPECT_THAT(take(source, 1, 1s).frames, IsEmpty());
  plug_in();
  EXPECT_EQ(take(source, 5, 30s).frames.size(), 5U) << source.health().message;
}

}  // namespace
}  // namespace huetrack::v4l2
