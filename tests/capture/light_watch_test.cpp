#include "capture/frames/light_watch.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "capture/temporary_folder.h"
#include "recordings/names_in.h"
#include "recordings/replay_source.h"

namespace huetrack::capture {
namespace {

// A room of grey and brown cells before a camera, and what happens to it.
struct World {
  double fps = 30, seconds = 10;
  double flicker_hz = 100, modulation = 0;  // of the values in the picture
  double readout_s = 0.025;
  std::function<double(double)> gain = [](double) { return 1.0; };
  std::function<double(double)> red = [](double) { return 1.0; };
  std::function<int(double)> pan_px = [](double) { return 0; };  // how far the camera has turned
  // Columns that are covered by something that moves, [from, to) as shares of the width; dark, and of its own texture.
  std::function<std::pair<double, double>(double)> cover = [](double) { return std::pair(0.0, 0.0); };
};

class Filming {
 public:
  explicit Filming(World world) : world_(std::move(world)) {}

  // Shows the watch everything; how often its findings changed.
  int show(LightWatch& watch) {
    int changes = 0;
    const int frames = int(std::lround(world_.seconds * world_.fps));
    for (int k = 0; k < frames; ++k, ++frame_) {
      const double t = frame_ / world_.fps;
      const Timestamp at{duration_of(t + jitter_(random_))};
      if (watch.is_wanted(at)) changes += watch.look(picture(t), at) ? 1 : 0;
    }
    return changes;
  }

 private:
  static constexpr int width = 128, height = 96;
  Image picture(double t) {
    const WritableImage out = make_image(PixelFormat::bgr, ColorRange::full, width, height);
    const double gain = world_.gain(t), red = world_.red(t);
    const int pan = world_.pan_px(t);
    const auto [from, to] = world_.cover(t);
    for (int v = 0; v < height; ++v) {
      const double row_t = t + (double(v) / (height - 1) - 0.5) * world_.readout_s;
      const double light =
          gain * (1 + world_.modulation * std::cos(2 * std::numbers::pi * world_.flicker_hz * row_t + 0.7));
      for (int u = 0; u < width; ++u) {
        const bool is_covered = u >= from * width && u < to * width;
        const double texture = 0.5 + 0.5 * std::sin(0.17 * (u + pan)) * std::sin(0.12 * v + 0.05 * (u + pan));
        const double base = is_covered ? 30 + 20 * std::sin(v + 40 * t) : 60 + 90 * texture;
        const auto byte = [&](double value) {
          return static_cast<std::uint8_t>(std::clamp(std::lround(value + noise_(random_)), 0L, 255L));
        };
        std::uint8_t* p = out.data[0] + v * out.image.planes[0].stride + 3 * u;
        p[0] = byte(0.8 * base * light), p[1] = byte(0.9 * base * light), p[2] = byte(base * light * red);
      }
    }
    return out.image;
  }

  const World world_;
  int frame_ = 0;
  std::mt19937 random_{3};
  std::normal_distribution<double> noise_{0, 4}, jitter_{0, 0.0005};
};

LightFindings found_in(World world, double window_s = 4.2) {
  LightWatch watch(window_s);
  Filming(std::move(world)).show(watch);
  EXPECT_GT(watch.windows(), 0u);
  return watch.findings();
}

double swinging(double t) {
  return 1 + 0.07 * std::sin(2 * std::numbers::pi * t / 7);
}

struct Case {
  double fps, hz, readout_s, modulation;
};
class FlickerAt : public testing::TestWithParam<Case> {};

TEST_P(FlickerAt, IsDetectedWithRateAndBands) {
  const auto [fps, hz, readout_s, modulation] = GetParam();
  const auto found =
      found_in({.fps = fps, .seconds = 6, .flicker_hz = hz, .modulation = modulation, .readout_s = readout_s});
  ASSERT_TRUE(found.flicker);
  EXPECT_EQ(found.flicker->light_hz, hz);
  EXPECT_NEAR(found.flicker->modulation, modulation, 0.25 * modulation);
  EXPECT_NEAR(found.flicker->bands, hz * std::abs(readout_s), 0.3);
  EXPECT_FALSE(found.exposure_change);
  EXPECT_FALSE(found.balance_change);
}
INSTANTIATE_TEST_SUITE_P(LightWatch, FlickerAt,
                         testing::Values(Case{30, 100, 0.025, 0.03}, Case{29.93, 100, 0.0185, 0.01},
                                         Case{30, 100, -0.03, 0.02}, Case{60, 100, 0.012, 0.03},
                                         Case{25, 120, 0.03, 0.03}, Case{50, 120, 0.015, 0.03},
                                         Case{15, 100, 0.033, 0.05}));

std::pair<double, double> walking(double t) {
  const double from = 0.3 + 0.3 * std::sin(2 * t);
  return {from, from + 0.1};
}

TEST(LightWatch, DetectsFlickerAndExposureBehindMotion) {
  const auto together = found_in({.modulation = 0.03, .gain = swinging});
  EXPECT_TRUE(together.flicker);
  EXPECT_TRUE(together.exposure_change);
  EXPECT_FALSE(together.balance_change);
  EXPECT_TRUE(found_in({.modulation = 0.03, .cover = walking}).flicker);
  EXPECT_TRUE(found_in({.gain = swinging, .cover = walking}).exposure_change);
}

TEST(LightWatch, DetectsNothingInStillLight) {
  EXPECT_EQ(found_in({}), LightFindings{});
  EXPECT_EQ(found_in({.cover =
                          [](double t) {
                            const double from = std::fmod(0.2 * t, 1.2) - 0.3;
                            return std::pair(from, from + 0.3);
                          }}),
            LightFindings{});
}

// They would be taken for a pattern on the wall, and they move nothing.
TEST(LightWatch, StandingBandsAreNotDetected) {
  EXPECT_EQ(found_in({.fps = 25, .modulation = 0.03}), LightFindings{});
}

TEST(LightWatch, MovingCameraGivesNoFinding) {
  LightWatch watch;
  Filming({.modulation = 0.03, .gain = swinging, .pan_px = [](double t) { return int(60 * t); }}).show(watch);
  EXPECT_EQ(watch.windows(), 0u);
  EXPECT_EQ(watch.findings(), LightFindings{});
}

TEST(LightWatch, DetectsSwingingExposureButNotALightSwitch) {
  const auto found = found_in({.gain = swinging});
  ASSERT_TRUE(found.exposure_change);
  EXPECT_NEAR(*found.exposure_change, 0.14, 0.04);
  EXPECT_FALSE(found.flicker);
  EXPECT_FALSE(found.balance_change);
  EXPECT_EQ(found_in({.gain = [](double t) { return t < 2.5 ? 1.0 : 0.8; }}), LightFindings{});
}

TEST(LightWatch, DetectsChangingWhiteBalance) {
  const auto found = found_in({.red = [](double t) { return 1 + 0.02 * t; }});
  ASSERT_TRUE(found.balance_change);
  EXPECT_NEAR(*found.balance_change, 0.08, 0.03);
  EXPECT_FALSE(found.exposure_change);
}

TEST(LightWatch, ReportsNewFindingsAndForgetsOldOnes) {
  LightWatch watch;
  Filming room({.seconds = 45, .gain = [](double t) { return t < 9 ? swinging(t) : swinging(9); }});
  EXPECT_EQ(room.show(watch), 2);  // it comes, and goes
  EXPECT_GE(watch.windows(), 8u);
  EXPECT_EQ(watch.findings(), LightFindings{});
}

// The truth is in truth.yaml there: flicker of 100 Hz, 0.017 to 0.086 of the light; exposure swings by 0.12 to 0.15.
class SharedLight : public testing::TestWithParam<const char*> {
 protected:
  // Per camera.
  static std::vector<LightFindings> found() {
    const recordings::Recording recording =
        recordings::read_recording(std::filesystem::path(HUETRACK_SHARED_DATA) / "rendered" / GetParam());
    std::vector<LightWatch> watches(recording.cameras.size());
    recordings::ReplaySource source(recording, recordings::names_in(recording), {.decoder_threads = 2});
    while (const auto frame = source.next({})) {
      LightWatch& watch = watches[std::size_t(frame->camera)];
      if (watch.is_wanted(frame->captured_at)) watch.look(frame->pixels, frame->captured_at);
    }
    std::vector<LightFindings> all;
    for (const LightWatch& watch : watches) all.push_back(watch.findings());
    return all;
  }
  static bool is_there() {
    return std::filesystem::exists(std::filesystem::path(HUETRACK_SHARED_DATA) / "rendered" / GetParam());
  }
};

class SharedWebcams : public SharedLight {};
TEST_P(SharedWebcams, HaveFlickerAndAutomaticExposure) {
  if (!is_there()) GTEST_SKIP();
  for (const LightFindings& camera : found()) {
    ASSERT_TRUE(camera.flicker);
    EXPECT_EQ(camera.flicker->light_hz, 100);
    EXPECT_TRUE(camera.exposure_change);
    EXPECT_FALSE(camera.balance_change);
  }
}
INSTANTIATE_TEST_SUITE_P(LightWatch, SharedWebcams, testing::Values("webcams"));

class SharedStillLight : public SharedLight {};
TEST_P(SharedStillLight, HasNoFinding) {
  if (!is_there()) GTEST_SKIP();
  for (const LightFindings& camera : found()) EXPECT_EQ(camera, LightFindings{});
}
INSTANTIATE_TEST_SUITE_P(LightWatch, SharedStillLight, testing::Values("occlusion", "bumped"));

}  // namespace
}  // namespace huetrack::capture
