#include <netdb.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <list>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "capture/file_descriptor.h"
#include "daemon/metrics.h"

namespace huetrack::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::size_t most_clients = 16;
constexpr std::size_t longest_request = 8192;  // bytes
constexpr auto client_patience = 2s;           // from its connection until its answer is sent

// throws std::runtime_error
capture::FileDescriptor listen_on(const std::string& address, int port) {
  const std::string where = "metrics: " + address + ":" + std::to_string(port) + " cannot be listened on: ";
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0)
    throw std::runtime_error(where + ::gai_strerror(error) + ": give an address of this host, or 0.0.0.0 for all");
  capture::FileDescriptor fd(::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const bool is_listening =
      fd.get() >= 0 && ::bind(fd.get(), found->ai_addr, found->ai_addrlen) == 0 && ::listen(fd.get(), 16) == 0;
  const int error = errno;
  ::freeaddrinfo(found);
  if (!is_listening)
    throw std::runtime_error(where + std::strerror(error) +
                             ": another program has that port, or the address is not this host's");
  return fd;
}

struct Client {
  capture::FileDescriptor fd;
  Clock::time_point deadline;
  std::string request, answer;
  std::size_t sent = 0;  // of the answer
};

std::string answer_to(std::string_view request, const std::string& metrics) {
  const std::string_view line = request.substr(0, request.find("\r\n"));
  const std::string_view method = line.substr(0, line.find(' '));
  std::string_view path = line.substr(std::min(method.size() + 1, line.size()));
  path = path.substr(0, path.find_first_of(" ?"));
  const bool is_read = method == "GET" || method == "HEAD";
  const bool is_found = is_read && path == "/metrics";
  const std::string body = is_found ? metrics : is_read ? "not here: /metrics\n" : "only GET\n";
  return std::string("HTTP/1.1 ") +
         (is_found  ? "200 OK"
          : is_read ? "404 Not Found"
                    : "405 Method Not Allowed\r\nAllow: GET, HEAD") +
         "\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + (method == "HEAD" ? "" : body);
}

}  // namespace

// One thread that waits for all sockets at once and for the end: no client, however silent, holds up another or the
// end.
struct MetricsServer::Impl {
  capture::FileDescriptor listening;
  capture::FileDescriptor ending{::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};
  std::mutex mutex;
  std::string text;  // guarded by mutex
  std::jthread thread;

  void serve() {
    std::list<Client> clients;
    for (;;) {
      std::vector<pollfd> waiting{{ending.get(), POLLIN, 0}};
      // Who comes when there are too many waits in the kernel's queue.
      waiting.push_back({clients.size() < most_clients ? listening.get() : -1, POLLIN, 0});
      auto soonest = Clock::time_point::max();
      for (const auto& client : clients) {
        waiting.push_back({client.fd.get(), static_cast<short>(client.answer.empty() ? POLLIN : POLLOUT), 0});
        soonest = std::min(soonest, client.deadline);
      }
      const auto patience = std::chrono::ceil<std::chrono::milliseconds>(soonest - Clock::now()).count();
      if (::poll(waiting.data(), waiting.size(), clients.empty() ? -1 : int(std::max<std::int64_t>(patience, 0))) < 0 &&
          errno != EINTR)
        return;
      if (waiting[0].revents != 0) return;
      std::size_t w = 2;
      for (auto client = clients.begin(); client != clients.end(); ++w) {
        const bool is_through = (waiting[w].revents != 0 && !go_on(*client)) || Clock::now() >= client->deadline;
        client = is_through ? clients.erase(client) : std::next(client);
      }
      if (waiting[1].revents != 0) {
        capture::FileDescriptor fd(::accept4(listening.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (fd.get() >= 0) clients.push_back({std::move(fd), Clock::now() + client_patience, {}, {}, 0});
      }
    }
  }

  // False: done with it.
  bool go_on(Client& client) {
    if (client.answer.empty()) {
      char bytes[2048];
      const ssize_t got = ::recv(client.fd.get(), bytes, sizeof bytes, 0);
      if (got <= 0) return got < 0 && (errno == EAGAIN || errno == EINTR);
      client.request.append(bytes, std::size_t(got));
      if (client.request.find("\r\n\r\n") == std::string::npos) return client.request.size() < longest_request;
      const std::scoped_lock lock(mutex);
      client.answer = answer_to(client.request, text);
    }
    const ssize_t sent =
        ::send(client.fd.get(), client.answer.data() + client.sent, client.answer.size() - client.sent, MSG_NOSIGNAL);
    if (sent < 0) return errno == EAGAIN || errno == EINTR;
    client.sent += std::size_t(sent);
    return client.sent < client.answer.size();
  }
};

MetricsServer::MetricsServer(const std::string& address, int port) : impl_(std::make_unique<Impl>()) {
  impl_->listening = listen_on(address, port);
  impl_->thread = std::jthread([this] { impl_->serve(); });
}

MetricsServer::~MetricsServer() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(impl_->ending.get(), &one, sizeof one);
}

void MetricsServer::show(std::string text) {
  const std::scoped_lock lock(impl_->mutex);
  impl_->text = std::move(text);
}

}  // namespace huetrack::daemon
