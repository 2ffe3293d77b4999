#include "object_tracking/motion_observer.h"

#include <cmath>

namespace huetrack::object_tracking {
namespace {

struct MotionObserverTuning {
  double first_radii = 0.1;  // radii that the first pass must have moved the position by to linearise again
  double next_radii = 0.01;  // the same of a later pass
};
constexpr MotionObserverTuning motion_observer{};

constexpr int max_passes = 3;  // capacity: repeated linearisations after the first

}  // namespace

MotionState MotionObserver::observed(const MotionState& from, const MotionState* linearised_about,
                                     std::span<const Sighting> sightings, double power_density) {
  MotionState out = from;
  views_.clear();
  is_size_consistent_.reset();
  double nis = 0;
  int measured = 0;  // numbers
  for (const Sighting& sighting : sightings) {
    out.predict_to(sighting.row.at, power_density);
    const MotionState& near = linearised_about != nullptr ? *linearised_about : out;
    const Eigen::Vector3d then = near.position_at(sighting.row.at);
    const auto at = project_ball(*sighting.camera, then, radius_m_);
    if (!at) continue;
    views_.push_back({&sighting,
                      {.row = sighting.row,
                       .px = sighting.px,
                       .covariance = sighting.covariance,
                       .bias_sigma_px = sighting.bias_sigma_px,
                       .inflation = sighting.inflation(),
                       .linearised_at = then,
                       .px_expected = at->px,
                       .jacobian = at->jacobian,
                       .ray = then - sighting.camera->centre()}});
    const LinearSighting& linear = views_.back().linear;
    nis += out.observe(linear, near.velocity(), power_density), measured += 2;
    if (!is_ball_ || !sighting.size || !out.has_size()) continue;
    const MeasuredSize& size = *sighting.size;
    const double size_nis = out.observe_size({.row = linear.row,
                                              .log_off = std::log(size.radius_px / at->radius_px),
                                              .variance = size.log_sigma * size.log_sigma,
                                              .bias_sigma = size.log_bias,
                                              .is_bias_constant = size.is_bias_constant,
                                              .linearised_at = then,
                                              .ray = linear.ray},
                                             near.velocity(), power_density);
    nis += size_nis, ++measured;
    is_size_consistent_ = std::sqrt(size_nis) <= sighting_tuning.prediction_sigmas;
  }
  mean_nis_ = measured == 0 ? 1 : nis / measured;
  return out;
}

MotionState MotionObserver::observed_in_passes(const MotionState& from, std::span<const Sighting> sightings,
                                               double power_density) {
  MotionState out = observed(from, nullptr, sightings, power_density);
  if (from.has_size()) return out;
  Eigen::Vector3d before = from.position() + capture::seconds(out.at - from.at) * from.velocity();
  for (int iteration = 0; iteration < max_passes; ++iteration) {
    const double moved_m = (out.position() - before).norm();
    if (moved_m < (iteration == 0 ? motion_observer.first_radii : motion_observer.next_radii) * radius_m_) break;
    before = out.position();
    const MotionState about = out;
    out = observed(from, &about, sightings, power_density);
  }
  return out;
}

}  // namespace huetrack::object_tracking
