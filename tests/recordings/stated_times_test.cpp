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

capture::Timestamp at_s(double s) {
  return capture::Timestamp{capture::duration_of(s)};
}

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

// As a program logs the clock's readings: late by 0 to 8 ms.
RecordedCamera measured(double hz, int rows, int every = 1) {
  RecordedCamera camera;
  camera.times_file = "t.csv";
  for (int k = 0; k < rows; ++k)
    camera.timestamps.emplace_back(k * every,
                                   capture::Timestamp{capture::duration_of(k * every / hz + 0.002 * ((k * 7) % 5))});
  return camera;
}

// A webcam's film has the rate that its program wrote into it, and a row for each of its pictures.
TEST(MeasuredTimes, AreRightWhereTheyListEveryPicture) {
  for (const double hz : {7.5, 15., 27., 60., 120.})
    for (const std::int64_t frames : {200, 190, 215}) {  // what was killed lacks some at the end
      const auto remark = remark_on_measured_rate(measured(hz, 200), at_30_hz, frames);
      ASSERT_TRUE(remark);
      EXPECT_FALSE(remark->is_mistake) << hz << ' ' << frames << ' ' << remark->text;
      EXPECT_THAT(remark->text, AllOf(HasSubstr("but the file itself 30 frames a second"), HasSubstr("are used")));
    }
  EXPECT_FALSE(remark_on_measured_rate(measured(30, 200), at_30_hz, 200));
  EXPECT_FALSE(remark_on_measured_rate(measured(30, 100, 2), at_30_hz, 200)) << "every second one, with its number";
  EXPECT_FALSE(remark_on_measured_rate(measured(30, 200), 0ns, 200)) << "pictures have no rate";
  EXPECT_FALSE(remark_on_measured_rate(listed(1 / 15.), at_30_hz, 200)) << "not measured: TimesBesideFilm";
}

TEST(EvenTimesOf, FilmsOfOneRateAndOfMeasuredTimes) {
  const auto hz = [](int dropped_at, double late_s, int every) {
    EvenTimes times;
    for (int k = 0; k < 60; ++k)
      times.see(k * every,
                at_s(std::round(1e3 * (k * every + (k >= dropped_at ? 1 : 0)) / 30.) / 1e3 + late_s * ((k * 7) % 5)));
    return times.hz();
  };
  EXPECT_NEAR(hz(1000, 0, 1), 30, 0.02) << "rounded to milliseconds";
  EXPECT_NEAR(hz(1000, 0, 3), 30, 0.02);
  EXPECT_EQ(hz(30, 0, 1), 0) << "a gap was measured";
  EXPECT_EQ(hz(1000, 0.001, 1), 0);
}

TEST(RoundedTimes, AreNamedWhereTheyAreUneven) {
  const auto rounded = [](double hz, double unit_s, double from_s) {
    RecordedCamera camera;
    for (int k = 0; k < 60; ++k)
      camera.timestamps.emplace_back(
          k, capture::Timestamp{capture::duration_of(from_s + std::round(k / hz / unit_s) * unit_s)});
    return remark_on_rounding(camera);
  };
  EXPECT_THAT(rounded(30, 0.01, 0.003).value_or(""),
              HasSubstr("rounded to 0.01 s, so positions are off by up to 5 mm"));
  EXPECT_THAT(rounded(7, 0.1, 0).value_or(""), HasSubstr("rounded to 0.1 s"));
  EXPECT_FALSE(rounded(30, 0.001, 0));
  EXPECT_FALSE(rounded(20, 0.01, 0)) << "even: every 50 ms";
}

// Every second picture was listed, and numbered 0, 1, 2; the table of a camera of another rate.
TEST(MeasuredTimes, ThatNumberOtherPicturesAreAMistake) {
  for (const int every : {2, 3, 4}) {
    const auto remark = remark_on_measured_rate(measured(30. / every, 300 / every), at_30_hz, 300);
    ASSERT_TRUE(remark);
    EXPECT_TRUE(remark->is_mistake) << every;
    EXPECT_THAT(remark->text,
                AllOf(HasSubstr("one of every " + std::to_string(every) + " frames"), HasSubstr("trust_times: true")));
  }
  const auto of_another = remark_on_measured_rate(measured(60, 600), at_30_hz, 300);
  ASSERT_TRUE(of_another);
  EXPECT_TRUE(of_another->is_mistake);
  EXPECT_THAT(of_another->text, HasSubstr("give the table of this film"));
}

RecordedCamera at_rate(double fps) {
  RecordedCamera camera;
  camera.fps = fps;
  return camera;
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

// A webcam that drops a frame at once: its clock varies by less than a millisecond, but was read.
TEST(TimesBesideFilm, AClockThatHardlyVariesWasMeasured) {
  for (const double unit_s : {1e-6, 1e-4}) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> jitter(-0.0004, 0.0004);
    RecordedCamera camera;
    camera.times_file = "t.csv";
    for (int k = 0; k < 60; ++k)
      camera.timestamps.emplace_back(
          k, at_s(1 + unit_s * std::round(((k < 3 ? k : k + 1) / 30. + jitter(random)) / unit_s)));
    TimesBesideFilm times(camera, at_30_hz);
    for (int k = 0; k < 60; ++k)
      times.see(k, camera.timestamps[std::size_t(k)].second, at_s(std::round(1e3 * k / 30.) / 1e3));
    times.end();
    EXPECT_THAT(times.take_problems(), IsEmpty()) << unit_s;
  }
}

// Row k of the table has the film's time of frame k + shift; the film drops frames, or its times were measured.
TEST(TimesBesideFilm, ATableThatIsARowOffIsNamed) {
  for (const bool drops_frames : {false, true})
    for (const int shift : {-1, 0, 1}) {
      const auto film_s = [&](int k) {
        return drops_frames ? (k < 50 ? k : k < 100 ? k + 2 : k + 3) / 30. : k / 30. + 0.004 * std::sin(1.7 * k);
      };
      RecordedCamera camera;
      camera.times_file = "t.csv";
      for (int k = 0; k < 150; ++k) camera.timestamps.emplace_back(k, at_s(film_s(k + shift)));
      TimesBesideFilm times(camera, at_30_hz);
      for (int k = 0; k < 150; ++k)
        times.see(k, camera.timestamps[std::size_t(k)].second, at_s(std::round(1e3 * film_s(k)) / 1e3));
      times.end();
      const auto problems = times.take_problems();
      if (shift == 0)
        EXPECT_THAT(problems, IsEmpty());
      else
        EXPECT_THAT(problems,
                    ElementsAre(AllOf(
                        HasSubstr(shift > 0 ? "t.csv gives every frame the time of the one after it"
                                            : "t.csv gives every frame the time of the one before it"),
                        HasSubstr(shift > 0 ? "is a row missing at its start?" : "a row too many at its start"))));
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

TEST(TimesBesideFilm, SmallDifferencesOfRatesAddUp) {
  const auto problems = [](double fps, double film_hz, double jitter_s) {
    TimesBesideFilm times(at_rate(fps), capture::duration_of(1 / film_hz));
    for (int k = 0; k < 300; ++k)
      times.see(k, at_s(k / fps), at_s(std::round(1e3 * (k / film_hz + jitter_s * ((k * 7) % 5))) / 1e3));
    return times.take_problems();
  };
  for (const double fps : {29.5, 29.85, 30.4})
    EXPECT_THAT(problems(fps, 30, 0), ElementsAre(HasSubstr("but the file itself 30 frames a second"))) << fps;
  EXPECT_THAT(problems(30, 30 / 1.001, 0), IsEmpty());
  EXPECT_THAT(problems(24, 24 / 1.001, 0), IsEmpty());
  EXPECT_THAT(problems(29.7, 30, 0.002), IsEmpty()) << "measured: the header's rate is nominal";
}

// A camera's clock, whose rate is not exactly that of the film's header; and one that dropped frames.
TEST(TimesBesideFilm, OfACamerasClockAreRightBesideAHeader) {
  for (const int dropped_at : {60, 1000}) {
    RecordedCamera camera;
    camera.times_file = "t.csv";
    for (int k = 0; k < 300; ++k)
      camera.timestamps.emplace_back(k, at_s((k < dropped_at ? k : k + 5) / 29.9 + 1e-4 * ((k * 7) % 5)));
    TimesBesideFilm times(camera, at_30_hz);
    for (int k = 0; k < 300; ++k) times.see(k, camera.timestamps[std::size_t(k)].second, at_s(k / 30.));
    EXPECT_THAT(times.take_problems(), IsEmpty());
  }
}

TEST(TimesBesideFilm, OfATableThatWasCountedAtAnotherRateContradictIt) {
  RecordedCamera camera;
  camera.times_file = "t.csv";
  for (int k = 0; k < 300; ++k) camera.timestamps.emplace_back(k, at_s(std::round(1e6 * k / 29.7) / 1e6));
  TimesBesideFilm times(camera, at_30_hz);
  for (int k = 0; k < 300; ++k) times.see(k, camera.timestamps[std::size_t(k)].second, at_s(k / 30.));
  EXPECT_THAT(times.take_problems(), ElementsAre(HasSubstr("t.csv says 29.7, but the file itself 30")));
}

// A table of 97 pictures at 30 Hz, of which the camera dropped three after 40.
RecordedCamera with_gap() {
  RecordedCamera camera;
  camera.times_file = "t.csv";
  for (int k = 0; k < 97; ++k) camera.timestamps.emplace_back(k, at_s((k < 40 ? k : k + 3) / 30.));
  return camera;
}

TEST(RowsOfATable, ThatLeaveOutFramesOfTheFilmAreNamed) {
  EXPECT_THAT(problem_of_rows(with_gap(), 100).value_or(""),
              AllOf(HasSubstr("t.csv has 97 rows"), HasSubstr("3 frames in its times, first before row 40"),
                    HasSubstr("trust_times: true")));
  EXPECT_FALSE(problem_of_rows(with_gap(), 97)) << "the film lacks them, too";
  EXPECT_FALSE(problem_of_rows(with_gap(), 105)) << "the table ends earlier";
  RecordedCamera numbered = with_gap();
  for (std::size_t k = 40; k < 97; ++k) numbered.timestamps[k].first += 3;
  EXPECT_FALSE(problem_of_rows(numbered, 100));
}

TEST(ListedTimes, OfATimecodeAreNamed) {
  const auto timecode = [](int fps, double unit_s, int count) {
    RecordedCamera camera;
    for (int k = 0; k < count; ++k) camera.timestamps.emplace_back(k, at_s(k / fps + unit_s * (k % fps)));
    return problem_of_timecode(camera);
  };
  EXPECT_THAT(timecode(30, 0.01, 150).value_or(""), HasSubstr("seconds and frames"));
  EXPECT_TRUE(timecode(25, 0.01, 100));
  EXPECT_FALSE(timecode(100, 0.01, 350)) << "even";
  EXPECT_FALSE(timecode(30, 0.01, 40)) << "one gap";
  EXPECT_FALSE(problem_of_timecode(listed(1 / 30.)));
  EXPECT_FALSE(problem_of_timecode(with_gap()));
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
