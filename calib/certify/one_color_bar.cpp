#include "calib/certify/one_color_bar.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "calib/model/median.h"

namespace huetrack::certify {
namespace {

// Gap after which two objects may be others than before.
constexpr double same_pair_s = 1;

struct ObjectFix {
  std::size_t object = 0;
  const BallFix* fix = nullptr;
};

struct PairLength {
  std::pair<std::size_t, std::size_t> objects;
  MeasuredLength length;
};

// By frame set.
std::map<std::uint64_t, std::vector<ObjectFix>> sets_of(std::span<const BallTrack> objects) {
  std::map<std::uint64_t, std::vector<ObjectFix>> sets;
  for (std::size_t k = 0; k < objects.size(); ++k)
    for (const BallFix& fix : objects[k]) sets[fix.set].push_back({k, &fix});
  return sets;
}

std::vector<PairLength> pairs_of(std::span<const BallTrack> objects, const std::set<std::uint64_t>& sets_with_third,
                                 double length_m, const calib::CameraRig& rig, OneColorBar& out) {
  std::vector<PairLength> pairs;
  for (const auto& [set, fixes] : sets_of(objects)) {
    if (fixes.size() > 2 || sets_with_third.contains(set))
      ++out.with_third;
    else if (fixes.size() == 1)
      ++out.only_one;
    else
      pairs.push_back(
          {{fixes[0].object, fixes[1].object}, length_between(*fixes[0].fix, *fixes[1].fix, length_m, rig)});
  }
  return pairs;
}

double median_error(std::span<const MeasuredLength> measurement) {
  std::vector<double> errors;
  for (const MeasuredLength& length : measurement) errors.push_back(length.error_m);
  return calib::median(std::move(errors));
}

// Adjacent periods are merged.
void note_other(std::span<const MeasuredLength> measurement, double distance_m, OneColorBar& out) {
  if (out.others.empty() || measurement.front().t_s - out.others.back().to_s > same_pair_s)
    out.others.push_back({.from_s = measurement.front().t_s, .least_m = distance_m, .most_m = distance_m});
  OneColorBar::Other& other = out.others.back();
  other.to_s = measurement.back().t_s;
  other.least_m = std::min(other.least_m, distance_m);
  other.most_m = std::max(other.most_m, distance_m);
  other.sets += measurement.size();
}

// A run: consecutive lengths between the same two objects, judged by the median of each measurement, since an object
// may become another one without its track ending. If most measurements of a run do not match, none is used: a foreign
// object may be at the right distance for a moment.
void judge_run(std::span<MeasuredLength> run, double length_m, int& next_measurement, OneColorBar& out) {
  next_measurement = number_measurements(run, next_measurement);
  std::vector<std::span<const MeasuredLength>> measurements;
  for (auto from = run.begin(); from != run.end();) {
    const auto to = std::find_if(from, run.end(), [&](const auto& m) { return m.measurement != from->measurement; });
    measurements.emplace_back(from, to);
    from = to;
  }
  const auto is_other = [&](std::span<const MeasuredLength> m) {
    return std::abs(median_error(m)) > OneColorBar::other_share * length_m;
  };
  const bool is_none = 2 * std::ranges::count_if(measurements, is_other) > std::ssize(measurements);
  for (const auto measurement : measurements) {
    if (is_none || is_other(measurement))
      note_other(measurement, length_m + median_error(measurement), out);
    else
      out.lengths.insert(out.lengths.end(), measurement.begin(), measurement.end());
  }
}

}  // namespace

OneColorBar one_color_bar(std::span<const BallTrack> objects, const std::set<std::uint64_t>& sets_with_third,
                          double length_m, const calib::CameraRig& rig) {
  OneColorBar out;
  const std::vector<PairLength> pairs = pairs_of(objects, sets_with_third, length_m, rig, out);
  int next_measurement = 0;
  std::vector<MeasuredLength> run;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    run.push_back(pairs[k].length);
    const bool goes_on = k + 1 < pairs.size() && pairs[k + 1].objects == pairs[k].objects &&
                         pairs[k + 1].length.t_s - pairs[k].length.t_s < same_pair_s;
    if (goes_on) continue;
    judge_run(run, length_m, next_measurement, out);
    run.clear();
  }
  return out;
}

}  // namespace huetrack::certify
