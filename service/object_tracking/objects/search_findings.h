// Evidence from searches that found nothing: is the colour wrong, or the radius?
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// Of the frame sets searched in vain since the target was last found, or in the whole run (observation: huetrack).
// Facts; the advice that follows from them: reports/search_advice.h.
struct SearchFindings {
  std::size_t sets = 0;
  std::vector<std::size_t> sets_with_color;  // per camera of the rig: sets with a region of the colour
  std::size_t sets_in_two = 0;               // with a region of the colour in two views or more
  std::size_t sets_shared = 0;               // in a room that shares the colour (static_clutter_mask.h)
  std::size_t sets_outside = 0;              // with regions of two views that fit one ball outside of the volume
  std::optional<double> radius_m;            // that the regions of two views agree on; > 0
  // Where the regions of two views fit a ball of one radius outside of the volume.
  struct Outside {
    Eigen::AlignedBox3d places;  // the middle nine tenths per axis
    double radius_m;
  };
  std::optional<Outside> outside;
  std::optional<double> radius_before_m;  // the same of the search before the target was first found

  bool shows_color(std::size_t camera) const;  // in a share of the sets that matters
};

// Two radii that one ball may have, as measured or configured: regions' areas are wrong by up to a half.
bool are_radii_alike(double a_m, double b_m);

// The true radii, from least to most, that a ball may have whose regions show this one.
std::pair<double, double> alike_radii(double radius_m);

// thread-compatible.
class SearchLog {
 public:
  explicit SearchLog(std::size_t cameras) : since_found_(cameras), of_run_(cameras) {}

  // One frame set in which no object was found. regions[i] belongs to views[i]. In a room that shares the colour,
  // regions are discs of the size that is searched, so they say nothing about the radius. An object far larger than
  // configured passes for such a room.
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions, const object_tracking::Volume& volume,
           bool is_room_shared);
  void clear();                                                        // it was found
  SearchFindings findings() const { return since_found_.findings(); }  // since it was last found
  SearchFindings findings_of_run() const { return of_run_.findings(); }

 private:
  static constexpr std::size_t kept_pairs = 300;  // capacity: pairs of regions in the median
  struct Pair {                                   // of regions that one ball explains
    Eigen::Vector3d place;
    double radius_m;
  };
  struct Pairs {
    std::vector<Pair> all = {};  // a ring once it is full
    std::size_t next = 0;
    void add(const Pair& pair);
    std::optional<double> radius_m() const;  // that they agree on
  };
  struct Counted {
    explicit Counted(std::size_t cameras) { counts.sets_with_color.resize(cameras); }
    SearchFindings counts;
    Pairs inside, outside;  // of the volume
    SearchFindings findings() const;
  };
  bool was_found_ = false;
  Counted since_found_, of_run_;
};

}  // namespace huetrack::objects
