#include "object_tracking/objects/clutter_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct ClutterMapTuning {
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

void ClutterMap::claim(std::span<const Sighting> sightings, double probability) {
  for (const Sighting& s : sightings) {
    auto& open = cameras_[std::size_t(s.row.camera)].open;
    if (!open) continue;
    for (Open& region : *open)
      if ((region.centre - s.px).norm() < s.radius_px) region.clutter *= float(1 - probability);
  }
}

void ClutterMap::forget(std::size_t camera) {
  PerCamera& of = cameras_[camera];
  of.sets = of.regions = of.others_now = 0, of.marks = {};
  std::ranges::fill(of.around, 0.f);
  of.open.reset();
}

void ClutterMap::count(PerCamera& of, std::span<const Open> regions) {
  const double fresh = 1 / (of.sets + 1);
  of.sets = std::min(of.sets + 1, clutter_map.memory_sets);
  of.regions -= fresh * of.regions;
  for (float& cell : of.around) cell -= float(fresh) * cell;
  for (const auto& [centre, clutter] : regions) {
    const int u = std::clamp(int(centre.x()) / cell_px, 0, of.columns - 1);
    const int v = std::clamp(int(centre.y()) / cell_px, 0, of.rows - 1);
    of.regions += fresh * double(clutter);
    of.around[std::size_t(v * of.columns + u)] += float(fresh) * clutter;
  }
}

void ClutterMap::look(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions) {
  for (std::size_t i = 0; i < views.size(); ++i) {
    PerCamera& of = cameras_[std::size_t(views[i].index)];
    Marks now{.regions = double(regions[i].size())};
    for (const color::ColorRegion& region : regions[i])
      if (region.evidence.most > 0) ++now.discs, now.evidence += region.evidence.odds;
    of.others_now = std::max(0.0, now.regions - 1);
    const double fresh = 1 / (of.sets + 1);
    of.marks.regions += fresh * (now.regions - of.marks.regions);
    of.marks.discs += fresh * (now.discs - of.marks.discs);
    of.marks.evidence += fresh * (now.evidence - of.marks.evidence);
  }
}

void ClutterMap::add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions) {
  for (PerCamera& of : cameras_)
    if (const auto open = std::exchange(of.open, {})) count(of, *open);
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto& open = cameras_[std::size_t(views[i].index)].open.emplace();
    for (const color::ColorRegion& region : regions[i]) open.push_back({region.centre, 1});
  }
}

// Half a region more than were seen: Jeffreys' prior of a rate.
double ClutterMap::counted(const PerCamera& of) {
  return of.regions + 0.5 / std::max(1.0, of.sets);
}

// The target's odds are uniform up to the largest. Those of clutter are exponential, with the mean of this view's
// discs: of a mean over few discs the predictive distribution is Lomax's. Jeffreys' priors of both, around the mean 1
// that odds have if the pixels' model holds.
double ClutterMap::log_ratio(std::size_t camera, const color::DiscEvidence& evidence) const {
  const Marks& marks = cameras_[camera].marks;
  if (marks.discs == 0 && evidence.most <= 0) return 0;
  const double share = (marks.discs + 0.5) / (marks.regions + 1);  // of the clutter, that stands out
  if (evidence.most <= 0) return std::log((1 - detection.probability) / (1 - share));
  const double count = marks.discs + 0.5, sum = marks.evidence + 0.5;
  return std::log(detection.probability / share) - std::log(evidence.most) - std::log(count / sum) +
         (count + 1) * std::log1p(evidence.odds / sum);
}

double ClutterMap::expected(std::size_t camera) const {
  const PerCamera& of = cameras_[camera];
  return counted(of) + of.others_now / (of.sets + 1);
}

bool ClutterMap::is_crowded(std::size_t camera) const {
  return cameras_[camera].marks.regions > double(sighting_tuning.max_regions);
}

double ClutterMap::unjudged(std::size_t camera) const {
  const PerCamera& of = cameras_[camera];
  return of.others_now / (of.sets + 1) / of.pixels;
}

double ClutterMap::density(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const {
  const PerCamera& of = cameras_[camera];
  const int u = std::clamp(int(px.x()) / cell_px, 0, of.columns - 1);
  const int v = std::clamp(int(px.y()) / cell_px, 0, of.rows - 1);
  const int reach = std::clamp(int(std::ceil(radius_px / cell_px)), 1, of.columns);
  double near = 0, cells = 0;
  for (int j = std::max(0, v - reach); j <= std::min(of.rows - 1, v + reach); ++j) {
    for (int i = std::max(0, u - reach); i <= std::min(of.columns - 1, u + reach); ++i)
      near += double(of.around[std::size_t(j * of.columns + i)]), ++cells;
  }
  return near / (cells * cell_px * cell_px) + counted(of) / of.pixels;
}

}  // namespace huetrack::objects
