// Tracks one target: the position of its object or objects in the world, from still, calibrated cameras.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "color/color_model.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/search_findings.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/color_watch.h"

namespace huetrack::object_trackers {

// thread-compatible; one per target. After construction only trust() throws. World frame, metres.
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
  // Appends where the outline was in this camera's frame of the last update(), and how it moves; nothing where no
  // outline would be fitted. For cameras whose pixels are on another host. count: 1 and observation: huetrack only.
  void expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const;
  // How many frames of this camera came with matches of other colours only (Frame::matches), and were not used.
  std::uint64_t frames_of_other_colors(std::size_t camera) const;

  // Makes the colour table of a camera whose format is known in advance; otherwise the first set waits some 5 ms for
  // it.
  void expect(int camera, capture::PixelFormat format, capture::ColorRange range);

  // From the next update() on, how far each camera's calibration is trusted; cameras beyond the end of the span are as
  // the rig says. Replaces the last call. Tracking goes on; what was learnt of a camera's inconsistency is reset where
  // its pose changes. observation: paper uses is_used and the pose only. throws std::invalid_argument: a value is not
  // finite.
  void trust(std::span<const object_tracking::CameraTrust> cameras);

  // After update() of the trackers of one rig, before correct_times(): what each has learnt of the cameras' timing, all
  // know. Several objects of one tracker share it by themselves. No effect with observation: paper, and with
  // timing: fixed.
  static void share_times(std::span<ObjectTracker> trackers);

  // Per camera of the rig: its frames are later than this tracker estimates, seconds (ViewWatch::late_s()). Tracking
  // goes on with the uncertainty that this leaves. No effect with observation: paper, and with timing: fixed.
  void correct_times(std::span<const double> late_s);

  // The next set does not continue the last one, as after a recording's jump: the objects' tracks end, and their
  // positions are unknown. What was learnt of timing, colours and room stays.
  void begin_anew();

  // Before the first update(): continues the numbering of `before`, whose objects end with the next update().
  void take_over_from(const ObjectTracker& before);

  // Sets come in time order, with one slot per camera of the rig. A frame whose size is not the rig's is not used.
  // Keeps the frames until learn().
  object_tracking::ObjectEstimate update(const capture::FrameSet& set);  // count: 1
  // Any count. Several objects: one estimate per known object, by ascending number, and per object that has just ended;
  // where there is none, one estimate of the target itself.
  void update(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);

  // After each update(), once its estimates are published: what only later sets need (the room's clutter, what is
  // behind the object, further objects, its colour), of the same frames. update() and trust() call it if it was not
  // called.
  void learn();

  // The particles after the last update, for pictures. about: at least so many of them, but fewer than twice as many,
  // by a regular step; 0: all.
  std::vector<Eigen::Vector3f> particles(std::size_t about = 0) const;

  objects::SearchFindings search_findings() const;         // since it was last found
  objects::SearchFindings search_findings_of_run() const;  // since the first update(), or another radius
  object_tracking::OutlineFindings outline_findings() const;

  // In force instead of an assumed radius: the one that the pictures of several cameras have shown; from then on the
  // objects were searched for again. nullopt: the target's is in force. observation: huetrack.
  std::optional<double> shown_radius_m() const;
  bool is_radius_known() const;  // false: assumed, and its outlines have shown none yet

  // Regions that the last update() used, in views in which the target is expected or searched. Of several objects only
  // one that is apart from the others. Valid until the next update(). observation: huetrack.
  std::span<const object_tracking::SeenRegion> regions() const;
  std::vector<object_tracking::ColorShare> color_shares() const;  // per camera of the rig; observation: huetrack

  // As of the last learn(): where one more object than the target's count, or something that looks like one, has been
  // seen for more than a second. nullopt: none; also where count is 1 and the room has the target's colour.
  // observation: huetrack.
  std::optional<Eigen::Vector3d> further_object() const;

  std::vector<ColorHealth> color_health() const;  // as of the last learn(); per camera of the rig
  std::uint64_t color_change_count() const;       // increases whenever a warning of color_health() changes

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::object_trackers
