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
  explicit SeenRegions(double pixel_noise_px) : pixel_noise_px_(pixel_noise_px) {}
  void clear() { all_.clear(); }
  std::span<const SeenRegion> all() const { return all_; }
  bool has(int camera) const {
    return std::ranges::any_of(all_, [&](const SeenRegion& region) { return region.camera == camera; });
  }

  void add_target(const TargetView& view, const Sighting& sighting) {
    all_.push_back(seen(view, sighting.px, sighting.radius_px, true));
    all_.back().sigma_px = std::sqrt(sighting.covariance.trace() / 2 + sighting.bias_sigma_px * sighting.bias_sigma_px);
  }
  void add_others(const TargetView& view, std::span<const color::ColorRegion> regions) {
    for (const color::ColorRegion& region : regions.first(std::min(max_others, regions.size())))
      all_.push_back(seen(view, region.centre, disc_radius(region.area), false));
  }

 private:
  static constexpr std::size_t max_others = 4;  // capacity: per view, the largest ones
  SeenRegion seen(const TargetView& view, const Eigen::Vector2d& px, double radius_px, bool is_target) const {
    const BaseError error = base_error(radius_px, pixel_noise_px_, sample_px(*view.image));
    return {.camera = view.index,
            .at = view.frame->row_time(px.y()),
            .px = px,
            .radius_px = radius_px,
            .below_middle = view.below_middle(px.y()),
            .sigma_px = std::sqrt(error.noise_px2 + error.bias_px2),
            .is_target = is_target};
  }

  double pixel_noise_px_;
  std::vector<SeenRegion> all_;
};

}  // namespace huetrack::object_tracking
