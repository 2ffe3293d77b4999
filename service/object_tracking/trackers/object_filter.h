// What is believed of one object, given the sightings of each set: a Gaussian particle filter (Kotecha and Djuric 2003)
// over the position, with the velocity, the cameras' times and what lasts of their errors marginalised. Which sighting
// is of which object, and whether it is tracked, is decided by those who call it.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "object_tracking/motion_state.h"
#include "object_tracking/motion_observer.h"
#include "object_tracking/sighting.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/paper_tracker.h"
#include "object_tracking/trackers/times_learner.h"
#include "object_tracking/view_consistency.h"
#include "particle_filter/random.h"

namespace huetrack::object_trackers {

// thread-compatible. Sightings come by the times of their rows.
class ObjectFilter {
 public:
  ObjectFilter(const calib::CameraRig& rig, double radius_m, const object_tracking::ObjectTrackerOptions& options,
               particle_filter::Rng rng);

  const object_tracking::MotionState& belief() const { return belief_; }
  object_tracking::MotionState& belief() { return belief_; }
  const PositionParticles& particles() const { return particles_; }
  double effective_sample_size() const { return effective_sample_size_; }
  const Eigen::Vector3d& map_position() const { return map_; }

  // What `other` has learnt of the cameras' times, for an object that is new.
  void adopt_times(const ObjectFilter& other);

  // Nothing is known of the position: particles anywhere in the volume.
  void scatter();

  // A new object, from what two sets saw of it, dt apart, and nothing but what is usual. is_in_step: the cameras are
  // triggered together, as far as is known. Returns the second set's sightings, doubted as the views are.
  std::vector<object_tracking::Sighting> start(const object_tracking::PositionCandidate& earlier,
                                               const object_tracking::PositionCandidate& found,
                                               const object_tracking::ViewConsistency& agreement,
                                               capture::Timestamp set_at, double dt, bool is_in_step,
                                               capture::Timestamp told);

  // Covariance matching, before update(): raises the acceleration until the innovations of all sightings together are
  // ones that it explains. Of three views, one that contradicts the others is left out.
  void raise_acceleration(std::vector<object_tracking::Sighting>& sightings);
  // And lowers it slowly while they are smaller than they need be.
  void settle_acceleration(std::span<const object_tracking::Sighting> sightings);
  double acceleration() const { return acceleration_; }  // m/s^2
  void set_acceleration(double m_s2) { acceleration_ = m_s2; }
  double power_density() const;                             // of it, m^2/s^3
  double surprise() const { return observer_.mean_nis(); }  // of the sightings that were looked at last
  // The hardest acceleration does not explain these, which were looked at last: a bounce, a hit or a throw.
  bool is_unexplained(std::span<const object_tracking::Sighting> sightings) const;
  // By as much its velocity may change then, on each axis. At any moment within dt that is as good as white
  // acceleration of a power density of its square over dt.
  double kick_m_s() const;

  // One set. Positions are told in the order of time: what is believed after it is later than `told`.
  void update(std::span<const object_tracking::Sighting> sightings, capture::Timestamp set_at, capture::Timestamp told,
              double power_density);

  void forget_camera(int camera);                      // it stands elsewhere
  void correct_times(std::span<const double> late_s);  // MotionState::correct_times()

 private:
  void begin(const object_tracking::PositionCandidate& earlier, const object_tracking::PositionCandidate& found,
             capture::Timestamp set_at, double dt, bool is_in_step);
  void predict_to_be_told(object_tracking::MotionState& belief, capture::Timestamp set_at, capture::Timestamp told,
                          double power_density) const;
  void leave_out_what_contradicts(std::vector<object_tracking::Sighting>& sightings);
  object_tracking::MotionState propose(std::span<const object_tracking::Sighting> sightings, capture::Timestamp set_at,
                                        capture::Timestamp told, double power_density);
  void draw_particles(const object_tracking::MotionState& proposal);
  void weigh(const object_tracking::MotionState& proposal, double power_density);
  void estimate(object_tracking::MotionState&& proposal);

  object_tracking::ObjectTrackerOptions options_;
  particle_filter::Rng rng_;

  object_tracking::MotionState belief_;  // after the last set
  object_tracking::MotionState about_;   // while an object starts: a motion near its own
  double acceleration_ = 0;               // m/s^2, learnt
  object_tracking::MotionObserver observer_;
  TimesLearner times_;
  bool has_begun_ = false;  // an object was found: times are being learnt

  PositionParticles particles_;
  std::vector<float> weight_, log_weight_, unit_, u_, v_;
  PositionParticles seen_at_;  // the particles at a view's own capture time
  double effective_sample_size_ = 0;
  Eigen::Vector3d map_ = Eigen::Vector3d::Zero();
};

// Of what fixes the position: the belief for the views as they are believed to be, or the views of this set alone where
// they are surer (a belief that allows for anything between two sets of slow cameras is not). Standard deviation along
// the largest axis, metres.
double judged_sigma(const object_tracking::MotionState& belief, std::span<const object_tracking::Sighting> sightings);

// Whatever leaves it open, also that nobody knows the cameras' times: what may be anywhere is not tracked.
bool is_somewhere(const object_tracking::ObjectTrackerOptions& options, const object_tracking::MotionState& belief);

// An object that was known before this set. A view or more must see it, and together they must say where. What is open
// because nobody knows the cameras' times does not count here, but for is_somewhere(): the covariance tells it, and
// motion will. What is open because views contradict one another does: such an object is seen, and where it is nobody
// knows well enough. lost: it is to be forgotten, and looked for.
struct Judged {
  object_tracking::TrackState state;
  bool is_seen;  // as well as an object must be to be tracked, were it not for what is doubted
};
// doubted_m: ViewConsistency::inflated_sigma(). unseen_s: since it was seen so last. may_be_tracked: false, and it is
// followed for a while, but not tracked.
Judged judged(const object_tracking::ObjectTrackerOptions& options, const object_tracking::MotionState& belief,
              std::span<const object_tracking::Sighting> sightings, double doubted_m, double unseen_s,
              bool may_be_tracked);

}  // namespace huetrack::object_trackers
