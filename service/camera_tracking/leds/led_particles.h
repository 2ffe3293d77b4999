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

  // Initialisation: uniform over the room, turned every way, with velocities about zero.
  void scatter(const Eigen::Vector3d& room_min, const Eigen::Vector3d& room_max, const LedStartVelocity& velocity);
  void draw(const LedGaussian& from);                      // all of them, with equal weights
  void predict(double dt_s, const LedMotionNoise& noise);  // the 12 of the paper: constant velocities, disturbed

  // The importance factor: a Gaussian of the distance from each sighting to where the particle has that LED; of
  // sightings with led < 0 (all or none are), which are not identified, to the LED that is nearest among those that are
  // not nearer to another one. A LED that the particle cannot see is `miss_px` away.
  //   enough_share  in (0, 1): when fewer than so many of the particles would survive,
  //   least_share   the Gaussian is widened until so many do. The paper's own, narrow from the first frame on, leaves
  //                 one particle of those of a whole room.
  // Returns the widening, >= 1: at 1 the particles are as the measurement noise says.
  double weigh(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
               std::span<const LedSighting> sightings, double least_share, double enough_share, double miss_px);

  // From the whole room to one place by the sightings of one frame, which are not identified: there are as many wrong
  // places as ways to take one LED for another, and a cloud that comes together over many frames ends in one of them.
  // Annealing (Deutscher et al. 2000): a Gaussian of half of miss_px shrinks to the sightings' sigma in some forty
  // layers, each weighed and resampled, the copies parting by a fifth of its width. What cloud there was is given up.
  // Returns the rms distance of the dots from the best particle's LEDs, px; when it is large, the place is wrong.
  double anneal(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
                std::span<const LedSighting> sightings, const Eigen::Vector3d& room_min,
                const Eigen::Vector3d& room_max, const LedStartVelocity& velocity, double miss_px);

  void resample(double jitter);  // systematic; then copies part by so much of the cloud's standard deviations
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
