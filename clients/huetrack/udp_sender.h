// Datagrams to one address: each is sent or lost, and nothing is waited for.
#pragma once

#include <string>
#include <string_view>

namespace huetrack::client {

// thread-compatible.
class UdpSender {
 public:
  // to: HOST:PORT or [IPV6]:PORT; a name is looked up once, here. Broadcast and multicast addresses are as good as any
  // (multicast stays on this network). throws std::runtime_error, one readable line.
  explicit UdpSender(const std::string& to);
  ~UdpSender();
  UdpSender(const UdpSender&) = delete;
  UdpSender& operator=(const UdpSender&) = delete;

  // What is wrong with the way there, once for each trouble that is new; empty: nothing, or the same as before.
  // throws std::runtime_error: larger than a datagram can be.
  std::string send(std::string_view datagram);

 private:
  std::string to_;
  int fd_ = -1;
  int last_error_ = 0;  // that was told
};

}  // namespace huetrack::client
