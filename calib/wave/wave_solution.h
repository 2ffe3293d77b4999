// One solution of a wave: data association (which region of each frame is the ball), poses, timing and path. Private to
// this module.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/wave/outline_cost.h"
#include "calib/wave/timing_diagnostics.h"
#include "calib/wave/wave.h"
#include "calib/wave/wave_adjustment.h"
#include "calib/wave/wave_start.h"
#include "object_tracking/sighting.h"

namespace huetrack::wave {

// Frames that two cameras must share, and in which a camera must agree with the others.
inline constexpr int least_shared = 20;

// Steps of the progress: solve() twice (two rough ones, then refine()), refine(), settle(), two halves.
struct WaveSteps {
  static constexpr int most_rounds = 8;  // of refine()
  static constexpr int refined = 2, solved = refined + most_rounds, refined_again = 2 * solved,
                       settled = refined_again + most_rounds, halves = settled + 1, all = halves + 2;
};

// frames and options must outlive it; frames ascend in time. thread-compatible; copies are independent.
class WaveSolution {
 public:
  WaveSolution(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, const WaveOptions& options);

  // From these poses. any_scale: the start's scale is arbitrary; the ball's apparent size replaces it. lenses_first:
  // the first poses are of free lenses. throws CalibrationError
  void solve(const WaveStart& start, bool any_scale, bool lenses_first);
  // Alternates association, learnt noise model and adjustment. step: the first of WaveSteps::most_rounds reported.
  void refine(int step);
  // One more adjustment with the association as it is; sets the covariance.
  void settle();

  void silence() { is_silent_ = true; }  // no progress

  // The same frames with slightly other times; they must outlive it.
  void retime(const std::vector<BallFrame>& frames) { frames_ = &frames; }
  // Keeps every other piece of the recording (1/20 of it, at least a second). half: 0 or 1.
  void keep_half(int half);

  double misfit() const;      // less log odds over clutter, with the cost of changed lenses: lower is better
  bool is_possible() const;   // all readouts are
  double used_share() const;  // of the frames with a region
  double exposed_s(const BallFrame& frame, const color::ColorRegion& region) const {
    return state_.exposed_s(rig_, frame.camera, frame.t_s, region.centre);
  }
  double size_ratio() const;  // median apparent over expected radius, at the present scale
  // Share of the camera's outlines, used ones, that are narrower or wider than a whole ball's.
  double partly_seen(std::size_t camera) const;
  bool is_held() const;  // much of a camera's
  BallTracks tracks() const;
  std::vector<BallObservation> observations() const;
  std::vector<LinearOutline> linear_outlines() const;  // of these, by time

  std::vector<TimingDiagnostics> timing() const;                                      // per camera
  void set_wander(std::vector<double> wander_s) { wander_s_ = std::move(wander_s); }  // WaveAdjustmentOptions::wander_s

  WaveState& state() { return state_; }
  const WaveState& state() const { return state_; }
  Eigen::Vector3d centre(int camera) const {
    return calib::inverse(state_.cam_from_world[static_cast<std::size_t>(camera)]).translation;
  }
  const calib::CameraRig& rig() const { return rig_; }  // as given, with the lenses of the state
  const calib::CameraModel& lens(std::size_t camera) const { return rig_.cameras[camera].model; }
  const WaveFit& fit() const { return fit_; }
  double from_s() const { return from_s_; }
  double to_s() const { return to_s_; }
  double frame_s(std::size_t camera) const { return frame_s_[camera]; }  // median interval of its frames
  double step_s() const { return step_s_; }                              // the shortest of those
  double longest_frame_s() const { return longest_s_; }                  // and the longest
  double jerk_m_s3() const { return jerk_m_s3_; }

 private:
  void report_progress(const char* step, int done) const;
  void find_span();
  const color::ColorRegion& region(std::size_t f) const;
  WaveAdjustmentOptions adjustment_options() const;
  std::optional<object_tracking::BallProjection> appearance(const BallFrame& frame,
                                                            const color::ColorRegion& region) const;
  void choose_consistent();
  void set_prior_weights(WaveAdjustmentOptions& o) const;
  void learn_jerk();
  void learn_shapes();
  Eigen::Vector2d width_misfit(const BallFrame& frame, const color::ColorRegion& region,
                               const object_tracking::BallProjection& at) const;
  Eigen::Matrix2d covariance_of(const BallFrame& frame, const color::ColorRegion& region,
                                const object_tracking::BallProjection& at) const;
  struct Match {
    double distance2, log_odds;  // Mahalanobis, squared; log likelihood over that of clutter
  };
  std::optional<Match> match_of(std::size_t f, const color::ColorRegion& region) const;
  void associate(double sigmas);

  void adjust(const WaveAdjustmentOptions& options);  // with the observations as they are associated

  const calib::CameraRig given_;
  calib::CameraRig rig_;  // given_, with the lenses of state_
  const std::vector<BallFrame>* frames_;
  const WaveOptions& options_;
  std::vector<int> chosen_;      // per frame: the associated region; -1: none
  std::vector<double> frame_s_;  // per camera
  double from_s_ = 0, to_s_ = 0, step_s_ = 0, longest_s_ = 0;
  bool is_silent_ = false;              // see silence()
  bool in_step_ = false;                // the cameras' stamps are synchronised
  std::vector<double> wander_s_;        // see set_wander()
  bool rough_ = true;                   // all outlines have the same covariance
  bool lenses_first_ = false;           // see solve()
  double jerk_m_s3_ = 60;               // see learn_jerk()
  std::vector<Eigen::Vector2d> blur2_;  // per camera: see learn_shapes(); px^2
  std::vector<double> edge2_;           // per camera: mean squared misfit of widths, over the radius
  WaveState state_;
  WaveFit fit_;
};

}  // namespace huetrack::wave
