// `observation: paper`: Barrera, Canas, Matellan, Martin: "Multi-camera 3-D tracking using particle filter", as
// published.
#pragma once

#include <cstdint>
#include <vector>

#include "object_tracking/object_estimate.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "particle_filter/random.h"

namespace huetrack::object_trackers {

// Particle positions, world frame, metres; structure of arrays, because that is how they are projected.
struct PositionParticles {
  std::vector<float> x, y, z;
  std::size_t size() const { return x.size(); }
  void resize(std::size_t n) { x.resize(n), y.resize(n), z.resize(n); }
};

inline constexpr int window_pixels = 25;  // layout: the paper's window of 5x5

// Eqs. (4)-(6): weight[i] becomes the product over the views of p_m(s_i | img_m), times 25^M (a constant that the
// normalisation removes, so that the product stays in the range of a float for up to 27 views).
//   inside the image:  k / 25, k = pixels of the target's colour in the 5x5 window around the projection, at least 1
//   outside:           1 / 25
// The paper assumes lenses without distortion; this projection includes it.
class PaperObservation {
 public:
  void weigh(const PositionParticles& particles, const std::vector<object_tracking::TargetView>& views,
             std::vector<float>& weight);

  // What the last call saw of one particle in views[view].
  struct Window {
    Eigen::Vector2f px;  // its projection, raw pixels
    std::uint8_t k;      // matching pixels around it, 0..25; MatchBits::outside
  };
  Window window(std::size_t view, std::size_t particle) const {
    const std::size_t i = view * particle_count_ + particle;
    return {{u_[i], v_[i]}, k_[i]};
  }

 private:
  std::size_t particle_count_ = 0;
  std::vector<float> u_, v_;     // per view, per particle
  std::vector<std::uint8_t> k_;  // per view, per particle
};

// thread-compatible.
class PaperTracker {
 public:
  PaperTracker(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
               const object_tracking::ObjectTrackerOptions& options, particle_filter::Rng rng);

  object_tracking::ObjectEstimate update(const capture::FrameSet& set);
  void trust(std::span<const object_tracking::CameraTrust> cameras) { views_.trust(cameras); }
  void begin_anew();
  object_tracking::TargetViews& views() { return views_; }
  const object_tracking::TargetViews& views() const { return views_; }
  const PositionParticles& particles() const { return particles_; }

 private:
  void predict();
  void resample();
  object_tracking::ObjectEstimate estimate(const capture::FrameSet& set,
                                           const std::vector<object_tracking::TargetView>& views);
  void scatter(std::size_t from);

  object_tracking::ObjectTrackerOptions options_;
  object_tracking::TargetViews views_;
  particle_filter::Rng rng_;
  PositionParticles particles_, resampled_;
  std::vector<float> weight_, noise_;
  PaperObservation observation_;
  bool seen_ = false;  // in this set
  object_tracking::TrackState state_ = object_tracking::TrackState::searching;
  capture::Timestamp last_seen_{};
};

}  // namespace huetrack::object_trackers
