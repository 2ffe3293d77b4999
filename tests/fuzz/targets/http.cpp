// What comes over a connection to the page's server, and the JSON of its requests.
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <stdexcept>

#include "clients/live_view/events.h"
#include "clients/live_view/page_server.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

namespace {

std::string answered(const std::string& body) {
  try {
    live_view::control_request_of(body);
  } catch (const std::invalid_argument&) {  // of the other kind
  }
  try {
    live_view::teach_request_of(body);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

live_view::PageServerOptions any_port() {
  live_view::PageServerOptions options;
  options.port = 0;
  return options;
}

}  // namespace

HUETRACK_FUZZ_TARGET(http) {
  answered(std::string(input.substr(std::min(input.find("\r\n\r\n") + 4, input.size()))));
  static live_view::EventHub hub;
  static const live_view::PageServer server(any_port(), hub, {.teach = answered, .control = answered});
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(server.port()));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const linger at_once{.l_onoff = 1, .l_linger = 0};  // thousands a second: none may linger
  ::setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) {
    [[maybe_unused]] const auto sent = ::send(fd, input.data(), input.size(), MSG_NOSIGNAL);
    ::shutdown(fd, SHUT_WR);
    char answer[4096];
    pollfd wait{fd, POLLIN, 0};
    while (::poll(&wait, 1, 20) > 0 && ::recv(fd, answer, sizeof answer, 0) > 0) {
    }
  }
  ::close(fd);
}
