#include "calib/report/volume_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "calib/model/median.h"
#include "drawing/axes.h"

namespace huetrack::report {
namespace {

using drawing::Canvas;
using drawing::Color;
using drawing::Point;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Color unseen{229, 231, 235}, camera_color{194, 65, 12}, mark_color{37, 99, 168}, volume_color{219, 234, 254};
constexpr double label = 11;  // size of a font

std::vector<int> shown_layers(int layers) {
  if (layers <= 3) {
    std::vector<int> all;
    for (int z = 0; z < layers; ++z) all.push_back(z);
    return all;
  }
  return {0, layers / 2, layers - 1};
}

double quantile_95(const std::vector<double>& values) {
  std::vector<double> some;
  std::ranges::copy_if(values, std::back_inserter(some), [](double v) { return std::isfinite(v); });
  return some.empty() ? 0 : calib::quantile_in_place(std::span(some), 0.95);
}

}  // namespace

Color blue(double share) {
  const double s = std::clamp(share, 0.0, 1.0);
  const auto mix = [&](double from, double to) { return static_cast<int>(std::lround(from + (to - from) * s)); };
  return {mix(228, 12), mix(238, 52), mix(248, 110)};
}

VolumeValues values_of(const solver::VolumeAccuracy& map) {
  VolumeValues out{.box = map.box, .steps = map.steps, .values = {}};
  for (const solver::PointAccuracy& point : map.points)
    out.values.push_back(point.views < 2 ? VolumeValues::none : 1e3 * point.total_m);
  return out;
}

Figure slices_figure(const VolumeValues& values, const std::string& none_means, double most_mm,
                     const std::string& caption) {
  constexpr double side = 190, gap = 16, legend = 120, top = 20;
  const Vector3d extent = values.box.high - values.box.low;
  const double zoom = side / std::max({extent.x(), extent.y(), 1e-6});
  const double w = zoom * extent.x() / values.steps[0], h = zoom * extent.y() / values.steps[1];
  const double most = std::max(most_mm > 0 ? most_mm : quantile_95(values.values), 1e-6);
  const std::vector<int> layers = shown_layers(values.steps[2]);
  Figure figure;
  figure.caption = caption;
  figure.width = static_cast<int>(static_cast<double>(layers.size()) * (w * values.steps[0] + gap) + legend);
  figure.height = static_cast<int>(top + std::max(h * values.steps[1], 120.0) + 6);
  figure.draw = [=](Canvas& canvas) {
    double left = 0;
    for (const int z : layers) {
      const double share = values.are_cells       ? (z + 0.5) / values.steps[2]
                           : values.steps[2] == 1 ? 0.5
                                                  : static_cast<double>(z) / (values.steps[2] - 1);
      const double height_m = values.box.low.z() + share * extent.z();
      canvas.text({left, top - 7}, fmt::format("z = {:.2f} m", height_m), label, drawing::muted);
      for (int y = 0; y < values.steps[1]; ++y) {
        for (int x = 0; x < values.steps[0]; ++x) {
          const double value = values.at(x, y, z);
          canvas.rectangle({left + x * w, top + (values.steps[1] - 1 - y) * h, w + 0.3, h + 0.3},
                           std::isfinite(value) ? blue(value / most) : unseen);
        }
      }
      left += w * values.steps[0] + gap;
    }
    constexpr int bands = 40;
    constexpr double band = 2.0, bar = 14;
    for (int i = 0; i < bands; ++i)
      canvas.rectangle({left, top + band * i, bar, band + 0.3}, blue(1 - static_cast<double>(i) / (bands - 1)));
    canvas.text({left + bar + 5, top + 9}, fmt::format("{:.3g} mm", most), label, drawing::ink);
    canvas.text({left + bar + 5, top + band * bands}, "0 mm", label, drawing::ink);
    canvas.rectangle({left, top + band * bands + 12, bar, 10}, unseen);
    canvas.text({left + bar + 5, top + band * bands + 21}, none_means, label, drawing::ink);
  };
  return figure;
}

Figure plan_figure(const calib::CameraRig& rig, const solver::WorldBox& box, const std::vector<PlaceOnPlan>& marked,
                   const std::string& caption) {
  Vector2d low = box.low.head<2>(), high = box.high.head<2>();
  const auto include = [&](const Vector3d& p) {
    low = low.cwiseMin(p.head<2>());
    high = high.cwiseMax(p.head<2>());
  };
  for (const calib::Camera& camera : rig.cameras) include(camera.centre());
  for (const PlaceOnPlan& mark : marked) include(mark.p_world);
  const double size = std::max(0.1, (high - low).maxCoeff());
  low -= Vector2d::Constant(0.14 * size);
  high += Vector2d::Constant(0.14 * size);
  const double zoom = std::min(440 / (high.x() - low.x()), 380 / (high.y() - low.y()));
  Figure figure;
  figure.caption = caption;
  figure.width = static_cast<int>(std::ceil(zoom * (high.x() - low.x())));
  figure.height = static_cast<int>(std::ceil(zoom * (high.y() - low.y())));
  figure.draw = [=](Canvas& canvas) {
    const auto at = [&](const Vector3d& p) { return Point(zoom * (p.x() - low.x()), zoom * (high.y() - p.y())); };
    canvas.rectangle({0, 0, zoom * (high.x() - low.x()), zoom * (high.y() - low.y())}, {246, 248, 250});
    const Point corner = at({box.low.x(), box.high.y(), 0});
    canvas.rectangle({corner.x(), corner.y(), zoom * (box.high.x() - box.low.x()), zoom * (box.high.y() - box.low.y())},
                     volume_color);
    for (const calib::Camera& camera : rig.cameras) {
      const Vector3d centre = camera.centre();
      std::vector<Point> wedge{at(centre)};
      for (const double u : {0.0, camera.image_size.width - 1.0}) {
        const auto ray = camera.model.ray({{u, camera.image_size.height / 2.0}});
        if (ray) wedge.push_back(at(centre + 0.3 * size * (camera.cam_from_world.rotation.conjugate() * *ray)));
      }
      canvas.polygon(wedge, camera_color.faded(0.12));
      canvas.polyline(wedge, camera_color, 0.8, true);
      canvas.disc(wedge.front(), 3.5, camera_color);
      canvas.text(wedge.front() + Point(6, -5), camera.name, label, drawing::ink, drawing::Align::left,
                  drawing::Weight::bold);
    }
    for (const PlaceOnPlan& mark : marked) {
      canvas.disc(at(mark.p_world), mark.name.empty() ? 1.5 : 4, mark_color.faded(mark.name.empty() ? 0.5 : 1));
      if (!mark.name.empty())
        canvas.text(at(mark.p_world) + Point(6, 4), mark.name, label, mark_color, drawing::Align::left,
                    drawing::Weight::bold);
    }
    const double bar = drawing::tick_step(0.5 * size, 2), bottom = zoom * (high.y() - low.y()) - 8;
    canvas.line({10, bottom}, {10 + zoom * bar, bottom}, drawing::ink, 2);
    canvas.text({10, bottom - 5}, fmt::format("{:g} m", bar), label, drawing::ink);
  };
  return figure;
}

}  // namespace huetrack::report
