// Our own observation and filter, `observation: huetrack`: a Gaussian particle filter (Kotecha and Djuric 2003) over
// the position, with the velocity marginalised. Between frame sets the belief is one Gaussian over (position,
// velocity); in a set, positions are drawn from it, weighed by what every view shows at their projections, and give the
// next one. What differs from the paper, and why:
//   - proposal: particles are drawn from motion AND the colour regions near the prediction (the optimal proposal of
//     Doucet, Godsill and Andrieu 2000), not from the motion alone. 200 particles then sit where they matter.
//   - observation: the centre of the colour region is rewarded, not the inside of it, with a covariance that knows the
//     object's radius and sees when a part of it is hidden (sighting.h). The paper's floor of 1/25 stays: no view can
//     veto.
//   - motion: constant velocity with white acceleration; how much of it is needed is learnt from the innovations, so
//     that calm motion is smoothed and a thrown ball followed. A bounce, which none of it explains, is followed within
//     the set, when two views or more see where the object went.
//   - time: a sighting counts when the row was exposed in which it lies. When that is, per camera, is part of what is
//     believed and learnt (motion_belief.h).
//   - trust: views that contradict one another are doubted by as much as they do (view_doubts.h). What is doubted is an
//     error that lasts, like a pose that is not quite known, so that no number of frames averages it away; it is in the
//     covariance, and what it leaves too open is not `tracking`.
//   - search: rays crossed between views through matching pixels of a coarse grid, confirmed by a second frame set.
//     Several hypotheses are needed only here, and here they are kept.
//   - calibration: what the rig's own covariance leaves open of a position, where it has one, is in the covariance that
//     is told (rig_error.h).
// A position is that of the moment of the newest sighting in its set; of the set's own time, where that is within 2 ms
// of it or nobody sees the object.
// What else was tried, with figures: README.md beside this file.
#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "object_tracking/color_region.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/object_tracker.h"
#include "object_tracking/paper_tracker.h"
#include "object_tracking/rig_error.h"
#include "object_tracking/search_findings.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/view_doubts.h"
#include "particle_filter/random.h"

namespace huetrack::object_tracking {

// thread-compatible.
class RegionTracker {
 public:
  RegionTracker(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options,
                particle_filter::Rng rng);

  ObjectEstimate update(const capture::FrameSet& set);
  void trust(std::span<const CameraTrust> cameras);
  TargetViews& views() { return views_; }
  const PositionParticles& particles() const { return particles_; }
  std::span<const SeenRegion> regions() const { return seen_regions_; }
  const std::vector<ColorShare>& color_shares() const { return color_shares_; }
  SearchFindings search_findings() const { return search_log_.findings(); }

 private:
  struct SizeInView {
    double smallest_px = 0, largest_px = 0;
  };  // radius of the target; 0: never in view
  SizeInView size_in(const calib::Camera& camera) const;
  struct ExpectedView {
    SeenRow row;
    Appearance at;
  };
  std::optional<ExpectedView> expect(const TargetView& view) const;
  ImageMotion image_motion(const TargetView& view, const Appearance& at) const;
  std::span<const ColorRegion> regions_near(const TargetView& view, const Appearance& at,
                                            const Eigen::Matrix2d& spread);
  bool is_repeated(const TargetView& view, std::span<const ColorRegion> regions, const Appearance& at);
  void sight(const std::vector<TargetView>& views, std::vector<Sighting>& out);
  std::optional<SeenBeside> beside(const Sighting& sighting) const;
  const ColorRegion* only_moving(int camera, std::span<const ColorRegion> regions, double disc_px2, double still_px,
                                 capture::Timestamp at);
  std::optional<SeenBeside> far_off(const TargetView& view, capture::Timestamp set_at);
  std::optional<Disagreement> disagreement_of(const Sighting& i, const Sighting& j) const;
  void compare_searched(const std::vector<TargetView>& views, capture::Timestamp set_at);
  bool is_contested(const PositionCandidate& candidate, const std::vector<TargetView>& views) const;
  void note_regions(const TargetView& view, std::span<const ColorRegion> regions);
  void measure_color(const std::vector<TargetView>& views, capture::Timestamp set_at);
  void compare(const std::vector<TargetView>& views, capture::Timestamp set_at);
  void compare_sighted();
  void compare_besides();
  void doubt(std::vector<Sighting>& sightings) const;
  double doubted_sigma() const;
  bool add_support(const TargetView& view, ObjectEstimate& estimate) const;
  void add_witnesses(ObjectEstimate& estimate) const;
  bool sight_after_bounce(const std::vector<TargetView>& views, double power_density);
  MotionBelief observed(const MotionBelief& from, const MotionBelief* linearised_about, double power_density);
  MotionBelief observed_in_passes(const MotionBelief& from, double power_density);
  void predict_to_be_told(MotionBelief& belief, capture::Timestamp set_at, double power_density) const;
  bool are_times_open() const;
  void leave_out_what_contradicts();
  double learn_acceleration(const capture::FrameSet& set, const std::vector<TargetView>& views);
  MotionBelief propose(const capture::FrameSet& set, double power_density);
  void draw_particles(const MotionBelief& proposal);
  void weigh(const MotionBelief& proposal, double power_density);
  void estimate(const MotionBelief& proposal);
  bool remember(double power_density);
  std::vector<Eigen::Vector3d> smooth_velocities() const;
  void linearise_times_again();
  double judged_sigma() const;
  void judge(const capture::FrameSet& set);
  void forget();
  void search(const capture::FrameSet& set, const std::vector<TargetView>& views);
  void start_at(const PositionCandidate& earlier, const PositionCandidate& found, capture::Timestamp set_at, double dt);
  void scatter();
  ObjectEstimate report(const capture::FrameSet& set, const std::vector<TargetView>& views);
  double power_density() const;  // of the acceleration, m^2/s^3

  TargetOptions target_;
  ObjectTrackerOptions options_;
  TargetViews views_;
  particle_filter::Rng rng_;

  MotionBelief belief_;      // after the last set
  MotionBelief begun_;       // what was known of the times before the object was found
  double acceleration_ = 0;  // m/s^2, learnt
  PositionParticles particles_;
  std::vector<float> weight_, log_weight_, unit_, u_, v_;
  PositionParticles seen_at_;  // the particles at a view's own capture time
  double effective_sample_size_ = 0;
  Eigen::Vector3d map_ = Eigen::Vector3d::Zero();

  std::vector<Sighting> sightings_;  // of this set, by the times of their rows
  // All that views show of the object in this set: also what contradicts, and what cameras see that are not used.
  std::vector<Sighting> seen_;
  std::vector<Sighting> watched_;    // of the latter
  std::vector<SeenBeside> besides_;  // of seen_ and what is far off, while views are compared
  ViewDoubts doubts_;
  unsigned compared_sets_ = 0;                                // since the object was found
  std::vector<Eigen::Matrix<double, 6, 6>> pose_covariance_;  // per camera, CameraTrust
  bool has_pose_covariance_ = false;
  // A view that should show the object and does not, or that is searched.
  struct Unseen {
    unsigned sets = 0;                                // one after the other
    std::vector<ColorRegion> older = {}, newer = {};  // in the whole image, when it was looked at before
    capture::Timestamp older_at{}, newer_at{};
    bool is_suspicious = false;  // something moved in it when it was last looked at
  };
  std::vector<Unseen> unseen_;            // per camera
  std::vector<SeenRegion> seen_regions_;  // of this set
  std::vector<ColorShare> color_shares_;  // per camera
  std::size_t shared_next_ = 0;           // the camera whose share is measured next
  capture::Timestamp shared_at_ = capture::Timestamp::min();
  std::vector<PixelAt> hits_;
  RigError rig_error_;
  struct LinearView {
    const Sighting* sighting;
    LinearSighting linear;
  };
  std::vector<LinearView> linear_views_;  // of the proposal
  double surprise_ = 0;                   // of them, 1 when all is as it should be
  // What was seen of the object since it was found, as long as the times may turn out to be others.
  struct SeenSet {
    double power_density;
    std::vector<Sighting> sightings;
    capture::Timestamp believed_at;  // what was believed of the motion after it
    Eigen::Vector3d position, velocity;
  };
  std::deque<SeenSet> seen_sets_;
  int moving_sets_ = 0;                // among them, since the times were linearised again
  bool is_forgetting_motion_ = false;  // seen_sets_ had to be given up: what they told of times is only in the belief
  struct LastRegion {
    ColorRegion region = {};
    capture::Timestamp captured_at{};
    bool is_repeated = false;
  };
  std::vector<LastRegion> last_regions_;           // per camera: what was sighted last
  std::vector<SizeInView> size_in_view_;           // per camera
  std::vector<RegionFinder> finders_;              // per camera
  std::vector<std::vector<ColorRegion>> regions_;  // of the views of this set, while searching
  SearchLog search_log_;
  std::vector<PositionCandidate> candidates_;  // of the last set, while searching
  capture::Timestamp candidates_at_{};

  TrackState state_ = TrackState::searching;
  capture::Timestamp last_at_{}, last_tracking_{};  // of the sets
  bool has_begun_ = false;                          // an object was found: times are being learnt
  std::size_t sets_apart_ = 0;                      // whose frames were not taken at one moment
  capture::Timestamp last_reported_ = capture::Timestamp::min();
};

}  // namespace huetrack::object_tracking
