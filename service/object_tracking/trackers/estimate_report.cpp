#include "object_tracking/trackers/estimate_report.h"

#include <algorithm>
#include <cmath>

#include "object_tracking/expected_view.h"
#include "object_tracking/objects/object_births.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

// Fills in one view. Returns whether it sees the object.
bool add_support(const TargetView& view, const ToReport& in, ObjectEstimate& estimate) {
  ViewSupport& support = estimate.per_view[static_cast<std::size_t>(view.index)];
  const auto expected = expected_in(view, in.filter.motion(), in.radius_m);
  if (!expected || !view.camera->contains({expected->at.px})) return false;
  const BallProjection& at = expected->at;
  support.in_view = true;
  support.px = at.px.cast<float>();
  support.radius_px = static_cast<float>(at.radius_px);
  for (const Sighting& s : in.sightings) {
    if (s.row.camera != view.index) continue;
    support.seen = true;
    support.support = static_cast<float>(s.support);
    support.residual_px = static_cast<float>((s.px - at.px).norm());
  }
  return support.seen;
}

}  // namespace

double hidden_error(std::span<const Sighting> sightings) {
  double radii = 0, weights = 0;
  for (const Sighting& s : sightings) {
    const double weight = 1 / (s.covariance.trace() / 2 + s.bias_sigma_px * s.bias_sigma_px + s.inflation_px2);
    const double unmodelled = s.radius_px > 0 ? s.unmodelled_px / s.radius_px : 0;
    radii += weight * std::hypot(sighting_tuning.cut_error * s.missing, unmodelled), weights += weight;
  }
  return weights > 0 ? radii / weights : 0;
}

ObjectEstimate without_position(const capture::FrameSet& set, const TargetViews& views, const ObjectFilter& filter,
                                const ViewConsistency& agreement, TrackState state) {
  ObjectEstimate e;
  e.at = set.at;
  e.set_number = set.number;
  e.state = state;
  e.particle_count = static_cast<int>(filter.particles().size());
  e.effective_sample_size = filter.effective_sample_size();
  e.per_view.resize(views.camera_count());
  for (std::size_t c = 0; c < e.per_view.size(); ++c) {
    e.times.push_back(filter.motion().timing(int(c)));
    e.per_view[c].inflation_px = static_cast<float>(std::sqrt(agreement.inflation_px2(c)));
  }
  for (const auto* some : {&views.used(), &views.unused()})
    for (const TargetView& view : *some) e.per_view[static_cast<std::size_t>(view.index)].delivered = true;
  return e;
}

ObjectEstimate report(const ToReport& in, RigError& rig_error, capture::Timestamp& last_published) {
  const MotionState& motion = in.filter.motion();
  const capture::FrameSet& set = in.set;
  ObjectEstimate e = without_position(set, in.views, in.filter, in.agreement, in.state);
  if (!e.has_position()) return e;
  // A set of one moment gets the stamp of that moment, whatever the uncertain times of a few rows say.
  const bool is_of_the_set =
      std::abs(capture::seconds(set.at - motion.at)) <= sighting_tuning.same_time_s && set.at > last_published;
  e.at = is_of_the_set ? set.at : std::max(motion.at, last_published + capture::Duration(1));
  last_published = e.at;
  e.position = motion.position_at(e.at);
  e.velocity = motion.velocity();
  rig_error.add(in.sightings);
  const double hidden_m = in.hidden_radii * in.radius_m;
  e.covariance = in.agreement.noise_scale2() * motion.position_covariance() + rig_error.left_open(e.position, e.at) +
                 motion.clock_variance_s2() * e.velocity * e.velocity.transpose() +
                 hidden_m * hidden_m * Eigen::Matrix3d::Identity();
  e.map_position = in.filter.map_position();
  for (const auto* some : {&in.views.used(), &in.views.unused()}) {
    for (const TargetView& view : *some) e.views += add_support(view, in, e) ? 1 : 0;
  }
  add_leave_one_out(motion, in.radius_m, in.options.acceleration_m_s2,
                    (in.options.volume.max - in.options.volume.min).norm(), in.seen, in.sightings, e);
  // Probability that not all views' supports are clutter. It says nothing of the position's accuracy.
  double all_clutter = 1;
  for (const Sighting& s : in.sightings) {
    // A view that is inconsistent by as much as its gate allows counts half.
    const double usual_px2 = s.covariance.trace() / 2 + s.bias_sigma_px * s.bias_sigma_px;
    all_clutter *=
        1 - objects::detection.probability * s.support / (1 + s.inflation_px2 / (sighting_tuning.gate_nis * usual_px2));
  }
  e.confidence = 1 - all_clutter;
  return e;
}

}  // namespace huetrack::object_trackers
