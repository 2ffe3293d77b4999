// What is believed of a target's motion, and of when each camera's rows were exposed: one Gaussian over both, since
// neither is known without the other. A moving object that two cameras see at unknown times is at an unknown place; how
// its sightings disagree while it moves tells the times.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frame.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::object_tracking {

// The row of a view in which something is seen.
struct SeenRow {
  int camera = 0;
  double below_middle = 0;  // r / (H - 1) - 1/2
  capture::Timestamp at{};  // when it was exposed, with the camera's times as they were believed
  double shift_s = 0;       // when the set came: what they added to the frame's own time
};

// A measurement of the object's projected centre, and how its projection moves with it.
struct LinearSighting {
  SeenRow row;
  Eigen::Vector2d px;          // measured, raw pixels
  Eigen::Matrix2d covariance;  // px^2, of what is new in every frame
  double lasting_px = 0;       // standard deviation of what lasts: see MotionBelief
  // px^2, of what lasts besides: the camera's pose is not quite known, or views contradict it.
  Eigen::Matrix2d doubt = Eigen::Matrix2d::Zero();
  Eigen::Vector3d linearised_at;         // a position near the object's when the row was exposed, metres
  Eigen::Vector2d px_expected;           // its projection
  Eigen::Matrix<double, 2, 3> jacobian;  // d px / d p_world there, px/m
};

// Variance, and standard deviation, along the axis on which least is known; 0 and above.
double largest_variance(const Eigen::Matrix3d& covariance);
double largest_sigma(const Eigen::Matrix3d& covariance);

// State: position (m) and velocity (m/s) in the world at `at`, then for each camera what its latency and its readout
// differ from those that its frames' times were made with (s). Motion: constant velocity with white acceleration of a
// power density q (m^2/s^3; Bar-Shalom, Li, Kirubarajan 2001, section 6.2.2). Times: as good as constant.
// And for each camera how far the object is seen beside where it is (px, two coordinates): it is lit from one side, and
// its bright side matches further out than its dark one. Such an error lasts while the object rests and changes as it
// moves through the light. Left out, it would pass for noise, which many frames average away, and what remains of it in
// a slow motion would be taken for latencies. The same holds, pixels instead of fractions of one, where the camera does
// not quite stand where the rig says (LinearSighting::doubt). A sighting sees position + (t - at) velocity at its row's
// time t, which is later by -latency + below_middle * readout. thread-compatible.
class MotionBelief {
 public:
  // One of the rig's cameras gives the time on which all hangs: its latency is held, as one shift of all latencies
  // moves the object along its path and changes no picture. It is the first one.
  static constexpr int reference_camera = 0;
  // So that what a sighting says fits on the stack: nothing is allocated while a set is worked on.
  static constexpr int max_cameras = 64;

  // Throws std::invalid_argument for more cameras than that.
  // times_are_learnt: otherwise the rig's hold, and what it states of their uncertainty counts as noise of a sighting.
  MotionBelief(const calib::CameraRig& rig, bool times_are_learnt);

  capture::Timestamp at{};
  Eigen::Vector3d position() const { return mean_.head<3>(); }
  Eigen::Vector3d velocity() const { return mean_.segment<3>(3); }
  // If it goes on, or came, as it moves now.
  Eigen::Vector3d position_at(capture::Timestamp when) const {
    return position() + capture::seconds(when - at) * velocity();
  }
  Eigen::Matrix3d position_covariance() const { return covariance_.topLeftCorner<3, 3>(); }
  Eigen::Matrix3d velocity_covariance() const { return covariance_.block<3, 3>(3, 3); }
  // The whole belief, if what is believed of the views, their times and what lasts, were known to be so; and of it the
  // position's covariance. With many cameras it costs as much as all else: who asks more than once, or hands it to
  // open_views_as(), has it worked out beforehand.
  MotionBelief given_views() const;
  Eigen::Matrix3d position_covariance_given_views() const;
  void work_out_views();
  // Undoes it: what the views leave open, of all, is as it is in `other`, of which this was given_views() and may have
  // been moved since.
  void open_views_as(const MotionBelief& other);

  // The frames of this set, before anything is observed in them: those whose stamps are of another host's clock are
  // known in time no better than that clock is, next to the one that stamps the reference camera's. It is one error of
  // all cameras of a host; it wanders, so that nothing that was learnt of it in earlier sets makes it smaller again.
  void open_clocks(const capture::FrameSet& set);
  void adopt_clocks(const MotionBelief& known) { clocks_ = known.clocks_; }
  // What that leaves open of the time itself to which positions refer, s^2: of the clock that stamps the reference
  // camera's frames next to ours. No view can tell it.
  double clock_variance_s2() const { return clocks_[reference_camera].variance_s2; }

  // The cameras are triggered together: their frames' times have been the same. Before anything is learnt only, and
  // not after correct_times(). Then
  // latencies hardly differ, and such cameras mostly have global shutters.
  void expect_in_step();
  // Per camera of the rig: its frames were found to be later than is believed by so much, by something that this belief
  // cannot see: times that jumped, or were held to be known. 0: as it is believed. The reference camera's is held
  // thereafter where it is put. The latencies of those that differ from it are open again, as of cameras of which
  // nothing is known; that the cameras are in step is believed no longer; and the motion, which was seen by wrong
  // times, is open as far as these move it. Nothing where times are not learnt.
  void correct_times(std::span<const double> late_s);
  // What is to be added to the frame's time for this row of this camera, and how well that is known (standard
  // deviation).
  double row_shift_s(int camera, double below_middle) const;
  double row_sigma_s(int camera, double below_middle) const;
  CameraTimingEstimate timing(int camera) const;

  // A new object: what was learnt of the cameras stays.
  void begin(capture::Timestamp when, const Eigen::Vector3d& position, double position_variance,
             const Eigen::Vector3d& velocity, double velocity_variance);
  // Forward only.
  void predict_to(capture::Timestamp when, double power_density);
  // The camera stands elsewhere: what lasted there, lasts no more.
  void forget_lasting(int camera);
  // Kalman update. Returns the squared innovation in its own standard deviations: 2 on average. A sighting from before
  // `at` is compared with where the object was then, swerves included. velocity: that of the linearisation.
  double observe(const LinearSighting& sighting, const Eigen::Vector3d& velocity, double power_density);
  // Velocity times time is a product of two unknowns, which observe() takes at the times' means of then. They are far
  // from those by now: what was learnt on the way was linearised at wrong times, and is surer than it should be.
  bool are_times_far() const;
  // What is observed from now on is linearised at the times' means of `known`.
  void linearise_times_at(const MotionBelief& known);
  // The position's mean and covariance are replaced; all else follows by regression on the position.
  void set_position(const Eigen::Vector3d& mean, const Eigen::Matrix3d& covariance);

  // What the camera of the sighting sees is y, a position. E[y | position] = slope * position + offset, and what is
  // left open of it.
  struct SeenPosition {
    Eigen::Matrix3d slope;
    Eigen::Vector3d offset;
    Eigen::Matrix3d covariance;
  };
  SeenPosition seen_given_position(const SeenRow& row, double power_density) const;
  // How far the camera is believed to see the object beside where it is, px.
  Eigen::Vector2d lasting_error(int camera) const { return mean_.segment<2>(lasting_of(camera)); }
  // Of y itself; the row may be later or earlier than `at`.
  Eigen::Matrix3d seen_covariance(const SeenRow& row, double power_density) const;

 private:
  Eigen::Index size() const { return mean_.size(); }
  Eigen::Index latency_of(int camera) const { return 6 + 2 * camera; }
  Eigen::Index lasting_of(int camera) const {
    return size() - 2 * static_cast<Eigen::Index>(given_.size()) + 2 * camera;
  }
  // y = position + dt velocity + v (below_middle readout - latency) is linear in the state; v is the velocity that it
  // is linearised at.
  struct SeenBy {
    const SeenRow& row;
    double dt;
    Eigen::Vector3d v;
  };
  static constexpr int most_states = 6 + 4 * max_cameras;
  template <int rows>
  using WithState = Eigen::Matrix<double, rows, Eigen::Dynamic, Eigen::ColMajor, rows, most_states>;
  WithState<2> two_rows(Eigen::Index i) const;  // of the covariance, from the i-th on, which is none of the motion's
  double below_diagonal(Eigen::Index row, Eigen::Index column) const;  // of the covariance
  // Takes off what is open.
  void settle();
  WithState<3> covariance_with_state(const SeenBy& by) const;
  template <int rows>  // the product with the transpose of y's coefficients
  Eigen::Matrix<double, rows, 3> onto(const SeenBy& by, const WithState<rows>& with_state) const;
  // The part of the motion's covariance that follows from that of the times and of what lasts.
  Eigen::Matrix<double, 6, 6> by_views() const;
  // What is not in the state: swerves between the row and `at`, and times that are given with an uncertainty.
  Eigen::Matrix3d unmodelled(const SeenBy& by, double power_density) const;

  void renew_lasting(int camera, double lasting_px, const Eigen::Matrix2d& doubt);
  // Of the clock that stamps a camera's frames next to that of the reference camera; 0 where it is the same one.
  double relative_clock_variance_s2(int camera) const;

  bool times_are_learnt_;
  bool is_in_step_ = false;           // it is held that the cameras are triggered together
  bool are_times_corrected_ = false;  // they are not
  Eigen::VectorXd times_linearised_;  // their means when they were last linearised at
  Eigen::VectorXd mean_;
  // Below the diagonal and on it, and all of the motion's own 6 x 6; what is not kept is the mirror of what is.
  Eigen::MatrixXd covariance_;
  // With so many cameras that the matrix is larger than what a processor keeps near itself, going through it is what an
  // observation costs. So that it is done once for several of them, what they take off is put aside: off what is below
  // the diagonal and right of the motion's columns, gains_ times the transpose of seen_, as far as their first open_
  // columns go. All else is as it is.
  Eigen::MatrixXd gains_, seen_;
  Eigen::Index open_ = 0;
  std::optional<Eigen::Matrix<double, 6, 6>> by_views_;  // of this covariance; nullopt: not worked out
  struct Given {                                         // by the rig
    double latency_s = 0, readout_s = 0;
    double latency_variance_s2 = 0, readout_variance_s2 = 0;  // where times are not learnt
    double readout_prior_s2 = 0;                              // where they are, before anything was
  };
  std::vector<Given> given_;  // per camera
  struct Clock {
    std::uint16_t of = 0;  // capture::StampClock
    double variance_s2 = 0;
  };
  std::vector<Clock> clocks_;  // per camera, of its last frame
  struct Lasting {
    double px = 0;     // the standard deviation that what lasts had at the last sighting; 0: there was none,
    double way_m = 0;  // the way since then,
    Eigen::Matrix2d doubt = Eigen::Matrix2d::Zero();  // and the variance of the doubt that was a part of it
  };
  std::vector<Lasting> lasting_;  // per camera
};

}  // namespace huetrack::object_tracking
