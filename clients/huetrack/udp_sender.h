// Sends datagrams to one address, without waiting and without retries.
#pragma once

#include <string>
#include <string_view>

namespace huetrack::client {

// thread-compatible.
class UdpSender {
 public:
  // to: HOST:PORT or [IPV6]:PORT, also broadcast and multicast (which stays on this network); resolved once, here.
  // Throws std::runtime_error with a one-line message.
  explicit UdpSender(const std::string& to);
  ~UdpSender();
  UdpSender(const UdpSender&) = delete;
  UdpSender& operator=(const UdpSender&) = delete;

  // Returns a message for each new error; empty: none, or the same as before. Throws std::runtime_error: too large for
  // a datagram.
  std::string send(std::string_view datagram);

 private:
  std::string to_;
  int fd_ = -1;
  int last_error_ = 0;  // that was reported
};

}  // namespace huetrack::client
