// Interacting multiple models (Blom and Bar-Shalom 1988) of different process and pixel noise: from a camera on a rail
// to one in a hand.
#pragma once

#include <span>
#include <vector>

#include "camera_tracking/leds/led_motion.h"

namespace huetrack::leds {

// thread-compatible.
class LedModels {
 public:
  LedModels(const LedGaussian& start, const LedMotionNoise& largest_noise);

  void predict(double dt_s);
  // Each state by Gauss-Newton from `from`, with its prediction as prior.
  void update(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
              std::span<const LedSighting> sightings, const LedMotionState& from);
  LedGaussian state() const;   // mean and covariance of the mixture
  double pixel_scale() const;  // estimated pixel noise over the sightings' sigma_px

 private:
  std::vector<LedGaussian> states_;
  std::vector<double> probability_;
  LedMotionNoise largest_noise_;
};

}  // namespace huetrack::leds
