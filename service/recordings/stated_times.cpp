#include "recordings/stated_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>

#include "calib/files/csv_table.h"
#include "calib/files/median.h"

namespace huetrack::recordings {
namespace {

constexpr std::string_view how_to_confirm = "trust_times: true";
constexpr std::string_view leave_out = "leave";

struct TimeUnit {
  std::string_view name;
  double s;
};
// Those that cameras, spreadsheets (days) and programs write times in.
constexpr std::array<TimeUnit, 9> time_units{{{"nanoseconds", 1e-9},
                                              {"ticks of 100 ns", 1e-7},
                                              {"microseconds", 1e-6},
                                              {"ticks of 90 kHz", 1. / 90'000},
                                              {"milliseconds", 1e-3},
                                              {"seconds", 1},
                                              {"minutes", 60},
                                              {"hours", 3600},
                                              {"days", 86'400}}};

struct ListedTimesTuning {
  // A camera's rate beside the one that its file's header says, as a factor: webcams write 30 fps into it, and have 7.5
  // in the dark.
  double other_rate = 5;
  // Of a unit that explains the times: half of the way (of the exponent) between the two units that are nearest to each
  // other.
  double fits = 3.2;
  double usual_period_s = 1. / 30;  // where the file has no rate
  // Without one: slower than once a second nothing is tracked, and cameras take up to 960 pictures a second.
  double longest_period_s = 1, shortest_period_s = 1e-3;
};
constexpr ListedTimesTuning listed_times{};

struct FilmTimesTuning {
  std::int64_t enough = 4;  // pictures, for a rate by their stamps
  double slack = 0.02;      // of a rate by few pictures, or whose stamps vary
  // Of a rate by many pictures with even stamps: half as much again as 29.97 differs from 30.
  double even_slack = 0.0015;
  double jitter_s = 1e-4;   // of a camera's clock, at least: steps that are more alike were counted, not measured
  double gap = 0.9;         // usual steps: a picture is missing
  std::size_t window = 16;  // pictures, in which a late stamp is made up for
  // Matroska and tables with three decimals round to the millisecond: steps between even times vary by as much.
  double rounding_s = 1.001e-3;
  double varying = 0.1;  // of the steps: fewer are those at dropped frames
  // A table's steps differ from the film's by at most this share of what they do as it is numbered. Noise leaves 1.
  double of_other_row = 0.5;
};
constexpr FilmTimesTuning film_times{};

using files::median;

// Times from one frame of the stream to the next, listed ones.
std::vector<double> listed_steps_s(const RecordedCamera& camera) {
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < camera.timestamps.size(); ++k) {
    const auto &before = camera.timestamps[k - 1], &row = camera.timestamps[k];
    steps_s.push_back(capture::seconds(row.second - before.second) / static_cast<double>(row.first - before.first));
  }
  return steps_s;
}

// Usual one: the median, which is robust to gaps. 0: one row only.
double seconds_a_frame(const RecordedCamera& camera) {
  auto steps_s = listed_steps_s(camera);
  return steps_s.empty() ? 0 : median(std::move(steps_s));
}

// A clock's readings at pictures, not multiples of a period.
bool do_vary(const std::vector<double>& steps_s, double rounding_s = film_times.rounding_s) {
  if (steps_s.empty()) return false;
  const double usual_s = median(steps_s);
  const auto others = std::ranges::count_if(steps_s, [&](double s) { return std::abs(s - usual_s) > rounding_s; });
  return static_cast<double>(others) > film_times.varying * static_cast<double>(steps_s.size());
}

// Listed times that vary by more than they are rounded to.
bool were_measured(const RecordedCamera& camera) {
  std::int64_t unit_ns = 0;  // all are multiples of it
  for (const auto& row : camera.timestamps)
    unit_ns = std::gcd(unit_ns, std::chrono::nanoseconds(row.second - camera.timestamps.front().second).count());
  return do_vary(listed_steps_s(camera),
                 std::clamp(1.001e-9 * double(unit_ns), film_times.jitter_s, film_times.rounding_s));
}

// Multiples of a period, with no gap.
bool are_counted(const std::vector<double>& steps_s) {
  if (steps_s.empty()) return true;
  const auto [least, most] = std::ranges::minmax(steps_s);
  return most - least < film_times.jitter_s;
}

double factor_between(double a, double b) {
  return std::max(a / b, b / a);
}

// "name the column t_ms", or what else gives seconds.
std::string remedy(const TimeUnit& unit) {
  const auto known = std::ranges::find(files::time_unit_names, unit.name);
  if (known == files::time_unit_names.end()) return "convert them to seconds";
  return fmt::format("name the column t_{}",
                     files::time_units[static_cast<std::size_t>(known - files::time_unit_names.begin())]);
}

}  // namespace

std::optional<TimesProblem> problem_of_listed_times(const RecordedCamera& camera, capture::Duration file_period) {
  const double listed_s = seconds_a_frame(camera), file_s = capture::seconds(file_period);
  const bool has_rate = file_s > 0;
  if (!(listed_s > 0)) return std::nullopt;
  if (has_rate ? factor_between(listed_s, file_s) < listed_times.other_rate
               : listed_s < listed_times.longest_period_s && listed_s >= listed_times.shortest_period_s)
    return std::nullopt;

  const std::string_view own = files::time_unit_names[camera.times_unit];
  const double own_s = std::ranges::find(time_units, own, &TimeUnit::name)->s;
  TimesProblem problem{.text = fmt::format("its times are {:.4g} s a frame, if they are {}, but ", listed_s, own)};
  problem.text += has_rate ? fmt::format("the file itself says {:.4g} s", file_s)
                           : std::string("cameras take 1 to 1000 pictures a second");
  const std::string or_confirm = fmt::format("; if they are right (slow motion), add {}", how_to_confirm);
  if (std::abs(listed_s / own_s - 1) < 1e-6) {
    problem.is_of_unit = true;
    problem.text += ": they look like the frames' numbers: give fps instead of timestamps" + or_confirm;
    return problem;
  }
  const double expected_s = has_rate ? file_s : listed_times.usual_period_s;
  const auto by_unit = [&](const TimeUnit& unit) { return factor_between(listed_s * unit.s / own_s, expected_s); };
  const TimeUnit& nearest = *std::ranges::min_element(time_units, {}, by_unit);
  const double then_s = listed_s * nearest.s / own_s;
  problem.is_of_unit = nearest.name != own &&
                       (has_rate ? by_unit(nearest) <= listed_times.fits
                                 : then_s < listed_times.longest_period_s && then_s >= listed_times.shortest_period_s);
  problem.text += problem.is_of_unit ? fmt::format(": they look like {}: {}", nearest.name, remedy(nearest))
                                     : std::string(": correct them, or leave timestamps out");
  problem.text += or_confirm;
  return problem;
}

std::optional<std::string> problem_of_rows(const RecordedCamera& camera, std::int64_t film_frames) {
  const auto& rows = camera.timestamps;
  const auto count = static_cast<std::int64_t>(rows.size());
  if (rows.front().first != 0 || rows.back().first != count - 1 || film_frames <= count) return std::nullopt;
  const double usual_s = seconds_a_frame(camera);
  std::int64_t missing = 0, first = 0;
  for (std::size_t k = 1; k < rows.size(); ++k) {
    const auto steps = std::lround(capture::seconds(rows[k].second - rows[k - 1].second) / usual_s);
    if (steps > 1 && missing == 0) first = static_cast<std::int64_t>(k);
    missing += std::max(0L, steps - 1);
  }
  if (missing == 0 || missing != film_frames - count) return std::nullopt;
  return fmt::format(
      "{} has {} rows, and leaves out {} in its times, first before row {}; the film has {} frames, which is as many "
      "as with those: from there on, rows stand for other frames: number the rows by the film's frames; if they are "
      "right, add {}",
      camera.times_file.filename().string(), count, missing == 1 ? "a frame" : fmt::format("{} frames", missing), first,
      film_frames, how_to_confirm);
}

std::optional<std::string> problem_of_timecode(const RecordedCamera& camera) {
  using namespace std::chrono_literals;
  const auto& rows = camera.timestamps;
  std::size_t seconds = 0;
  for (const capture::Duration unit : {capture::Duration(100ms), capture::Duration(10ms), capture::Duration(1ms)}) {
    seconds = 0;
    const bool is_timecode = std::ranges::all_of(rows.begin() + 1, rows.end(), [&](const auto& row) {
      const auto at = row.second.time_since_epoch(), before = (&row - 1)->second.time_since_epoch();
      if (at - before == unit * (row.first - (&row - 1)->first)) return true;
      ++seconds;
      return at % 1s == 0s && at - before < 1s;
    });
    if (is_timecode && seconds >= 2) break;
    seconds = 0;
  }
  if (seconds == 0) return std::nullopt;
  return fmt::format(
      "its times look like seconds and frames (timecode), since every {} rows they go on at a full second: give fps "
      "instead of timestamps, or write them as seconds; if they are right, add {}",
      rows.size() / seconds, how_to_confirm);
}

std::optional<RateRemark> remark_on_measured_rate(const RecordedCamera& camera, capture::Duration film_period,
                                                  std::optional<std::int64_t> film_frames) {
  const double film_s = capture::seconds(film_period);
  if (!(film_s > 0) || !were_measured(camera)) return std::nullopt;
  const auto& [first, first_at] = camera.timestamps.front();
  const auto& [last, last_at] = camera.timestamps.back();
  const double listed_s = capture::seconds(last_at - first_at) / static_cast<double>(last - first);
  const std::string name = camera.times_file.filename().string();
  const double ratio = listed_s / film_s;  // listed frames in the time of one
  if (std::abs(ratio - 1) < film_times.slack) return std::nullopt;
  const std::string rates =
      fmt::format("{} says {:.4g}, but the file itself {:.4g} frames a second", name, 1 / listed_s, 1 / film_s);
  const double listed = static_cast<double>(camera.timestamps.back().first + 1);
  // Which is nearer, by factors: a row for every frame, or the length of the film?
  const double missing = film_frames ? std::log(static_cast<double>(*film_frames) / listed) / std::log(ratio) : 0;
  const bool is_a_multiple = std::lround(std::max(ratio, 1 / ratio)) >= 2;
  if (is_a_multiple && missing > 0.5)
    return RateRemark{
        fmt::format("{}, and numbers {:.0f} frames of its {}, which last as long: its numbers are not those of the "
                    "film's frames, so the times are wrong: {}; if the numbers are right, add {}",
                    rates, listed, *film_frames,
                    ratio > 1 ? fmt::format("if it lists one of every {} frames, number them so", std::lround(ratio))
                              : std::string("give the table of this film"),
                    how_to_confirm),
        true};
  return RateRemark{fmt::format("{}: {}'s times vary, as measured ones do, and are used", rates, name)};
}

void EvenTimes::see(std::int64_t index, capture::Timestamp at) {
  if (pictures_++ == 0) {
    first_ = index, first_at_ = at;
  } else {
    const double step_s = capture::seconds(at - last_at_) / static_cast<double>(index - last_);
    shortest_s_ = pictures_ == 2 ? step_s : std::min(shortest_s_, step_s);
    longest_s_ = std::max(longest_s_, step_s);
  }
  last_ = index, last_at_ = at;
}

double EvenTimes::hz() const {
  if (pictures_ <= film_times.enough || longest_s_ - shortest_s_ > film_times.rounding_s) return 0;
  return static_cast<double>(last_ - first_) / capture::seconds(last_at_ - first_at_);
}

std::optional<std::string> remark_on_rounding(const RecordedCamera& camera) {
  using namespace std::chrono_literals;
  if (!were_measured(camera)) return std::nullopt;
  for (const capture::Duration unit : {capture::Duration(1s), capture::Duration(100ms), capture::Duration(10ms)}) {
    const auto is_multiple = [&](const auto& row) {
      return (row.second - camera.timestamps.front().second) % unit == capture::Duration::zero();
    };
    if (!std::ranges::all_of(camera.timestamps, is_multiple)) continue;
    return fmt::format(
        "its times are rounded to {:.3g} s, so positions are off by up to {:.0f} mm at 1 m/s: write them with three "
        "decimals or more",
        capture::seconds(unit), 500 * capture::seconds(unit));
  }
  return std::nullopt;
}

namespace {

// Whether the times of two rows, k-1 and k, are further apart than usual.
bool is_gap(const RecordedCamera& camera, std::size_t row, double usual_s) {
  constexpr double between_one_and_two = 1.5;  // steps
  const auto& rows = camera.timestamps;
  return capture::seconds(rows[row].second - rows[row - 1].second) > between_one_and_two * usual_s;
}

}  // namespace

std::optional<NumbersProblem> problem_of_numbers(const RecordedCamera& camera, std::span<const ImageFile> files) {
  std::vector<std::size_t> gaps;  // files after one
  for (std::size_t k = 1; k < files.size(); ++k)
    if (files[k].named > files[k - 1].named + 1) gaps.push_back(k);
  const bool are_counted = !files.empty() && files.back().number == static_cast<std::int64_t>(files.size()) - 1;
  if (gaps.empty() || (camera.timestamps.empty() && !are_counted)) return std::nullopt;
  const std::string before = files[gaps.front()].path.filename().string();
  if (camera.timestamps.empty())
    return NumbersProblem{
        fmt::format("numbers are missing before {}, but a glob counts files: if pictures are missing there, times from "
                    "there on are too early: give a pattern, like img%d.jpg; if none is missing, add {}",
                    before, how_to_confirm)};
  const auto& rows = camera.timestamps;
  const bool has_a_row_a_file = rows.size() == files.size() && rows.front().first == 0 &&
                                rows.back().first == static_cast<std::int64_t>(files.size()) - 1;
  if (!has_a_row_a_file && !are_counted) return std::nullopt;
  const double usual_s = seconds_a_frame(camera);
  const bool has_gaps = std::ranges::all_of(gaps, [&](std::size_t k) { return is_gap(camera, k, usual_s); });
  const std::string name = camera.times_file.filename().string();
  if (!has_a_row_a_file)
    return NumbersProblem{
        fmt::format("numbers are missing before {}, but a glob counts files, and {} has {} rows for {} files: give a "
                    "pattern, like img%d.jpg; if the rows are right, add {}",
                    before, name, rows.size(), files.size(), how_to_confirm)};
  if (has_gaps && are_counted) return std::nullopt;
  if (has_gaps)
    return NumbersProblem{fmt::format("{} has a row for every file, and longer steps where numbers are missing (first "
                                      "before {}): its rows are taken for the files in their order",
                                      name, before),
                          true};
  return NumbersProblem{
      fmt::format("numbers are missing before {}, but {} has a row for every file, and goes on evenly there: if "
                  "pictures are missing, its times are too early from there on; if none is missing, add {}",
                  before, name, how_to_confirm)};
}

TimesBesideFilm::TimesBesideFilm(const RecordedCamera& camera, capture::Duration film_period)
    : name_(camera.fps > 0 ? "fps" : camera.times_file.filename().string()),
      key_(camera.fps > 0 ? "fps" : "timestamps"),
      is_measured_(were_measured(camera)),
      is_counted_(are_counted(listed_steps_s(camera))),
      stated_period_s_(camera.fps > 0 ? 1 / camera.fps : seconds_a_frame(camera)),
      film_period_s_(capture::seconds(film_period)) {}

void TimesBesideFilm::see(std::int64_t index, capture::Timestamp stated, capture::Timestamp stamp) {
  const Seen picture{index, capture::seconds(stated.time_since_epoch()), capture::seconds(stamp.time_since_epoch())};
  if (!first_) first_ = picture;
  if (!recent_.empty()) {
    const Seen& before = recent_.back();
    const auto frames = static_cast<double>(index - before.index);
    film_steps_s_.push_back((picture.film_s - before.film_s) / frames);
    stated_steps_s_.push_back((picture.stated_s - before.stated_s) / frames);
  }
  recent_.push_back(picture);
  if (recent_.size() > film_times.window) recent_.pop_front();
  if (is_measured_) {  // the rate of a film that is not measured is nominal, but its gaps are dropped frames
    look_for_gap_beside_measured();
    return;
  }
  if (!has_compared_ && index - first_->index >= film_times.enough) compare_rates(picture);
  look_for_gap();
  compare_lengths(picture);
}

void TimesBesideFilm::end() {
  if (!has_compared_ && do_vary(film_steps_s_)) compare_rates(recent_.back());
  compare_rows();
}

// Steps that vary in the film and in the table, and are alike one row further.
void TimesBesideFilm::compare_rows() {
  const std::size_t steps = film_steps_s_.size();
  if (key_ == "fps" || steps < film_times.window) return;
  const auto difference_s = [&](std::size_t stated, std::size_t film) {
    double squares = 0;
    for (std::size_t k = 0; k + 1 < steps; ++k)
      squares += std::pow(stated_steps_s_[k + stated] - film_steps_s_[k + film], 2);
    return std::sqrt(squares / static_cast<double>(steps - 1));
  };
  const double as_is_s = difference_s(0, 0), missing_s = difference_s(0, 1), additional_s = difference_s(1, 0);
  if (as_is_s < 2 * film_times.rounding_s) return;
  if (std::min(missing_s, additional_s) > film_times.of_other_row * as_is_s) return;
  const bool is_missing = missing_s < additional_s;
  problems_.push_back(fmt::format(
      "{0} gives every frame the time of the one {1} it by the film's own time stamps ({2}): correct its numbers, or "
      "leave timestamps out to use the file's time stamps; if the table is right, add {3}",
      name_, is_missing ? "after" : "before",
      is_missing ? "is a row missing at its start?" : "has it a row too many at its start (a header that was counted)?",
      how_to_confirm));
}

// What a person stated is wrong more often than a film; but it may be intended, for slow motion.
void TimesBesideFilm::compare_rates(const Seen& picture) {
  has_compared_ = true;
  const auto count = static_cast<double>(picture.index - first_->index);
  const double stated_s = (picture.stated_s - first_->stated_s) / count;
  const double film_s = (picture.film_s - first_->film_s) / count;
  // Some headers count empty chunks, and stamps may have a gap: both must contradict.
  const auto contradicts = [&](double s) { return std::abs(s / stated_s - 1) >= film_times.slack; };
  if (!contradicts(film_s) || (film_period_s_ > 0 && !contradicts(film_period_s_))) return;
  report_rate(stated_s, film_s, leave_out);
}

// Small differences of rates add up: two even clocks must not be further apart than rounding explains.
void TimesBesideFilm::compare_lengths(const Seen& picture) {
  const double stated_s = picture.stated_s - first_->stated_s, film_s = picture.film_s - first_->film_s;
  const auto contradicts = [](double a_s, double b_s, double rounding_s) {
    return std::abs(a_s - b_s) > film_times.even_slack * b_s + 2 * rounding_s;
  };
  if (has_problem_ || !is_counted_ || film_steps_s_.size() < film_times.window) return;
  if (!contradicts(stated_s, film_s, film_times.rounding_s) || do_vary(film_steps_s_)) return;
  if (film_period_s_ > 0 && stated_period_s_ > 0 && !contradicts(stated_period_s_, film_period_s_, 0)) return;
  const auto count = static_cast<double>(picture.index - first_->index);
  report_rate(stated_s / count, film_period_s_ > 0 ? film_period_s_ : film_s / count, leave_out);
}

void TimesBesideFilm::see_header(capture::Duration period) {
  const double header_s = capture::seconds(period);
  if (is_measured_ || !(header_s > 0) || !(stated_period_s_ > 0)) return;
  if (std::abs(header_s / stated_period_s_ - 1) >= film_times.slack) report_rate(stated_period_s_, header_s, "correct");
}

void TimesBesideFilm::report_rate(double stated_s, double film_s, std::string_view remedy) {
  has_problem_ = true;
  problems_.push_back(
      fmt::format("{0} says {1:.4g}, but the file itself {2:.4g} frames a second: if the file is right, {3} {4}{5}; if "
                  "{4} is right (slow motion, a wrong header), add {6}",
                  name_, 1 / stated_s, 1 / film_s, remedy, key_, remedy == leave_out ? " out" : "", how_to_confirm));
}

// A longer step among even ones, which the stated times do not have: all later times are wrong by the missing frames.
void TimesBesideFilm::look_for_gap() {
  if (has_problem_ || recent_.size() <= static_cast<std::size_t>(film_times.enough)) return;
  std::vector<double> steps_s, stated_steps_s;
  for (std::size_t k = 1; k < recent_.size(); ++k) {
    const auto frames = static_cast<double>(recent_[k].index - recent_[k - 1].index);
    steps_s.push_back((recent_[k].film_s - recent_[k - 1].film_s) / frames);
    stated_steps_s.push_back((recent_[k].stated_s - recent_[k - 1].stated_s) / frames);
  }
  const double usual_s = median(steps_s), stated_usual_s = median(stated_steps_s);
  const Seen &begin = recent_.front(), &end = recent_.back();
  const double stated_periods = (end.stated_s - begin.stated_s) / stated_usual_s;
  const double gap_s = end.film_s - begin.film_s - stated_periods * usual_s;
  if (gap_s < film_times.gap * usual_s) return;
  const auto longest = static_cast<std::size_t>(std::ranges::max_element(steps_s) - steps_s.begin());
  // A table may have its gap a row beyond the window.
  if (key_ != "fps" && (longest == 0 || longest + 1 == steps_s.size())) return;
  report_gap(std::max(1L, std::lround(gap_s / usual_s)), recent_[longest + 1].index);
}

// In the middle of the window the film has a gap among even steps: how far both clocks differ, in their own usual
// steps, by the medians before and after it, which neither jitter nor a late stamp changes.
void TimesBesideFilm::look_for_gap_beside_measured() {
  if (has_problem_ || recent_.size() < film_times.window) return;
  std::vector<double> film_s, stated_s;
  for (std::size_t k = 1; k < recent_.size(); ++k) {
    const auto frames = static_cast<double>(recent_[k].index - recent_[k - 1].index);
    film_s.push_back((recent_[k].film_s - recent_[k - 1].film_s) / frames);
    stated_s.push_back((recent_[k].stated_s - recent_[k - 1].stated_s) / frames);
  }
  if (do_vary(film_s)) return;
  const double usual_s = median(film_s), stated_usual_s = median(stated_s);
  const std::size_t middle = film_times.window / 2;
  if (film_s[middle - 1] < (1 + film_times.gap) * usual_s) return;
  std::vector<double> before, after;
  for (std::size_t k = 0; k < recent_.size(); ++k)
    (k < middle ? before : after).push_back(recent_[k].film_s / usual_s - recent_[k].stated_s / stated_usual_s);
  const double steps = median(std::move(after)) - median(std::move(before));
  if (steps >= film_times.gap) report_gap(std::max(1L, std::lround(steps)), recent_[middle].index);
}

void TimesBesideFilm::report_gap(long missing, std::int64_t before) {
  has_problem_ = true;
  problems_.push_back(fmt::format(
      "its own time stamps say that {} missing before frame {}: from there on, {} gives times that are too early: "
      "leave {} out to use the file's time stamps; if these are wrong, add {}",
      missing == 1 ? "a frame is" : fmt::format("{} frames are", missing), before, name_, key_, how_to_confirm));
}

}  // namespace huetrack::recordings
