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

MotionBelief MotionObserver::observed(const MotionBelief& from, const MotionBelief* linearised_about,
                                      std::span<const Sighting> sightings, double power_density) {
  MotionBelief out = from;
  views_.clear();
  double surprise = 0;
  for (const Sighting& sighting : sightings) {
    out.predict_to(sighting.row.at, power_density);
    const MotionBelief& near = linearised_about != nullptr ? *linearised_about : out;
    const Eigen::Vector3d then = near.position_at(sighting.row.at);
    const auto at = appearance_of(*sighting.camera, then, radius_m_);
    if (!at) continue;
    views_.push_back({&sighting,
                      {.row = sighting.row,
                       .px = sighting.px,
                       .covariance = sighting.covariance,
                       .lasting_px = sighting.lasting_px,
                       .doubt = sighting.doubt(),
                       .linearised_at = then,
                       .px_expected = at->px,
                       .jacobian = at->jacobian}});
    surprise += out.observe(views_.back().linear, near.velocity(), power_density);
  }
  surprise_ = views_.empty() ? 1 : surprise / (2 * static_cast<double>(views_.size()));
  return out;
}

MotionBelief MotionObserver::observed_in_passes(const MotionBelief& from, std::span<const Sighting> sightings,
                                                double power_density) {
  MotionBelief out = observed(from, nullptr, sightings, power_density);
  Eigen::Vector3d before = from.position() + capture::seconds(out.at - from.at) * from.velocity();
  for (int iteration = 0; iteration < motion_observer.max_passes; ++iteration) {
    const double moved_m = (out.position() - before).norm();
    if (moved_m < (iteration == 0 ? motion_observer.first_radii : motion_observer.next_radii) * radius_m_) break;
    before = out.position();
    const MotionBelief about = out;
    out = observed(from, &about, sightings, power_density);
  }
  return out;
}

}  // namespace huetrack::object_tracking
