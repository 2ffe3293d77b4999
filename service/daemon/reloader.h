// The configuration read again while the program runs: on SIGHUP, and when a colour has been taught.
#pragma once

#include <string>

#include "pipeline/session.h"

namespace huetrack::daemon {

// Puts the file into force as far as that is possible now, and says in the log what came of it. Returns why it was
// refused, and nothing has changed; empty: it was not. One thread at a time, as Session::take_over().
std::string reload(pipeline::Session& session);

}  // namespace huetrack::daemon
