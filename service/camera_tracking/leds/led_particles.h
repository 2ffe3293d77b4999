// The particle filter of Herranz et al., section III.A.
#pragma once

#include <span>
#include <vector>

#include "camera_tracking/leds/led_motion.h"
#include "particle_filter/random.h"

namespace huetrack::leds {

// thread-compatible.
class LedParticles {
 public:
  LedParticles(int count, particle_filter::Rng rng);

  // Initialisation: uniform over the room and all rotations, with velocities about zero.
  void scatter(const Eigen::Vector3d& room_min, const Eigen::Vector3d& room_max, const LedStartVelocity& velocity);
  void draw(const LedGaussian& from);                      // from a Gaussian, with equal weights
  void predict(double dt_s, const LedMotionNoise& noise);  // the paper's 12 dimensions: disturbed constant velocities

  // Multiplies the weights by a Gaussian of the distances from the sightings to the LEDs' projections. Unidentified
  // sightings (led < 0; all or none) are assigned to different LEDs, greedily by distance. An invisible LED is
  // `miss_px` away.
  //   enough_share, least_share  in (0, 1): if fewer than enough_share of the particles would survive (effective sample
  //                 size), the Gaussian is widened until least_share does.
  // Returns the widening, >= 1; 1: the measurement noise itself.
  double weigh(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
               std::span<const LedSighting> sightings, double least_share, double enough_share, double miss_px);

  // Global initialisation from the unidentified sightings of one frame, which have many local optima: annealing
  // (Deutscher et al. 2000) of a Gaussian from miss_px / 2 to the sightings' sigma in about forty layers. Replaces the
  // cloud. Returns the rms distance of the dots from the best particle's LEDs, px; large: a wrong place.
  double anneal(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
                std::span<const LedSighting> sightings, const Eigen::Vector3d& room_min,
                const Eigen::Vector3d& room_max, const LedStartVelocity& velocity, double miss_px);

  void resample(double jitter);  // systematic, with normal jitter in units of the cloud's standard deviations
  LedMotionState mean() const;   // weighted
  LedGaussian moments() const;   // weighted mean and covariance
  double effective_sample_size() const;

  std::span<const LedMotionState> states() const { return states_; }
  std::span<const float> weights() const { return weight_; }

 private:
  std::vector<LedMotionState> states_, resampled_;
  std::vector<float> weight_, log_weight_, noise_;
  std::vector<double> squared_;  // sum of squared distances over sigma
  std::vector<std::uint32_t> ancestor_;
  particle_filter::Rng rng_;
};

}  // namespace huetrack::leds
