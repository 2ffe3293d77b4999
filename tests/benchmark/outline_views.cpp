#include "benchmark/outline_views.h"

#include <Eigen/LU>
#include <chrono>
#include <cmath>

#include "color/color_region.h"
#include "object_tracking/ball_outline.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::figures {
namespace {

constexpr double learning_s = 1, ahead_s = 0.3, same_light_m = 1.5;  // the latter ones as the tracker's
constexpr double least_visible = 0.3;
constexpr auto step = std::chrono::milliseconds(5);  // over which the truth's velocity is taken

}  // namespace

std::vector<std::vector<OutlineView>> fit_outlines(const Sequence& sequence,
                                                   const object_tracking::TargetOptions& target, double off_radii) {
  object_tracking::TargetViews views(sequence.rig, target);
  color::RegionFinder finder;
  outline::OutlineFit fit;
  std::vector<outline::Background> backgrounds;
  std::vector<outline::Look> looks(sequence.rig.cameras.size());
  std::vector<Eigen::Vector3d> lit_at(looks.size(), Eigen::Vector3d::Zero());
  for (const calib::Camera& camera : sequence.rig.cameras)
    backgrounds.emplace_back(camera.image_size.width, camera.image_size.height);
  std::vector<std::vector<OutlineView>> out;
  for (const capture::FrameSet& set : sequence.sets) {
    out.emplace_back();
    for (const object_tracking::TargetView& view : views.look_at(set)) {
      const auto c = static_cast<std::size_t>(view.index);
      const capture::Timestamp at = view.frame->captured_at;
      const auto row = sequence.row(target.name, at);
      if (!row) continue;
      const auto ball = object_tracking::outline_of(*view.camera, row->position, target.radius_m);
      if (!ball) continue;
      const double radius_px = std::sqrt(std::abs(ball->ellipse.axes.determinant()));
      Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
      if (const auto next = sequence.row(target.name, at + step)) {
        const auto then = object_tracking::outline_of(*view.camera, next->position, target.radius_m);
        if (then) velocity = (then->centre_px - ball->centre_px) / capture::seconds(step);
      }
      const outline::Picture picture = object_tracking::picture_of(view.frame->pixels);
      const double visible = row->visible.empty() ? 1 : row->visible[c];
      const auto appearance = object_tracking::project_ball(*view.camera, row->position, target.radius_m);
      if (capture::seconds(at - sequence.sets.front().at) > learning_s && visible > least_visible && appearance) {
        OutlineView& one = out.back().emplace_back();
        one.camera = view.index;
        one.visible = visible;
        one.jacobian = appearance->jacobian;
        one.radius_px = radius_px, one.px_per_s = velocity;
        const double row_s = view.camera->timing.readout_s.value_or(0) / (view.camera->image_size.height - 1);
        outline::Ellipse start = ball->ellipse;
        const auto turn = static_cast<double>(out.size());
        start.centre += off_radii * radius_px * Eigen::Vector2d(std::cos(turn), std::sin(turn));
        const auto before = std::chrono::steady_clock::now();
        const double way_m = (row->position - lit_at[c]).norm();
        one.fit = fit.fit(picture, backgrounds[c], start, {velocity, row_s}, looks[c],
                          {.same_light = std::exp(-way_m / same_light_m)});
        one.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
        one.off_px = one.fit.centre - ball->ellipse.centre;
        if (one.fit.outcome == outline::FitOutcome::fits && fit.learn(looks[c])) lit_at[c] = row->position;
        const Eigen::Vector2i px = ball->ellipse.centre.cast<int>();
        const int reach = static_cast<int>(2 * radius_px + 3);
        const auto& regions = finder.find(
            *view.matches, {px.x() - reach, px.y() - reach, px.x() + reach, px.y() + reach}, 4, 1.3 * radius_px);
        if (!regions.empty()) one.region_off_px = regions.front().centre - ball->ellipse.centre;
      }
      const outline::ObjectDisc disc{ball->centre_px, radius_px},
          hidden{ball->centre_px, 1.1 * radius_px + 4 + 0.01 * velocity.norm()};
      backgrounds[c].learn(picture, disc, ahead_s * velocity, &hidden, 1);
    }
  }
  return out;
}

std::optional<double> bound_of_sets_m(const std::vector<std::vector<OutlineView>>& sets) {
  double sum = 0;
  int n = 0;
  for (const auto& views : sets) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    int used = 0;
    for (const OutlineView& view : views) {
      if (view.fit.outcome != outline::FitOutcome::fits || view.visible <= 0.5) continue;
      information += view.jacobian.transpose() * view.fit.bound.inverse() * view.jacobian;
      ++used;
    }
    if (used < 2) continue;
    sum += information.inverse().trace(), ++n;
  }
  if (n == 0) return std::nullopt;
  return std::sqrt(sum / n);
}

}  // namespace huetrack::figures
