// Our own observation and filter, `observation: huetrack`: a Rao-Blackwellised particle filter. A particle is a position
// with a path; its velocity, given the path, is Gaussian and kept in closed form (Schon, Gustafsson, Nordlund 2005). What
// differs from the paper, and why:
//   - proposal: particles are drawn from motion AND the colour regions near them (the optimal proposal of Doucet, Godsill
//     and Andrieu 2000), not from the motion alone. 200 particles then sit where they matter: millimetres, not centimetres.
//   - observation: the centre of the colour region is rewarded, not the inside of it, with a covariance that knows the
//     object's radius and sees when a part of it is hidden (sighting.h). The paper's floor of 1/25 stays: no view can veto.
//   - motion: constant velocity with white acceleration; how much of it is needed is learnt from the innovations, so that
//     calm motion is smoothed and a thrown ball followed. Each view is scored at its own capture time.
//   - search: rays crossed between views through matching pixels of a coarse grid, confirmed by a second frame set.
// What was tried and left out, with figures: README.md beside this file.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "object_tracking/color_region.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/object_tracker.h"
#include "object_tracking/paper_tracker.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "particle_filter/random.h"

namespace huetrack {

// thread-compatible.
class RegionTracker {
 public:
  RegionTracker(const CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options, Rng rng);

  ObjectEstimate update(const FrameSet& set);
  const PositionParticles& particles() const { return p_; }

 private:
  struct Prior {                  // of the position, before this set's images
    Eigen::Vector3d mean, velocity;
    Eigen::Matrix3d covariance;
  };
  void predict(double dt);
  Prior prior() const;
  void choose_acceleration(const std::vector<TargetView>& views, double dt);
  void set_motion_noise(double dt);
  std::vector<Sighting> sight(const std::vector<TargetView>& views, const Prior& prior);
  void propose_and_weigh(const Prior& prior);
  void resample_if_poor();
  void summarize();
  void judge(const FrameSet& set);
  void search(const FrameSet& set, const std::vector<TargetView>& views);
  void start_at(const Candidate& found, const Eigen::Vector3d& velocity, double velocity_variance);
  void scatter();
  ObjectEstimate report(const FrameSet& set, const std::vector<TargetView>& views) const;

  TargetOptions target_;
  ObjectTrackerOptions options_;
  TargetViews views_;
  Rng rng_;

  // Particles: position, mean velocity, weight. The velocity's variance given the path, per axis, is common to all.
  PositionParticles p_, v_, predicted_, mean_;
  std::vector<float> weight_, log_weight_, noise_, u_, v_px_;
  std::vector<std::uint32_t> ancestor_;
  PositionParticles scratch_;
  double velocity_variance_ = 0;         // (m/s)^2
  double acceleration_ = 0;              // m/s^2, learnt
  // One step of white acceleration, per axis: variances and covariance of (position, velocity).
  double var_p_ = 0, cov_pv_ = 0, var_v_ = 0;
  Eigen::Matrix3d proposal_covariance_ = Eigen::Matrix3d::Zero();

  std::vector<Sighting> sightings_;      // of this set
  std::vector<RegionFinder> finders_;    // per camera
  std::vector<std::vector<ColorRegion>> regions_;
  std::vector<Candidate> candidates_;    // of the last set, while searching
  Timestamp candidates_at_{};

  TrackState state_ = TrackState::searching;
  Timestamp last_at_{}, last_tracking_{};
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero(), velocity_ = Eigen::Vector3d::Zero(), map_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  double effective_sample_size_ = 0;
};

}  // namespace huetrack
