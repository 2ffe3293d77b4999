// The captures that lie beside the project, read as they are.
#include <gmock/gmock.h>

#include "capture/temporary_folder.h"
#include "capture/timing/frame_synchronizer.h"
#include "recordings/names_in.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

using testing::IsEmpty;

const std::filesystem::path data = HUETRACK_SHARED_DATA;

struct Expected {
  const char* recording;
  int cameras;
  int frames;  // of each camera
  int width, height;
  capture::PixelFormat format;
  capture::ColorRange range;
  double last_s;
};
void PrintTo(const Expected& e, std::ostream* out) {
  *out << e.recording;
}

class SharedRecording : public testing::TestWithParam<Expected> {};

TEST_P(SharedRecording, IsPlayedWhole) {
  const Expected& e = GetParam();
  if (!std::filesystem::exists(data / e.recording / "recording.yaml")) GTEST_SKIP() << "no " << data / e.recording;
  const Recording recording = read_recording(data / e.recording);
  ASSERT_EQ(recording.cameras.size(), static_cast<std::size_t>(e.cameras));
  const auto names = names_in(recording);
  ReplaySource source(recording, names);
  EXPECT_EQ(source.expected_frames(), e.cameras * e.frames);

  std::vector<capture::Duration> periods;
  for (const auto& camera : source.cameras()) periods.push_back(camera.frame_period);
  capture::FrameSynchronizer synchronizer(
      {.camera_count = e.cameras, .tolerance = capture::suggested_tolerance(periods)});
  capture::Timestamp last;
  while (auto frame = source.next({})) {
    ASSERT_EQ(frame->status, capture::FrameStatus::ok);
    ASSERT_EQ(frame->pixels.format, e.format);
    ASSERT_EQ(frame->pixels.range, e.range);
    ASSERT_EQ(frame->pixels.width, e.width);
    ASSERT_EQ(frame->pixels.height, e.height);
    last = frame->captured_at;
    synchronizer.push(std::move(*frame));
  }
  EXPECT_NEAR(capture::seconds(last), e.last_s, 1e-6);
  EXPECT_THAT(source.take_warnings(), IsEmpty());
  for (const auto& camera : source.cameras()) {
    EXPECT_EQ(camera.frames, e.frames);
    EXPECT_EQ(camera.missing + camera.corrupted, 0);
    EXPECT_EQ(camera.first_at, capture::Timestamp{});
  }
  EXPECT_EQ(synchronizer.counters().sets, static_cast<std::uint64_t>(e.frames));
  EXPECT_EQ(synchronizer.counters().incomplete_sets, 0u);
}

INSTANTIATE_TEST_SUITE_P(Data, SharedRecording,
                         testing::Values(Expected{"rendered/two_cams", 2, 150, 320, 240, capture::PixelFormat::i422,
                                                  capture::ColorRange::limited, 149 / 30.0},
                                         Expected{"rendered/occlusion", 3, 180, 320, 240, capture::PixelFormat::i422,
                                                  capture::ColorRange::full, 179 / 30.0},
                                         Expected{"rendered/fast_60fps", 3, 90, 320, 240, capture::PixelFormat::i422,
                                                  capture::ColorRange::full, 89 / 60.0},
                                         Expected{"rendered/chessboard", 3, 25, 320, 240, capture::PixelFormat::i420,
                                                  capture::ColorRange::full, 24},
                                         Expected{"rendered/desk", 1, 240, 320, 240, capture::PixelFormat::i422,
                                                  capture::ColorRange::full, 239 / 30.0},
                                         Expected{"rendered/leds", 1, 140, 640, 480, capture::PixelFormat::i422,
                                                  capture::ColorRange::full, 139 / 90.0},
                                         Expected{"hand_held_7scenes", 1, 300, 640, 480, capture::PixelFormat::i420,
                                                  capture::ColorRange::full, 9.966667}),
                         [](const auto& test) {
                           std::string name = test.param.recording;
                           std::ranges::replace(name, '/', '_');
                           return name;
                         });

class WrittenRecording : public testing::Test {
 protected:
  Recording write(const std::string& cameras) const {
    capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n" + cameras);
    return read_recording(folder.path());
  }
  const capture::TemporaryFolder folder;
};

TEST_F(WrittenRecording, RedSquareStereoHasOneTimePerPair) {
  const std::string square = (data / "red_square_stereo").string();
  if (!std::filesystem::exists(square)) GTEST_SKIP() << "no " << square;
  std::string cameras;
  for (const std::string camera : {"cam1", "cam2"})
    cameras +=
        "  " + camera + ": {frames: " + square + "/" + camera + ".mkv, timestamps: " + square + "/timestamps.csv}\n";
  const Recording recording = write(cameras);
  const auto names = names_in(recording);
  ReplaySource source(recording, names);
  const std::vector<capture::Duration> periods{source.cameras()[0].frame_period, source.cameras()[1].frame_period};
  EXPECT_NEAR(capture::seconds(periods[0]), 0.064, 0.003);
  capture::FrameSynchronizer synchronizer({.camera_count = 2, .tolerance = capture::suggested_tolerance(periods)});
  int complete = 0;
  capture::Timestamp last;
  while (auto frame = source.next({})) {
    EXPECT_EQ(frame->pixels.format, capture::PixelFormat::i422);
    EXPECT_EQ(frame->pixels.range, capture::ColorRange::limited);
    last = frame->stamped_at;
    EXPECT_LT(std::chrono::abs(frame->captured_at - last), std::chrono::milliseconds(10)) << "smoothed, not invented";
    for (const auto& set : synchronizer.push(std::move(*frame))) complete += set.frames[0] && set.frames[1] ? 1 : 0;
  }
  EXPECT_EQ(complete, 114);
  EXPECT_EQ(last, capture::Timestamp{std::chrono::microseconds(7518156)});
  EXPECT_THAT(source.take_warnings(), IsEmpty());
}

TEST_F(WrittenRecording, SixtyFpsPlaysAsFreeRunningThirtyFpsCameras) {
  const std::string fast = (data / "rendered/fast_60fps").string();
  if (!std::filesystem::exists(fast)) GTEST_SKIP() << "no " << fast;
  std::string cameras;
  for (const int camera : {0, 1, 2})
    cameras += "  cam" + std::to_string(camera) + ": {frames: " + fast + "/cam" + std::to_string(camera) +
               ".mkv, fps: 60, every: 2, first_frame: " + std::to_string(camera % 2) + "}\n";
  const Recording recording = write(cameras);
  const auto names = names_in(recording);
  ReplaySource source(recording, names);
  std::vector<capture::Duration> periods;
  for (const auto& camera : source.cameras()) periods.push_back(camera.frame_period);
  capture::FrameSynchronizer synchronizer({.camera_count = 3, .tolerance = capture::suggested_tolerance(periods)});
  int complete = 0;
  while (auto frame = source.next({}))
    for (const auto& set : synchronizer.push(std::move(*frame)))
      complete += set.frames[0] && set.frames[1] && set.frames[2] ? 1 : 0;
  EXPECT_EQ(complete, 45);
}

TEST_F(WrittenRecording, OtherToolsVideosPlayByTheirOwnTimes) {
  const std::string videos = (data / "caliscope_charuco_4cam/post_optimization/calibration/extrinsic").string();
  if (!std::filesystem::exists(videos)) GTEST_SKIP() << "no " << videos;
  std::string cameras;
  for (int i = 0; i < 4; ++i)
    cameras += "  cam_" + std::to_string(i) + ": {frames: " + videos + "/cam_" + std::to_string(i) + ".mp4}\n";
  const Recording recording = write(cameras);
  const auto names = names_in(recording);
  ReplaySource source(recording, names);
  std::vector<int> counts(4);
  capture::Timestamp last;
  while (const auto frame = source.next({})) {
    EXPECT_EQ(frame->pixels.format, capture::PixelFormat::i420);
    ++counts[static_cast<std::size_t>(frame->camera)];
    last = frame->captured_at;
  }
  EXPECT_THAT(counts, testing::Each(57));
  EXPECT_NEAR(capture::seconds(last), 56 / 6.0, 1e-3);
  EXPECT_THAT(source.take_warnings(), IsEmpty());
}

TEST(SharedData, LosslessFramesHaveTheirBytes) {
  if (!std::filesystem::exists(data / "rendered/two_cams")) GTEST_SKIP() << "no " << data / "rendered/two_cams";
  const Recording recording = read_recording(data / "rendered/two_cams");
  const auto names = names_in(recording);
  for (const int threads : {1, 2}) {
    ReplaySource source(recording, names, {.decoder_threads = threads});
    std::uint64_t hash = 0xcbf29ce484222325;  // FNV-1a over the visible bytes of the first ten frames
    for (int i = 0; i < 10; ++i) {
      const auto frame = source.next({});
      ASSERT_TRUE(frame);
      capture::require_all(frame->pixels);
      for (int plane = 0; plane < 3; ++plane)
        for (int y = 0; y < capture::plane_rows(frame->pixels.format, plane, 240); ++y)
          for (std::size_t x = 0; x < capture::plane_row_bytes(frame->pixels.format, plane, 320); ++x) {
            const capture::Plane& p = frame->pixels.planes[static_cast<std::size_t>(plane)];
            hash = (hash ^ p.data[y * p.stride + static_cast<std::ptrdiff_t>(x)]) * 0x100000001b3;
          }
    }
    EXPECT_EQ(hash, 0xdd098aca8e693310u);  // as the ffmpeg program decodes them
  }
}

}  // namespace
}  // namespace huetrack::recordings
