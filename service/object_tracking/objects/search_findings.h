// What a search that finds nothing has seen: tells a user whether it is the colour or the radius that is wrong.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// What searching has seen in the sets in which it found nothing, since the target was last found (observation:
// huetrack).
struct SearchFindings {
  std::size_t sets = 0;
  std::vector<std::size_t> sets_with_color;  // per camera of the rig: sets in which it showed a region of the colour
  std::optional<double> radius_m;            // that the regions of two views agree on, if they do; > 0
  // The same of the search before the target was first found; nullopt also where it never was.
  std::optional<double> radius_before_m;
  // Something moves through the volume as the target would, of twice the hue: hue_deg was given in OpenCV's units, of
  // which there are 180.
  bool is_found_at_twice_the_hue = false;
  // What a user should try, one sentence; empty when nothing was searched. `cameras`: their names, in the order of the
  // rig.
  std::string advice(const object_tracking::TargetOptions& target, const std::vector<std::string>& cameras) const;
  // The same of a target that was found, but late; empty where nothing tells why.
  std::string late_advice(const object_tracking::TargetOptions& target) const;
};

struct SearchLogTuning {
  std::size_t kept_radii = 300;  // pairs of regions in the median of the radius
};
inline constexpr SearchLogTuning search_log{};

// thread-compatible.
class SearchLog {
 public:
  explicit SearchLog(std::size_t cameras) { findings_.sets_with_color.resize(cameras); }

  // One set in which no object of the given radius was found. regions[i] belongs to views[i].
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions, const object_tracking::Volume& volume);
  void clear();  // it was found
  SearchFindings findings() const;

 private:
  bool was_found_ = false;
  SearchFindings findings_;
  std::vector<double> radii_m_;  // of pairs of regions that one ball can explain; a ring once it is full
  std::size_t next_ = 0;
};

}  // namespace huetrack::objects
