// A target that is several objects of one colour. Each set goes through the same steps as of one object
// (region_tracker.h), with two of its own:
//   - association: each view's regions are found once over the whole image and assigned to the predicted objects
//     (region_association.h): global nearest neighbour, view by view. An object's identity follows from its motion.
//   - births: unassigned regions may be new objects (object_births.h).
// Objects are solid: two tracks that come to lie within one another are one object. An object that leaves the volume is
// followed as long as it is seen, so that its regions are not taken for something else, but it is not published.
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

  // As of ObjectTracker.
  void update(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  void learn();
  void trust(std::span<const object_tracking::CameraTrust> cameras);
  void correct_times(std::span<const double> late_s);
  void begin_anew();
  void take_over_from(const ManyTracker& before);
  object_tracking::TargetViews& views() { return views_; }
  const object_tracking::TargetViews& views() const { return views_; }
  PositionParticles particles() const;  // of all objects
  std::span<const object_tracking::SeenRegion> regions() const { return seen_regions_.all(); }
  const std::vector<object_tracking::ColorShare>& color_shares() const { return clutter_mask_.shares(); }
  const std::optional<Eigen::Vector3d>& further_object() const { return further_.published(); }
  objects::SearchFindings search_findings() const { return search_log_.findings(); }

 private:
  struct Object {
    Object(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
           const object_tracking::ObjectTrackerOptions& options, particle_filter::Rng rng)
        : filter(rig, target, options, rng), rig_error(rig, options.max_coast_sigma_m) {}
    std::uint32_t number = 0;  // 0: not published yet
    ObjectFilter filter;
    object_tracking::RigError rig_error;
    objects::ObjectExistence existence;
    object_tracking::TrackState state = object_tracking::TrackState::tracking;
    capture::Timestamp last_tracking{}, last_published = capture::Timestamp::min();
    std::vector<object_tracking::Sighting> sightings;  // of this set
    std::vector<object_tracking::Sighting> watched;    // of cameras that are not used
    bool is_published = false;                         // in the last set
    capture::Timestamp last_inside{};
  };

  void predict(const std::vector<object_tracking::TargetView>& views);
  void find_regions(const std::vector<object_tracking::TargetView>& views);
  void associate(const std::vector<object_tracking::TargetView>& views,
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
  bool continue_track(const objects::Birth& birth, const std::vector<object_tracking::TargetView>& views,
                      capture::Timestamp set_at);
  void start(Object& object, const objects::Birth& birth, const std::vector<object_tracking::TargetView>& views,
             capture::Timestamp set_at);
  void end_duplicates();
  void forget_all();
  object_tracking::MotionState times() const;
  void report(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  void report_ended(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  object_tracking::ObjectEstimate no_object(const capture::FrameSet& set) const;

  const calib::CameraRig rig_;
  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  std::uint64_t stream_;  // of random numbers; each object has its own
  object_tracking::TargetViews views_;
  objects::RegionAssociation association_;
  object_tracking::ViewConsistency consistency_;
  objects::ObjectBirths births_;
  objects::StaticClutterMask clutter_mask_;
  objects::ClutterMap clutter_;
  objects::SearchLog search_log_;
  objects::FurtherObject further_;  // tracked beyond the target's count
  ObjectFilter times_;              // the timing's estimate while there is no object

  std::vector<objects::SizeInView> size_in_view_;                       // per camera
  std::vector<color::RegionFinder> finders_;                            // per camera
  std::vector<std::vector<objects::ExpectedObject>> expected_;          // in the views of this set
  std::vector<std::vector<color::ColorRegion>> regions_, unexplained_;  // of the views of this set
  std::vector<std::unique_ptr<Object>> objects_;                        // by age
  struct LastRegions {                                                  // of a camera's last frame
    std::vector<color::ColorRegion> regions = {};
    capture::Timestamp captured_at{};
    bool is_repeated = false;  // it was the frame before
  };
  std::vector<LastRegions> last_regions_;  // per camera
  const Object* lead_ = nullptr;           // by which views are compared; an address only
  object_tracking::SeenRegions seen_regions_;
  std::uint32_t last_number_ = 0;
  std::uint32_t number_before_ = 0;   // last_number_ when this one took over, or began anew
  std::vector<std::uint32_t> ended_;  // numbers from before that; their end is not published yet
  std::uint64_t started_ = 0;
  std::size_t sets_apart_ = 0;
  capture::Timestamp last_at_{};
};

}  // namespace huetrack::object_trackers
