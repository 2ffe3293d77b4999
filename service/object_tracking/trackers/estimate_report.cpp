#include "object_tracking/trackers/estimate_report.h"

#include <algorithm>
#include <cmath>

#include "object_tracking/expected_view.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

constexpr auto as_good_as_the_sets_time = std::chrono::milliseconds(2);  // a line is exact enough for as long

// What one view says to the estimate. Is it seen there?
bool add_support(const TargetView& view, const ToReport& what, ObjectEstimate& estimate) {
  ViewSupport& support = estimate.per_view[static_cast<std::size_t>(view.index)];
  const auto expected = expected_in(view, what.filter.belief(), what.radius_m);
  if (!expected || !view.camera->contains({expected->at.px})) return false;
  const BallProjection& at = expected->at;
  support.in_view = true;
  support.px = at.px.cast<float>();
  support.radius_px = static_cast<float>(at.radius_px);
  for (const Sighting& s : what.sightings) {
    if (s.row.camera != view.index) continue;
    support.seen = true;
    support.support = static_cast<float>(s.support);
    support.residual_px = static_cast<float>((s.px - at.px).norm());
  }
  return support.seen;
}

}  // namespace

ObjectEstimate without_position(const capture::FrameSet& set, const TargetViews& views, const MotionState& belief,
                                TrackState state) {
  ObjectEstimate e;
  e.at = set.at;
  e.set_number = set.number;
  e.state = state;
  e.per_view.resize(views.camera_count());
  for (int c = 0; c < static_cast<int>(views.camera_count()); ++c) e.times.push_back(belief.timing(c));
  for (const auto* some : {&views.used(), &views.unused()})
    for (const TargetView& view : *some) e.per_view[static_cast<std::size_t>(view.index)].delivered = true;
  return e;
}

ObjectEstimate report(const ToReport& what, RigError& rig_error, capture::Timestamp& last_reported) {
  const MotionState& belief = what.filter.belief();
  const capture::FrameSet& set = what.set;
  ObjectEstimate e = without_position(set, what.views, belief, what.state);
  e.particle_count = static_cast<int>(what.filter.particles().size());
  e.effective_sample_size = what.filter.effective_sample_size();
  for (std::size_t c = 0; c < e.per_view.size(); ++c)
    e.per_view[c].inflation_px = static_cast<float>(std::sqrt(what.agreement.inflation_px2(c)));
  if (!e.has_position()) return e;
  // Frames of one moment are told at that moment, whatever a few rows' uncertain times make of it.
  const bool is_of_the_set = std::chrono::abs(set.at - belief.at) <= as_good_as_the_sets_time && set.at > last_reported;
  e.at = is_of_the_set ? set.at : std::max(belief.at, last_reported + capture::Duration(1));
  last_reported = e.at;
  e.position = belief.position_at(e.at);
  e.velocity = belief.velocity();
  rig_error.add(what.sightings);
  e.covariance = belief.position_covariance() + rig_error.left_open(e.position, e.at) +
                 belief.clock_variance_s2() * e.velocity * e.velocity.transpose();
  e.map_position = what.filter.map_position();
  for (const auto* some : {&what.views.used(), &what.views.unused()}) {
    for (const TargetView& view : *some) e.views += add_support(view, what, e) ? 1 : 0;
  }
  add_leave_one_out(belief, what.radius_m, what.options.acceleration_m_s2,
                (what.options.volume.max - what.options.volume.min).norm(), what.seen, what.sightings, e);
  // How sure we are that this is the object, not where it is (the covariance says that): that not all supports are
  // chance.
  double doubt = 1;
  for (const Sighting& s : what.sightings) {
    // A view that contradicts the others by as much as its gate allows is worth half.
    const double usual_px2 = s.covariance.trace() / 2 + s.bias_sigma_px * s.bias_sigma_px;
    doubt *= 1 - 0.9 * s.support / (1 + s.inflation_px2 / (sighting_tuning.gate_nis * usual_px2));
  }
  e.confidence = 1 - doubt;
  return e;
}

}  // namespace huetrack::object_trackers
