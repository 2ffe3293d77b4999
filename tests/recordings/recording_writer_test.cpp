#include "recordings/recording_writer.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <thread>

#include "calib/files/config_error.h"
#include "capture/clips.h"
#include "capture/frames/jpeg_decoder.h"
#include "recordings/growing_recording.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr auto start = capture::Timestamp(1'795'232'262'123'456'789ns);  // a UNIX time with nanoseconds

// Noise, so that no byte is right by chance. Rows are padded, as drivers do, when `padding` is not 0.
capture::Frame raw_frame(int k, capture::PixelFormat format = capture::PixelFormat::yuyv, int width = 64,
                         int height = 48, capture::ColorRange range = capture::ColorRange::limited,
                         std::size_t padding = 0) {
  capture::Frame frame;
  frame.sequence = static_cast<std::uint32_t>(k);
  frame.captured_at = start + k * 33'333'333ns;
  frame.arrival = static_cast<std::uint64_t>(k) + 1;
  frame.clock = {.of = static_cast<std::uint16_t>(k % 3), .sigma = capture::Duration(k % 3 * 100'003)};
  capture::Image& image = frame.pixels;
  image.format = format;
  image.range = range;
  image.width = width;
  image.height = height;
  std::size_t bytes = 0;
  for (int i = 0; i < 3; ++i) {
    const std::size_t row = capture::plane_row_bytes(format, i, width);
    if (row > 0) bytes += (row + padding) * static_cast<std::size_t>(capture::plane_rows(format, i, height));
  }
  const auto memory = std::make_shared<std::vector<std::uint8_t>>(bytes);
  std::mt19937 random(static_cast<unsigned>(k));
  for (auto& byte : *memory) byte = static_cast<std::uint8_t>(random());
  const std::uint8_t* next = memory->data();
  for (int i = 0; i < 3; ++i) {
    const std::size_t row = capture::plane_row_bytes(format, i, width);
    if (row == 0) continue;
    image.planes[static_cast<std::size_t>(i)] = {next, static_cast<std::ptrdiff_t>(row + padding)};
    next += (row + padding) * static_cast<std::size_t>(capture::plane_rows(format, i, height));
  }
  image.owner = memory;
  return frame;
}

// As V4l2Source makes them.
std::vector<capture::Frame> jpeg_frames(int count, AVPixelFormat format = AV_PIX_FMT_YUVJ422P) {
  std::vector<capture::Frame> frames;
  const capture::TemporaryFolder folder;
  capture::write_clip(folder / "film.mkv", {.codec = "mjpeg",
                                            .format = format,
                                            .range = AVCOL_RANGE_JPEG,
                                            .frames = count,
                                            .tamper = [&](int, AVPacket& packet) {
                                              capture::Frame frame = raw_frame(static_cast<int>(frames.size()));
                                              frame.encoded = std::make_shared<const std::vector<std::uint8_t>>(
                                                  packet.data, packet.data + packet.size);
                                              frame.pixels = *capture::JpegDecoder().decode(*frame.encoded).image;
                                              frames.push_back(frame);
                                              return true;
                                            }});
  return frames;
}

RecordingOptions options_for(const fs::path& folder, std::vector<std::string> cameras = {"left"}) {
  RecordingOptions options;
  options.folder = folder;
  options.cameras = std::move(cameras);
  return options;
}

struct Replayed {
  std::vector<capture::Frame> frames;
  std::vector<std::string> warnings;
};
Replayed replay(const fs::path& folder, const std::vector<std::string>& cameras = {"left"}) {
  ReplaySource source(read_recording(folder), cameras);
  Replayed result;
  while (auto frame = source.next({})) result.frames.push_back(std::move(*frame));
  result.warnings = source.take_warnings();
  return result;
}

void expect_same(const capture::Frame& got, const capture::Frame& written) {
  EXPECT_EQ(got.camera, written.camera);
  EXPECT_EQ(got.sequence, written.sequence);
  EXPECT_EQ(got.captured_at, written.captured_at);
  EXPECT_EQ(got.arrival, written.arrival);
  EXPECT_EQ(got.clock, written.clock);
  ASSERT_EQ(got.status, written.status);
  if (written.status != capture::FrameStatus::ok) return;
  EXPECT_EQ(got.pixels.range, written.pixels.range);
  EXPECT_EQ(capture::hash_of(got.pixels), capture::hash_of(written.pixels));
}

// ---- Seen while it is made

RecordedCamera left_in(const fs::path& recording) {
  RecordedCamera camera;
  camera.name = "left";
  camera.frames = recording / "left.mkv";
  return camera;
}

TEST(GrowingRecording, IsReadWhileItIsWritten) {
  const capture::TemporaryFolder folder;
  RecordingOptions options = options_for(folder / "run");
  options.flush_every = 10ms;
  RecordingWriter writer(options);
  // Begun before there is a frame, and even the file.
  GrowingCamera camera(left_in(folder / "run"), 3);
  std::jthread writing([&](const std::stop_token& stop) {
    for (int k = 0; k < 400 && !stop.stop_requested(); ++k, std::this_thread::sleep_for(5ms))
      writer.write(raw_frame(k));
  });
  std::stop_source stop;
  for (std::uint32_t k = 0; k < 60; ++k) {
    const auto frame = camera.next(stop.get_token());
    ASSERT_TRUE(frame) << k;
    EXPECT_EQ(frame->camera, 3);
    EXPECT_EQ(frame->sequence, k);
    EXPECT_NEAR(capture::seconds(frame->captured_at), k / 30.0, 0.0011);  // Matroska counts milliseconds
    EXPECT_EQ(capture::hash_of(frame->pixels), capture::hash_of(raw_frame(static_cast<int>(k)).pixels));
  }
  // At its end more is waited for, until the stop.
  writing = {};
  writer.finish();
  std::jthread stopping([&] {
    std::this_thread::sleep_for(300ms);
    stop.request_stop();
  });
  const auto began = std::chrono::steady_clock::now();
  while (camera.next(stop.get_token())) {
  }
  EXPECT_GT(std::chrono::steady_clock::now() - began, 200ms);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 2s);
}

TEST(GrowingRecording, ThatNeverBeginsIsAwaitedUntilTheStop) {
  const capture::TemporaryFolder folder;
  const RecordingWriter writer(options_for(folder / "run"));
  GrowingCamera camera(left_in(folder / "run"), 0);
  std::stop_source stop;
  std::jthread stopping([&] {
    std::this_thread::sleep_for(100ms);
    stop.request_stop();
  });
  EXPECT_FALSE(camera.next(stop.get_token()));
}

// ---- The same frames

struct Stored {
  capture::PixelFormat format;
  capture::ColorRange range;
  std::size_t padding;
};
class EveryFormat : public testing::TestWithParam<Stored> {};

TEST_P(EveryFormat, ReplaysByteForByteAtTheSameTimes) {
  const capture::TemporaryFolder folder;
  const auto [format, range, padding] = GetParam();
  std::vector<capture::Frame> written;
  RecordingWriter writer(options_for(folder / "run"));
  for (int k = 0; k < 8; ++k) {
    written.push_back(raw_frame(k, format, 64, 48, range, padding));
    ASSERT_TRUE(writer.write(written.back())) << *writer.failure();
  }
  writer.finish();
  const auto [frames, warnings] = replay(folder / "run");
  EXPECT_THAT(warnings, IsEmpty());
  ASSERT_EQ(frames.size(), written.size());
  for (std::size_t i = 0; i < frames.size(); ++i) expect_same(frames[i], written[i]);
}

std::vector<Stored> all_formats() {
  std::vector<Stored> all;
  for (const auto format : {capture::PixelFormat::yuyv, capture::PixelFormat::nv12, capture::PixelFormat::i420,
                            capture::PixelFormat::i422, capture::PixelFormat::i444, capture::PixelFormat::grey})
    for (const auto range : {capture::ColorRange::limited, capture::ColorRange::full})
      for (const std::size_t padding : {std::size_t{0}, std::size_t{32}}) all.push_back({format, range, padding});
  return all;
}
INSTANTIATE_TEST_SUITE_P(RecordingWriter, EveryFormat, testing::ValuesIn(all_formats()), [](const auto& tested) {
  return std::string(name(tested.param.format)) +
         (tested.param.range == capture::ColorRange::full ? "_full" : "_limited") +
         (tested.param.padding > 0 ? "_padded" : "");
});

TEST(RecordingWriter, HuffyuvKeepsEveryPixel) {
  for (const auto format : {capture::PixelFormat::yuyv, capture::PixelFormat::nv12, capture::PixelFormat::grey,
                            capture::PixelFormat::i444}) {
    const capture::TemporaryFolder folder;
    auto options = options_for(folder / "run");
    options.raw_storage = RawStorage::huffyuv;
    RecordingWriter writer(options);
    std::vector<capture::Frame> written;
    for (int k = 0; k < 5; ++k) {
      written.push_back(raw_frame(k, format, 64, 48, capture::ColorRange::full, 16));
      ASSERT_TRUE(writer.write(written.back())) << *writer.failure();
    }
    writer.finish();
    const auto frames = replay(folder / "run").frames;
    ASSERT_EQ(frames.size(), written.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_EQ(frames[i].captured_at, written[i].captured_at);
      EXPECT_EQ(frames[i].pixels.range, capture::ColorRange::full);
      for (int v = 0; v < 48; ++v)
        for (int u = 0; u < 64; ++u) {
          const capture::Yuv got = capture::yuv_at(frames[i].pixels, u, v);
          const capture::Yuv was = capture::yuv_at(written[i].pixels, u, v);
          ASSERT_TRUE(got.y == was.y && got.u == was.u && got.v == was.v) << name(format) << " " << u << "," << v;
        }
    }
  }
}

TEST(RecordingWriter, JpegsKeepTheirBytesAndTheirPixels) {
  for (const auto format : {AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUVJ422P, AV_PIX_FMT_YUVJ444P}) {
    const capture::TemporaryFolder folder;
    const auto written = jpeg_frames(6, format);
    RecordingWriter writer(options_for(folder / "run"));
    for (const auto& frame : written) ASSERT_TRUE(writer.write(frame)) << *writer.failure();
    writer.finish();
    const auto frames = replay(folder / "run").frames;
    ASSERT_EQ(frames.size(), written.size());
    const std::string file = capture::read_bytes(folder / "run/left.mkv");
    for (std::size_t i = 0; i < frames.size(); ++i) {
      expect_same(frames[i], written[i]);
      EXPECT_NE(file.find(std::string(written[i].encoded->begin(), written[i].encoded->end())), std::string::npos);
    }
  }
}

TEST(RecordingWriter, ReplaysDropsCorruptedFramesAndArrivalOrder) {
  const capture::TemporaryFolder folder;
  RecordingWriter writer(options_for(folder / "run", {"left", "right eye"}));
  std::vector<capture::Frame> written;
  std::uint64_t arrival = 0;
  for (int k = 0; k < 10; ++k)
    for (const int camera : {1, 0}) {       // the right one is captured later, and comes first
      if (k == 4 && camera == 0) continue;  // dropped
      capture::Frame frame = raw_frame(k);
      frame.camera = camera;
      if (camera == 1) frame.captured_at += 5ms;
      frame.arrival = ++arrival;
      if ((k == 0 || k == 6 || k == 9) && camera == 0) {
        frame.status = capture::FrameStatus::corrupted;
        frame.pixels = capture::Image{};
      }
      ASSERT_TRUE(writer.write(frame));
      written.push_back(frame);
    }
  EXPECT_THAT(writer.figures(), ElementsAre(testing::Field(&RecordedCameraFigures::frames, 9U),
                                            testing::Field(&RecordedCameraFigures::frames, 10U)));
  writer.finish();
  const std::vector<std::string> cameras{"left", "right eye"};
  ReplaySource source(read_recording(folder / "run"), cameras);
  for (const auto& frame : written) {
    const auto got = source.next({});
    ASSERT_TRUE(got);
    expect_same(*got, frame);
  }
  EXPECT_FALSE(source.next({}));
  EXPECT_EQ(source.cameras()[0].missing, 1);
  EXPECT_EQ(source.cameras()[0].corrupted, 3);
  EXPECT_EQ(source.cameras()[1].missing, 0);
}

TEST(RecordingWriter, CameraWithoutFramesIsAccepted) {
  const capture::TemporaryFolder folder;
  {
    RecordingWriter writer(options_for(folder / "run", {"left", "right"}));
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(writer.write(raw_frame(k)));
  }
  const auto [frames, warnings] = replay(folder / "run", {"left", "right"});
  EXPECT_THAT(frames, SizeIs(3));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("right.csv"), HasSubstr("camera right delivered none"))));
}

TEST(RecordingWriter, RecordingWithoutFramesIsAnError) {
  const capture::TemporaryFolder folder;
  { const RecordingWriter writer(options_for(folder / "run")); }
  EXPECT_THROW(read_recording(folder / "run"), files::ConfigError);
}

TEST(RecordingWriter, WritesRigAndConfiguration) {
  const capture::TemporaryFolder folder;
  auto options = options_for(folder / "run");
  options.rig_yaml = "the rig\n";
  options.config_yaml = "the configuration\n";
  const RecordingWriter writer(options);
  EXPECT_EQ(capture::read_bytes(folder / "run/rig.yaml"), "the rig\n");
  EXPECT_EQ(capture::read_bytes(folder / "run/huetrackd.yaml"), "the configuration\n");
}

TEST(RecordingWriter, OddCameraNamesRoundTrip) {
  const capture::TemporaryFolder folder;
  const std::vector<std::string> cameras{"../up", "a b", "a_b", "quote\"back\\slash", "1"};
  RecordingWriter writer(options_for(folder / "run", cameras));
  for (int camera = 0; camera < 5; ++camera) {
    capture::Frame frame = raw_frame(camera);
    frame.camera = camera;
    ASSERT_TRUE(writer.write(frame));
  }
  writer.finish();
  EXPECT_THAT(replay(folder / "run", cameras).frames, SizeIs(5));
  EXPECT_FALSE(fs::exists(folder / "up.mkv"));
}

TEST(RecordingWriter, CountsFramesThatCannotBeReplayed) {
  const capture::TemporaryFolder folder;
  RecordingWriter writer(options_for(folder / "run"));
  EXPECT_TRUE(writer.write(raw_frame(3)));
  EXPECT_TRUE(writer.write(raw_frame(3)));                              // the same time again
  EXPECT_TRUE(writer.write(raw_frame(2)));                              // time goes back
  EXPECT_TRUE(writer.write(raw_frame(4, capture::PixelFormat::nv12)));  // the camera came back with another format
  EXPECT_TRUE(writer.write(raw_frame(5, capture::PixelFormat::yuyv, 32, 24)));  // or size
  EXPECT_TRUE(writer.write(raw_frame(6)));
  writer.finish();
  EXPECT_EQ(writer.figures()[0].frames, 2U);
  EXPECT_EQ(writer.figures()[0].left_out, 4U);
  EXPECT_THAT(replay(folder / "run").frames, SizeIs(2));
}

TEST(RecordingWriter, RefusesANonEmptyFolder) {
  const capture::TemporaryFolder folder;
  capture::write_text(folder / "run/precious", "data");
  EXPECT_THROW(RecordingWriter(options_for(folder / "run")), capture::CaptureError);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "run"), fs::directory_iterator()), 1);
  EXPECT_THROW(RecordingWriter(options_for("/proc/nowhere")), capture::CaptureError);
}

TEST(RecordingWriter, OneThreadPerCamera) {
  const capture::TemporaryFolder folder;
  RecordingWriter writer(options_for(folder / "run", {"a", "b", "c"}));
  {
    std::vector<std::jthread> threads;
    for (int camera = 0; camera < 3; ++camera)
      threads.emplace_back([&, camera] {
        for (int k = 0; k < 30; ++k) {
          capture::Frame frame = raw_frame(k);
          frame.camera = camera;
          frame.arrival = 0;
          EXPECT_TRUE(writer.write(frame));
          writer.figures();
        }
      });
  }
  writer.finish();
  EXPECT_THAT(replay(folder / "run", {"a", "b", "c"}).frames, SizeIs(90));
}

// ---- What goes wrong

// Writes in real time until it is killed.
void write_until_killed(const fs::path& folder, bool is_jpeg) {
  const auto jpegs = is_jpeg ? jpeg_frames(12) : std::vector<capture::Frame>{};
  RecordingWriter writer(options_for(folder));
  for (int k = 0; k < 100000; ++k) {
    capture::Frame frame = raw_frame(k, capture::PixelFormat::yuyv, 320, 240);
    if (is_jpeg) {
      frame.encoded = jpegs[static_cast<std::size_t>(k) % 12].encoded;
      frame.pixels = jpegs[static_cast<std::size_t>(k) % 12].pixels;
    }
    frame.captured_at = capture::Timestamp(std::chrono::system_clock::now().time_since_epoch());
    if (!writer.write(frame)) ::_exit(1);
    std::this_thread::sleep_for(10ms);
  }
}

TEST(RecordingWriter, ReplaysUpToTheLastSecondAfterAKill) {
  for (int round = 0; round < 6; ++round) {
    const capture::TemporaryFolder folder;
    const bool is_jpeg = round % 2 == 1;
    const pid_t child = ::fork();
    if (child == 0) {
      write_until_killed(folder / "run", is_jpeg);
      ::_exit(0);
    }
    std::this_thread::sleep_for(600ms + round * 137ms);
    const auto killed_at = std::chrono::system_clock::now();
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status));

    const auto [frames, warnings] = replay(folder / "run");
    ASSERT_GT(frames.size(), 10U);
    EXPECT_LT(capture::seconds(capture::Timestamp(killed_at.time_since_epoch()) - frames.back().captured_at), 0.6);
    for (std::size_t k = 0; k < frames.size(); ++k) {
      ASSERT_EQ(frames[k].sequence, k);
      ASSERT_EQ(frames[k].status, capture::FrameStatus::ok);
      if (!is_jpeg) {
        ASSERT_EQ(capture::hash_of(frames[k].pixels),
                  capture::hash_of(raw_frame(static_cast<int>(k), capture::PixelFormat::yuyv, 320, 240).pixels));
      }
    }
  }
}

// The video ends anywhere: what is left of it must be right, and nothing may be invented.
TEST(RecordingWriter, TruncatedVideoReplaysItsBeginning) {
  const capture::TemporaryFolder folder;
  std::vector<capture::Frame> written;
  {
    RecordingWriter writer(options_for(folder / "run"));
    for (int k = 0; k < 6; ++k) {
      capture::Frame frame = raw_frame(k, capture::PixelFormat::yuyv, 16, 8);
      frame.captured_at += k * k * 7ms;  // irregular, as live
      ASSERT_TRUE(writer.write(frame));
      written.push_back(frame);
    }
  }
  const std::string whole = capture::read_bytes(folder / "run/left.mkv");
  std::size_t most = 0;
  for (std::size_t length = 0; length <= whole.size(); length += 13) {
    capture::write_text(folder / "run/left.mkv", whole.substr(0, length));
    std::vector<capture::Frame> frames;
    try {
      frames = replay(folder / "run").frames;
    } catch (const files::ConfigError&) {
      ASSERT_EQ(most, 0U) << "later ends gave frames, and this one none: " << length;
      continue;
    }
    ASSERT_GE(frames.size(), most);
    most = frames.size();
    for (std::size_t i = 0; i < frames.size(); ++i) expect_same(frames[i], written[i]);
  }
  EXPECT_GE(most, 5U);
}

TEST(RecordingWriter, TruncatedTimesReplayTheirBeginning) {
  const capture::TemporaryFolder folder;
  std::vector<capture::Frame> written;
  {
    RecordingWriter writer(options_for(folder / "run"));
    for (int k = 0; k < 4; ++k) ASSERT_TRUE(writer.write(written.emplace_back(raw_frame(k))));
  }
  const std::string whole = capture::read_bytes(folder / "run/left.csv");
  const std::size_t header = whole.find('\n') + 1;
  for (std::size_t length = header; length < whole.size(); ++length) {
    capture::write_text(folder / "run/left.csv", whole.substr(0, length));
    const auto rows =
        static_cast<std::size_t>(std::count(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length), '\n')) -
        1;
    if (rows == 0) {
      EXPECT_THROW(replay(folder / "run"), files::ConfigError);
      continue;
    }
    const auto [frames, warnings] = replay(folder / "run");
    ASSERT_EQ(frames.size(), rows) << length;
    for (std::size_t i = 0; i < frames.size(); ++i) expect_same(frames[i], written[i]);
    if (whole[length - 1] != '\n') {
      EXPECT_THAT(warnings, Contains(HasSubstr("the last row is cut off"))) << length;
    }
  }
}

// In a child: a limit on the size of files stays with a process.
TEST(RecordingWriter, FullDiskStopsItWithOneMessage) {
  const capture::TemporaryFolder folder;
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{400'000, 400'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    RecordingWriter writer(options_for(folder / "run"));
    int written = 0;
    while (written < 1000 && writer.write(raw_frame(written))) ++written;
    if (writer.write(raw_frame(written + 1))) ::_exit(2);  // it failed for good
    writer.finish();
    const auto failure = writer.failure();
    capture::write_text(folder / "failure", failure ? *failure : "none");
    ::_exit(written > 10 && written < 1000 ? 0 : 3);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  ASSERT_EQ(WEXITSTATUS(status), 0);
  EXPECT_THAT(capture::read_bytes(folder / "failure"),
              AllOf(HasSubstr("left.mkv: File too large: recording stopped after"), HasSubstr("replays")));
  const auto frames = replay(folder / "run").frames;
  EXPECT_GT(frames.size(), 10U);
  for (std::size_t i = 0; i < frames.size(); ++i) expect_same(frames[i], raw_frame(static_cast<int>(i)));
}

TEST(RecordingWriter, RealFullDisk) {
  const capture::TemporaryFolder folder;
  fs::create_directory(folder / "disk");
  if (::mount("none", (folder / "disk").c_str(), "tmpfs", 0, "size=1m") != 0)
    GTEST_SKIP() << "a small tmpfs needs root: " << std::strerror(errno);
  {
    auto options = options_for(folder / "disk/run", {"left", "right"});
    options.flush_every = 1ms;  // the frames come much faster than a camera's
    RecordingWriter writer(options);
    int k = 0;
    bool is_fine = true;
    while (is_fine && k < 1000) {
      for (const int camera : {0, 1}) {
        capture::Frame frame = raw_frame(k);
        frame.camera = camera;
        is_fine = writer.write(frame) && is_fine;
      }
      ++k;
    }
    EXPECT_LT(k, 1000);
    ASSERT_TRUE(writer.failure());
    EXPECT_THAT(*writer.failure(), HasSubstr("No space left on device: recording stopped after"));
  }
  EXPECT_GT(replay(folder / "disk/run", {"left", "right"}).frames.size(), 20U);
  ::umount((folder / "disk").c_str());
}

// ---- Pre-roll

TEST(PreRoll, KeepsTheLastSecondsInOrder) {
  PreRoll ring({.length = 1s});
  for (int k = 0; k < 100; ++k) ring.push(raw_frame(k));
  EXPECT_EQ(ring.size(), 31U);  // 30 periods of 33.3 ms, both ends
  const auto frames = ring.take();
  ASSERT_EQ(frames.size(), 31U);
  for (std::size_t i = 0; i < frames.size(); ++i) expect_same(frames[i], raw_frame(static_cast<int>(69 + i)));
  EXPECT_EQ(ring.size(), 0U);
  EXPECT_EQ(ring.bytes(), 0U);
  EXPECT_FALSE(ring.cut_to());
}

TEST(PreRoll, MemoryIsBounded) {
  const std::size_t most = 20 * 64 * 48 * 2;
  PreRoll ring({.length = 1h, .most_bytes = most});
  for (int k = 0; k < 1000; ++k) {
    ring.push(raw_frame(k));
    ASSERT_LE(ring.bytes(), most);
  }
  EXPECT_GT(ring.size(), 15U);
  const auto frames = static_cast<int>(ring.size());
  EXPECT_EQ(ring.cut_to(), raw_frame(frames).captured_at - raw_frame(1).captured_at);
  EXPECT_EQ(ring.take().back().sequence, 999U);
}

TEST(PreRoll, HoldsNoDriverBuffer) {
  PreRoll ring({.length = 1h});
  capture::Frame frame = raw_frame(1, capture::PixelFormat::nv12, 64, 48, capture::ColorRange::limited, 32);
  const std::weak_ptr<const void> buffer = frame.pixels.owner;
  const capture::Frame as_it_was = raw_frame(1, capture::PixelFormat::nv12);
  const auto hash = capture::hash_of(frame.pixels);
  ring.push(frame);
  frame = capture::Frame{};
  EXPECT_TRUE(buffer.expired());
  EXPECT_EQ(capture::hash_of(ring.take()[0].pixels), hash);
}

TEST(PreRoll, KeepsOnlyTheBytesOfJpegs) {
  PreRoll ring({.length = 1h});
  const auto frames = jpeg_frames(5);
  std::size_t bytes = 0;
  for (const auto& frame : frames) {
    ring.push(frame);
    bytes += frame.encoded->size();
  }
  EXPECT_LT(ring.bytes(), bytes + 5 * 1024);
  for (const auto& held : ring.take()) EXPECT_FALSE(held.pixels.owner);
}

TEST(PreRoll, IsWrittenBeforeLiveFrames) {
  for (const bool is_jpeg : {false, true}) {
    const capture::TemporaryFolder folder;
    std::vector<capture::Frame> all;
    if (is_jpeg)
      all = jpeg_frames(12);
    else
      for (int k = 0; k < 12; ++k) all.push_back(raw_frame(k));
    all[3].status = capture::FrameStatus::corrupted;
    all[3].pixels = capture::Image{};
    all[3].encoded.reset();
    PreRoll ring({.length = 200ms});
    for (int k = 0; k < 9; ++k) ring.push(all[static_cast<std::size_t>(k)]);
    RecordingWriter writer(options_for(folder / "run"));
    for (const auto& frame : ring.take()) ASSERT_TRUE(writer.write(frame)) << *writer.failure();
    for (std::size_t k = 9; k < 12; ++k) ASSERT_TRUE(writer.write(all[k]));
    writer.finish();
    const auto frames = replay(folder / "run").frames;
    ASSERT_EQ(frames.size(), 10U);  // from number 2 on
    for (std::size_t i = 0; i < frames.size(); ++i) expect_same(frames[i], all[2 + i]);
  }
}

TEST(RecordingOptions, Problems) {
  EXPECT_THAT(options_for("x").problems(), IsEmpty());
  RecordingOptions bad;
  bad.flush_every = 0ms;
  EXPECT_EQ(bad.problems().size(), 3U);
  EXPECT_THROW(RecordingWriter{bad}, std::invalid_argument);
  EXPECT_THROW(PreRoll({.length = 0s}), std::invalid_argument);
}

}  // namespace
}  // namespace huetrack::recordings
