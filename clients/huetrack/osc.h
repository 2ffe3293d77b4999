// Samples as Open Sound Control 1.0 (opensoundcontrol.org), for stage, light and music. Pure functions; thread-safe.
#pragma once

#include <string>

#include "idl/huetrack.h"

namespace huetrack::client {

// One bundle with the capture time as its time tag and the messages
//   /huetrack/TARGET/state     ,s    "tracking", "coasting", "searching", "lost"
//   /huetrack/TARGET/position  ,fff  x y z, metres; this and the next two only while there is a position
//   /huetrack/TARGET/velocity  ,fff  m/s
//   /huetrack/TARGET/sigma     ,fff  standard deviation along x, y, z, metres
// Characters that OSC does not allow in an address (#*,/?[]{} and blanks) become underscores in TARGET.
std::string osc_bundle(const msg::ObjectPosition& sample);

// A tracked camera's bundle, under /huetrack/camera/NAME: state, position, orientation (,ffff: x y z w), sigma.
std::string osc_bundle(const msg::CameraPose& sample);

}  // namespace huetrack::client
