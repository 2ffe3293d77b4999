// Kalman filter over one object's motion and, as nuisance states, each camera's timing and image bias. Model and
// equations: design.md.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::object_tracking {

// Of a camera that the rig has no timing of. Latency: drivers stamp 0 to 45 ms after mid-exposure, uniform 13 ms rms,
// 18 ms for a difference of two. Readout: 10 to 33 ms for rolling shutters, 0 for global ones, either sign.
struct TimePriorTuning {
  double unknown_sigma_s = 0.020;  // s
  double same_sigma_s = 3e-4;      // s, cameras with one trigger; shading and lamp flicker shift a row by as much
};
inline constexpr TimePriorTuning time_prior{};

// The image row in which something is seen.
struct SeenRow {
  int camera = 0;
  double below_middle = 0;  // r / (H - 1) - 1/2
  capture::Timestamp at{};  // when it was exposed, by the timing estimated when the frame set came
  double shift_s = 0;       // what that estimate added to the frame's own time
};

// A measurement of the object's projected centre, and the linearised projection.
struct LinearSighting {
  SeenRow row;
  Eigen::Vector2d px;                                   // measured, raw pixels
  Eigen::Matrix2d covariance;                           // px^2, independent in every frame
  double bias_sigma_px = 0;                             // 1 sigma of the slowly varying bias
  Eigen::Matrix2d inflation = Eigen::Matrix2d::Zero();  // px^2, of the bias in addition: pose, inconsistent views
  Eigen::Vector3d linearised_at;                        // a position near the object's at row.at, metres
  Eigen::Vector2d px_expected;                          // its projection
  Eigen::Matrix<double, 2, 3> jacobian;                 // d px / d p_world there, px/m
  Eigen::Vector3d ray;                                  // from the camera's centre to linearised_at, m
};

// A measurement of the object's radius in an image, and so of its distance, linearised in the logarithm.
struct LinearSize {
  SeenRow row;
  double log_off = 0;             // log of the measured radius over that expected at linearised_at
  double variance = 0;            // of the log, independent in every frame
  double bias_sigma = 0;          // 1 sigma of the log's slowly varying bias
  bool is_bias_constant = false;  // it does not vary
  Eigen::Vector3d linearised_at;  // a position near the object's at row.at, metres
  Eigen::Vector3d ray;            // from the camera's centre to linearised_at, m
};

// On the cameras' timing, in information form: inverse covariance (1/s^2) and its product with the mean (1/s). States:
// readout of the reference camera, then latency and readout of each further one.
struct TimesInformation {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd vector;
};

// Variance and standard deviation along the least certain axis; >= 0.
double largest_variance(const Eigen::Matrix3d& covariance);
double largest_sigma(const Eigen::Matrix3d& covariance);

// Mean and covariance of
//   position (m), velocity (m/s)    world frame, at time `at`; constant velocity, white acceleration of power density
//                                   q (m^2/s^3; Bar-Shalom, Li, Kirubarajan 2001, section 6.2.2)
//   per camera, latency, readout    s, corrections to the frames' own times; only where times are learnt
//   per camera, image bias          px, 2 coordinates: shading, pose error; a Gauss-Markov process along the object's
//   path
//   with one camera, size, size bias  log of the object's radius over the configured one, constant; log of the bias of
//                                   the radius in the image, by blur and shading: the same kind of process
// A sighting in row r measures position + (t - at) velocity at t = its time - latency + below_middle * readout.
// thread-compatible.
class MotionState {
 public:
  // Its latency is fixed: a common shift of all latencies moves the object along its path and changes no image.
  static constexpr int reference_camera = 0;  // layout
  static constexpr int max_cameras = 64;      // capacity: a measurement's row of the covariance fits on the stack

  // times_are_learnt: false takes the rig's timing; its stated uncertainty is then measurement noise.
  // Throws std::invalid_argument for more than max_cameras.
  MotionState(const calib::CameraRig& rig, bool times_are_learnt);

  capture::Timestamp at{};
  Eigen::Vector3d position() const { return mean_.head<3>(); }
  Eigen::Vector3d velocity() const { return mean_.segment<3>(3); }
  // Along the velocity, forwards or backwards.
  Eigen::Vector3d position_at(capture::Timestamp when) const {
    return position() + capture::seconds(when - at) * velocity();
  }
  Eigen::Matrix3d position_covariance() const { return covariance_.topLeftCorner<3, 3>(); }
  Eigen::Matrix3d velocity_covariance() const { return covariance_.block<3, 3>(3, 3); }

  // The state conditioned on the nuisance states at their means. With many cameras this costs as much as an update;
  // cache_nuisance_part() computes it once for several calls.
  MotionState conditioned_on_nuisances() const;
  Eigen::Matrix3d position_covariance_conditioned() const;
  void cache_nuisance_part();
  // Adds the nuisance covariance of `other` back; this was other.conditioned_on_nuisances() and may have been moved.
  void reinflate_nuisances(const MotionState& other);

  // Before the first measurement of a set. Where frames are stamped by another host's clock, opens the latencies of its
  // cameras by that clock's uncertainty: one error per host, which wanders and so cannot be averaged away.
  void open_clocks(const capture::FrameSet& set);
  void adopt_clocks(const MotionState& known) { clocks_ = known.clocks_; }
  // Variance of the reference camera's clock against this host's, s^2. No view can measure it.
  double clock_variance_s2() const { return clocks_[reference_camera].variance_s2; }

  // The cameras share a trigger: tightens the priors of latency and readout. Before anything is learnt; without effect
  // after correct_times().
  void expect_synchronised();
  // Adds late_s, one per camera, to the latencies: an error found by something else (jumped stamps, a wrong rig).
  // Reopens the latencies of cameras that differ from the reference camera, and the position by the motion in that
  // time. Without effect where times are not learnt.
  void correct_times(std::span<const double> late_s);
  // To add to the frame's time for this row, and its standard deviation.
  double row_offset_s(int camera, double below_middle) const;
  double row_sigma_s(int camera, double below_middle) const;
  CameraTimingEstimate timing(int camera) const;

  // Several objects of one rig share its timing (shared_times.h). Its joint posterior factorises: given the timing, the
  // objects are independent. So each adds what the others' measurements show, and no measurement counts twice.
  // What this object's measurements have shown since set_times_shared(); before the first call, since the prior. Zero
  // where times are not learnt.
  TimesInformation unshared_times() const;
  // Adds what others have shown. Position, velocity and biases follow by regression. Without effect where times are not
  // learnt, and if `shown` contradicts (the sum is no information matrix).
  void add_times(const TimesInformation& shown);
  void set_times_shared();       // the others know what this object's measurements have shown by now
  void forget_unshared_times();  // a new object begins with what all objects share
  void adopt_shared_times(const MotionState& known) {
    shared_times_ = known.shared_times_, since_shared_s_ = known.since_shared_s_;
  }
  void adopt_time_assumptions(const MotionState& other);  // expect_synchronised() and correct_times(), if it had them

  // A new object. Timing is kept, biases are reset.
  void begin(capture::Timestamp when, const Eigen::Vector3d& position, double position_variance,
             const Eigen::Vector3d& velocity, double velocity_variance);
  // Forward only.
  void predict_to(capture::Timestamp when, double power_density);
  void reset_bias(int camera);  // the camera was moved
  // Kalman update; returns the normalised innovation squared (2 dof). A sighting from before `at` is compared with the
  // position then, process noise included. velocity: at which position and time are linearised.
  double observe(const LinearSighting& sighting, const Eigen::Vector3d& velocity, double power_density);
  // With one camera: the same for a radius (1 dof), robustly, as something may hide a part of the object.
  double observe_size(const LinearSize& size, const Eigen::Vector3d& velocity, double power_density);
  // With one camera: mean and sigma of the log of the radius in the image over that of a ball of the configured radius
  // at position_at(row.at). ray: from the camera's centre to there.
  std::pair<double, double> expected_log_size(const SeenRow& row, const Eigen::Vector3d& ray) const;
  bool has_size() const { return given_.size() == 1; }
  double log_size() const { return mean_(size_at()); }
  double log_size_sigma() const { return std::sqrt(covariance_(size_at(), size_at())); }
  // The timing has moved far from where velocity * time was linearised: the covariance is too small.
  bool needs_relinearisation() const;
  void relinearise_times_at(const MotionState& known);  // at its means, from the next observe() on
  // Replaces the position's mean and covariance; everything else follows by regression.
  void set_position(const Eigen::Vector3d& mean, const Eigen::Matrix3d& covariance);

  // Where this row's camera sees the object (a position y) given the position at `at`:
  // E[y | position] = slope * position + offset.
  struct ConditionalMeasurement {
    Eigen::Matrix3d slope;
    Eigen::Vector3d offset;
    Eigen::Matrix3d covariance;
  };
  ConditionalMeasurement measurement_given_position(const SeenRow& row, double power_density) const;
  Eigen::Vector2d bias(int camera) const { return mean_.segment<2>(bias_of(camera)); }  // px
  Eigen::Matrix3d seen_covariance(const SeenRow& row, double power_density) const;      // of y; any row time

 private:
  Eigen::Index size() const { return mean_.size(); }
  Eigen::Index latency_of(int camera) const { return 6 + 2 * camera; }
  Eigen::Index bias_of(int camera) const {
    return size() - 2 * static_cast<Eigen::Index>(given_.size()) - (has_size() ? 2 : 0) + 2 * camera;
  }
  Eigen::Index size_at() const { return size() - 2; }
  Eigen::Index size_bias_at() const { return size() - 1; }
  // y = position + dt velocity + v (below_middle readout - latency), linear in the state.
  struct SeenBy {
    const SeenRow& row;
    double dt;
    Eigen::Vector3d v;
  };
  static constexpr int most_states = 6 + 4 * max_cameras;  // layout
  template <int rows>
  using WithState = Eigen::Matrix<double, rows, Eigen::Dynamic, Eigen::ColMajor, rows, most_states>;
  WithState<2> two_rows(Eigen::Index i) const;                         // of the covariance, i >= 6 and i + 1
  double below_diagonal(Eigen::Index row, Eigen::Index column) const;  // of the covariance
  void settle();                                                       // applies gains_ and seen_
  WithState<3> covariance_with_state(const SeenBy& by) const;          // of y
  template <int rows>                                                  // times the transpose of y's coefficients
  Eigen::Matrix<double, rows, 3> onto(const SeenBy& by, const WithState<rows>& with_state) const;
  // The part of the motion's covariance that the nuisance states explain.
  Eigen::Matrix<double, 6, 6> by_nuisances() const;
  // Process noise between the row and `at`, second order of velocity * time, and uncertain given times.
  Eigen::Matrix3d unmodelled(const SeenBy& by, double power_density) const;
  // Of the log of the radius in the image.
  struct SizeMoments {
    Eigen::RowVectorXd with_state;
    double variance;
  };
  SizeMoments size_moments(const SeenBy& by, const Eigen::Vector3d& ray, double power_density) const;
  // Kalman update; of_state: covariance of the state with what is measured.
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::ColMajor, most_states, 2>;
  void apply(const Columns& gain, const Columns& of_state, const Eigen::Vector2d& innovation);
  void scale_with_distance(const Eigen::Matrix<double, 6, 1>& step, const Eigen::Vector3d& ray);
  void propagate_size_bias(double sigma, bool is_constant);
  void propagate_bias(int camera, double bias_sigma_px, const Eigen::Matrix2d& inflation);
  // Of the clock that stamps a camera's frames against that of the reference camera; 0 where it is the same one.
  double relative_clock_variance_s2(int camera) const;

  struct Times {  // as TimesInformation, in moments
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
  };
  Eigen::Index times_size() const { return times_linearised_.size() - 1; }  // the reference latency is fixed
  Times times() const;
  Times shared_times() const;  // with the walk since then
  void set_times(const Times& times);
  void keep_times_open(const Eigen::Ref<const Eigen::VectorXd>& variances_before);  // of times(): their least sigmas

  bool times_are_learnt_;
  bool is_synchronised_ = false;
  bool are_times_corrected_ = false;
  Eigen::VectorXd times_linearised_;           // the timing at which velocity * time was linearised
  std::shared_ptr<const Times> shared_times_;  // the prior, later what all objects knew when they shared it last
  double since_shared_s_ = 0;                  // predicted since then: the latencies have walked
  Eigen::VectorXd mean_;
  // Valid on and below the diagonal, and in all of the motion's own 6 x 6.
  Eigen::MatrixXd covariance_;
  // With many cameras the covariance exceeds the cache, and passing over it dominates an update. So several updates are
  // applied at once: below the diagonal and right of the motion's columns, the covariance is covariance_ less
  // gains_ seen_^T, of which open_ columns are in use.
  Eigen::MatrixXd gains_, seen_;
  Eigen::Index open_ = 0;
  std::optional<Eigen::Matrix<double, 6, 6>> by_nuisances_;  // cache
  struct Given {                                             // by the rig
    double latency_s = 0, readout_s = 0;
    double latency_variance_s2 = 0, readout_variance_s2 = 0;  // where times are not learnt
    double readout_prior_s2 = 0;                              // where they are
  };
  std::vector<Given> given_;  // per camera
  struct Clock {
    std::uint16_t of = 0;  // capture::StampClock
    double variance_s2 = 0;
  };
  std::vector<Clock> clocks_;  // per camera, of its last frame
  struct Bias {
    double sigma_px = 0;                                  // at the last sighting; 0: there was none
    double path_m = 0;                                    // since then
    Eigen::Matrix2d inflation = Eigen::Matrix2d::Zero();  // at the last sighting
  };
  std::vector<Bias> biases_;                      // per camera
  double size_bias_sigma_ = 0, size_path_m_ = 0;  // at the last measured radius (0: there was none), and since then
  bool is_size_bias_constant_ = false;            // the same
};

}  // namespace huetrack::object_tracking
