// A target that is several objects of one colour: how many there are, where each of them is, and which is which. The
// road of one set through the same steps that one object goes through (region_tracker.h), with two of its own:
//   - every view's regions are found once, over the whole image, and shared out among the objects that are expected
//     (region_association.h): global nearest neighbour, view by view. Objects keep who they are by their motion.
//   - what no object explains may be new ones (object_births.h).
// In the field's terms: global nearest neighbour association over views; births by exclusion and confirmation (track
// initiation 2 of 2, and 8 of 8 where a view contradicts), as multi-hypothesis trackers do it within a window;
// particles score each object's position (object_filter.h). Objects are solid: two that come to lie within one another
// are one, told twice. What leaves the volume is followed as long as it is seen, so that what it shows is not taken for
// something else, and not told.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/expected_view.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/further_objects.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/object_existence.h"
#include "object_tracking/objects/object_search.h"
#include "object_tracking/objects/region_association.h"
#include "object_tracking/objects/search_findings.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/rig_error.h"
#include "object_tracking/seen_regions.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/object_filter.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

// thread-compatible.
class ManyTracker {
 public:
  ManyTracker(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
              const object_tracking::ObjectTrackerOptions& options, std::uint64_t stream);

  // ObjectTracker::update().
  void update(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  void trust(std::span<const object_tracking::CameraTrust> cameras);
  void correct_times(std::span<const double> late_s);
  // Before the first update(): ObjectTracker::take_the_place_of().
  void take_the_place_of(const ManyTracker& before);
  object_tracking::TargetViews& views() { return views_; }
  const object_tracking::TargetViews& views() const { return views_; }
  PositionParticles particles() const;  // of all objects
  std::span<const object_tracking::SeenRegion> regions() const { return seen_regions_.all(); }
  const std::vector<object_tracking::ColorShare>& color_shares() const { return clutter_mask_.shares(); }
  const std::optional<Eigen::Vector3d>& further_object() const { return further_.published(); }
  objects::SearchFindings search_findings() const { return search_log_.findings(); }

 private:
  struct Object {
    Object(const calib::CameraRig& rig, double radius_m, const object_tracking::ObjectTrackerOptions& options,
           particle_filter::Rng rng)
        : filter(rig, radius_m, options, rng), rig_error(rig, options.max_coast_sigma_m) {}
    std::uint32_t number = 0;  // 0: not told yet
    ObjectFilter filter;
    object_tracking::RigError rig_error;
    objects::ObjectExistence existence;
    object_tracking::TrackState state = object_tracking::TrackState::tracking;
    capture::Timestamp last_tracking{}, last_reported = capture::Timestamp::min();
    std::vector<object_tracking::Sighting> sightings;  // of this set
    std::vector<object_tracking::Sighting> watched;    // by cameras that are not used
    bool is_told = false;                              // in the last set
    capture::Timestamp last_inside{};
  };

  void expect(const std::vector<object_tracking::TargetView>& views);
  void find_regions(const std::vector<object_tracking::TargetView>& views);
  // Of each object, by these views.
  void sight(const std::vector<object_tracking::TargetView>& views,
             std::vector<object_tracking::Sighting> Object::*sightings);
  bool is_repeated(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
                   std::span<const objects::ExpectedObject> expected);
  std::optional<object_tracking::Sighting> seen_elsewhere(const object_tracking::TargetView& view, std::size_t i,
                                                          std::size_t which) const;
  void compare_views(const std::vector<object_tracking::TargetView>& views);
  double learn_acceleration(Object& object, const capture::FrameSet& set);
  void follow(Object& object, const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  void judge(Object& object, const capture::FrameSet& set);
  void note_births(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  bool take_up(const objects::Birth& birth, const std::vector<object_tracking::TargetView>& views,
               capture::Timestamp set_at);
  void start(Object& object, const objects::Birth& birth, const std::vector<object_tracking::TargetView>& views,
             capture::Timestamp set_at);
  void end_what_is_one();
  void forget_all();
  object_tracking::MotionState times() const;
  void report(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  void report_left_behind(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  object_tracking::ObjectEstimate none_known(const capture::FrameSet& set) const;

  const calib::CameraRig rig_;
  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  std::uint64_t stream_;  // of randomness; each object has one of its own
  object_tracking::TargetViews views_;
  objects::RegionAssociation association_;
  object_tracking::ViewConsistency consistency_;
  objects::ObjectBirths births_;
  objects::StaticClutterMask clutter_mask_;
  objects::ClutterMap clutter_;  // while the room shares the colour
  objects::SearchLog search_log_;
  objects::FurtherObject further_;  // that is tracked, and would be one too many
  ObjectFilter times_;              // of no object: what is known of the cameras' times when there is none

  std::vector<objects::SizeInView> size_in_view_;                       // per camera
  std::vector<color::RegionFinder> finders_;                            // per camera
  std::vector<std::vector<objects::ExpectedObject>> expected_;          // in the views of this set
  std::vector<std::vector<color::ColorRegion>> regions_, unexplained_;  // of the views of this set
  std::vector<std::unique_ptr<Object>> objects_;                        // by age
  // Of each camera's frame before, and whether that one was shown once more.
  struct LastRegions {
    std::vector<color::ColorRegion> regions = {};
    capture::Timestamp captured_at{};
    bool is_repeated = false;
  };
  std::vector<LastRegions> last_regions_;  // per camera
  const Object* lead_ = nullptr;           // by which views are compared; only an address
  object_tracking::SeenRegions seen_regions_;
  std::uint32_t last_number_ = 0;
  std::uint32_t number_before_ = 0;         // the last one of the trackers whose place this one took
  std::vector<std::uint32_t> left_behind_;  // numbers of theirs whose end is not told yet
  std::uint64_t started_ = 0;
  std::size_t sets_apart_ = 0;
  capture::Timestamp last_at_{};
};

}  // namespace huetrack::object_trackers
