// Where a view shows an object that keeps its velocity, and how it moves in the image.
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
// At the time of the row in which it is seen, which depends on where it is seen (fixed point). nullopt: behind the
// camera.
std::optional<ExpectedView> expected_in(const TargetView& view, const MotionState& state, double radius_m);

// Appends the object's expected places in the views, as sightings with px and radius_px only.
void add_expected(const std::vector<TargetView>& views, const MotionState& state, double radius_m,
                  std::vector<Sighting>& out);

ImageMotion image_motion(const TargetView& view, const BallProjection& at, const MotionState& state);

}  // namespace huetrack::object_tracking
