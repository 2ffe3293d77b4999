// What light does to cameras and colours, in sentences for people.
#pragma once

#include <string>
#include <vector>

#include "capture/frames/light_watch.h"
#include "object_tracking/trackers/object_tracker.h"

namespace huetrack::reports {

struct Remark {
  std::string what;    // "the light flickers at 100 Hz: ..."
  std::string advice;  // what to set
  std::string brief;   // "flicker at 100 Hz"; the same for all cameras that have it
};
// Of one camera's pictures; none where they are still.
std::vector<Remark> light_remarks(const capture::LightFindings& findings);

// "ball in cam1: the colour has moved by 12 degrees since it was taught; ..."; empty when all is well. is_recorded: no
// camera can be set any more.
std::string color_warning(const object_tracking::TargetOptions& target, const std::string& camera,
                          const object_trackers::ColorHealth& health, bool is_recorded);

// The object's colour is beyond what is looked for, or was at its end when the object was lost: nothing is seen of it
// from then on, and its colour as known stays what it was.
bool is_lost(const object_trackers::ColorHealth& health, object_tracking::TrackState state);

// "its colour in cam1 was followed by 12 degrees of hue"; empty when it is looked for as it was taught.
std::string followed_text(const std::string& camera, const object_trackers::ColorHealth& health);

}  // namespace huetrack::reports
