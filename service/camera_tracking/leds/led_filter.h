// The camera's pose from the pixels of LEDs: Herranz et al. as in the paper, and ours. led_tracker.h detects the LEDs
// in images.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_estimate.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/leds/led_models.h"
#include "camera_tracking/leds/led_particles.h"
#include "camera_tracking/leds/led_search.h"

namespace huetrack::leds {

using namespace camera_tracking;

struct LedFilterOptions {
  LedStart start;             // the LEDs and the room; the schedule is not used
  int particle_count = 5000;  // of the paper
  std::uint64_t seed = 1;
  double pixel_noise_px = 0.06;  // > 0; standard deviation of a LED's centre in a good image
  LedMotionNoise motion = {};    // largest process noise
  LedStartVelocity start_velocity = {};
  bool report_unproven = false;  // paper() only, for benchmarks: the particles' mean in every state
};

// The detections of one frame.
struct LedFrame {
  capture::Timestamp at;
  std::uint64_t number = 0;
  std::optional<int> lit;             // the LED that is lit, -1: none; nullopt: the dots are not identified
  std::vector<Eigen::Vector2d> dots;  // raw pixels, the brightest first; may contain false detections
};

// thread-compatible.
class LedFilter {
 public:
  virtual ~LedFilter() = default;
  virtual CameraEstimate update(const LedFrame& frame) = 0;  // in time order
  virtual CameraTrackerInside inside() const = 0;
  virtual double start_noise_px() const { return 0; }  // pixel noise at which the initial pose fits
  virtual void forget() {}                             // the pose: the previous identifications were wrong
  virtual bool is_ambiguous() const { return false; }  // more than one pose fitted the last frame

  // Herranz et al., section III. The convergence from a whole room to one pose and the handling of a lost camera, which
  // the paper leaves out: LedParticles::weigh(), led_paper_filter.cpp.
  static std::unique_ptr<LedFilter> paper(const calib::Camera& camera, const LedFilterOptions& options);
  // Ours: LedSearch for the initial pose, then a Gaussian particle filter (Kotecha and Djuric 2003) whose mean starts a
  // Gauss-Newton fit with the prediction as prior (LedModels).
  static std::unique_ptr<LedFilter> huetrack(const calib::Camera& camera, const LedFilterOptions& options);
};

// Recent matches and misses of the LEDs: the evidence for a pose.
class LedEvidence {
 public:
  // a LED that was lit and projects into the image
  void add(capture::Timestamp at, int led, bool matched) { flashes_.push_back({at, led, matched}); }
  void forget(capture::Timestamp before) {
    while (!flashes_.empty() && flashes_.front().at < before) flashes_.pop_front();
  }
  void clear() { flashes_.clear(); }
  int in_view() const { return static_cast<int>(flashes_.size()); }  // expected sightings
  int matched() const { return static_cast<int>(std::ranges::count(flashes_, true, &Flash::matched)); }  // of those
  int distinct() const;         // different LEDs that were matched
  int missed_in_a_row() const;  // up to the last one
  struct Leds {                 // different LEDs; matched: at their last expected sighting
    int in_view = 0, matched = 0;
  };
  Leds leds() const;
  std::optional<capture::Timestamp> last_match() const;

 private:
  struct Flash {  // an expected sighting
    capture::Timestamp at;
    int led;
    bool matched;
  };
  std::deque<Flash> flashes_;
};

using FoundLed = std::pair<int, Eigen::Vector2d>;  // LED, raw pixel
// For CameraTracker::inside(): the LEDs in view with their search regions, and particles.
CameraTrackerInside inside_of(const calib::Camera& camera, const std::vector<Eigen::Vector3d>& leds,
                              const LedGaussian& pose, const Eigen::Matrix2d& noise, const std::vector<FoundLed>& found,
                              const LedParticles& particles);

// Square roots of the largest eigenvalues of the covariance's position and rotation part: metres, radians.
Eigen::Vector2d largest_sigmas(const LedCovariance& covariance);

}  // namespace huetrack::leds
