// What a search that finds nothing has seen: tells a user whether it is the colour or the radius that is wrong.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/object_tracker.h"
#include "object_tracking/target_views.h"

namespace huetrack::object_tracking {

// thread-compatible.
class SearchLog {
 public:
  explicit SearchLog(std::size_t cameras) { findings_.sets_with_color.resize(cameras); }

  // One set in which no object of the given radius was found. regions[i] belongs to views[i].
  void add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
           const Volume& volume);
  void clear();  // it was found
  SearchFindings findings() const;

 private:
  static constexpr std::size_t kept_radii = 300;
  SearchFindings findings_;
  std::vector<double> radii_m_;  // of pairs of regions that one ball can explain; a ring once it is full
  std::size_t next_ = 0;
};

}  // namespace huetrack::object_tracking
