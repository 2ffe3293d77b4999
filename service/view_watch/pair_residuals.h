// Epipolar consistency of cameras: how far the rays of two cameras pass each other, over the recent past of one target,
// with the rig as it is or under a fault hypothesis.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::view_watch {

struct PairSamplingTuning {
  double window_s = 3;             // seconds that are judged together
  double longest_gap_s = 0.15;     // seconds between two samples, to interpolate between them
  std::size_t least_samples = 12;  // of a pair, to compare it; the median of fewer is noise
  double least_noise2 = 0.2;  // share of the expected variance that is really noise, at least: shade does not average
};
inline constexpr PairSamplingTuning pair_sampling{};

struct LatenessSearchTuning {
  double max_s = 0.6;             // seconds, either way: two cameras' latencies differ by twice that at most
  std::size_t most_compared = 4;  // earlier cameras that one is compared with: all pairs of many would take too long
};
inline constexpr LatenessSearchTuning lateness_search{};

// One camera's sample.
struct SeenPoint {
  double t_s = 0;           // of its row, with the estimated timing; one clock for all cameras
  Eigen::Vector2d px;       // raw pixels
  double radius_px = 0;     // of the disc of the region's area
  double sigma_px = 0;      // standard deviation of px on each axis
  double below_middle = 0;  // the row: r / (H - 1) - 1/2
  Eigen::Vector3d ray;      // through px, camera frame, unit
  bool is_target = false;   // assigned to the target; otherwise a region of its colour
};
using Track = std::deque<SeenPoint>;  // of one camera, by time

// Focal length, pixels, in the middle of the picture.
double focal_px(const calib::Camera& camera);

// One respect in which the rig may be wrong.
struct FaultHypothesis {
  // Camera of the rig that really took the frames assigned to camera c; empty: each its own.
  std::vector<std::size_t> really = {};
  // Per camera, seconds by which its times are to be made earlier; empty: 0.
  std::vector<double> late_s = {};
  static constexpr std::size_t every_camera = ~std::size_t{0};
  std::size_t camera = 0;                              // that the rest applies to
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();  // cam_from_world = exp(turn) * the rig's
  double zoom = 1;                                     // its focal length in the rig's
  bool is_mirrored = false;                            // left and right are exchanged in its pictures
  bool is_upside_down = false;                         // they are turned by 180 degrees
};

struct PairResiduals {
  std::vector<double> off_px;    // distance from the epipolar line, with sign
  std::vector<double> expected;  // its standard deviation, px
  std::vector<double> radius_m;  // of the ball, where the rays meet
  double usual() const;          // median of |off_px| / expected; 0.67 is perfect. Infinity: too few samples
  double usual_px() const;       // median of |off_px|
};

// Standard deviations of the cameras' times, seconds.
using TimeSigmas = std::vector<double>;

// Pure; the rig outlives it.
class PairComparison {
 public:
  explicit PairComparison(const calib::CameraRig& rig);

  PairResiduals residuals(const std::vector<Track>& tracks, std::size_t i, std::size_t j, const FaultHypothesis& with,
                          const TimeSigmas& times) const;
  // Over all pairs with enough samples.
  struct Agreement {
    std::size_t pairs = 0;
    double worst = 0;  // the largest usual()
    double score = 0;  // robust cost: mean of min(off / expected, 5)^2
    double worst_px = 0;
  };
  static void add(Agreement& agreement, const PairResiduals& pair);
  Agreement agreement(const std::vector<Track>& tracks, const FaultHypothesis& with, const TimeSigmas& times) const;
  // Of the pairs with this camera, or without it.
  Agreement agreement_of(const std::vector<Track>& tracks, std::size_t camera, bool with_it,
                         const FaultHypothesis& with, const TimeSigmas& times) const;

  // Samples of two cameras at one moment; one of them may be interpolated.
  struct Moment {
    Eigen::Vector3d of_i, of_j;  // directions, unit, in one frame
    double radius_i_px, radius_j_px;
    double sigma_i_px, sigma_j_px;
    double elsewhere_px2;  // variance from rig, uncertain times and interpolation
  };
  struct Placement {
    Eigen::Vector3d j_from_i_m;  // from i's centre to j's, in the frame of the moments
    double focal_i_px, focal_j_px;
  };
  // How two rays pass each other; nullopt: they are parallel.
  struct Passing {
    double off_px, expected_px;
    double radius_m;                // 0: they meet behind a camera
    Eigen::Vector3d slope_of_i_px;  // derivative of off_px by a small rotation of the ray of_i about the frame's axes
  };
  static std::optional<Passing> passing(const Moment& moment, const Placement& placement);
  // Of this camera, i, with every other one that has enough samples; as the rig is, in the camera's frame.
  struct WithOther {
    Placement placement;
    std::vector<Moment> moments;
  };
  std::vector<WithOther> moments_of(const std::vector<Track>& tracks, std::size_t camera,
                                    const TimeSigmas& times) const;

 private:
  struct Placed {  // a sample in the world
    Eigen::Vector3d direction;
    double t_s;
    double radius_px;
    double sigma_px;
    double px_per_s;
  };
  using PlacedTrack = std::vector<Placed>;

  Placed placed(const std::vector<Track>& tracks, std::size_t slot, std::size_t k, const FaultHypothesis& with) const;
  PlacedTrack placed(const std::vector<Track>& tracks, std::size_t slot, const FaultHypothesis& with) const;
  std::vector<PlacedTrack> all_placed(const std::vector<Track>& tracks, const FaultHypothesis& with) const;
  std::vector<Moment> moments(const PlacedTrack& of_i, const PlacedTrack& of_j, std::size_t i, std::size_t j,
                              const TimeSigmas& times) const;
  PairResiduals residuals(const PlacedTrack& of_i, const PlacedTrack& of_j, std::size_t i, std::size_t j,
                          const FaultHypothesis& with, const TimeSigmas& times) const;
  // Over the pairs (i, j), i < j, that `use` selects.
  template <typename Use>
  Agreement agreement_over(const std::vector<Track>& tracks, const FaultHypothesis& with, const TimeSigmas& times,
                           Use use) const;

  const calib::CameraRig& rig_;
  std::vector<double> focal_px_;          // per camera
  std::vector<Eigen::Vector3d> centres_;  // in the world
};

// The latency of this camera's frames beyond the rig's that makes it agree best; -0.6..0.6 s.
double best_lateness(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                     const TimeSigmas& times);

// The same of all cameras, one after the other, relative to the first; with: what else is supposed.
std::vector<double> best_latenesses(const PairComparison& comparison, const std::vector<Track>& tracks,
                                    const TimeSigmas& times, FaultHypothesis with = {});

}  // namespace huetrack::view_watch
