// As much of an HTTP client as the tests of the metrics need.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

namespace huetrack::end_to_end {

// A connection to a port of this host; closed with it.
class Connection {
 public:
  explicit Connection(int port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{.tv_sec = 5, .tv_usec = 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    is_open_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  ~Connection() { ::close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  bool is_open() const { return is_open_; }
  void send(const std::string& text) const {
    [[maybe_unused]] const auto sent = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
  }
  // What is there, at least a byte; empty: the other side ended, or 5 s without one.
  std::string receive_some() const {
    std::string some(65536, '\0');
    const ssize_t got = ::recv(fd_, some.data(), some.size(), 0);
    some.resize(got > 0 ? std::size_t(got) : 0);
    return some;
  }
  // Until the other side ends, or 5 s without a byte.
  std::string receive() const {
    std::string all;
    char buffer[4096];
    for (ssize_t got = 0; (got = ::recv(fd_, buffer, sizeof buffer, 0)) > 0;) all.append(buffer, std::size_t(got));
    return all;
  }

 private:
  int fd_;
  bool is_open_ = false;
};

// Header and body; nullopt: nobody listens.
inline std::optional<std::string> http_get(int port, const std::string& path) {
  const Connection connection(port);
  if (!connection.is_open()) return std::nullopt;
  connection.send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  return connection.receive();
}

// Every sample of a Prometheus text, by its name and labels as written.
inline std::map<std::string, double> prometheus_samples(const std::string& text) {
  std::map<std::string, double> samples;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const auto blank = line.rfind(' ');
    if (line.empty() || line[0] == '#' || blank == std::string::npos) continue;
    try {
      samples[line.substr(0, blank)] = std::stod(line.substr(blank + 1));
    } catch (const std::invalid_argument&) {  // a header of HTTP
    }
  }
  return samples;
}

}  // namespace huetrack::end_to_end
