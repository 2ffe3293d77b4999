// Reloads the configuration while the program runs: on SIGHUP, and when a colour was taught.
#pragma once

#include <string>

#include "pipeline/session.h"

namespace huetrack::daemon {

// Applies the file as far as possible while running, and logs the result. Returns the reason if it was refused and
// nothing has changed; empty: applied. One thread at a time, as Session::take_over().
std::string reload(pipeline::Session& session);

}  // namespace huetrack::daemon
