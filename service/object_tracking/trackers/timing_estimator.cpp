#include "object_tracking/trackers/timing_estimator.h"

#include <algorithm>

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

constexpr std::size_t sets_of_a_start = 2;  // maths: fewer fix no position and velocity

}  // namespace

bool are_times_open(std::span<const Sighting> sightings, const MotionState& motion) {
  return std::ranges::any_of(sightings, [&](const Sighting& s) {
    return motion.row_sigma_s(s.row.camera, s.row.below_middle) > sighting_tuning.same_time_s;
  });
}

TimingEstimator::TimingEstimator(std::size_t cameras, const TargetOptions& target, const ObjectTrackerOptions& options)
    // One camera alone shows nothing of its timing.
    : is_learning_(options.timing == TimingMode::learn && cameras > 1),
      speed_m_s_(options.start_speed_m_s),
      anywhere_m_((options.volume.max - options.volume.min).norm()),
      observer_(target.radius_m, target.shape != TargetShape::blob) {}

void TimingEstimator::begin(const MotionState& motion) {
  begun_ = motion;
  seen_sets_.clear();
  is_forgetting_motion_ = false;
  moving_sets_ = 0;
}

void TimingEstimator::settle(const MotionState& motion) {
  for (SeenSet& seen : seen_sets_)
    seen.estimated_at = motion.at, seen.position = motion.position(), seen.velocity = motion.velocity();
}

void TimingEstimator::add_times(const TimesInformation& shown) {
  if (begun_) begun_->add_times(shown);
}

void TimingEstimator::forget_seen() {
  seen_sets_.clear();
  is_forgetting_motion_ = true;
}

bool TimingEstimator::remember(const MotionState& motion, std::span<const Sighting> sightings, double power_density) {
  if (!is_learning_ || is_forgetting_motion_ || sightings.empty()) return false;
  if (seen_sets_.size() == timing_tuning.most_sets) {
    // Sets of an object at rest have no information on the timing. When one of a moving object would be dropped, all
    // are, as a replay without it would lose its information.
    is_forgetting_motion_ = seen_sets_.front().velocity.norm() > timing_tuning.at_rest_m_s;
    seen_sets_.pop_front();
    if (is_forgetting_motion_) seen_sets_.clear();
    if (is_forgetting_motion_) return false;
  }
  seen_sets_.push_back(
      {power_density, {sightings.begin(), sightings.end()}, motion.at, motion.position(), motion.velocity()});
  moving_sets_ += motion.velocity().norm() > timing_tuning.at_rest_m_s ? 1 : 0;
  if (moving_sets_ < timing_tuning.sets_until_again && !motion.needs_relinearisation()) return false;
  moving_sets_ = 0;
  return seen_sets_.size() > sets_of_a_start;
}

// Velocities at the remembered sets from the path around each: less noisy than the filter's, and hardly correlated with
// the noise of that set's own measurements, with which they are multiplied.
std::vector<Eigen::Vector3d> TimingEstimator::smooth_velocities() const {
  std::vector<Eigen::Vector3d> out;
  const auto count = std::ptrdiff_t(seen_sets_.size());
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const SeenSet& before = seen_sets_[std::size_t(std::max<std::ptrdiff_t>(0, i - 2))];
    const SeenSet& after = seen_sets_[std::size_t(std::min(count - 1, i + 2))];
    const double dt = capture::seconds(after.estimated_at - before.estimated_at);
    out.push_back(dt > 0 && dt < sighting_tuning.confirmation_s
                      ? Eigen::Vector3d((after.position - before.position) / dt)
                      : seen_sets_[std::size_t(i)].velocity);
  }
  return out;
}

void TimingEstimator::linearise_again(MotionState& motion, double power_density) {
  MotionState about = motion;
  std::vector<Sighting> sightings;
  for (int pass = 0; pass < timing_tuning.passes; ++pass) {
    const MotionState known = motion;
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
      about.begin(seen.estimated_at, seen.position, 0, velocities[i], 0);
      again = observer_.observed(again, &about, sightings, seen.power_density);
      seen.estimated_at = again.at, seen.position = again.position(), seen.velocity = again.velocity();
    }
    again.predict_to(known.at, power_density);
    again.adopt_shared_times(known);
    motion = again;
  }
}

}  // namespace huetrack::object_trackers
