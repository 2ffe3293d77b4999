#include "recordings/stated_times.h"

#include <gmock/gmock.h>

namespace huetrack::recordings {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr capture::Duration at_30_hz = 33'333'333ns;

// Of every n-th frame. unit: of the column's name, as an index of files::time_units.
RecordedCamera listed(double seconds_a_frame, std::size_t unit = 0, std::int64_t every = 1) {
  RecordedCamera camera;
  camera.times_unit = unit;
  for (std::int64_t k = 0; k < 20; ++k)
    camera.timestamps.emplace_back(
        k * every, capture::Timestamp{capture::duration_of(seconds_a_frame * static_cast<double>(k * every))});
  return camera;
}

TEST(ListedTimes, MayHaveAnotherRateThanTheFilesHeader) {
  for (const double hz : {7.5, 15., 30., 60., 120.})
    EXPECT_FALSE(problem_of_listed_times(listed(1 / hz), at_30_hz)) << hz;
  EXPECT_FALSE(problem_of_listed_times(listed(1 / 30., 0, 10), at_30_hz)) << "every tenth frame is listed";
  EXPECT_FALSE(problem_of_listed_times(listed(1 / 30., 1), at_30_hz));
  EXPECT_FALSE(problem_of_listed_times(RecordedCamera{}, at_30_hz));
}

TEST(ListedTimes, InAnotherUnitAreNamed) {
  struct Case {
    double s;  // what is read as seconds, of a frame at 30 Hz
    std::string unit;
  };
  for (const Case& c :
       {Case{33.33, "milliseconds: name the column t_ms"}, Case{33333, "microseconds: name the column t_us"},
        Case{3.3e7, "nanoseconds: name the column t_ns"}, Case{3.3e5, "ticks of 100 ns: convert"},
        Case{3000, "ticks of 90 kHz: convert"}, Case{1 / 1800., "minutes: convert them to seconds"},
        Case{1 / 108'000., "hours: convert"}, Case{1 / 2'592'000., "days: convert"},
        Case{1, "the frames' numbers: give fps"}})
    for (const auto period : {at_30_hz, capture::Duration(0), at_30_hz * 2}) {
      const auto problem = problem_of_listed_times(listed(c.s), period);
      ASSERT_TRUE(problem) << c.s;
      EXPECT_TRUE(problem->is_of_unit) << problem->text;
      EXPECT_THAT(problem->text, AllOf(HasSubstr("look like " + c.unit), HasSubstr("trust_times: true")));
    }
  const auto seconds_as_ms = problem_of_listed_times(listed(at_30_hz.count() / 1e12, 1), at_30_hz);
  ASSERT_TRUE(seconds_as_ms);
  EXPECT_THAT(seconds_as_ms->text, HasSubstr("if they are milliseconds, but the file itself says 0.03333 s: they look "
                                             "like seconds: name the column t_s"));
}

TEST(ListedTimes, ThatNoUnitExplainsMayBeRight) {
  const auto slow_motion = problem_of_listed_times(listed(1 / 240.), at_30_hz);
  ASSERT_TRUE(slow_motion);
  EXPECT_FALSE(slow_motion->is_of_unit);
  const auto of_images = problem_of_listed_times(listed(5), 0ns);
  ASSERT_TRUE(of_images);
  EXPECT_THAT(of_images->text, HasSubstr("1 to 1000 pictures a second"));
}

TEST(GivenRate, AsTheFilesIsRight) {
  for (const double fps : {30., 29.97, 30.3}) {
    GivenRate rate(fps, at_30_hz);
    for (int k = 0; k < 3000; ++k) {
      const auto late = k % 7 == 0 ? 10ms : 0ms;  // is made up for
      rate.see(k, capture::Timestamp{k * at_30_hz + late});
    }
    EXPECT_THAT(rate.take_problems(), IsEmpty()) << fps;
  }
}

TEST(GivenRate, ContradictsTheFile) {
  GivenRate rate(25, at_30_hz);
  for (int k = 0; k < 30; ++k) rate.see(k, capture::Timestamp{k * at_30_hz});
  EXPECT_THAT(rate.take_problems(), ElementsAre(AllOf(HasSubstr("fps says 25, but the file itself 30 frames a second"),
                                                      HasSubstr("slow motion"), HasSubstr("trust_times: true"))));
}

TEST(GivenRate, ContradictsAFileThatLacksFrames) {
  for (const double fps : {30., 29.2})  // the second one: the header's average
    for (const int dropped : {1, 5}) {
      GivenRate rate(fps, capture::duration_of(1 / 29.2));
      for (int k = 0; k < 200; ++k) rate.see(k, capture::Timestamp{(k < 100 ? k : k + dropped) * at_30_hz});
      EXPECT_THAT(rate.take_problems(),
                  ElementsAre(AllOf(HasSubstr(dropped == 1 ? "a frame is missing" : "5 frames are missing"),
                                    HasSubstr("before frame 100"), HasSubstr("trust_times: true"))));
    }
}

}  // namespace
}  // namespace huetrack::recordings
