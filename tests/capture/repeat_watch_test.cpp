#include "capture/frames/repeat_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <span>

#include "recordings/names_in.h"
#include "recordings/replay_source.h"

namespace huetrack::capture {
namespace {

constexpr int width = 160, height = 120;

// Pictures of a room in which a square moves. noise: standard deviation, grey values.
class Room {
 public:
  explicit Room(double noise, PixelFormat format = PixelFormat::yuyv) : noise_(noise), format_(format) {}

  Image picture(int square_at) {
    WritableImage out = make_image(format_, ColorRange::limited, width, height);
    std::normal_distribution<double> noise(0, noise_);
    for (int v = 0; v < height; ++v) {
      std::uint8_t* row = out.data[0] + v * out.image.planes[0].stride;
      for (std::size_t b = 0; b < plane_row_bytes(format_, 0, width); ++b) {
        const int u = static_cast<int>(b * width / plane_row_bytes(format_, 0, width));
        const bool is_square = std::abs(u - square_at) < 8 && std::abs(v - 60) < 8;
        const double value = (is_square ? 200 : 60 + v / 2) + (noise_ > 0 ? noise(random_) : 0.0);
        row[b] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
      }
    }
    return out.image;
  }

 private:
  double noise_;
  PixelFormat format_;
  std::mt19937 random_{7};
};

class RepeatWatchOf : public testing::TestWithParam<PixelFormat> {};

TEST_P(RepeatWatchOf, ReportsARepeatedLivePictureAsLongAsItLasts) {
  Room room(0.7, GetParam());
  RepeatWatch watch;
  Image last;
  for (int i = 0; i < 100; ++i) ASSERT_FALSE(watch.is_repeated(last = room.picture(40))) << i;
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(watch.is_repeated(last)) << i;
  EXPECT_FALSE(watch.is_repeated(last = room.picture(40)));
  EXPECT_TRUE(watch.is_repeated(last));
  EXPECT_FALSE(watch.is_repeated(room.picture(40)));
}

INSTANTIATE_TEST_SUITE_P(RepeatWatch, RepeatWatchOf,
                         testing::Values(PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::bgr, PixelFormat::grey));

TEST(RepeatWatch, ReportsHalfWhenEveryPictureComesTwice) {
  Room room(0.7);
  RepeatWatch watch;
  int repeated = 0;
  for (int i = 0; i < 100; ++i) {
    const Image picture = room.picture(i);
    EXPECT_FALSE(watch.is_repeated(picture)) << i;
    repeated += watch.is_repeated(picture);
  }
  EXPECT_GE(repeated, 97);  // of the first three pictures nothing is known
}

TEST(RepeatWatch, StillPicturesWithoutNoiseAreNoRepetition) {
  Room room(0);
  RepeatWatch watch;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(room.picture(i % 160))) << i;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(room.picture(80))) << i;
}

// As a video is that codes only what changes: whole pictures come anew now and then, and what moves in between.
TEST(RepeatWatch, KeyFramesAreNoNoise) {
  Room drawn(0), coded(1);
  RepeatWatch watch;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated((i % 12 == 0 ? coded : drawn).picture(i % 160))) << i;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(drawn.picture(80))) << i;
}

// Nothing moves, so that only key frames differ, and each of them everywhere.
TEST(RepeatWatch, VideoOfAStillRoomIsNotRepeated) {
  Room room(1);
  RepeatWatch watch;
  Image key;
  for (int i = 0; i < 60 * 12; ++i) ASSERT_FALSE(watch.is_repeated(i % 12 == 0 ? key = room.picture(40) : key)) << i;
}

// Its coder spends the first pictures on getting the room right, and then nothing moves.
TEST(RepeatWatch, SettledVideoIsNotRepeated) {
  Room room(1);
  RepeatWatch watch;
  Image last;
  for (int i = 0; i < 6; ++i) ASSERT_FALSE(watch.is_repeated(last = room.picture(40))) << i;
  int repeated = 0;
  for (int i = 0; i < 200; ++i) repeated += watch.is_repeated(last);
  EXPECT_LE(repeated, 3);
}

// Its coder leaves out the noise of a night after the day's: that is learnt.
TEST(RepeatWatch, CameraMayChangeItsKind) {
  Room room(1);
  RepeatWatch watch;
  Image key;
  for (int i = 0; i < 1000; ++i) ASSERT_FALSE(watch.is_repeated(room.picture(40))) << i;
  for (int i = 0; i < 300 * 12; ++i) watch.is_repeated(i % 12 == 0 ? key = room.picture(40) : key);
  for (int i = 0; i < 60 * 12; ++i) ASSERT_FALSE(watch.is_repeated(i % 12 == 0 ? key = room.picture(40) : key)) << i;
}

// A picture as a film codes it that repeats `last`: some of it, in `of_16` of 16 columns, comes from `now`.
Image coded_again(const Image& last, const Image& now, int of_16) {
  WritableImage out = make_image(last.format, last.range, width, height);
  const auto bytes = static_cast<std::ptrdiff_t>(plane_row_bytes(last.format, 0, width));
  for (int v = 0; v < height; ++v)
    for (std::ptrdiff_t b = 0; b < bytes; ++b)
      out.data[0][v * out.image.planes[0].stride + b] =
          (b * 16 / bytes < of_16 ? now : last).planes[0].data[v * last.planes[0].stride + b];
  return out.image;
}

TEST(RepeatWatch, ReportsRepetitionsThatAFilmCodesAnew) {
  Room room(1);
  RepeatWatch watch;
  Image last;
  for (int i = 0; i < 40; ++i) ASSERT_FALSE(watch.is_repeated(last = room.picture(i)));
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(watch.is_repeated(last = coded_again(last, room.picture(40), 2))) << i;
    ASSERT_FALSE(watch.is_repeated(last = room.picture(i)));
  }
}

// Low bit rates code noise in some of the picture.
TEST(RepeatWatch, FilmsWithSomeNoiseAreNotRepeated) {
  Room room(1);
  RepeatWatch watch;
  Image last = room.picture(40);
  for (int i = 0; i < 300; ++i)
    ASSERT_FALSE(watch.is_repeated(last = coded_again(last, room.picture(i % 160), 2 + i * 7 % 13))) << i;
}

// The light goes off, or the bit rate sinks.
TEST(RepeatWatch, AFilmThatLosesItsNoiseIsNotRepeatedForLong) {
  Room room(1);
  RepeatWatch watch;
  Image last;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(last = room.picture(i % 160)));
  int repeated = 0;
  for (int i = 0; i < 300; ++i) repeated += watch.is_repeated(last = coded_again(last, room.picture(40), 1));
  EXPECT_LE(repeated, 12);
}

TEST(RepeatWatch, CoveredCameraIsNotRepeated) {
  RepeatWatch watch;
  Room room(1);
  const Image dark = make_image(PixelFormat::yuyv, ColorRange::limited, width, height).image;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(dark)) << i;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(room.picture(40))) << i;
  for (int i = 0; i < 300; ++i) ASSERT_FALSE(watch.is_repeated(dark)) << i;
}

// Every reported repetition is byte-equal to the previous picture.
class SharedRecording : public testing::TestWithParam<const char*> {};

TEST_P(SharedRecording, HasNoFalseRepetition) {
  const auto folder = std::filesystem::path(HUETRACK_SHARED_DATA) / "rendered" / GetParam();
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const recordings::Recording recording = recordings::read_recording(folder);
  recordings::ReplaySource source(recording, recordings::names_in(recording), {.decoder_threads = 2});
  std::vector<RepeatWatch> watches(recording.cameras.size());
  std::vector<Image> last(recording.cameras.size());
  int repeated = 0, frames = 0;
  while (const auto frame = source.next({})) {
    if (!has_pixels(frame->pixels)) continue;
    const auto c = std::size_t(frame->camera);
    ++frames;
    if (watches[c].is_repeated(frame->pixels)) {
      ++repeated;
      require_all(frame->pixels);
      require_all(last[c]);
      for (int v = 0; v < frame->pixels.height; ++v) {
        const auto row = [&](const Image& image) {
          const auto* at = image.planes[0].data + v * image.planes[0].stride;
          return std::span(at, plane_row_bytes(image.format, 0, image.width));
        };
        ASSERT_TRUE(std::ranges::equal(row(frame->pixels), row(last[c]))) << "camera " << c << ", row " << v;
      }
    }
    last[c] = frame->pixels;
  }
  EXPECT_LT(repeated, frames / 10);
}

INSTANTIATE_TEST_SUITE_P(RepeatWatch, SharedRecording, testing::Values("webcams", "occlusion"));

}  // namespace
}  // namespace huetrack::capture
