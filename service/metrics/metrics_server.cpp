// libmicrohttpd only has a timeout without data. Here a connection has a total timeout, so events are polled here.
#include <microhttpd.h>
#include <netdb.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include "capture/frames/file_descriptor.h"
#include "metrics/metrics.h"

namespace huetrack::metrics {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr unsigned most_clients = 256;
// Beyond this number, the oldest connection is closed: silent clients only displace one another.
constexpr std::size_t most_open = most_clients - 16;
constexpr std::size_t client_memory = 16 * 1024;  // bytes per request; longer ones are refused
constexpr auto client_patience = 2s;              // from connection to the end of the reply

}  // namespace

struct MetricsServer::Impl {
  capture::FileDescriptor ending{::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};
  std::mutex mutex;
  std::string text;  // guarded by mutex
  MHD_Daemon* daemon = nullptr;
  std::map<int, Clock::time_point> deadlines;  // the thread's; by the connection's descriptor
  bool has_ended = false;                      // the thread's: a connection ended
  std::jthread thread;

  // throws std::runtime_error
  Impl(const std::string& address, int port) {
    const std::string where = "metrics: " + address + ":" + std::to_string(port) + " cannot be used: ";
    addrinfo hints{};
    hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* first = nullptr;
    if (const int error = ::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &first); error != 0)
      throw std::runtime_error(where + ::gai_strerror(error) + ": give an address of this host, or 0.0.0.0 for all");
    const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> found(first, &::freeaddrinfo);
    const unsigned family = found->ai_family == AF_INET6 ? MHD_USE_DUAL_STACK : MHD_NO_FLAG;
    errno = 0;
    daemon =
        MHD_start_daemon(MHD_USE_EPOLL | family, 0, nullptr, nullptr, &Impl::answer, this, MHD_OPTION_SOCK_ADDR,
                         found->ai_addr, MHD_OPTION_CONNECTION_LIMIT, most_clients, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
                         client_memory, MHD_OPTION_NOTIFY_CONNECTION, &Impl::note, this, MHD_OPTION_END);
    if (daemon == nullptr)
      throw std::runtime_error(where + (errno != 0 ? std::strerror(errno) : "the HTTP server does not start") +
                               ": another program has that port, or the address is not this host's");
    thread = std::jthread([this] { serve(); });
  }
  ~Impl() {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(ending.get(), &one, sizeof one);
    if (thread.joinable()) thread.join();
    MHD_stop_daemon(daemon);  // closes all connections
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // ---- All below: the server's thread.

  // One thread waits for all sockets and for the end.
  void serve() {
    const int events = MHD_get_daemon_info(daemon, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd;
    for (;;) {
      std::array<pollfd, 2> waiting{{{ending.get(), POLLIN, 0}, {events, POLLIN, 0}}};
      if (::poll(waiting.data(), waiting.size(), patience_ms()) < 0 && errno != EINTR) return;
      if (waiting[0].revents != 0) return;
      for (const auto& [fd, deadline] : deadlines)  // the shutdown is an event that removes it
        if (Clock::now() >= deadline) ::shutdown(fd, SHUT_RDWR);
      do {  // repeat after an end, to accept again
        has_ended = false;
        MHD_run(daemon);
      } while (has_ended);
    }
  }

  int patience_ms() const {
    MHD_UNSIGNED_LONG_LONG wanted_ms = 0;
    std::int64_t patience = MHD_get_timeout(daemon, &wanted_ms) == MHD_YES ? std::int64_t(wanted_ms) : -1;
    for (const auto& [_, deadline] : deadlines) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
      patience = patience < 0 ? std::max<std::int64_t>(left, 0) : std::clamp<std::int64_t>(left, 0, patience);
    }
    return int(patience);
  }

  static void note(void* closure, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode what) {
    auto& self = *static_cast<Impl*>(closure);
    const int fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
    if (what == MHD_CONNECTION_NOTIFY_STARTED) {
      self.deadlines[fd] = Clock::now() + client_patience;
      if (self.deadlines.size() <= most_open) return;
      const auto first = std::ranges::min_element(self.deadlines, {}, [](const auto& entry) { return entry.second; });
      ::shutdown(first->first, SHUT_RDWR);
      self.deadlines.erase(first);
    } else {
      self.deadlines.erase(fd);
      self.has_ended = true;
    }
  }

  static MHD_Result reply(MHD_Connection* connection, unsigned status, std::string_view body) {
    MHD_Response* response =
        MHD_create_response_from_buffer(body.size(), const_cast<char*>(body.data()), MHD_RESPMEM_MUST_COPY);
    if (response == nullptr) return MHD_NO;
    MHD_add_response_header(response, "Content-Type", "text/plain; version=0.0.4; charset=utf-8");
    MHD_add_response_header(response, "Connection", "close");
    if (status == MHD_HTTP_METHOD_NOT_ALLOWED) MHD_add_response_header(response, "Allow", "GET, HEAD");
    const MHD_Result result = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return result;
  }

  // Called first with the headers, then again; ignores a body.
  static MHD_Result answer(void* closure, MHD_Connection* connection, const char* url, const char* method, const char*,
                           const char*, std::size_t* data_size, void** has_headers) {
    auto& self = *static_cast<Impl*>(closure);
    if (std::exchange(*has_headers, closure) == nullptr) return MHD_YES;
    if (std::exchange(*data_size, 0) > 0) return MHD_YES;
    if (std::string_view(method) != "GET" && std::string_view(method) != "HEAD")
      return reply(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "only GET\n");
    if (std::string_view(url) != "/metrics") return reply(connection, MHD_HTTP_NOT_FOUND, "not found: use /metrics\n");
    const std::scoped_lock lock(self.mutex);
    return reply(connection, MHD_HTTP_OK, self.text);
  }
};

MetricsServer::MetricsServer(const std::string& address, int port) : impl_(std::make_unique<Impl>(address, port)) {}
MetricsServer::~MetricsServer() = default;

void MetricsServer::show(std::string text) {
  const std::scoped_lock lock(impl_->mutex);
  impl_->text = std::move(text);
}

}  // namespace huetrack::metrics
