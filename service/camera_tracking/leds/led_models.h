// A camera on a rail and one in a hand do not move alike, and nobody knows beforehand: several Gaussian states side by
// side that expect quieter or livelier motion, weighed by how well each foretold the LEDs' pixels (interacting multiple
// models: Blom and Bar-Shalom 1988).
#pragma once

#include <span>
#include <vector>

#include "camera_tracking/leds/led_motion.h"

namespace huetrack::leds {

// thread-compatible.
class LedModels {
 public:
  LedModels(const LedGaussian& start, const LedMotionNoise& liveliest);

  void predict(double dt_s);
  // Each state by Gauss-Newton from `from` on, with its prediction as the prior.
  void update(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
              std::span<const LedSighting> sightings, const LedMotionState& from);
  LedGaussian state() const;   // mean and covariance of the mixture
  double pixel_scale() const;  // rms, of the sightings' sigma_px: how noisy the image seems

 private:
  std::vector<LedGaussian> states_;
  std::vector<double> probability_;
  LedMotionNoise liveliest_;
};

}  // namespace huetrack::leds
