// `huetrack view`: the bridge from DDS to browsers. It starts before the service and outlives it.
#pragma once

#include <functional>

#include "clients/live_view/page_server.h"
#include "idl/dds_participant.h"

namespace huetrack::live_view {

struct LiveViewOptions {
  idl::ParticipantOptions participant;
  PageServerOptions server;  // its token is made here where the address needs one
};

// Says the page's address on stdout, and runs until `ended`. Returns the exit status.
// throws std::exceptions with one readable line when the bus cannot be joined or the address not be listened on.
int view(LiveViewOptions options, const std::function<bool()>& ended);

}  // namespace huetrack::live_view
