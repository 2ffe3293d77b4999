// `huetrack view`: the bridge from DDS to browsers. Does not need a running service.
#pragma once

#include <functional>

#include "clients/live_view/page_server.h"
#include "idl/dds_participant.h"

namespace huetrack::live_view {

struct LiveViewOptions {
  idl::ParticipantOptions participant;
  PageServerOptions server;  // the token is generated here if the address needs one
};

// Prints the page's address on stdout and runs until `ended`. Returns the exit status. Throws std::exception with a
// one-line message if the bus cannot be joined or the address cannot be used.
int view(LiveViewOptions options, const std::function<bool()>& ended);

}  // namespace huetrack::live_view
