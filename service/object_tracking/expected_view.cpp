#include "object_tracking/expected_view.h"

#include <algorithm>

namespace huetrack::object_tracking {
namespace {

// An exposure smears a moving object. Indoors, one period of the light of lamps is the shortest one without flicker,
// and the longest one before motion blurs what colour is.
constexpr double longest_exposure_s = 0.010;

}  // namespace

std::optional<ExpectedView> expected_in(const TargetView& view, const MotionState& belief, double radius_m) {
  ExpectedView out;
  double row = (view.image->height - 1) / 2.0;
  for (int step = 0; step < 3; ++step) {
    out.row = row_of(view, row, belief);
    const auto at = project_ball(*view.camera, belief.position_at(out.row.at), radius_m);
    if (!at) return std::nullopt;
    out.at = *at;
    row = std::clamp(at->px.y(), -0.5 * view.image->height, 1.5 * view.image->height);
  }
  return out;
}

void add_expected(const std::vector<TargetView>& views, const MotionState& belief, double radius_m,
                  std::vector<Sighting>& out) {
  for (const TargetView& view : views) {
    const auto expected = expected_in(view, belief, radius_m);
    if (!expected) continue;
    Sighting& s = out.emplace_back();
    s.row.camera = view.index;
    s.px = expected->at.px;
    s.radius_px = expected->at.radius_px;
  }
}

ImageMotion image_motion(const TargetView& view, const BallProjection& at, const MotionState& belief) {
  const double readout_s = capture::seconds(view.frame->readout) + belief.row_offset_s(view.index, 0.5) -
                           belief.row_offset_s(view.index, -0.5);
  return {.velocity = at.jacobian * belief.velocity(),
          .row_s = view.image->height > 1 ? readout_s / (view.image->height - 1) : 0.0,
          .longest_exposure_s = longest_exposure_s};
}

}  // namespace huetrack::object_tracking
