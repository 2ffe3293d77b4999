// Films whose frame rate was converted, pictures that are exchanged, and times of arrival are named by the path of the
// target; films as they were taken are not, whatever the target does.
#include "view_watch/path_times.h"
#include "drawn.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace huetrack::view_watch {
namespace {

using PathOf = std::function<Eigen::Vector2d(double)>;  // pixels at a time
using Times = std::function<double(int)>;               // seconds, of a picture
constexpr double noise_px = 0.1;

// A film of `count` pictures that were taken at `taken` and have the stamps `stamped`.
std::optional<Mistake> judged(const PathOf& path, const Times& taken, const Times& stamped, int count = 150) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, noise_px);
  PathTimes times;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector2d px = path(taken(k)) + drawn<2>(random, noise);
    times.see({.number = k, .stamp_s = stamped(k), .t_s = stamped(k), .px = px, .sigma_px = 0.3, .is_target = true});
    if (auto mistake = times.judge(1)) return mistake;
  }
  return std::nullopt;
}

Eigen::Vector2d waving(double t) {
  return {160 + 80 * std::sin(2.2 * t), 120 + 60 * std::cos(1.7 * t)};
}

// A ball that falls from the same height again and again, 6 px a frame at most.
Eigen::Vector2d bounced(double t) {
  const double since = std::fmod(t, 0.7) - 0.35;
  return {20 + 40 * t, 220 - 120 * (1 - since * since / (0.35 * 0.35))};
}

// Along a line, three times a second, as a hand shakes a ball.
Eigen::Vector2d shaken(double t) {
  return {160 + 40 * std::sin(2 * std::numbers::pi * 3 * t), 120};
}

Times evenly(double hz) {
  return [=](int k) { return k / hz; };
}

// A film of `source` pictures a second as one of `shown`, of which each shows the picture that was there last.
Times converted(double source, double shown) {
  return [=](int k) { return std::floor(k * source / shown + 0.3) / source; };
}

class FilmOf : public testing::TestWithParam<std::pair<double, double>> {};

TEST_P(FilmOf, AnotherRateIsNamed) {
  const auto [source, shown] = GetParam();
  const auto mistake = judged(waving, converted(source, shown), evenly(shown), int(6 * shown));
  ASSERT_TRUE(mistake);
  EXPECT_EQ(mistake->kind, MistakeKind::converted);
  EXPECT_EQ(mistake->cameras, std::vector{1});
  EXPECT_NEAR(mistake->source_hz, source, 0.04 * source);
  EXPECT_NEAR(mistake->shown_hz, shown, 1e-6);
  EXPECT_NEAR(mistake->size, 1 / source / std::sqrt(12), 0.3 / source);
}

INSTANTIATE_TEST_SUITE_P(PathTimes, FilmOf,
                         testing::Values(std::pair{30., 60.}, std::pair{30., 50.}, std::pair{30., 36.},
                                         std::pair{24., 30.}, std::pair{25., 30.}, std::pair{30., 24.},
                                         std::pair{30., 25.}, std::pair{30., 20.}, std::pair{60., 25.},
                                         std::pair{15., 30.}, std::pair{30., 120.}));

TEST(PathTimes, FilmsAsTheyWereTakenAreNotNamed) {
  for (const auto& [name, path] : {std::pair("waving", PathOf(waving)), {"bounced", bounced}, {"shaken", shaken}})
    for (const double hz : {15., 25., 30., 60., 120.}) {
      const auto mistake = judged(path, evenly(hz), evenly(hz), int(6 * hz));
      EXPECT_FALSE(mistake) << name << ' ' << hz << ' ' << int(mistake->kind) << ' ' << mistake->source_hz;
    }
}

TEST(PathTimes, EveryOtherPictureOfAFilmIsRight) {
  EXPECT_FALSE(judged(waving, converted(60, 30), evenly(30)));
  EXPECT_FALSE(judged(waving, converted(30, 15), evenly(15)));
}

TEST(PathTimes, ExchangedPicturesAreNamed) {
  const auto mistake = judged(
      waving, [](int k) { return (k ^ 1) / 30.; }, evenly(30));
  ASSERT_TRUE(mistake);
  EXPECT_EQ(mistake->kind, MistakeKind::exchanged);
}

double arrival_delay_s(int k) {  // 0 to 30 ms
  return 0.03 * std::fmod(k * 0.61803398875, 1);
}

TEST(PathTimes, TimesOfArrivalAreNamed) {
  const auto mistake = judged(waving, evenly(30), [](int k) { return k / 30. + arrival_delay_s(k); });
  ASSERT_TRUE(mistake);
  EXPECT_EQ(mistake->kind, MistakeKind::delayed);
  EXPECT_NEAR(mistake->size, 0.03 / std::sqrt(12), 0.002);
  EXPECT_NEAR(mistake->shown_hz, 30, 0.3);
}

// Every eighth picture arrives late.
TEST(PathTimes, SomeLateStampsAreNamed) {
  const auto mistake = judged(waving, evenly(30), [](int k) { return k / 30. + (k % 8 == 0 ? 0.025 : 0); });
  ASSERT_TRUE(mistake);
  EXPECT_EQ(mistake->kind, MistakeKind::delayed);
}

// A camera that really takes its pictures at uneven times.
TEST(PathTimes, MeasuredTimesAreNotNamed) {
  const Times uneven = [](int k) { return k / 30. + arrival_delay_s(k); };
  EXPECT_FALSE(judged(waving, uneven, uneven));
}

TEST(PathTimes, JitterOfAMillisecondIsNotNamed) {
  EXPECT_FALSE(judged(waving, evenly(30), [](int k) { return k / 30. + 0.1 * arrival_delay_s(k); }));
}

TEST(PathTimes, NothingIsNamedOfATargetAtRest) {
  const PathOf at_rest = [](double) { return Eigen::Vector2d(160, 120); };
  EXPECT_FALSE(judged(at_rest, evenly(30), evenly(30)));
  EXPECT_FALSE(judged(at_rest, converted(30, 60), evenly(60)));
}

}  // namespace
}  // namespace huetrack::view_watch
