#include "recordings/replay_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "calib/files/config_error.h"
#include "capture/clips.h"

namespace huetrack::recordings {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Replay : public testing::Test {
 protected:
  // cameras: the lines below `cameras:`
  ReplaySource open(const std::string& cameras, const std::vector<std::string>& names, ReplayOptions options = {}) {
    capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n" + cameras);
    return ReplaySource(read_recording(folder.path()), names, options);
  }
  ReplaySource open(const std::string& camera, ReplayOptions options = {}) {
    return open("  cam: {" + camera + "}\n", std::vector<std::string>{"cam"}, std::move(options));
  }
  std::string error_of(const std::string& cameras, const std::vector<std::string>& names) {
    try {
      open(cameras, names);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "(accepted)";
  }
  std::string error_of(const std::string& camera) { return error_of("  cam: {" + camera + "}\n", {"cam"}); }

  static std::vector<capture::Frame> read_all(ReplaySource& source) {
    std::vector<capture::Frame> frames;
    while (auto frame = source.next({})) frames.push_back(std::move(*frame));
    return frames;
  }
  static std::vector<capture::Duration> times(const std::vector<capture::Frame>& frames) {
    std::vector<capture::Duration> result;
    for (const auto& f : frames) result.push_back(f.captured_at.time_since_epoch());
    return result;
  }
  static std::vector<int> shown(const std::vector<capture::Frame>& frames) {
    std::vector<int> result;
    for (const auto& f : frames) result.push_back(capture::frame_shown_by(f.pixels));
    return result;
  }
  static std::vector<int> numbers(const std::vector<capture::Frame>& frames) {
    std::vector<int> result;
    for (const auto& f : frames) result.push_back(static_cast<int>(f.sequence));
    return result;
  }

  capture::TemporaryFolder folder;
};

// ---- Times and numbers

TEST_F(Replay, FrameRateGivesExactlyRoundedTimes) {
  capture::write_clip(folder / "a.avi", {.codec = "mjpeg", .format = AV_PIX_FMT_YUVJ422P, .frames = 8, .fps = 30});
  auto source = open("frames: a.avi, fps: 30, offset_s: 0.5");
  EXPECT_EQ(source.expected_frames(), 8);
  const auto frames = read_all(source);
  EXPECT_THAT(times(frames), ElementsAre(500000000ns, 533333333ns, 566666667ns, 600000000ns, 633333333ns, 666666667ns,
                                         700000000ns, 733333333ns));
  EXPECT_THAT(shown(frames), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(numbers(frames), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(source.take_warnings(), IsEmpty());
}

TEST_F(Replay, WarnsOfAFrameRateThatDiffersFromTheFiles) {
  capture::write_clip(folder / "a.avi", {.codec = "mjpeg", .format = AV_PIX_FMT_YUVJ422P, .frames = 8, .fps = 30});
  auto source = open("frames: a.avi, fps: 28");
  read_all(source);
  const auto named = ElementsAre(AllOf(HasSubstr("a.avi"), HasSubstr("fps says 28, but the file itself 30 frames"),
                                       HasSubstr("add trust_times: true"), HasSubstr("camera cam")));
  EXPECT_THAT(source.take_warnings(), named);
  EXPECT_THAT(source.mistakes(), named);
  std::vector<std::string> at_once;
  auto heard = open("frames: a.avi, fps: 28",
                    {.on_contradicted_times = [&](const std::string& text) { at_once.push_back(text); }});
  read_all(heard);
  EXPECT_THAT(at_once, named);
  EXPECT_THAT(heard.take_warnings(), IsEmpty());
  EXPECT_THAT(heard.mistakes(), named);
  auto confirmed = open("frames: a.avi, fps: 28, trust_times: true");
  EXPECT_EQ(read_all(confirmed).size(), 8u);
  EXPECT_THAT(confirmed.take_warnings(), IsEmpty());
  EXPECT_THAT(confirmed.mistakes(), IsEmpty());
  EXPECT_THAT(error_of("frames: a.avi, trust_times: true"), HasSubstr("is for fps or timestamps"));
}

// As spreadsheets and other tools number rows.
TEST_F(Replay, TablesThatCountFramesFrom1) {
  std::string whole = "frame,t_s\n", part = whole;
  for (int k = 0; k < 6; ++k) whole += std::to_string(k + 1) + "," + std::to_string(0.1 * k) + "\n";
  for (int k = 0; k < 4; ++k) part += std::to_string(k + 1) + "," + std::to_string(0.1 * k) + "\n";
  capture::write_text(folder / "whole.csv", whole);
  capture::write_text(folder / "part.csv", part);
  for (const auto& [frames, codec, format] : {std::tuple{"a.mkv", "ffv1", AV_PIX_FMT_YUV422P},
                                              {"a.mp4", "libx264", AV_PIX_FMT_YUV420P},
                                              {"a.avi", "mjpeg", AV_PIX_FMT_YUVJ422P},
                                              {"%d.png", "png", AV_PIX_FMT_RGB24}}) {
    capture::write_clip(folder / frames, {.codec = codec, .format = format, .frames = 6});
    const std::string file = "frames: '" + std::string(frames) + "'";
    auto source = open(file + ", timestamps: whole.csv");
    const auto played = read_all(source);
    EXPECT_THAT(shown(played), ElementsAre(0, 1, 2, 3, 4, 5)) << frames;
    EXPECT_EQ(played.back().captured_at.time_since_epoch(), 500ms) << frames;
    EXPECT_EQ(source.cameras()[0].missing, 0);
    EXPECT_THAT(source.take_warnings(), ElementsAre(HasSubstr("whole.csv counts its frames from 1"))) << frames;
    auto some = open(file + ", timestamps: part.csv");
    EXPECT_THAT(shown(read_all(some)), ElementsAre(1, 2, 3, 4)) << frames;
    EXPECT_THAT(some.take_warnings(), ElementsAre(HasSubstr("if it counts frames from 1, subtract 1"))) << frames;
  }
}

// A header that was counted, a first row that was cut off.
TEST_F(Replay, TablesWithARowTooFewOrTooManyAreNamed) {
  for (const auto& [frames, codec, format] :
       {std::tuple{"a.mkv", "ffv1", AV_PIX_FMT_YUV422P}, {"a.mp4", "libx264", AV_PIX_FMT_YUV420P}}) {
    capture::write_clip(folder / frames, {.codec = codec, .format = format, .frames = 6});
    for (const int rows : {4, 5, 6, 7, 8}) {
      std::string table = "frame,t_s\n";
      for (int k = 0; k < rows; ++k) table += std::to_string(k) + "," + std::to_string(0.1 * k) + "\n";
      capture::write_text(folder / "t.csv", table);
      auto source = open("frames: " + std::string(frames) + ", timestamps: t.csv");
      read_all(source);
      const std::string said = fmt::format("{}", fmt::join(source.take_warnings(), " "));
      EXPECT_EQ(said.find("lists all of its 6 frames but the last: if it is the first row") != said.npos, rows == 5);
      EXPECT_EQ(said.find("if a row too many is at their start") != said.npos, rows == 7);
      EXPECT_EQ(said.empty(), rows == 4 || rows == 6) << said;
      EXPECT_THAT(source.mistakes(), IsEmpty());
    }
  }
}

TEST_F(Replay, ListedTimesThatTheFileContradicts) {
  capture::write_clip(folder / "a.mkv", {.frames = 6});
  const auto table = [&](double step) {
    std::string text = "frame,t_s\n";
    for (int k = 0; k < 6; ++k) text += std::to_string(k) + "," + std::to_string(step * k) + "\n";
    capture::write_text(folder / "t.csv", text);
  };
  table(100);
  EXPECT_THAT(error_of("frames: a.mkv, timestamps: t.csv"),
              AllOf(HasSubstr("t.csv"), HasSubstr("look like milliseconds: name the column t_ms")));
  table(0.1 / 8);  // slow motion
  auto source = open("frames: a.mkv, timestamps: t.csv");
  EXPECT_EQ(read_all(source).size(), 6u);
  EXPECT_THAT(source.mistakes(), ElementsAre(AllOf(HasSubstr("0.0125 s a frame"), HasSubstr("file itself says 0.1 s"),
                                                   HasSubstr("trust_times: true"))));
  auto confirmed = open("frames: a.mkv, timestamps: t.csv, trust_times: true");
  EXPECT_EQ(read_all(confirmed).size(), 6u);
  EXPECT_THAT(confirmed.mistakes(), IsEmpty());
}

TEST_F(Replay, EverySecondFrameKeepsItsOwnTime) {
  for (const std::string codec : {"mjpeg", "mpeg4"}) {  // one that can skip frames, one that cannot
    capture::write_clip(
        folder / "a.mkv",
        {.codec = codec, .format = codec == "mjpeg" ? AV_PIX_FMT_YUVJ422P : AV_PIX_FMT_YUV420P, .key_frame_every = 5});
    auto source = open("frames: a.mkv, fps: 10, first_frame: 1, every: 3");
    EXPECT_EQ(source.expected_frames(), 4);
    const auto frames = read_all(source);
    EXPECT_THAT(times(frames), ElementsAre(100ms, 400ms, 700ms, 1000ms));
    EXPECT_THAT(shown(frames), ElementsAre(1, 4, 7, 10));
    EXPECT_THAT(numbers(frames), ElementsAre(0, 1, 2, 3));
    EXPECT_EQ(source.cameras()[0].missing, 0);
    EXPECT_EQ(source.cameras()[0].frame_period, 300ms);
  }
}

TEST_F(Replay, WarnsOfCamerasThatHardlyOverlap) {
  capture::write_clip(folder / "a.mkv", {.frames = 10});
  capture::write_clip(folder / "b.mkv", {.frames = 10});
  const auto warnings = [&](const std::string& offset_s) {
    capture::write_text(
        folder / "recording.yaml",
        "version: 1\ncameras:\n  a: {frames: a.mkv, fps: 10}\n  b: {frames: b.mkv, fps: 10, offset_s: " + offset_s +
            "}\n");
    const std::vector<std::string> names{"a", "b"};
    return ReplaySource(read_recording(folder.path()), names).take_warnings();
  };
  EXPECT_THAT(warnings("0.3"), IsEmpty());
  EXPECT_THAT(warnings("0.72"),
              ElementsAre(AllOf(HasSubstr("camera a has frames from 0.000 to 0.900 s"), HasSubstr("more than 20 %")),
                          HasSubstr("camera b")));
  EXPECT_THAT(warnings("7"), Contains(HasSubstr("no other camera has any then")));
}

TEST_F(Replay, OneFileForTwoCamerasIsAMistake) {
  capture::write_clip(folder / "a.mkv", {.frames = 4});
  capture::write_clip(folder / "b.mkv", {.frames = 4});
  const auto mistakes = [&](const std::string& of_b) {
    ReplaySource source = open("  a: {frames: a.mkv, fps: 10}\n  b: {frames: " + of_b + ", fps: 10}\n", {"a", "b"});
    return source.mistakes();
  };
  EXPECT_THAT(mistakes("a.mkv"), ElementsAre(HasSubstr("is given for both a and b")));
  EXPECT_THAT(mistakes("b.mkv"), IsEmpty());
}

TEST_F(Replay, TimeStampsAreTakenAsListedAndSkippedFramesAreMissing) {
  capture::write_clip(folder / "a.mkv", {.key_frame_every = 4});
  capture::write_text(folder / "t.csv", "frame,t_s\n2,0.01\n3,0.02\n5,0.05\n6,0.06\n");
  auto source = open("frames: a.mkv, timestamps: t.csv, trust_times: true");
  EXPECT_EQ(source.expected_frames(), 4);
  const auto frames = read_all(source);
  EXPECT_THAT(times(frames), ElementsAre(10ms, 20ms, 50ms, 60ms));
  EXPECT_THAT(shown(frames), ElementsAre(2, 3, 5, 6));
  EXPECT_THAT(numbers(frames), ElementsAre(0, 1, 3, 4));
  EXPECT_EQ(source.cameras()[0].missing, 1);
  EXPECT_EQ(source.cameras()[0].frames, 4);
  EXPECT_THAT(source.take_warnings(), IsEmpty());
}

TEST_F(Replay, ListedFramesMissingInTheVideoAreCounted) {
  capture::write_clip(folder / "a.mkv", {.frames = 3});
  capture::write_text(folder / "t.csv", "frame,t_s\n0,0\n1,0.1\n2,0.2\n3,0.3\n5,0.5\n");
  auto source = open("frames: a.mkv, timestamps: t.csv");
  EXPECT_EQ(read_all(source).size(), 3u);
  EXPECT_EQ(source.cameras()[0].missing, 2);
  EXPECT_THAT(source.take_warnings(), ElementsAre(AllOf(HasSubstr("a.mkv"), HasSubstr("last 2 rows"))));
}

TEST_F(Replay, ContainerTimeStampsAreTheDefault) {
  capture::write_clip(folder / "a.mp4", {.codec = "mpeg4", .format = AV_PIX_FMT_YUV420P, .frames = 4, .fps = 8});
  auto source = open("frames: a.mp4, offset_s: 1");
  EXPECT_THAT(times(read_all(source)), ElementsAre(1000ms, 1125ms, 1250ms, 1375ms));
}

TEST_F(Replay, ImagesHaveNoTimesOfTheirOwn) {
  capture::write_clip(folder / "img/%03d.png", {.codec = "png", .format = AV_PIX_FMT_RGB24, .frames = 2});
  EXPECT_THAT(error_of("frames: img/%03d.png"),
              AllOf(HasSubstr("recording.yaml"), HasSubstr("cameras.cam"), HasSubstr("give fps or timestamps")));
}

TEST_F(Replay, CamerasAreMergedByTimeAndTiesGoByOrder) {
  capture::write_clip(folder / "a.mkv", {.frames = 4});
  capture::write_clip(folder / "b.mkv", {.frames = 3});
  const std::string cameras =
      "  a: {frames: a.mkv, fps: 20}\n"
      "  b: {frames: b.mkv, fps: 10}\n"
      "  c: {frames: b.mkv, fps: 10, offset_s: -0.025}\n";
  auto source = open(cameras, {"b", "a", "c"});
  std::vector<std::pair<int, capture::Duration>> order;
  while (const auto f = source.next({})) {
    order.emplace_back(f->camera, f->captured_at.time_since_epoch());
    if (order.size() == 10) {  // the last frame of 0; the last of 2 was the one before
      EXPECT_TRUE(source.ended(2));
    } else {
      EXPECT_FALSE(source.ended(0)) << order.size();
    }
  }
  EXPECT_TRUE(source.ended(0) && source.ended(1));
  const std::vector<std::pair<int, capture::Duration>> expected{
      {2, -25ms}, {0, 0ms}, {1, 0ms}, {1, 50ms}, {2, 75ms}, {0, 100ms}, {1, 100ms}, {1, 150ms}, {2, 175ms}, {0, 200ms}};
  EXPECT_EQ(order, expected);
  EXPECT_EQ(source.cameras()[1].name, "a");
  EXPECT_EQ(source.cameras()[1].frames, 4);
}

TEST_F(Replay, RepeatsExactlyWithAnyNumberOfThreads) {
  capture::write_clip(folder / "a.mkv", {.width = 128, .height = 96, .key_frame_every = 5});
  capture::write_clip(folder / "b.mkv",
                      {.codec = "mpeg4", .format = AV_PIX_FMT_YUV420P, .key_frame_every = 6, .b_frames = 2});
  const std::string cameras = "  a: {frames: a.mkv, fps: 20}\n  b: {frames: b.mkv, fps: 15}\n";
  std::set<std::vector<std::uint64_t>> runs;
  for (const int threads : {1, 1, 2, 4}) {
    auto source = open(cameras, {"a", "b"}, {.decoder_threads = threads});
    std::vector<std::uint64_t> run;
    for (const auto& f : read_all(source))
      run.push_back(capture::hash_of(f.pixels, static_cast<std::uint64_t>(f.captured_at.time_since_epoch().count()) +
                                                   static_cast<std::uint64_t>(f.camera)));
    EXPECT_EQ(run.size(), 24u);
    runs.insert(run);
  }
  EXPECT_EQ(runs.size(), 1u);
}

TEST_F(Replay, StopsWhenAskedTo) {
  capture::write_clip(folder / "a.mkv", {.frames = 3});
  auto source = open("frames: a.mkv, fps: 20");
  std::stop_source stop;
  EXPECT_TRUE(source.next(stop.get_token()).has_value());
  stop.request_stop();
  EXPECT_FALSE(source.next(stop.get_token()).has_value());
}

TEST_F(Replay, AnImageOutlivesItsSource) {
  capture::write_clip(folder / "a.mkv", {.frames = 3});
  std::vector<capture::Frame> frames;
  {
    auto source = open("frames: a.mkv, fps: 20");
    frames = read_all(source);
  }
  EXPECT_THAT(shown(frames), ElementsAre(0, 1, 2));
}

TEST_F(Replay, ReorderedFramesComeInOrder) {
  for (const std::string file : {"b.mp4", "b.mkv", "b.avi"}) {
    capture::write_clip(folder / file,
                        {.codec = "mpeg4", .format = AV_PIX_FMT_YUV420P, .key_frame_every = 6, .b_frames = 2});
    auto source = open("frames: " + file + ", fps: 10");
    const auto frames = read_all(source);
    EXPECT_THAT(shown(frames), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11)) << file;
    EXPECT_THAT(numbers(frames), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11)) << file;
    EXPECT_THAT(source.take_warnings(), IsEmpty());
  }
}

TEST_F(Replay, Vp9sHiddenFramesTakeNoNumber) {
  if (!avcodec_find_encoder_by_name("libvpx-vp9")) GTEST_SKIP() << "no VP9 encoder";
  for (const std::string codec : {"libvpx", "libvpx-vp9"}) {
    capture::write_clip(folder / "a.webm",
                        {.codec = codec, .format = AV_PIX_FMT_YUV420P, .frames = 20, .key_frame_every = 20});
    auto source = open("frames: a.webm, fps: 10");
    const auto frames = read_all(source);
    ASSERT_EQ(frames.size(), 20u);
    EXPECT_EQ(capture::frame_shown_by(frames.back().pixels), 19);
    EXPECT_THAT(source.take_warnings(), IsEmpty());
  }
}

// ---- Images

TEST_F(Replay, ImagePatternIsNumberedByFileAndMayHaveGaps) {
  capture::write_clip(folder / "img/%03d.png",
                      {.codec = "png", .format = AV_PIX_FMT_RGB24, .frames = 6});  // 001 .. 006
  std::filesystem::remove(folder / "img/003.png");
  std::filesystem::copy(folder / "img/006.png", folder / "img/006 copy.png");  // not of this pattern
  auto source = open("frames: img/%03d.png, fps: 10");
  EXPECT_EQ(source.cameras()[0].format, capture::PixelFormat::bgr);
  const auto frames = read_all(source);
  EXPECT_THAT(shown(frames), ElementsAre(0, 1, 3, 4, 5));
  EXPECT_THAT(times(frames), ElementsAre(0ms, 100ms, 300ms, 400ms, 500ms));
  EXPECT_THAT(numbers(frames), ElementsAre(0, 1, 3, 4, 5));
  EXPECT_EQ(source.cameras()[0].missing, 1);
}

// Left out without a word, they would shift the times of all others.
TEST_F(Replay, APatternThatLeavesOutOtherPaddingIsRefused) {
  capture::write_clip(folder / "img/f%03d.png", {.codec = "png", .format = AV_PIX_FMT_RGB24, .frames = 3});
  std::filesystem::copy(folder / "img/f003.png", folder / "img/f70.png");
  EXPECT_THAT(error_of("frames: img/f%d.png, fps: 10"), AllOf(HasSubstr("f001.png"), HasSubstr("other leading zeros"),
                                                              HasSubstr("f70.png"), HasSubstr("\"f*.png\"")));
}

TEST_F(Replay, ImageGlobIsSortedByNumber) {
  capture::write_clip(folder / "img/frame_%d.jpg", {.codec = "mjpeg", .format = AV_PIX_FMT_YUVJ420P, .frames = 11});
  auto source = open("frames: \"img/*.jpg\", fps: 10");
  EXPECT_EQ(source.expected_frames(), 11);
  EXPECT_THAT(shown(read_all(source)), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
}

TEST_F(Replay, FileNamedLikeAPatternIsThatFile) {
  capture::write_clip(folder / "a[1].mkv", {.frames = 2});
  auto source = open("frames: \"a[1].mkv\", fps: 10");
  EXPECT_EQ(read_all(source).size(), 2u);
}

TEST_F(Replay, ImageOfAnotherSizeIsNotUsed) {
  const std::vector<std::pair<std::string, AVPixelFormat>> kinds{{"png", AV_PIX_FMT_RGB24},
                                                                 {"mjpeg", AV_PIX_FMT_YUVJ422P}};
  for (const auto& [codec, format] : kinds) {
    const std::string name = codec == "png" ? "%d.png" : "%d.jpg";
    capture::write_clip(folder / codec / name, {.codec = codec, .format = format, .frames = 4});
    capture::write_clip(folder / (codec + "_other") / name,
                        {.codec = codec, .format = format, .width = 32, .frames = 4});
    const std::string second = codec == "png" ? "2.png" : "2.jpg";
    std::filesystem::copy(folder / (codec + "_other") / second, folder / codec / second,
                          std::filesystem::copy_options::overwrite_existing);
    auto source = open("frames: " + codec + "/" + name + ", fps: 10");
    const auto frames = read_all(source);
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_EQ(frames[1].status, capture::FrameStatus::corrupted);
    EXPECT_EQ(frames[2].status, capture::FrameStatus::ok);
    EXPECT_EQ(source.cameras()[0].corrupted, 1);
    EXPECT_THAT(source.take_warnings(), ElementsAre(AllOf(HasSubstr("32x48"), HasSubstr("64x48"))));
  }
}

// ---- Pixel formats

struct FormatCase {
  const char* codec;
  const char* file;
  AVPixelFormat coded;
  capture::PixelFormat expected;
  capture::ColorRange range = capture::ColorRange::limited;
  int width = 64;
  int height = 48;
  AVColorRange coded_range = AVCOL_RANGE_UNSPECIFIED;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
};
void PrintTo(const FormatCase& c, std::ostream* out) {
  *out << c.codec << " " << av_get_pix_fmt_name(c.coded) << " " << c.width << "x" << c.height;
}

class ReplayFormats : public testing::TestWithParam<FormatCase> {};

TEST_P(ReplayFormats, AreKeptOrConvertedToTheNearest) {
  const FormatCase& c = GetParam();
  const capture::TemporaryFolder folder;
  capture::write_clip(folder / c.file, {.codec = c.codec,
                                        .format = c.coded,
                                        .range = c.coded_range,
                                        .matrix = c.matrix,
                                        .width = c.width,
                                        .height = c.height,
                                        .frames = 3});
  capture::write_text(folder / "recording.yaml",
                      std::string("version: 1\ncameras:\n  cam: {frames: ") + c.file + ", fps: 10}\n");
  const std::vector<std::string> names{"cam"};
  ReplaySource source(read_recording(folder.path()), names);
  int count = 0;
  while (const auto frame = source.next({})) {
    const capture::Image& image = frame->pixels;
    ASSERT_EQ(frame->status, capture::FrameStatus::ok);
    EXPECT_EQ(name(image.format), name(c.expected));
    EXPECT_EQ(image.range, c.range);
    EXPECT_EQ(image.width, c.width);
    EXPECT_EQ(image.height, c.height);
    const int level = capture::level_of_frame(count);
    // the middle, and the corners, where a wrong stride or row order shows (noise is up to 15 there)
    for (const auto& [u, v] : {std::pair{c.width / 2, c.height / 2},
                               {0, 0},
                               {c.width - 1, 0},
                               {0, c.height - 1},
                               {c.width - 1, c.height - 1}}) {
      if (c.expected == capture::PixelFormat::bgr) {
        EXPECT_NEAR(capture::bgr_at(image, u, v).g, level + 7, c.matrix == AVCOL_SPC_UNSPECIFIED ? 9 : 35);
      } else {
        const capture::Yuv p = capture::yuv_at(image, u, v);
        EXPECT_NEAR(p.y, level + 7, 10);
        if (c.expected != capture::PixelFormat::grey && c.coded != AV_PIX_FMT_YUYV422 && c.coded != AV_PIX_FMT_NV12) {
          EXPECT_NEAR(p.u, 120 + 7, 10);
          EXPECT_NEAR(p.v, 140 + 7, 10);
        }
      }
    }
    ++count;
  }
  EXPECT_EQ(count, 3);
}

INSTANTIATE_TEST_SUITE_P(
    AsTheyAre, ReplayFormats,
    testing::Values(
        FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV420P, capture::PixelFormat::i420},
        FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV422P, capture::PixelFormat::i422},
        FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV444P, capture::PixelFormat::i444},
        FormatCase{"mjpeg", "a.mkv", AV_PIX_FMT_YUVJ420P, capture::PixelFormat::i420, capture::ColorRange::full},
        FormatCase{"mjpeg", "a.avi", AV_PIX_FMT_YUVJ422P, capture::PixelFormat::i422, capture::ColorRange::full},
        FormatCase{"mjpeg", "a.avi", AV_PIX_FMT_YUVJ444P, capture::PixelFormat::i444, capture::ColorRange::full},
        FormatCase{"rawvideo", "a.nut", AV_PIX_FMT_YUYV422, capture::PixelFormat::yuyv},
        FormatCase{"rawvideo", "a.nut", AV_PIX_FMT_NV12, capture::PixelFormat::nv12},
        FormatCase{"rawvideo", "a.avi", AV_PIX_FMT_BGR24, capture::PixelFormat::bgr, capture::ColorRange::full},
        FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_GRAY8, capture::PixelFormat::grey, capture::ColorRange::full},
        FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV422P, capture::PixelFormat::i422, capture::ColorRange::full, 64, 48,
                   AVCOL_RANGE_JPEG}));
INSTANTIATE_TEST_SUITE_P(Nearest, ReplayFormats,
                         testing::Values(FormatCase{"rawvideo", "a.nut", AV_PIX_FMT_RGB24, capture::PixelFormat::bgr,
                                                    capture::ColorRange::full},
                                         FormatCase{"png", "a%d.png", AV_PIX_FMT_RGB24, capture::PixelFormat::bgr,
                                                    capture::ColorRange::full},
                                         FormatCase{"rawvideo", "a.nut", AV_PIX_FMT_RGBA, capture::PixelFormat::bgr,
                                                    capture::ColorRange::full},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV410P, capture::PixelFormat::i420},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV411P, capture::PixelFormat::i422},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV440P, capture::PixelFormat::i444},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUVA420P, capture::PixelFormat::i420}));
// Sizes that the format cannot hold.
INSTANTIATE_TEST_SUITE_P(OddSizes, ReplayFormats,
                         testing::Values(FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV420P, capture::PixelFormat::i444,
                                                    capture::ColorRange::limited, 65, 48},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV420P, capture::PixelFormat::i422,
                                                    capture::ColorRange::limited, 64, 49},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV422P, capture::PixelFormat::i422,
                                                    capture::ColorRange::limited, 64, 49},
                                         FormatCase{"mjpeg", "a.mkv", AV_PIX_FMT_YUVJ422P, capture::PixelFormat::i444,
                                                    capture::ColorRange::full, 63, 47},
                                         FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_GRAY8, capture::PixelFormat::grey,
                                                    capture::ColorRange::full, 33, 17},
                                         FormatCase{"rawvideo", "a.avi", AV_PIX_FMT_BGR24, capture::PixelFormat::bgr,
                                                    capture::ColorRange::full, 33, 17}));
// Ours are BT.601.
INSTANTIATE_TEST_SUITE_P(OtherMatrix, ReplayFormats,
                         testing::Values(FormatCase{"ffv1", "a.mkv", AV_PIX_FMT_YUV422P, capture::PixelFormat::bgr,
                                                    capture::ColorRange::full, 64, 48, AVCOL_RANGE_MPEG,
                                                    AVCOL_SPC_BT709}));

TEST_F(Replay, AcceptsBottomUpRows) {
  capture::write_clip(folder / "a.avi", {.codec = "rawvideo", .format = AV_PIX_FMT_BGR24, .frames = 1});
  std::string bytes = capture::read_bytes(folder / "a.avi");
  const auto height = bytes.find("strf") + 16;  // biHeight: -48, top down; 48 means bottom up
  ASSERT_EQ(bytes.substr(height, 4), "\xD0\xFF\xFF\xFF");
  capture::write_text(folder / "b.avi", bytes.replace(height, 4, std::string("\x30\0\0\0", 4)));
  auto source = open("frames: b.avi, fps: 10");
  const capture::Image image = read_all(source).at(0).pixels;
  EXPECT_LT(image.planes[0].stride, 0);
  EXPECT_EQ(capture::bgr_at(image, 32, 3).g,
            capture::bgr_at(image, 33, 3).g);  // flat, and the noise of the first rows is below
  EXPECT_NE(capture::bgr_at(image, 32, 44).g, capture::bgr_at(image, 33, 44).g);
}

TEST_F(Replay, ConvertsBt709WithItsOwnMatrix) {
  const auto colour = [&](AVColorSpace matrix, const std::string& file) {
    capture::write_clip(folder / file, {.range = AVCOL_RANGE_MPEG, .matrix = matrix, .frames = 5});
    auto source = open("frames: " + file + ", fps: 10");
    return read_all(source).at(4).pixels;
  };
  const capture::Bgr hd = capture::bgr_at(colour(AVCOL_SPC_BT709, "hd.mkv"), 40, 30);
  const double y = 1.1644 * (capture::level_of_frame(4) - 16);  // U = 120, V = 140
  EXPECT_NEAR(hd.r, y + 1.7927 * 12, 1.5);
  EXPECT_NEAR(hd.g, y - 0.2132 * -8 - 0.5329 * 12, 1.5);
  EXPECT_NEAR(hd.b, y + 2.1124 * -8, 1.5);
  EXPECT_EQ(colour(AVCOL_SPC_SMPTE170M, "sd.mkv").format, capture::PixelFormat::i422);
}

// ---- What is wrong at the start

TEST_F(Replay, MissingCameraIsAnError) {
  capture::write_clip(folder / "a.mkv", {.frames = 1});
  const std::string cameras = "  left: {frames: a.mkv, fps: 10}\n  right: {frames: a.mkv, fps: 10}\n";
  EXPECT_THAT(error_of(cameras, {"left", "rihgt"}),
              AllOf(HasSubstr("recording.yaml"), HasSubstr("rihgt"), HasSubstr("did you mean right?"),
                    HasSubstr("left, right"), HasSubstr("left, rihgt")));
  EXPECT_THAT(error_of(cameras, {"top"}), testing::Not(HasSubstr("did you mean")));
}

TEST_F(Replay, ExtraCameraIsAWarning) {
  capture::write_clip(folder / "a.mkv", {.frames = 1});
  auto source = open("  left: {frames: a.mkv, fps: 10}\n  right: {frames: a.mkv, fps: 10}\n", {"right"});
  EXPECT_EQ(read_all(source).size(), 1u);
  EXPECT_THAT(source.take_warnings(), ElementsAre(AllOf(HasSubstr("left"), HasSubstr("not in the rig"))));
  EXPECT_THAT(source.take_warnings(), IsEmpty());
}

TEST_F(Replay, RefusesBadOptions) {
  capture::write_clip(folder / "a.mkv", {.frames = 1});
  EXPECT_THROW(open("  cam: {frames: a.mkv, fps: 10}\n", {"cam"}, {.decoder_threads = 0}), std::invalid_argument);
}

TEST_F(Replay, NamesAFileThatIsNoVideo) {
  const auto names_it = [](const std::string& file, const std::string& why) {
    return AllOf(HasSubstr(file), HasSubstr(why), HasSubstr("camera cam"));
  };
  EXPECT_THAT(error_of("frames: none.mkv, fps: 10"), names_it("none.mkv", "no such file"));
  EXPECT_THAT(error_of("frames: ., fps: 10"), HasSubstr("is not a file"));
  capture::write_text(folder / "empty.mkv", "");
  EXPECT_THAT(error_of("frames: empty.mkv, fps: 10"), names_it("empty.mkv", "is empty"));
  for (const std::string file : {"text.mkv", "text.txt", "text.jpg", "text.mp4", "text"}) {
    capture::write_text(folder / file, "this is not a video\n");
    EXPECT_THAT(error_of("frames: " + file + ", fps: 10"), names_it(file, "")) << file;
  }
  std::string wave = "RIFF\x24\x10";
  wave += std::string(
      "\0\0WAVEfmt \x10\0\0\0\1\0\1\0\x40\x1f\0\0\x40\x1f\0\0\1\0\x8\0"
      "data\0\x10\0\0",
      38);
  capture::write_text(folder / "sound.wav", wave + std::string(4096, '\x80'));
  EXPECT_THAT(error_of("frames: sound.wav, fps: 10"), names_it("sound.wav", "no video stream"));
  capture::write_clip(folder / "none.avi", {.codec = "mjpeg", .format = AV_PIX_FMT_YUVJ420P, .frames = 0});
  EXPECT_THAT(error_of("frames: none.avi, fps: 10"), names_it("none.avi", ""));
  EXPECT_THAT(error_of("frames: img/%04d.png, fps: 10"), names_it("img/%04d.png", "no file matches"));
  EXPECT_THAT(error_of("frames: img/%04d.png, fps: 10"), HasSubstr("; there is no folder "));
  EXPECT_THAT(error_of("frames: \"img/*.png\", fps: 10"), names_it("img/*.png", "no file matches"));
  EXPECT_THAT(error_of("frames: img/%s.png, fps: 10"), HasSubstr("one number like %06d"));
  capture::write_clip(folder / "a.mkv", {.frames = 2});
  EXPECT_THAT(error_of("frames: a.mkv, fps: 10, first_frame: 7"), names_it("a.mkv", "no frame of it can be played"));
}

// A recording is data: it must not make us talk to the network.
TEST_F(Replay, PlayListsDoNotLeaveTheMachine) {
  capture::write_text(folder / "list.m3u8",
                      "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n#EXT-X-ENDLIST\n");
  EXPECT_THAT(error_of("frames: list.m3u8, fps: 10"), HasSubstr("list.m3u8"));
  // Nor is it opened where what it names is here: a pipe would be waited for.
  ASSERT_EQ(::mkfifo((folder / "a.ts").c_str(), 0600), 0);
  capture::write_text(folder / "list.m3u8", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\na.ts\n#EXT-X-ENDLIST\n");
  EXPECT_THAT(error_of("frames: list.m3u8, fps: 10"), AllOf(HasSubstr("list.m3u8"), HasSubstr("is not followed")));
  capture::write_text(folder / "list.txt", "ffconcat version 1.0\nfile a.ts\n");
  EXPECT_THAT(error_of("frames: list.txt, fps: 10"), AllOf(HasSubstr("list.txt"), HasSubstr("is not followed")));
}

}  // namespace
}  // namespace huetrack::recordings
