// Regions of the target's colour in whole images, from a coarse grid of pixels: where objects of unknown position may
// be.
#pragma once

#include <span>
#include <vector>

#include "color/color_region.h"
#include "color/room_colors.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// Range of the target's radius in a view over the volume; 0: never in view.
struct SizeInView {
  double smallest_px = 0, largest_px = 0;  // radius
};
SizeInView size_in(const calib::Camera& camera, const object_tracking::Volume& volume, double radius_m);

// thread-compatible.
class ObjectSearch {
 public:
  ObjectSearch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
               const object_tracking::Volume& volume);

  // Finds all connected regions that may be objects. also: per view, pixels beyond the grid's where regions are looked
  // for.
  void look(const std::vector<object_tracking::TargetView>& views,
            std::span<const std::vector<color::PixelAt>> also = {});
  // Of the last look(), one for each of its views.
  std::span<const std::vector<color::ColorRegion>> regions() const { return std::span(regions_).first(view_count_); }
  // Geometric mean of the target's radius over the volume, one per view.
  std::vector<double> usual_radii_px(const std::vector<object_tracking::TargetView>& views) const;
  const SizeInView& size_in_view(std::size_t camera) const { return size_in_view_[camera]; }

  // The room shares the colour (static_clutter_mask.h).
  void set_shared(bool is_shared) { is_shared_ = is_shared; }

 private:
  int count_;                                             // of objects
  std::vector<SizeInView> size_in_view_;                  // per camera
  std::vector<color::RegionFinder> finders_;              // per camera
  std::vector<color::DiscFinder> disc_finders_;           // per camera
  std::vector<std::vector<color::ColorRegion>> regions_;  // of the views of this set
  std::size_t view_count_ = 0;
  bool is_shared_ = false;
};

}  // namespace huetrack::objects
