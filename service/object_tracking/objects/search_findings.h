// Evidence from searches that found nothing: is the colour wrong, or the radius?
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// Of the frame sets searched in vain since the target was last found (observation: huetrack). Facts; the advice that
// follows from them: reports/search_advice.h.
struct SearchFindings {
  std::size_t sets = 0;
  std::vector<std::size_t> sets_with_color;  // per camera of the rig: sets with a region of the colour
  std::optional<double> radius_m;            // that the regions of two views agree on; > 0
  std::optional<double> radius_before_m;     // the same of the search before the target was first found

  bool shows_color(std::size_t camera) const;  // in a share of the sets that matters
};

// Two radii that one ball may have, as measured or configured: regions' areas are wrong by up to a half.
bool are_radii_alike(double a_m, double b_m);

// The true radii, from least to most, that a ball may have whose regions show this one.
std::pair<double, double> alike_radii(double radius_m);

// thread-compatible.
class SearchLog {
 public:
  explicit SearchLog(std::size_t cameras) { findings_.sets_with_color.resize(cameras); }

  // One frame set in which no object was found. regions[i] belongs to views[i].
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions, const object_tracking::Volume& volume);
  void clear();  // it was found
  SearchFindings findings() const;

 private:
  static constexpr std::size_t kept_radii = 300;  // capacity: pairs of regions in the median
  bool was_found_ = false;
  SearchFindings findings_;
  std::vector<double> radii_m_;  // of pairs of regions that one ball explains; a ring once it is full
  std::size_t next_ = 0;
};

}  // namespace huetrack::objects
