#include "recordings/order_watch.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <random>

#include "recordings/video_reader.h"

namespace huetrack::recordings {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// A bright disc on a circle, before noise.
capture::Image picture(double k, std::mt19937_64& random, double sigma = 3) {
  constexpr int width = 160, height = 120, radius = 8;
  const auto made = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, width, height);
  std::normal_distribution<double> noise(0, sigma);
  const double u0 = 80 + 50 * std::cos(k / 25), v0 = 60 + 40 * std::sin(k / 40);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      made.data[0][v * made.image.planes[0].stride + u] = static_cast<std::uint8_t>(
          std::clamp((std::hypot(u - u0, v - v0) < radius ? 180 : 70) + noise(random), 0., 255.));
  return made.image;
}

struct Series {
  std::function<std::string(int)> name;  // of picture k
  int pictures = 120;
  bool is_still = false;
};

// What is said of them in the order of their names.
std::optional<std::string> watched(const Series& series) {
  std::vector<std::pair<std::filesystem::path, int>> files;
  for (int k = 0; k < series.pictures; ++k) files.emplace_back(series.name(k), k);
  std::ranges::sort(files);  // the names below have zeros in front
  std::vector<std::filesystem::path> names;
  for (const auto& [name, k] : files) names.push_back(name);
  OrderWatch watch(names);
  std::mt19937_64 random(1);
  for (std::size_t i = 0; i < files.size(); ++i) watch.see(i, picture(series.is_still ? 0 : files[i].second, random));
  return watch.problem();
}

template <typename... Numbers>
std::string printed(const char* format, Numbers... numbers) {
  char text[64];
  std::snprintf(text, sizeof(text), format, numbers...);
  return text;
}

TEST(OrderWatch, NamesTheNumberThatShouldLead) {
  EXPECT_THAT(watched({.name = [](int k) { return printed("frame_%d_%02d.png", k % 10, k / 10); }}),
              testing::Optional(AllOf(HasSubstr("frame_0_00.png, frame_1_00.png, frame_2_00.png, ... instead of "
                                                "frame_0_00.png, frame_0_01.png, frame_0_02.png"))));
  EXPECT_TRUE(watched({.name = [](int k) { return printed("f%d_%03d.png", k % 2, k / 2); }}));
  EXPECT_TRUE(watched({.name = [](int k) { return printed("f%d-%d-%d.png", k % 10, k / 10 % 10, k / 100); }}));
}

TEST(OrderWatch, NamesNoRightOrder) {
  EXPECT_FALSE(watched({.name = [](int k) { return printed("f%03d.png", k); }}));
  EXPECT_FALSE(watched({.name = [](int k) { return printed("s%02d_f%02d.png", k / 30, k % 30); }}));
  EXPECT_FALSE(watched({.name = [](int k) { return printed("2026-11-28_16-%02d-%02d.png", k / 60, k % 60); }}));
  EXPECT_FALSE(watched({.name = [](int k) { return printed("frame_%d_%02d.png", k % 10, k / 10); }, .is_still = true}));
}

TEST(OrderWatch, NamesASeam) {
  EXPECT_THAT(watched({.name = [](int k) { return printed("f%03d.png", (k + 40) % 120); }}),
              testing::Optional(AllOf(HasSubstr("jump from f039.png to f040.png"), HasSubstr("begins at f040.png"))));
  EXPECT_THAT(watched({.name = [](int k) { return printed("f%03d.png", (k + 200) % 256); }}),
              testing::Optional(HasSubstr("begins at f200.png")));
}

TEST(OrderWatch, PicturesThatAreLeftOutAreNotCompared) {
  OrderWatch watch({"a.png", "b.png", "c.png"});
  std::mt19937_64 random(1);
  watch.see(0, picture(0, random)), watch.see(2, picture(60, random));
  EXPECT_FALSE(watch.problem());
}

// Distances grow with the way of an object, beyond its size, too.
TEST(OrderWatch, MeasuresHowFarThingsMove) {
  std::mt19937_64 random(1);
  const Blocks start = blocks_of(picture(0, random));
  double before = 0;
  for (const int k : {2, 5, 10, 20, 40}) {
    const double moved = moved_between(start, blocks_of(picture(k, random)));
    EXPECT_GT(moved, 1.3 * before) << k;
    before = moved;
  }
  EXPECT_EQ(moved_between(start, blocks_of(picture(0, random))), 0);
}

// Every film as a series of files in the right order, and one that begins in its middle.
TEST(OrderWatch, NamesNoFilmBesideTheProject) {
  const std::filesystem::path data = HUETRACK_SHARED_DATA;
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  constexpr int pictures = 120;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data / "rendered")) {
    if (entry.path().extension() != ".mkv") continue;
    RecordedCamera camera;
    camera.name = "cam";
    camera.frames = entry.path();
    std::vector<std::string> warnings;
    VideoReader reader(camera, 1, warnings);
    std::vector<std::filesystem::path> by_two, by_one;
    for (int k = 0; k < pictures; ++k) {
      by_two.emplace_back(printed("%02d_%02d.png", k / 10, k % 10));
      by_one.emplace_back(printed("%03d.png", k));
    }
    OrderWatch right(by_two), rotated(by_one);
    std::vector<capture::Image> first;
    for (int k = 0; k < pictures; ++k) {
      const auto shown = reader.next();
      if (!shown) break;
      right.see(std::size_t(k), shown->image);
      if (k < pictures / 3)
        first.push_back(shown->image);
      else
        rotated.see(std::size_t(k - pictures / 3), shown->image);
    }
    for (int k = 0; k < pictures / 3; ++k) rotated.see(std::size_t(pictures * 2 / 3 + k), first[std::size_t(k)]);
    std::printf("  %s: begun in its middle %s\n", std::filesystem::relative(entry.path(), data).c_str(),
                rotated.problem() ? "named" : "not named");
    EXPECT_FALSE(right.problem()) << entry.path() << *right.problem();
  }
}

}  // namespace
}  // namespace huetrack::recordings
