// State of one object: a Gaussian particle filter (Kotecha and Djuric 2003) over the position; velocity, the cameras'
// timing and their slowly varying biases are marginalised. Association and existence are decided by the callers.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "object_tracking/motion_observer.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/sighting.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/paper_tracker.h"
#include "object_tracking/trackers/timing_estimator.h"
#include "object_tracking/view_consistency.h"
#include "particle_filter/random.h"

namespace huetrack::object_trackers {

// thread-compatible. Measurements are sorted by the time of their rows.
class ObjectFilter {
 public:
  ObjectFilter(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
               const object_tracking::ObjectTrackerOptions& options, particle_filter::Rng rng);

  const object_tracking::MotionState& motion() const { return motion_; }
  object_tracking::MotionState& motion() { return motion_; }
  const PositionParticles& particles() const { return particles_; }
  double effective_sample_size() const { return effective_sample_size_; }
  const Eigen::Vector3d& map_position() const { return map_; }

  void adopt_times(const ObjectFilter& other);  // for a new object: the timing that `other` has estimated
  // Of a filter of the same rig that has shared its timing, and what all others but this one have shown since.
  void adopt_shared(const ObjectFilter& other, const object_tracking::TimesInformation& shown);
  bool has_begun() const { return has_begun_; }  // an object was initialised: timing is being estimated
  void scatter();                                // position unknown: particles uniform in the volume

  // Initialises a new object from measurements of two sets, dt apart. is_in_step: the cameras are synchronised, as far
  // as is known. Returns the second set's measurements, with the inflation of `agreement`.
  std::vector<object_tracking::Sighting> start(const object_tracking::PositionCandidate& earlier,
                                               const object_tracking::PositionCandidate& found,
                                               const object_tracking::ViewConsistency& agreement,
                                               capture::Timestamp set_at, double dt, bool is_in_step,
                                               capture::Timestamp last_published);

  // Covariance matching, before update(): raises the acceleration until the innovations of all measurements together
  // are consistent with it. Removes one of three or more views if it is inconsistent with the others.
  void raise_acceleration(std::vector<object_tracking::Sighting>& sightings);
  void settle_acceleration(std::span<const object_tracking::Sighting> sightings);  // lowers it slowly
  double acceleration() const { return acceleration_; }                            // m/s^2
  void set_acceleration(double m_s2) { acceleration_ = m_s2; }
  double power_density() const;                             // of it, m^2/s^3
  double mean_nis() const { return observer_.mean_nis(); }  // of the last measurements
  // The highest acceleration does not explain the last measurements: a bounce, a hit or a throw.
  bool is_unexplained(std::span<const object_tracking::Sighting> sightings) const;
  // 1 sigma per axis of the change of velocity then. At an unknown moment within dt it acts like white acceleration of
  // power density kick^2 / dt.
  double kick_m_s() const;

  // One set. The state afterwards is later than `last_published`: published stamps strictly increase.
  void update(std::span<const object_tracking::Sighting> sightings, capture::Timestamp set_at,
              capture::Timestamp last_published, double power_density);

  // With one camera, from its centre to the object, m, world; nullopt: several cameras, or the radius was not as
  // expected when it was measured last. It stays over sets without a measured radius.
  std::optional<Eigen::Vector3d> ray() const;

  void forget_camera(int camera);                      // its pose changed
  void correct_times(std::span<const double> late_s);  // MotionState::correct_times()

 private:
  void begin(const object_tracking::PositionCandidate& earlier, const object_tracking::PositionCandidate& found,
             capture::Timestamp set_at, double dt, bool is_in_step);
  void predict_to_output(object_tracking::MotionState& motion, capture::Timestamp set_at,
                         capture::Timestamp last_published, double power_density) const;
  void note_size(std::span<const object_tracking::Sighting> sightings);
  double highest_acceleration() const;  // m/s^2
  void remove_inconsistent_view(std::vector<object_tracking::Sighting>& sightings);
  void draw_particles(const object_tracking::MotionState& proposal);
  void weigh(const object_tracking::MotionState& proposal, double power_density);
  void estimate(object_tracking::MotionState&& proposal);
  void reset_weights();

  object_tracking::ObjectTrackerOptions options_;
  particle_filter::Rng rng_;

  object_tracking::MotionState motion_;  // after the last set
  object_tracking::MotionState about_;  // while an object is initialised by several cameras: the motion to linearise at
  double acceleration_ = 0;             // m/s^2, learnt
  object_tracking::MotionObserver observer_;
  TimingEstimator times_;
  const calib::Camera* sizing_camera_ = nullptr;  // of ray()
  bool has_begun_ = false;

  PositionParticles particles_;
  std::vector<float> weight_, log_weight_, unit_, u_, v_;
  PositionParticles seen_at_;  // the particles at a view's own capture time
  double effective_sample_size_ = 0;
  Eigen::Vector3d map_ = Eigen::Vector3d::Zero();
};

// What decides about the state: 1 sigma of the position along its worst axis, metres; the smaller one of the
// estimate's, conditioned on the nuisance states, and that of this set's measurements alone (of slow cameras the
// prediction is wide). With one camera, sigma along its ray is scaled: max_tracking_share_along of the distance counts
// as max_tracking_sigma_m.
double judged_sigma(const object_tracking::ObjectTrackerOptions& options, const ObjectFilter& filter,
                    std::span<const object_tracking::Sighting> sightings);

// The position is known well enough to publish, all uncertainty included, that of the timing as well.
bool is_localized(const object_tracking::ObjectTrackerOptions& options, const ObjectFilter& filter);

// The state of an object that was known before this set. It is seen if a view or more see it and together fix its
// position; the timing's uncertainty counts only in is_localized(), inconsistent views count here. lost: end the track.
struct Judged {
  object_tracking::TrackState state;
  bool is_seen;  // well enough for `tracking`, inconsistency aside
};
// inconsistency_m: ViewConsistency::inflated_sigma(). unseen_s: since is_seen. may_be_tracked: false limits it to
// coasting.
Judged judged(const object_tracking::ObjectTrackerOptions& options, const ObjectFilter& filter,
              std::span<const object_tracking::Sighting> sightings, double inconsistency_m, double unseen_s,
              bool may_be_tracked);

// The same of an object that was initialised in this set. lost: views this inconsistent have found nothing.
object_tracking::TrackState judged_at_start(const object_tracking::ObjectTrackerOptions& options,
                                            const ObjectFilter& filter,
                                            std::span<const object_tracking::Sighting> sightings,
                                            double inconsistency_m, bool may_be_tracked);

}  // namespace huetrack::object_trackers
