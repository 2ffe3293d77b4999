// WHERE IS THE OBJECT: still, calibrated cameras; the target's position in the world.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frame.h"
#include "color/color_model.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/search_findings.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/color_watch.h"

namespace huetrack::object_trackers {

// thread-compatible; one per target; the pipeline's tracking threads own them. Never throws after
// construction, but for trust().
class ObjectTracker {
 public:
  // Copies what it needs of the rig. throws std::invalid_argument, naming the problems.
  ObjectTracker(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options);
  ~ObjectTracker();
  ObjectTracker(ObjectTracker&&) noexcept;
  ObjectTracker& operator=(ObjectTracker&&) noexcept;

  // The colour range in force in this camera: the target's, or what `color: adapt` made of it.
  color::HsiRange color_in(std::size_t camera) const;
  // Where the outline was in this camera's frame of the last update(), and how it moves, appended to `out`; nothing
  // where none would be fitted. For who has the pixels elsewhere. Of one object (count: 1; observation: huetrack).
  void expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const;
  // How many frames of this camera told nothing of the target: they say what matches other colours (Frame::matches).
  std::uint64_t frames_of_other_colors(std::size_t camera) const;

  // What a camera is going to deliver, where that is known beforehand: makes its colour table now, which otherwise
  // holds the first set up for some 5 ms.
  void expect(int camera, capture::PixelFormat format, capture::ColorRange range);

  // From the next update() on: per camera of the rig what is held of its calibration; fewer entries: the remaining
  // cameras are as the rig says. Replaces what was said before. The target is not searched anew, and what its views'
  // contradictions have told of a camera is forgotten where its pose becomes another one. observation: paper takes
  // is_used and the pose, and knows no covariance. throws std::invalid_argument: a value is not finite.
  void trust(std::span<const object_tracking::CameraTrust> cameras);

  // Per camera of the rig: its frames were found to be later than this tracker believes by so much, seconds, from what
  // cannot be learnt as it goes (view_watch.h); 0: as it is believed. The target is followed on, and as unsure as that
  // leaves it. observation: paper, and timing: fixed, take the rig's times for what they are.
  void correct_times(std::span<const double> late_s);

  // This one, which has not been updated yet, follows the target from now on, in the place of `before`: of a target of
  // several objects those that `before` told end with the next update(), and no number of theirs comes again.
  void take_the_place_of(const ObjectTracker& before);

  // set.frames has one slot per camera of the rig; a frame whose size is not the rig's is not used (the caller checks
  // sizes at start). Sets come in time order.
  // Of a target with a count of 1.
  object_tracking::ObjectEstimate update(const capture::FrameSet& set);
  // Of any target, one estimate or more: of a count of 1 that of the object; of a larger one those of all objects that
  // are known, by ascending numbers, and of those that have just ended; where there are none, one of the target itself.
  void update(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);

  // The particles after the last update, world frame, metres: for pictures and previews. about: every how many-th, so
  // that there are at least so many of them, but fewer than twice that; 0: all.
  std::vector<Eigen::Vector3f> particles(std::size_t about = 0) const;

  objects::SearchFindings search_findings() const;
  object_tracking::OutlineFindings outline_findings() const;

  // What the last update() looked at: nothing of views in which the target is neither expected nor searched. Of several
  // objects one stands for all, where it is apart from the others. Valid until the next update(). observation:
  // huetrack.
  std::span<const object_tracking::SeenRegion> regions() const;
  std::vector<object_tracking::ColorShare> color_shares() const;  // per camera of the rig; observation: huetrack

  // Where something is that would be one object more than the target's count, seen for more than a second: another one,
  // or something that looks like one. World frame, metres; nullopt: there is none, or, of a count of 1, the room has
  // the colour anyway. observation: huetrack.
  std::optional<Eigen::Vector3d> further_object() const;

  // Per camera of the rig: how the object's colour lies in the range that is looked for (color_watch.h). color_news()
  // counts what there is to tell of it.
  std::vector<ColorHealth> color_health() const;
  std::uint64_t color_news() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::object_trackers
