// Samples as Open Sound Control 1.0 (opensoundcontrol.org), which programs for stage, light and music understand. By
// hand: liblo and oscpack would be a package for fifty lines. Pure functions; thread-safe.
#pragma once

#include <string>

#include "idl/huetrack.h"

namespace huetrack::client {

// One bundle, whose time tag is the capture time, with a message each for
//   /huetrack/TARGET/state     ,s    "tracking", "coasting", "searching", "lost"
//   /huetrack/TARGET/position  ,fff  x y z, metres, and, as the two below, only while there is a position:
//   /huetrack/TARGET/velocity  ,fff  m/s
//   /huetrack/TARGET/sigma     ,fff  standard deviation along x, y, z, metres
// What OSC does not allow in an address ( #*,/?[]{} and blanks) is an underscore in TARGET.
std::string osc_bundle(const msg::ObjectPosition& sample);

// A tracked camera's bundle, under /huetrack/camera/NAME: state, position, orientation (,ffff: x y z w), sigma.
std::string osc_bundle(const msg::CameraPose& sample);

}  // namespace huetrack::client
