#include "udp_sender.h"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "calib/files/number_text.h"

namespace huetrack::client {

UdpSender::UdpSender(const std::string& to) : to_(to) {
  const auto colon = to.rfind(':');
  std::string host = to.substr(0, colon), port = colon == std::string::npos ? "" : to.substr(colon + 1);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  const int number = files::number_of<int>(port).value_or(0);
  if (host.empty() || number < 1 || number > 65535)
    throw std::runtime_error("--udp wants HOST:PORT, for example 127.0.0.1:9000, not \"" + to + "\"");
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int failed = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); failed != 0)
    throw std::runtime_error("--udp " + to + ": " + ::gai_strerror(failed));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owned(found, &::freeaddrinfo);
  int why = 0;
  for (const addrinfo* address = found; address != nullptr && fd_ < 0; address = address->ai_next) {
    fd_ = ::socket(address->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd_ < 0) {
      why = errno;
      continue;
    }
    const int yes = 1;
    ::setsockopt(fd_, SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
    // Connected, so that the other host's ICMP refusal is reported.
    if (::connect(fd_, address->ai_addr, address->ai_addrlen) == 0) break;
    why = errno;
    ::close(fd_);
    fd_ = -1;
  }
  if (fd_ < 0) throw std::runtime_error("--udp " + to + ": " + std::strerror(why));
}

UdpSender::~UdpSender() {
  if (fd_ >= 0) ::close(fd_);
}

std::string UdpSender::send(std::string_view datagram) {
  if (::send(fd_, datagram.data(), datagram.size(), MSG_NOSIGNAL) >= 0) return "";
  const int error = errno;
  if (error == EMSGSIZE) throw std::runtime_error("--udp " + to_ + ": a sample is larger than a datagram can be");
  if (error == last_error_) return "";
  last_error_ = error;
  if (error == ECONNREFUSED) return "no receiver at " + to_ + " (UDP: port closed); sending continues";
  return "sending to " + to_ + ": " + std::strerror(error) + "; sending continues";
}

}  // namespace huetrack::client
