// Where cameras saw a target over the recent past, and how far two cameras' rays pass each other: with the rig as it
// is, and with one thing in it supposed to be otherwise.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::view_watch {

// What one camera saw at one time.
struct SeenPoint {
  double t_s = 0;           // of its row, by the times that are believed; on one clock for all cameras
  Eigen::Vector2d px;       // raw pixels
  double radius_px = 0;     // of the disc of the region's area
  double sigma_px = 0;      // standard deviation of px on each axis
  double below_middle = 0;  // the row: r / (H - 1) - 1/2
  Eigen::Vector3d ray;      // through px, camera frame, unit
  bool is_target = false;   // the tracker takes it for the target; otherwise only for something of its colour
};
using Track = std::deque<SeenPoint>;  // of one camera, by time

// In the middle of the picture: a pixel there is 1 / focal_px radians wide.
double focal_px(const calib::Camera& camera);

// Of the middle of a region: how coarse its edge is, and light from one side.
double sigma_of_region_px(double radius_px);

// One thing that is otherwise than the rig says.
struct Supposition {
  // Which camera of the rig really took the frames that are taken for camera c's; empty: each its own.
  std::vector<std::size_t> really = {};
  // Per camera: its times are to be made earlier by so much. Empty: none are.
  std::vector<double> late_s = {};
  std::size_t camera = 0;                              // that the rest is of
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();  // cam_from_world = exp(turn) * the rig's
  double zoom = 1;                                     // its focal length is so many times the rig's
  bool is_mirrored = false;                            // left and right are exchanged in its pictures
};

// How the rays of two cameras pass each other.
struct PairResiduals {
  std::vector<double> off_px;    // across the epipolar lines; its sign says on which side
  std::vector<double> expected;  // standard deviation of it, px
  std::vector<double> radius_m;  // of the ball that both saw, where they agree about it
  double usual() const;          // median of |off_px| / expected; 0.67 is perfect. Infinity: too few samples
  double usual_px() const;       // median of |off_px|
};

// How well times are known: standard deviations, per camera, seconds.
using TimeSigmas = std::vector<double>;

// Pure; lent the rig.
class PairComparison {
 public:
  explicit PairComparison(const calib::CameraRig& rig);

  static constexpr std::size_t least_samples = 12;

  PairResiduals residuals(const std::vector<Track>& tracks, std::size_t i, std::size_t j, const Supposition& with,
                          const TimeSigmas& times) const;
  // Over all pairs that have enough samples.
  struct Agreement {
    std::size_t pairs = 0;
    double worst = 0;  // the largest usual()
    double score = 0;  // mean of (off / expected)^2, with at most 25 for each: a robust cost
    double worst_px = 0;
  };
  static void add(Agreement& agreement, const PairResiduals& pair);
  Agreement agreement(const std::vector<Track>& tracks, const Supposition& with, const TimeSigmas& times) const;
  // Of the pairs with this camera, or without it.
  Agreement agreement_of(const std::vector<Track>& tracks, std::size_t camera, bool with_it, const Supposition& with,
                         const TimeSigmas& times) const;

  // What two cameras saw at one moment, of which one of them may have been told between its samples.
  struct Moment {
    Eigen::Vector3d of_i, of_j;  // directions, unit, in one frame
    double radius_i_px, radius_j_px;
    double sigma_i_px, sigma_j_px;
    double
        elsewhere_px2;  // variance of what is not in their samples: rig, motion in uncertain times, the curve between
  };
  // Where two cameras stand beside each other.
  struct Placement {
    Eigen::Vector3d j_from_i_m;  // from i's centre to j's, in the frame of the moments
    double focal_i_px, focal_j_px;
  };
  // How the rays of a moment pass each other; nullopt: they are parallel.
  struct Passing {
    double off_px, expected_px;
    double radius_m;                // 0: they meet behind a camera
    Eigen::Vector3d slope_of_i_px;  // of off_px, by a small rotation of the ray of_i about the frame's axes
  };
  static std::optional<Passing> passing(const Moment& moment, const Placement& placement);
  // Of this camera, i, with every other one that it has enough with; as the rig is, in the camera's frame.
  struct WithOther {
    Placement placement;
    std::vector<Moment> moments;
  };
  std::vector<WithOther> moments_of(const std::vector<Track>& tracks, std::size_t camera,
                                    const TimeSigmas& times) const;

 private:
  struct Placed {  // one sample in the world
    Eigen::Vector3d direction;
    double t_s;
    double radius_px;
    double sigma_px;
    double px_per_s;
  };
  using PlacedTrack = std::vector<Placed>;  // of the frames that are taken for one camera's

  Placed placed(const std::vector<Track>& tracks, std::size_t slot, std::size_t k, const Supposition& with) const;
  PlacedTrack placed(const std::vector<Track>& tracks, std::size_t slot, const Supposition& with) const;
  std::vector<PlacedTrack> all_placed(const std::vector<Track>& tracks, const Supposition& with) const;
  std::vector<Moment> moments(const PlacedTrack& of_i, const PlacedTrack& of_j, std::size_t i, std::size_t j,
                              const TimeSigmas& times) const;
  PairResiduals residuals(const PlacedTrack& of_i, const PlacedTrack& of_j, std::size_t i, std::size_t j,
                          const Supposition& with, const TimeSigmas& times) const;

  const calib::CameraRig& rig_;
  std::vector<double> focal_px_;          // per camera
  std::vector<Eigen::Vector3d> centres_;  // in the world
};

// By how much this camera's frames are later than the rig says, so that it agrees best; -0.6..0.6 s.
double best_lateness(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                     const TimeSigmas& times);

// The same of all cameras at a time, beside the first one, of which it is 0: for cameras none of which agrees with
// another one.
std::vector<double> best_latenesses(const PairComparison& comparison, const std::vector<Track>& tracks,
                                    const TimeSigmas& times);

}  // namespace huetrack::view_watch
