#include "object_tracking/objects/object_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "object_tracking/sighting.h"

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct SearchTuning {
  double min_area_share = 0.3;  // of the square of the smallest radius that a region of one object must have
};
constexpr SearchTuning search_tuning{};

// count: objects that may be in a row.
const std::vector<color::ColorRegion>& whole_regions(color::RegionFinder& finder, color::MatchBits& matches,
                                                     const SizeInView& size, int count,
                                                     std::span<const color::PixelAt> also) {
  const double usual = std::sqrt(size.smallest_px * size.largest_px);
  const int step = std::max(1, int(std::numbers::sqrt2 * size.smallest_px));  // no disc is between points
  const int min_area = std::max(2, int(sighting_tuning.min_disc_share * disc_area(size.smallest_px)));
  const int largest = int(std::ceil(2 * size.largest_px * count)) + 2;
  return finder.components(matches, step, also, int(2 * usual) + 2, largest, min_area);
}

}  // namespace

// On a grid over the volume, of which the points in the image count.
SizeInView size_in(const calib::Camera& camera, const Volume& volume, double radius_m) {
  constexpr int steps = 12;  // layout: of the grid
  SizeInView out;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k) {
        const Eigen::Array3d share = Eigen::Array3d(i, j, k) / steps;
        const Eigen::Vector3d p = volume.min.array() + share * (volume.max - volume.min).array();
        const auto at = project_ball(camera, p, radius_m);
        if (!at || !camera.contains({at->px})) continue;
        out.smallest_px = out.largest_px == 0 ? at->radius_px : std::min(out.smallest_px, at->radius_px);
        out.largest_px = std::max(out.largest_px, at->radius_px);
      }
    }
  }
  return out;
}

ObjectSearch::ObjectSearch(const calib::CameraRig& rig, const TargetOptions& target, const Volume& volume)
    : count_(target.count),
      finders_(rig.cameras.size()),
      disc_finders_(rig.cameras.size()),
      regions_(rig.cameras.size()) {
  for (const calib::Camera& camera : rig.cameras) size_in_view_.push_back(size_in(camera, volume, target.radius_m));
}

void ObjectSearch::look(const std::vector<TargetView>& views, std::span<const std::vector<color::PixelAt>> also) {
  view_count_ = views.size();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    const SizeInView& size = size_in_view_[std::size_t(view.index)];
    regions_[i].clear();
    if (size.largest_px == 0) continue;  // no part of the volume is in view
    if (count_ == 1 && !is_shared_) {    // parts of one object may be joined: a pole before it cuts it in two
      const int step = std::max(1, int(size.smallest_px));
      const int extent = int(std::ceil(sighting_tuning.extent_radii * size.largest_px)) + 2;
      const int min_area = std::max(2, int(search_tuning.min_area_share * size.smallest_px * size.smallest_px));
      regions_[i] =
          finders_[std::size_t(view.index)].search(*view.matches, step, extent, min_area, 2 * size.smallest_px);
      continue;
    }
    if (is_shared_ && view.matches->room() != nullptr)
      regions_[i] = disc_finders_[std::size_t(view.index)].find(
          *view.matches, {0, 0, view.image->width - 1, view.image->height - 1}, size.smallest_px, size.largest_px);
    // In a row with one object there may be something else of the colour. An object of just the room's colours stands
    // alone somewhere, if at all.
    const std::size_t discs = regions_[i].size();
    std::ranges::copy_if(whole_regions(finders_[std::size_t(view.index)], *view.matches, size, std::max(2, count_),
                                       also.empty() ? std::span<const color::PixelAt>() : also[i]),
                         std::back_inserter(regions_[i]), [&](const color::ColorRegion& region) {
                           return std::none_of(regions_[i].begin(), regions_[i].begin() + std::ptrdiff_t(discs),
                                               [&](const color::ColorRegion& disc) {
                                                 return (disc.centre - region.centre).norm() < disc_radius(region.area);
                                               });
                         });
  }
}

std::vector<double> ObjectSearch::usual_radii_px(const std::vector<TargetView>& views) const {
  std::vector<double> out;
  for (const TargetView& view : views) {
    const SizeInView& size = size_in_view_[std::size_t(view.index)];
    out.push_back(std::sqrt(size.smallest_px * size.largest_px));
  }
  return out;
}

}  // namespace huetrack::objects
