// Global search for the camera's pose from LEDs. Particles are positions only, uniform over the room: the angles
// between the rays to the LEDs do not depend on the rotation, which follows in closed form (Wahba's problem). The best
// ones are refined by Gauss-Newton, with velocities, over the sightings of the last fraction of a second.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/leds/led_motion.h"
#include "particle_filter/random.h"

namespace huetrack::leds {

struct LedSearchOptions {
  std::vector<Eigen::Vector3d> leds;  // >= 4, not in one line
  Eigen::Vector3d room_min{-3, -3, 0}, room_max{3, 3, 3};
  int particle_count = 5000;  // >= 1
  LedStartVelocity start_velocity = {};
  LedMotionNoise motion = {};
};

// thread-compatible.
class LedSearch {
 public:
  LedSearch(const calib::Camera& camera, LedSearchOptions options, particle_filter::Rng rng);

  // nullopt: too few LEDs or sightings, no pose fits, or more than one does.
  //   sightings   identified, of the last fraction of a second, in time order; dt_s relative to the returned state
  std::optional<LedGaussian> find(std::span<const LedSighting> sightings);

  // From at least 5 unidentified dots of one frame (led is not used): four can be assigned in too many ways.
  std::optional<LedGaussian> find_unidentified(std::span<const LedSighting> sightings);

  // Of the last call: the factor of the sightings' sigma at which its pose fits; whether more than one pose fits; all
  // candidates, best first.
  double noise_scale() const { return noise_scale_; }
  bool is_ambiguous() const { return is_ambiguous_; }
  std::span<const calib::Rigid3d> candidates() const { return candidates_; }

 private:
  void scatter();
  std::optional<LedGaussian> polish(std::span<const calib::Rigid3d> starts, std::span<const LedSighting> coarse,
                                    std::span<const LedSighting> fine, double reference_dt_s);

  // ---- Unidentified dots.
  struct Dot {
    LedSighting sighting;  // led is not set
    Eigen::Vector3d ray;   // unit, camera
  };
  struct Explanation {
    LedFit fit;
    double cost = 0;  // the fit's chi2 plus that of the unexplained dots
  };
  double match(const calib::Rigid3d& pose, std::span<const Dot> dots, double reach_px,
               std::vector<LedSighting>& out) const;
  std::vector<calib::Rigid3d> turned_by_pairs(std::span<const Dot> dots);
  std::optional<Explanation> explain(const calib::Rigid3d& start, std::span<const Dot> dots) const;

  calib::Camera camera_;
  LedSearchOptions options_;
  particle_filter::Rng rng_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<calib::Rigid3d> candidates_;
  double noise_scale_ = 1;
  bool is_ambiguous_ = false;
  std::vector<float> noise_;
};

}  // namespace huetrack::leds
