#include "clients/live_view/view.h"

#include <malloc.h>
#include <sys/prctl.h>

#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <thread>

#include "clients/live_view/bus_reader.h"
#include "clients/live_view/events.h"

namespace huetrack::live_view {

using namespace std::chrono_literals;

int view(LiveViewOptions options, const std::function<bool()>& ended) {
  if (!is_loopback(options.server.address) && options.server.token.empty()) options.server.token = random_token();
  // Fast DDS sets room for the largest samples aside, of which a few kilobytes are ever used: by huge pages, it would
  // all be there. Where the kernel does not know this, it costs some ten megabytes.
  ::prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0);
  // Pictures come and go: those that are large are given back at once, and not kept in pieces by the C library.
  ::mallopt(M_MMAP_THRESHOLD, 32 * 1024);
  EventHub hub;
  BusReader bus(options.participant, hub);
  const auto asked = [&bus](auto request_of) {
    return [&bus, request_of](const std::string& body) -> std::string {
      try {
        return bus.request(request_of(body));
      } catch (const std::invalid_argument& error) {  // a client's invalid request
        return error.what();
      }
    };
  };
  const PageServer server(options.server, hub,
                          {.teach = asked(teach_request_of),
                           .control = asked(control_request_of),
                           .download = [&bus](const std::vector<std::string>& words, std::string& why_not) {
                             return bus.download(words, why_not);
                           }});
  std::vector<std::string> hosts{options.server.address};
  if (options.server.address == "0.0.0.0") {
    hosts = host_addresses();
    if (hosts.empty()) hosts = {"127.0.0.1"};
  }
  for (const std::string& host : hosts)
    std::printf("http://%s:%d/%s\n", host.c_str(), server.port(),
                options.server.token.empty() ? "" : ("?token=" + options.server.token).c_str());
  std::fflush(stdout);
  if (options.server.port != 0 && server.port() != options.server.port)
    std::fprintf(stderr, "huetrack: port %d is in use by another program: this page has port %d\n", options.server.port,
                 server.port());
  std::fprintf(stderr, "huetrack: the page is at the address%s above, for %s; %s. Ctrl-C ends it\n",
               hosts.size() > 1 ? "es" : "",
               options.server.token.empty() ? "this host only" : "every host, with the token",
               bus.description().c_str());
  while (!ended()) {
    const int pages = server.pages();
    bus.poll(pages);
    std::this_thread::sleep_for(server.listeners() + bus.downloads() > 0 ? 2ms : pages > 0 ? 10ms : 50ms);
  }
  return 0;
}

}  // namespace huetrack::live_view
