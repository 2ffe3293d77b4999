// A port of this machine on which a test or a benchmark serves.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <stdexcept>

#include "capture/frames/file_descriptor.h"

namespace huetrack::capture {

struct LoopbackPort {
  FileDescriptor listening{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  int number = 0;

  // Any free one of 127.0.0.1. Throws std::runtime_error: there is none.
  LoopbackPort() {
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof here;
    if (::bind(listening.get(), reinterpret_cast<sockaddr*>(&here), size) != 0 || ::listen(listening.get(), 4) != 0 ||
        ::getsockname(listening.get(), reinterpret_cast<sockaddr*>(&here), &size) != 0)
      throw std::runtime_error("no port of 127.0.0.1 is free");
    number = ntohs(here.sin_port);
  }
};

}  // namespace huetrack::capture
