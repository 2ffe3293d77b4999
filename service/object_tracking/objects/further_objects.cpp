#include "object_tracking/objects/further_objects.h"

#include <algorithm>

namespace huetrack::objects {

using namespace object_tracking;

void FurtherObject::note(capture::Timestamp set_at, const std::optional<Eigen::Vector3d>& seen_at) {
  if (seen_at && published_) published_ = seen_at;
  if (seen_at.has_value() == published_.has_value()) {
    since_.reset();
    return;
  }
  if (!since_ || set_at < *since_) since_ = set_at;
  if (capture::seconds(set_at - *since_) < delay_s_) return;
  published_ = seen_at;
  since_.reset();
}

void FurtherObjectWatch::find_others(const std::vector<TargetView>& views, const MotionState& state,
                                     ObjectSearch& search) {
  search.look(views);
  regions_.assign(search.regions().begin(), search.regions().end());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto own = project_ball(*views[i].camera, state.position(), target_.radius_m);
    std::erase_if(regions_[i], [&](const color::ColorRegion& region) {
      return own && (region.centre - own->px).norm() <= sighting_tuning.extent_radii * own->radius_px;
    });
  }
}

void FurtherObjectWatch::note_untracked(capture::Timestamp set_at) {
  is_second_ = false;
  if (!nothing_since_ || set_at < *nothing_since_) nothing_since_ = set_at;
  if (capture::seconds(set_at - *nothing_since_) > sighting_tuning.confirmation_s) further_.note(set_at, std::nullopt);
}

void FurtherObjectWatch::look(const std::vector<TargetView>& views, std::span<const Sighting> sightings,
                              const MotionState& state, ObjectSearch& search, const ClutterMap& clutter,
                              const StaticClutterMask& still, capture::Timestamp set_at) {
  nothing_since_.reset();
  if (views.size() < 2) return;
  if (looked_at_ && set_at < *looked_at_) looked_at_.reset(), is_second_ = false;
  if (!is_second_ && looked_at_ && capture::seconds(set_at - *looked_at_) < options_.coast_s) return;
  find_others(views, state, search);
  std::vector<CoveredDisc> covered;
  add_covered(views, sightings, state.position(), target_.radius_m, covered);
  if (!is_second_) births_.forget();
  const std::vector<Birth> births = births_.look(views, regions_, covered, clutter, still, set_at, state);
  if (!is_second_) {
    looked_at_ = set_at;
    is_second_ = true;
    return;
  }
  is_second_ = false;
  const auto other = std::ranges::find_if(births, [&](const Birth& birth) {
    if ((birth.now.position - state.position()).norm() <= sighting_tuning.extent_radii * target_.radius_m) return false;
    ObjectExistence existence;
    existence.begin(set_at, birth, views, target_.radius_m, options_, state, clutter, still);
    return existence.is_sure();
  });
  further_.note(set_at, other == births.end() ? std::nullopt : std::optional(other->now.position));
}

}  // namespace huetrack::objects
