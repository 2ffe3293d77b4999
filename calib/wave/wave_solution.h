// One solution of a wave: which region of every frame is the ball, the poses and the path that suit them. Private to
// this module.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/wave/time_signs.h"
#include "calib/wave/wave.h"
#include "calib/wave/wave_adjustment.h"
#include "calib/wave/wave_start.h"
#include "object_tracking/sighting.h"

namespace huetrack::wave {

// Frames that two cameras must share to be connected, and that a camera must agree in with the others.
inline constexpr int least_shared = 20;

// How far it is, for the progress: two rough steps, two times refine(), settle(), two halves.
struct WaveSteps {
  static constexpr int most_rounds = 8;  // of refine()
  static constexpr int refined = 2, refined_again = refined + most_rounds, settled = refined_again + most_rounds,
                       halves = settled + 1, all = halves + 2;
};

// rig, frames and options must outlive it; frames ascend in time. thread-compatible; a copy goes its own way.
class WaveSolution {
 public:
  WaveSolution(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, const WaveOptions& options);

  // Poses and path that suit the frames best, from these poses on. What does not agree is left out. `any_scale`: that
  // of the start means nothing; take the one at which the ball looks as large as it is. throws CalibrationError
  void solve(const WaveStart& start, bool any_scale);
  // Whatever agrees by its own covariance; what it is compared with is learnt anew in every round. step: the first of
  // WaveSteps::most_rounds that are told.
  void refine(int step);
  // Once more, for what is chosen, from where it is; with its covariance.
  void settle();

  // The same frames at times that differ by little; they must outlive it.
  void retime(const std::vector<BallFrame>& frames) { frames_ = &frames; }
  // Only every other piece of the recording, of a second or so.
  void keep_half(int half);

  // What speaks against this solution: lower is better.
  double misfit() const;
  double used_share() const;  // of the frames with a region in them
  // When a region of a frame was exposed, by what is known of its camera's times.
  double exposed_s(const BallFrame& frame, const color::ColorRegion& region) const {
    return state_.exposed_s(rig_, frame.camera, frame.t_s, region.centre);
  }
  // How large the ball looks over how large it should, at the scale as it is.
  double size_ratio() const;
  BallTracks tracks() const;
  std::vector<BallObservation> observations() const;

  // Per camera.
  std::vector<TimeSigns> signs() const;
  // What the covariance takes for the times' own unmodelled wandering; see WaveAdjustmentOptions::wander_s.
  void set_wander(std::vector<double> wander_s) { wander_s_ = std::move(wander_s); }

  WaveState& state() { return state_; }
  const WaveState& state() const { return state_; }
  Eigen::Vector3d centre(int camera) const {
    return calib::inverse(state_.cam_from_world[static_cast<std::size_t>(camera)]).translation;
  }
  const WaveFit& fit() const { return fit_; }
  double from_s() const { return from_s_; }
  double to_s() const { return to_s_; }
  double frame_s(std::size_t camera) const { return frame_s_[camera]; }  // from one of its frames to the next, usually
  double step_s() const { return step_s_; }                              // the shortest of those
  double jerk_m_s3() const { return jerk_m_s3_; }

 private:
  void tell(const char* step, int done) const;
  void find_span();
  const color::ColorRegion& region(std::size_t f) const;
  WaveAdjustmentOptions adjustment_options() const;
  std::optional<object_tracking::BallProjection> appearance(const BallFrame& frame,
                                                            const color::ColorRegion& region) const;
  void learn_jerk();
  void learn_shapes();
  std::optional<Eigen::Matrix2d> covariance_of(std::size_t f, const color::ColorRegion& region,
                                               const object_tracking::BallProjection& at) const;
  std::optional<double> cost_of(std::size_t f, const color::ColorRegion& region) const;
  void choose(double sigmas);

  const calib::CameraRig& rig_;
  const std::vector<BallFrame>* frames_;
  const WaveOptions& options_;
  std::vector<int> chosen_;      // beside the frames: the region that is taken for the ball; -1: none
  std::vector<double> frame_s_;  // per camera
  double from_s_ = 0, to_s_ = 0, step_s_ = 0, longest_s_ = 0;
  bool in_step_ = false;                // all cameras' frames are stamped alike
  std::vector<double> wander_s_;        // see set_wander()
  bool rough_ = true;                   // all outlines count the same
  double jerk_m_s3_ = 60;               // see learn_jerk()
  std::vector<Eigen::Vector2d> blur2_;  // per camera: see learn_shapes()
  WaveState state_;
  WaveFit fit_;
};

}  // namespace huetrack::wave
