#include "object_tracking/trackers/times_learner.h"

#include <algorithm>
#include <cstddef>

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

// At usual speeds, some metres a second, this is some millimetres of way: as much as what else is not known.
constexpr double open_time_s = 2e-3;

// Ten seconds of motion at 30 sets a second tell all that there is to tell of times; and a pass over them takes no
// longer than some ten milliseconds.
constexpr std::size_t most_seen_sets = 300;
constexpr int passes = 3;
constexpr std::size_t sets_of_a_start = 2;  // that say where the object is and how it moves
// Half of what is told in ten seconds is told anew.
constexpr int sets_until_again = 75;

}  // namespace

bool are_times_open(std::span<const Sighting> sightings, const MotionState& belief) {
  return std::ranges::any_of(
      sightings, [&](const Sighting& s) { return belief.row_sigma_s(s.row.camera, s.row.below_middle) > open_time_s; });
}

TimesLearner::TimesLearner(double radius_m, const ObjectTrackerOptions& options)
    : is_learning_(options.timing == TimingMode::learn),
      speed_m_s_(options.start_speed_m_s),
      anywhere_m_((options.volume.max - options.volume.min).norm()),
      observer_(radius_m) {}

void TimesLearner::begin(const MotionState& belief) {
  begun_ = belief;
  seen_sets_.clear();
  is_forgetting_motion_ = false;
  moving_sets_ = 0;
}

void TimesLearner::settle(const MotionState& belief) {
  for (SeenSet& seen : seen_sets_)
    seen.believed_at = belief.at, seen.position = belief.position(), seen.velocity = belief.velocity();
}

void TimesLearner::forget_seen() {
  seen_sets_.clear();
  is_forgetting_motion_ = true;
}

bool TimesLearner::remember(const MotionState& belief, std::span<const Sighting> sightings, double power_density) {
  if (!is_learning_ || is_forgetting_motion_ || sightings.empty()) return false;
  if (seen_sets_.size() == most_seen_sets) {
    // What an object at rest showed told nothing of times. Without what a moving one did, less would be known.
    is_forgetting_motion_ = seen_sets_.front().velocity.norm() > at_rest_m_s;
    seen_sets_.pop_front();
    if (is_forgetting_motion_) seen_sets_.clear();
    if (is_forgetting_motion_) return false;
  }
  seen_sets_.push_back(
      {power_density, {sightings.begin(), sightings.end()}, belief.at, belief.position(), belief.velocity()});
  moving_sets_ += belief.velocity().norm() > at_rest_m_s ? 1 : 0;
  if (moving_sets_ < sets_until_again && !belief.needs_relinearisation()) return false;
  moving_sets_ = 0;
  return seen_sets_.size() > sets_of_a_start;
}

// Velocities at the seen sets as the path around each of them tells them: less noisy than those of the filter, and not
// of the noise of that set's own sightings, with which they are multiplied.
std::vector<Eigen::Vector3d> TimesLearner::smooth_velocities() const {
  std::vector<Eigen::Vector3d> out;
  const auto count = std::ptrdiff_t(seen_sets_.size());
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const SeenSet& before = seen_sets_[std::size_t(std::max<std::ptrdiff_t>(0, i - 2))];
    const SeenSet& after = seen_sets_[std::size_t(std::min(count - 1, i + 2))];
    const double dt = capture::seconds(after.believed_at - before.believed_at);
    out.push_back(dt > 0 && dt < 0.3 ? Eigen::Vector3d((after.position - before.position) / dt)
                                     : seen_sets_[std::size_t(i)].velocity);
  }
  return out;
}

void TimesLearner::linearise_again(MotionState& belief, double power_density) {
  MotionState about = belief;
  std::vector<Sighting> sightings;
  for (int pass = 0; pass < passes; ++pass) {
    const MotionState known = belief;
    MotionState again = *begun_;
    again.relinearise_times_at(known);
    again.adopt_clocks(known);
    const std::vector<Eigen::Vector3d> velocities = smooth_velocities();
    for (std::size_t i = 0; i < seen_sets_.size(); ++i) {
      SeenSet& seen = seen_sets_[i];
      sightings = seen.sightings;
      for (Sighting& s : sightings) {
        const double shift_s = known.row_offset_s(s.row.camera, s.row.below_middle);
        s.row.at += capture::duration_of(shift_s - s.row.shift_s);
        s.row.shift_s = shift_s;
      }
      sort_by_time(sightings);
      if (i == 0) {
        again.begin(sightings.front().row.at, seen.position, anywhere_m_ * anywhere_m_, Eigen::Vector3d::Zero(),
                    speed_m_s_ * speed_m_s_);
      }
      about.begin(seen.believed_at, seen.position, 0, velocities[i], 0);
      again = observer_.observed(again, &about, sightings, seen.power_density);
      seen.believed_at = again.at, seen.position = again.position(), seen.velocity = again.velocity();
    }
    again.predict_to(known.at, power_density);
    belief = again;
  }
}

}  // namespace huetrack::object_trackers
