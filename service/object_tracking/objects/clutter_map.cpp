#include "object_tracking/objects/clutter_map.h"

#include <algorithm>
#include <utility>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct ClutterMapTuning {
  double first_sets = 15;    // frame sets that the first one is worth: a room shows the same for half a second
  double memory_sets = 100;  // frame sets in the means
};
constexpr ClutterMapTuning clutter_map{};

}  // namespace

ClutterMap::ClutterMap(const calib::CameraRig& rig) {
  for (const calib::Camera& camera : rig.cameras) {
    PerCamera& of = cameras_.emplace_back();
    of.columns = camera.image_size.width / cell_px + 1, of.rows = camera.image_size.height / cell_px + 1;
    of.pixels = double(camera.image_size.width) * camera.image_size.height;
    of.around.resize(std::size_t(of.columns * of.rows));
  }
}

void ClutterMap::claim(std::span<const Sighting> sightings) {
  for (const Sighting& s : sightings)
    if (auto& open = cameras_[std::size_t(s.row.camera)].open)
      std::erase_if(*open, [&](const Eigen::Vector2d& centre) { return (centre - s.px).norm() < s.radius_px; });
}

void ClutterMap::forget(std::size_t camera) {
  PerCamera& of = cameras_[camera];
  of.sets = of.regions = 0;
  std::ranges::fill(of.around, 0.f);
  of.open.reset();
}

void ClutterMap::count(PerCamera& of, std::span<const Eigen::Vector2d> centres) {
  const double fresh = of.sets == 0 ? 1 : 1 / (of.sets + 1);
  of.sets = of.sets == 0 ? clutter_map.first_sets : std::min(of.sets + 1, clutter_map.memory_sets);
  of.regions += fresh * (double(centres.size()) - of.regions);
  for (float& cell : of.around) cell -= float(fresh) * cell;
  for (const Eigen::Vector2d& centre : centres) {
    const int u = std::clamp(int(centre.x()) / cell_px, 0, of.columns - 1);
    const int v = std::clamp(int(centre.y()) / cell_px, 0, of.rows - 1);
    of.around[std::size_t(v * of.columns + u)] += float(fresh);
  }
}

void ClutterMap::add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions) {
  for (PerCamera& of : cameras_)
    if (const auto open = std::exchange(of.open, {})) count(of, *open);
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto& open = cameras_[std::size_t(views[i].index)].open.emplace();
    for (const color::ColorRegion& region : regions[i]) open.push_back(region.centre);
  }
}

// Half a region more than were seen: Jeffreys' prior of a rate.
double ClutterMap::expected(const PerCamera& of) {
  return of.regions + 0.5 / std::max(1.0, of.sets);
}

double ClutterMap::density(std::size_t camera, const Eigen::Vector2d& px) const {
  const PerCamera& of = cameras_[camera];
  const int u = std::clamp(int(px.x()) / cell_px, 0, of.columns - 1);
  const int v = std::clamp(int(px.y()) / cell_px, 0, of.rows - 1);
  double near = 0, cells = 0;
  for (int j = std::max(0, v - 1); j <= std::min(of.rows - 1, v + 1); ++j) {
    for (int i = std::max(0, u - 1); i <= std::min(of.columns - 1, u + 1); ++i)
      near += double(of.around[std::size_t(j * of.columns + i)]), ++cells;
  }
  return near / (cells * cell_px * cell_px) + expected(of) / of.pixels;
}

}  // namespace huetrack::objects
