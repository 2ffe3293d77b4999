// Log of the colour regions that were examined in one frame set, for diagnostics.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::object_tracking {

// thread-compatible.
class SeenRegions {
 public:
  void clear() { all_.clear(); }
  std::span<const SeenRegion> all() const { return all_; }
  bool has(int camera) const {
    return std::ranges::any_of(all_, [&](const SeenRegion& region) { return region.camera == camera; });
  }

  void add_target(const TargetView& view, const Sighting& sighting) {
    all_.push_back(seen(view, sighting.px, sighting.radius_px, true));
    if (sighting.is_outline)
      all_.back().outline_sigma_px =
          std::sqrt(sighting.covariance.trace() / 2 + sighting.bias_sigma_px * sighting.bias_sigma_px);
  }
  void add_others(const TargetView& view, std::span<const color::ColorRegion> regions) {
    for (const color::ColorRegion& region : regions.first(std::min(max_others, regions.size())))
      all_.push_back(seen(view, region.centre, disc_radius(region.area), false));
  }

 private:
  static constexpr std::size_t max_others = 4;  // capacity: per view, the largest ones
  static SeenRegion seen(const TargetView& view, const Eigen::Vector2d& px, double radius_px, bool is_target) {
    return {.camera = view.index,
            .at = view.frame->row_time(px.y()),
            .px = px,
            .radius_px = radius_px,
            .below_middle = view.below_middle(px.y()),
            .is_target = is_target};
  }

  std::vector<SeenRegion> all_;
};

}  // namespace huetrack::object_tracking
