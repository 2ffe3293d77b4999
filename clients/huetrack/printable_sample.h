// Sanitises the strings of received samples for terminals, CSV and logs: any program may have sent them. Applied to
// every sample on reception. Pure functions; thread-safe.
#pragma once

#include <string>

#include "idl/camera_host.h"
#include "idl/camera_times.h"
#include "idl/huetrack.h"
#include "idl/object_set.h"

namespace huetrack::client {

// Names become one word, sentences one line; both are cut beyond the lengths of huetrackd.
void make_printable(msg::ObjectPosition& sample);
void make_printable(msg::CameraPose& sample);
void make_printable(msg::ServiceStatus& sample);
void make_printable(msg::CameraTimes& sample);
void make_printable(msg::HostClocks& sample);
void make_printable(msg::CameraHost& sample);
void make_printable(msg::ObjectSet& sample);

const std::string& name_of(const msg::ObjectPosition& sample);  // the target's
const std::string& name_of(const msg::CameraPose& sample);      // the camera's

}  // namespace huetrack::client
