// Measures several objects of one colour: each view's regions are found once over the whole image and assigned to the
// predicted objects (region_association.h): global nearest neighbour, view by view. An object's identity follows from
// its motion.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/objects/object_search.h"
#include "object_tracking/objects/region_association.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/tracked_object.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

// thread-compatible. Of the last measure(): regions, which belong to its views.
class SharedRegions {
 public:
  SharedRegions(std::size_t cameras, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options);

  // Measures all objects, and replaces their sightings. An object whose track has ended has none.
  void measure(const std::vector<object_tracking::TargetView>& views, const object_tracking::ViewConsistency& agreement,
               objects::ObjectSearch& search, TrackedObjects& objects, SightingsOf sightings);
  // Of views[i], that no object explains.
  std::span<const std::vector<color::ColorRegion>> unexplained() const {
    return std::span(unexplained_).first(view_count_);
  }
  // The sightings of one object, and for a view that does not show it where it is predicted, of a region elsewhere that
  // may be it: in a camera that was turned. Empty: not apart from all other objects in every view.
  std::vector<object_tracking::Sighting> alone(const std::vector<object_tracking::TargetView>& views,
                                               const TrackedObject& object, std::size_t which) const;

 private:
  struct LastRegions {  // of a camera's last frame
    std::vector<color::ColorRegion> regions = {};
    capture::Timestamp captured_at{};
    bool is_repeated = false;  // it was the frame before
  };
  void predict(const std::vector<object_tracking::TargetView>& views, const object_tracking::ViewConsistency& agreement,
               const TrackedObjects& objects);
  bool is_repeated(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
                   std::span<const objects::ExpectedObject> expected);
  std::optional<object_tracking::Sighting> elsewhere(const object_tracking::TargetView& view, std::size_t i,
                                                     const TrackedObject& object, std::size_t which) const;

  double radius_m_;
  object_tracking::ObjectTrackerOptions options_;
  objects::RegionAssociation association_;
  std::size_t view_count_ = 0;
  std::vector<std::vector<objects::ExpectedObject>> expected_;  // of the views of this set
  std::vector<std::vector<color::ColorRegion>> unexplained_;    // of the views of this set
  std::vector<LastRegions> last_;                               // per camera
};

}  // namespace huetrack::object_trackers
