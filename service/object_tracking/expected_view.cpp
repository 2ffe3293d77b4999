#include "object_tracking/expected_view.h"

#include <algorithm>

namespace huetrack::object_tracking {
namespace {

struct ExpectedViewTuning {
  double max_exposure_s = 0.010;  // s, one period of lamps at 50 Hz: the shortest exposure without flicker
};
constexpr ExpectedViewTuning expected_view{};

constexpr int row_steps = 3;  // maths: fixed-point steps from the object's row to its time and back

}  // namespace

std::optional<ExpectedView> expected_in(const TargetView& view, const MotionState& state, double radius_m) {
  ExpectedView out;
  double row = (view.image->height - 1) / 2.0;
  for (int step = 0; step < row_steps; ++step) {
    out.row = row_of(view, row, state);
    const auto at = project_ball(*view.camera, state.position_at(out.row.at), radius_m);
    if (!at) return std::nullopt;
    out.at = *at;
    row = std::clamp(at->px.y(), 0.0, view.image->height - 1.0);
  }
  return out;
}

void add_expected(const std::vector<TargetView>& views, const MotionState& state, double radius_m,
                  std::vector<Sighting>& out) {
  for (const TargetView& view : views) {
    const auto expected = expected_in(view, state, radius_m);
    if (!expected) continue;
    Sighting& s = out.emplace_back();
    s.row.camera = view.index;
    s.px = expected->at.px;
    s.radius_px = expected->at.radius_px;
  }
}

ImageMotion image_motion(const TargetView& view, const BallProjection& at, const MotionState& state) {
  const double readout_s = capture::seconds(view.frame->readout) + state.row_offset_s(view.index, 0.5) -
                           state.row_offset_s(view.index, -0.5);
  return {.velocity = at.jacobian * state.velocity(),
          .row_s = view.image->height > 1 ? readout_s / (view.image->height - 1) : 0.0,
          .longest_exposure_s = expected_view.max_exposure_s};
}

}  // namespace huetrack::object_tracking
