#include "object_tracking/motion_observer.h"

namespace huetrack::object_tracking {
namespace {

struct MotionObserverTuning {
  int max_passes = 3;        // repeated linearisations after the first
  double first_radii = 0.1;  // radii that the first pass must have moved the position by to linearise again
  double next_radii = 0.01;  // the same of a later pass
};
constexpr MotionObserverTuning motion_observer{};

}  // namespace

MotionState MotionObserver::observed(const MotionState& from, const MotionState* linearised_about,
                                     std::span<const Sighting> sightings, double power_density) {
  MotionState out = from;
  views_.clear();
  double nis = 0;
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
                       .jacobian = at->jacobian}});
    nis += out.observe(views_.back().linear, near.velocity(), power_density);
  }
  mean_nis_ = views_.empty() ? 1 : nis / (2 * double(views_.size()));
  return out;
}

MotionState MotionObserver::observed_in_passes(const MotionState& from, std::span<const Sighting> sightings,
                                               double power_density) {
  MotionState out = observed(from, nullptr, sightings, power_density);
  Eigen::Vector3d before = from.position() + capture::seconds(out.at - from.at) * from.velocity();
  for (int iteration = 0; iteration < motion_observer.max_passes; ++iteration) {
    const double moved_m = (out.position() - before).norm();
    if (moved_m < (iteration == 0 ? motion_observer.first_radii : motion_observer.next_radii) * radius_m_) break;
    before = out.position();
    const MotionState about = out;
    out = observed(from, &about, sightings, power_density);
  }
  return out;
}

}  // namespace huetrack::object_tracking
