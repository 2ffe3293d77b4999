#include "object_tracking/motion_observer.h"

namespace huetrack::object_tracking {

MotionState MotionObserver::observed(const MotionState& from, const MotionState* linearised_about,
                                     std::span<const Sighting> sightings, double power_density) {
  MotionState out = from;
  views_.clear();
  double surprise = 0;
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
                       .doubt = sighting.doubt(),
                       .linearised_at = then,
                       .px_expected = at->px,
                       .jacobian = at->jacobian}});
    surprise += out.observe(views_.back().linear, near.velocity(), power_density);
  }
  surprise_ = views_.empty() ? 1 : surprise / (2 * static_cast<double>(views_.size()));
  return out;
}

MotionState MotionObserver::observed_in_passes(const MotionState& from, std::span<const Sighting> sightings,
                                               double power_density) {
  MotionState out = observed(from, nullptr, sightings, power_density);
  Eigen::Vector3d before = from.position() + capture::seconds(out.at - from.at) * from.velocity();
  for (int iteration = 0; iteration < 3; ++iteration) {
    const double moved_m = (out.position() - before).norm();
    if (moved_m < (iteration == 0 ? 0.1 : 0.01) * radius_m_) break;
    before = out.position();
    const MotionState about = out;
    out = observed(from, &about, sightings, power_density);
  }
  return out;
}

}  // namespace huetrack::object_tracking
