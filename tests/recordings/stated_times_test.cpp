#include "recordings/stated_times.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>
#include <set>

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

RecordedCamera at_rate(double fps) {
  RecordedCamera camera;
  camera.fps = fps;
  return camera;
}

capture::Timestamp at_s(double s) {
  return capture::Timestamp{capture::duration_of(s)};
}

// Files named by their pictures' numbers, without some; a glob counts them.
std::vector<ImageFile> files_without(const std::set<int>& missing, bool is_glob) {
  std::vector<ImageFile> files;
  for (int k = 0; k < 30; ++k)
    if (!missing.contains(k))
      files.push_back({is_glob ? static_cast<std::int64_t>(files.size()) : k, k, std::to_string(k) + ".jpg"});
  return files;
}

// A row for each file: at its number's time, or evenly.
RecordedCamera table_of(const std::vector<ImageFile>& files, bool has_gaps) {
  RecordedCamera camera;
  camera.times_file = "t.csv";
  for (const ImageFile& file : files) {
    const auto row = static_cast<std::int64_t>(camera.timestamps.size());
    camera.timestamps.emplace_back(row, at_s((has_gaps ? double(file.named) : double(row)) / 30));
  }
  return camera;
}

TEST(NumbersOfFiles, ThatAreMissingContradictEvenTimes) {
  for (const bool is_glob : {true, false}) {
    const auto files = files_without({9, 10, 20}, is_glob);
    const auto even = problem_of_numbers(table_of(files, false), files);
    ASSERT_TRUE(even);
    EXPECT_FALSE(even->counts_files);
    EXPECT_THAT(even->text, AllOf(HasSubstr("missing before 11.jpg"), HasSubstr("t.csv has a row for every file"),
                                  HasSubstr("trust_times: true")));
    const auto right = problem_of_numbers(table_of(files, true), files);
    EXPECT_EQ(right.has_value(), !is_glob);
    EXPECT_TRUE(is_glob || right->counts_files);
    EXPECT_FALSE(problem_of_numbers(table_of(files_without({}, is_glob), false), files_without({}, is_glob)));
    const auto by_rate = problem_of_numbers(at_rate(30), files);
    EXPECT_EQ(by_rate.has_value(), is_glob);
  }
}

// Dropped frames in the film's own stamps, and a table of measured times that does not know them.
TEST(TimesBesideFilm, AMeasuredTableWithoutTheFilmsGapsIsNamed) {
  for (const bool knows_gap : {false, true})
    for (const double jitter_s : {0.004, 0.015}) {
      std::mt19937_64 random(1);
      std::uniform_real_distribution<double> jitter(-jitter_s, jitter_s);
      RecordedCamera camera;
      camera.times_file = "t.csv";
      std::vector<double> film_s;
      for (int k = 0; k < 60; ++k) {
        film_s.push_back((k < 30 ? k : k + 2) / 30.);
        camera.timestamps.emplace_back(k, at_s(1 + (knows_gap ? film_s.back() : k / 30.) + jitter(random)));
      }
      TimesBesideFilm times(camera, at_30_hz);
      for (int k = 0; k < 60; ++k) times.see(k, camera.timestamps[std::size_t(k)].second, at_s(film_s[std::size_t(k)]));
      times.end();
      const auto problems = times.take_problems();
      EXPECT_EQ(problems.size(), knows_gap ? 0U : 1U) << jitter_s;
      for (const std::string& problem : problems) EXPECT_THAT(problem, HasSubstr("missing before frame 30"));
    }
}

TEST(TimesBesideFilm, AsTheFilmsAreRight) {
  for (const double fps : {30., 29.97, 30.3}) {
    TimesBesideFilm times(at_rate(fps), at_30_hz);
    for (int k = 0; k < 3000; ++k) {
      const auto late = k % 7 == 0 ? 10ms : 0ms;  // is made up for
      times.see(k, at_s(k / fps), capture::Timestamp{k * at_30_hz + late});
    }
    times.end();
    EXPECT_THAT(times.take_problems(), IsEmpty()) << fps;
  }
}

TEST(TimesBesideFilm, ContradictTheFilm) {
  TimesBesideFilm times(at_rate(25), at_30_hz);
  for (int k = 0; k < 30; ++k) times.see(k, at_s(k / 25.), capture::Timestamp{k * at_30_hz});
  EXPECT_THAT(times.take_problems(), ElementsAre(AllOf(HasSubstr("fps says 25, but the file itself 30 frames a second"),
                                                       HasSubstr("slow motion"), HasSubstr("trust_times: true"))));
}

TEST(TimesBesideFilm, ContradictAFilmThatLacksFrames) {
  for (const double fps : {30., 29.2})  // the second one: the header's average
    for (const int dropped : {1, 5}) {
      TimesBesideFilm times(at_rate(fps), capture::duration_of(1 / 29.2));
      for (int k = 0; k < 200; ++k)
        times.see(k, at_s(k / fps), capture::Timestamp{(k < 100 ? k : k + dropped) * at_30_hz});
      EXPECT_THAT(times.take_problems(),
                  ElementsAre(AllOf(HasSubstr(dropped == 1 ? "a frame is missing" : "5 frames are missing"),
                                    HasSubstr("before frame 100"), HasSubstr("trust_times: true"))));
    }
}

// 50 frames at this rate by a table and by the film, whose header says the latter. Measured times are late by 0 to 8
// ms.
std::vector<std::string> problems_of(double listed_hz, bool is_listed_measured, double film_hz, bool is_film_measured,
                                     int dropped_at = 1000) {
  const auto late_s = [](int k) { return 0.002 * ((k * 7) % 5); };
  RecordedCamera camera;
  camera.times_file = "t.csv";
  for (int k = 0; k < 50; ++k)
    camera.timestamps.emplace_back(k, at_s(k / listed_hz + (is_listed_measured ? late_s(k) : 0)));
  TimesBesideFilm times(camera, capture::duration_of(1 / film_hz));
  for (int k = 0; k < 50; ++k) {
    const double film_s = (k < dropped_at ? k : k + 1) / film_hz + (is_film_measured ? late_s(k + 3) : 0);
    times.see(k, camera.timestamps[std::size_t(k)].second, at_s(std::round(film_s * 1e3) / 1e3));  // as Matroska
  }
  times.end();
  return times.take_problems();
}

TEST(TimesBesideFilm, ThatWereMeasuredAreRightWhereAHeaderIsNot) {
  for (const double hz : {7.5, 15., 60., 120.}) EXPECT_THAT(problems_of(hz, true, 30, false), IsEmpty()) << hz;
  for (const bool is_film_measured : {false, true}) {
    EXPECT_THAT(problems_of(30, true, 30, is_film_measured), IsEmpty());
    EXPECT_THAT(problems_of(30, false, 30, is_film_measured), IsEmpty());
  }
}

TEST(TimesBesideFilm, OfATableContradictAFilmThatIsAsGoodOrBetter) {
  for (const double hz : {7.5, 15., 25., 60., 120.})
    for (const auto& [is_listed_measured, is_film_measured] : {std::pair{false, false}, {false, true}, {true, true}})
      EXPECT_THAT(problems_of(hz, is_listed_measured, 30, is_film_measured),
                  ElementsAre(AllOf(HasSubstr("t.csv says "), HasSubstr("leave timestamps out"),
                                    HasSubstr("trust_times: true"))))
          << hz;
}

TEST(TimesBesideFilm, OfAnEvenTableContradictAFilmThatLacksAFrame) {
  EXPECT_THAT(problems_of(30, false, 30, false, 20),
              ElementsAre(AllOf(HasSubstr("a frame is missing before frame 20"), HasSubstr("t.csv gives times"))));
}

}  // namespace
}  // namespace huetrack::recordings
