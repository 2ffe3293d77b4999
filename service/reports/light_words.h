// Sentences about the effect of light on pictures and colours. Pure.
#pragma once

#include <string>
#include <vector>

#include "capture/frames/light_watch.h"
#include "object_tracking/trackers/object_tracker.h"

namespace huetrack::reports {

struct Remark {
  std::string what;    // "the light flickers at 100 Hz: ..."
  std::string advice;  // what to set
  std::string brief;   // "flicker at 100 Hz"; equal for all cameras that have it
};
// About one camera's pictures; empty if they are steady. has_controls: `controls` of the configuration are for this
// camera; otherwise the advice is about the camera's own program, as for a network camera.
std::vector<Remark> light_remarks(const capture::LightFindings& findings, bool has_controls = true);

// "ball in cam1: the colour differs by 12 degrees from the configured one; ..."; empty if the colour is well inside its
// range. is_recorded: advice about camera controls is left out.
std::string color_warning(const object_tracking::TargetOptions& target, const std::string& camera,
                          const object_trackers::ColorHealth& health, bool is_recorded);

// The object's colour is outside its range, or was at the end of the range when the object was lost.
bool is_lost(const object_trackers::ColorHealth& health, object_tracking::TrackState state);

// "its colour in cam1 was followed, at the end by +12 degrees of hue"; empty if the range is still the taught one.
std::string followed_text(const std::string& camera, const object_trackers::ColorHealth& health);

}  // namespace huetrack::reports
