// The camera's pose from LEDs whose pixels are known: Herranz et al. as in the paper, and ours. No images here, so that
// tests/benchmark can feed it a simulation; led_tracker.h finds the LEDs in images.
#pragma once

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

struct LedFilterOptions {
  camera_tracking::LedStart start;  // the LEDs and the room; the schedule is not read here
  int particle_count = 0;           // 0: 5000, the paper's
  std::uint64_t seed = 1;
  double pixel_noise_px = 0.06;  // > 0; standard deviation of a LED's centre in a good image
  LedMotionNoise motion = {};    // of the liveliest cameras
  LedStartVelocity start_velocity = {};
  bool report_unproven = false;  // paper() only, to measure it: the particles' mean in every state
};

// What one frame shows.
struct LedFrame {
  capture::Timestamp at;
  std::uint64_t number = 0;
  std::optional<int> lit;             // which LED is lit, -1: none; nullopt: it is not known which dot is which LED
  std::vector<Eigen::Vector2d> dots;  // raw pixels, the brightest first; may hold what is no LED
};

// thread-compatible.
class LedFilter {
 public:
  virtual ~LedFilter() = default;
  virtual camera_tracking::CameraEstimate update(const LedFrame& frame) = 0;  // in time order
  virtual camera_tracking::CameraTrackerInside inside() const = 0;
  virtual double start_noise_px() const { return 0; }  // how noisy the pixels are if the pose that was found is right
  virtual void forget() {}  // which LED was lit in the frames so far was told wrongly: the pose, too
  virtual bool is_ambiguous() const { return false; }  // in the last frame more than one pose fitted

  // Herranz et al., section III, and nothing else. The paper says neither how the particles come from a whole room to
  // one pose nor what is done when the camera is lost: see LedParticles::weigh() and led_paper_filter.cpp.
  static std::unique_ptr<LedFilter> paper(const calib::Camera& camera, const LedFilterOptions& options);
  // Ours: LedSearch finds the pose; then particles are drawn from the predicted state and weighed (a Gaussian particle
  // filter: Kotecha and Djuric 2003), and Gauss-Newton polishes their mean with the prediction as its prior
  // (LedModels), which takes the noise of the sampling out.
  static std::unique_ptr<LedFilter> huetrack(const calib::Camera& camera, const LedFilterOptions& options);
};

// Which LEDs the pose has explained lately: what makes it valid.
class LedEvidence {
 public:
  void add(capture::Timestamp at, int led, bool matched);  // of a LED that was lit and projects into the image
  void forget(capture::Timestamp before);
  void clear() { flashes_.clear(); }
  int in_view() const { return static_cast<int>(flashes_.size()); }  // sightings due
  int matched() const;                                               // sightings had
  int distinct() const;                                              // different LEDs that were matched
  int missed_in_a_row() const;                                       // of the last sightings due
  // Different LEDs; matched: of which the last sighting that was due was had.
  struct Leds {
    int in_view = 0, matched = 0;
  };
  Leds leds() const;
  std::optional<capture::Timestamp> last_match() const;

 private:
  struct Flash {  // that was due
    capture::Timestamp at;
    int led;
    bool matched;
  };
  std::deque<Flash> flashes_;
};

// Which LED was found in a frame, and where.
using FoundLed = std::pair<int, Eigen::Vector2d>;
// What a filter with a pose shows: the LEDs in view, with where `noise` and the pose leave them room, and particles.
camera_tracking::CameraTrackerInside inside_of(const calib::Camera& camera, const std::vector<Eigen::Vector3d>& leds,
                                               const LedGaussian& pose, const Eigen::Matrix2d& noise,
                                               const std::vector<FoundLed>& found, const LedParticles& particles);

// Square roots of the largest eigenvalues of the covariance's position and rotation part: metres, radians.
Eigen::Vector2d largest_sigmas(const LedCovariance& covariance);

}  // namespace huetrack::leds
