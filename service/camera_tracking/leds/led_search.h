// Where a camera may be that sees these LEDs, when nothing is known of its pose: particles uniform over the room.
//
// Beyond Herranz et al.: a particle here is a position only. The angles between the rays to two LEDs do not depend on
// how the camera is turned, so a position can be weighed without its rotation; the rotation that fits best follows from
// it in closed form (Wahba's problem). That leaves three dimensions of the paper's twelve to be filled with particles.
// The best of them are polished by Gauss-Newton, with the velocities, over the sightings of the last fraction of a
// second.
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

  // nullopt: too few LEDs or sightings, nothing fits, or more than one pose does.
  //   sightings   identified ones of the last fraction of a second, in time order; dt_s from now, the state's time
  std::optional<LedGaussian> find(std::span<const LedSighting> sightings);

  // From bright dots of one frame, of which it is not known which LEDs they are (led is not read). At least 5: four
  // have too many ways to be four LEDs.
  std::optional<LedGaussian> find_unidentified(std::span<const LedSighting> sightings);

  double noise_scale() const { return noise_scale_; }  // of the sightings' sigma, by which the last call's pose fits
  bool is_ambiguous() const { return is_ambiguous_; }  // of the last call: more than one pose fits
  std::span<const calib::Rigid3d> candidates() const { return candidates_; }  // of the last call, best first

 private:
  void scatter();
  std::optional<LedGaussian> polish(std::span<const calib::Rigid3d> starts, std::span<const LedSighting> coarse,
                                    std::span<const LedSighting> fine, double reference_dt_s);

  // ---- Of dots that are not identified.
  struct Dot {
    LedSighting sighting;  // its led is not known
    Eigen::Vector3d ray;   // unit, camera
  };
  struct Explanation {
    LedFit fit;
    double cost = 0;  // the fit's chi2, and what the dots cost that it leaves unexplained
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
