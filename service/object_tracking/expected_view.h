// Where a view shows an object that goes on as it does, and how it moves there.
#pragma once

#include <optional>
#include <vector>

#include "object_tracking/motion_state.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::object_tracking {

struct ExpectedView {
  SeenRow row;
  BallProjection at;
};
// Where a view shows the object, if it goes on as it does: at the time of the row on which it is seen, which depends on
// where it is seen. nullopt: behind the camera.
std::optional<ExpectedView> expected_in(const TargetView& view, const MotionState& belief, double radius_m);

// Where the views may show an object by now, as sightings that say no more than that.
void add_expected(const std::vector<TargetView>& views, const MotionState& belief, double radius_m,
                  std::vector<Sighting>& out);

ImageMotion image_motion(const TargetView& view, const BallProjection& at, const MotionState& belief);

}  // namespace huetrack::object_tracking
