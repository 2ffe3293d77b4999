// Search for an object of unknown position: regions of the whole images, from a coarse grid of pixels; the first birth
// among them inside the volume is a find (object_births.h). Objects outside the volume explain their regions.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "color/room_colors.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/search_findings.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// Range of the target's radius in a view over the volume; 0: never in view.
struct SizeInView {
  double smallest_px = 0, largest_px = 0;  // radius
};
SizeInView size_in(const calib::Camera& camera, const object_tracking::Volume& volume, double radius_m);

// All connected regions of a view that may be objects, from a grid and the points `also`. count: objects that may be in
// a row.
const std::vector<color::ColorRegion>& whole_regions(color::RegionFinder& finder, color::MatchBits& matches,
                                                     const SizeInView& size, int count,
                                                     std::span<const color::PixelAt> also);

// thread-compatible.
class ObjectSearch {
 public:
  ObjectSearch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
               const object_tracking::ObjectTrackerOptions& options);

  // Finds regions in the whole images.
  void look(const std::vector<object_tracking::TargetView>& views);
  // Of the last look(), one for each of its views.
  std::span<const std::vector<color::ColorRegion>> regions() const { return std::span(regions_).first(view_count_); }
  // Geometric mean of the target's radius over the volume, one per view.
  std::vector<double> usual_radii_px(const std::vector<object_tracking::TargetView>& views) const;
  const SizeInView& size_in_view(std::size_t camera) const { return size_in_view_[camera]; }
  std::span<const SizeInView> sizes_in_view() const { return size_in_view_; }  // per camera of the rig

  using Find = Birth;
  // The room shares the colour (static_clutter_mask.h).
  void set_shared(bool is_shared) { is_shared_ = is_shared; }
  // After look(). nullopt: none, or no second set yet. Of `times` only the timing is used.
  std::optional<Find> find(const std::vector<object_tracking::TargetView>& views, capture::Timestamp set_at,
                           const object_tracking::MotionState& times, const ClutterMap& clutter,
                           const StaticClutterMask& still);
  void found();   // the find was accepted
  void forget();  // the candidates are out of date

  SearchFindings findings() const { return log_.findings(); }

 private:
  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  std::vector<SizeInView> size_in_view_;                  // per camera
  std::vector<color::RegionFinder> finders_;              // per camera
  std::vector<color::DiscFinder> disc_finders_;           // per camera
  std::vector<std::vector<color::ColorRegion>> regions_;  // of the views of this set
  std::size_t view_count_ = 0;
  SearchLog log_;
  bool is_shared_ = false;
  ObjectBirths births_;
};

}  // namespace huetrack::objects
