// Finds an object of known colour and radius in pictures of another moment, in which nothing was pointed at. Model:
// design.md, "Other light".
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "calib/model/camera_rig.h"
#include "color/room_colors.h"
#include "color_teaching/ball_size.h"
#include "color_teaching/disc_candidate.h"
#include "object_tracking/target_views.h"

namespace huetrack::color_teaching {

// In one picture.
struct FoundView {
  ColoredRegion view;
  std::vector<color::Hsi> pixels;
};

// thread-compatible. Keeps a reference to the rig.
class FoundAgain {
 public:
  // target: its radius, and ranges that hold it in any light. looks: per camera of the rig.
  FoundAgain(const calib::CameraRig& rig, const object_tracking::TargetOptions& target, std::vector<Look> looks,
             const object_tracking::Volume& volume);

  // What two views or more show at one place; the likeliest first. Without `several`: of one alone, and nothing if
  // another place is about as likely. Counts the room's colours on its way.
  std::vector<std::vector<FoundView>> in(const capture::FrameSet& set, bool several);

 private:
  struct Picture;
  struct Place;
  Picture picture_of(const object_tracking::TargetView& view);
  std::vector<Place> places_of(const std::vector<Picture>& pictures) const;

  const calib::CameraRig& rig_;
  const std::vector<Look> looks_;
  const object_tracking::Volume volume_;
  const double radius_m_;
  object_tracking::TargetViews views_;
  std::vector<std::shared_ptr<color::RoomColors>> rooms_;
  color::DiscFinder finder_;
};

}  // namespace huetrack::color_teaching
