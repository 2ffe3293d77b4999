#include "clients/live_view/page_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <ifaddrs.h>
#include <malloc.h>
#include <microhttpd.h>
#include <net/if.h>
#include <netinet/in.h>
#include <strings.h>
#include <sys/random.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include "clients/live_view/page_files.h"
#include "clients/live_view/web_sockets.h"
#include "idl/control_words.h"

namespace huetrack::live_view {
namespace {

constexpr std::size_t most_body_bytes = 64 * 1024;
constexpr std::size_t connection_memory = 16 * 1024;  // request line and headers; larger ones are refused
constexpr std::size_t stream_block = 8 * 1024;        // of each page's stream: 400 of them are as many times this
constexpr rlim_t most_files = 8192;

constexpr std::size_t most_bodies = 2 << 20;  // bytes, of all requests that come in at once
constexpr auto look_round_period = std::chrono::milliseconds(250);
constexpr int many_connections = 100;

constexpr std::string_view recordings_path = "/api/recordings/", recording_kind = ".tar", picture_kind = ".jpg";
constexpr std::string_view report_path = "/api/calibration.html", board_path = "/api/board.pdf";
constexpr std::size_t download_block = 64 * 1024;

// A download that is forwarded. Owned by its request until it is answered, then by the response.
struct Transfer {
  Transfer(std::shared_ptr<RecordingDownload> what, MHD_Connection* where)
      : download(std::move(what)), connection(where) {
    download->on_news([this] { resume(); });
  }
  ~Transfer() { download->on_news(nullptr); }
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;

  // The server's thread. Suspends the connection until there is data.
  void wait() {
    download->if_nothing([this] {
      is_waiting = true;
      MHD_suspend_connection(connection);
    });
  }

  const std::shared_ptr<RecordingDownload> download;
  MHD_Connection* const connection;

 private:
  void resume() {  // under the download's lock
    if (std::exchange(is_waiting, false)) MHD_resume_connection(connection);
  }
  bool is_waiting = false;  // guarded by the download's lock
};

// A request while its body or its response is pending.
struct Request {
  std::string body;
  bool is_too_long = false;
  std::shared_ptr<Transfer> transfer = nullptr;
};

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[b.empty() ? 0 : i % b.size()]);
  return difference == 0;
}

std::string_view header(MHD_Connection* connection, const char* name) {
  const char* value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
  return value == nullptr ? std::string_view() : std::string_view(value);
}

// Cookies ignore ports: each `huetrack view` on this host needs its own.
std::string cookie_name_of(int port) {
  return "huetrack_token_" + std::to_string(port);
}

// Without the port.
std::string_view host_name(std::string_view host) {
  if (host.starts_with('[')) return host.substr(0, host.find(']') + 1);
  return host.substr(0, host.rfind(':'));
}

bool is_json(std::string_view content_type) {
  constexpr std::string_view json = "application/json";
  if (content_type.size() < json.size() || ::strncasecmp(content_type.data(), json.data(), json.size()) != 0)
    return false;
  const auto rest = content_type.find_first_not_of(" \t", json.size());
  return rest == std::string_view::npos || content_type[rest] == ';';
}

// Connections without a pending request, with their deadlines. thread-safe.
class SilentConnections {
 public:
  SilentConnections(std::chrono::seconds patience, std::size_t most) : patience_(patience), most_(most) {}

  // It waits for a request from now on.
  void begin(int fd) {
    const std::scoped_lock lock(mutex_);
    deadlines_[fd] = Clock::now() + patience_;
    if (deadlines_.size() <= most_) return;
    const auto oldest = std::ranges::min_element(deadlines_, {}, [](const auto& entry) { return entry.second; });
    ::shutdown(oldest->first, SHUT_RDWR);  // the server sees its end, and end() is called
    deadlines_.erase(oldest);
  }
  void end(int fd) {
    const std::scoped_lock lock(mutex_);
    deadlines_.erase(fd);
  }
  void close_those_that_are_due() {
    const std::scoped_lock lock(mutex_);
    std::erase_if(deadlines_, [now = Clock::now()](const auto& entry) {
      if (entry.second > now) return false;
      ::shutdown(entry.first, SHUT_RDWR);
      return true;
    });
  }

 private:
  using Clock = std::chrono::steady_clock;
  const std::chrono::seconds patience_;
  const std::size_t most_;
  std::mutex mutex_;
  std::map<int, Clock::time_point> deadlines_;  // guarded by mutex_; by socket. A socket in it is open: libmicrohttpd
                                                // closes it after end()
};

int socket_of(MHD_Connection* connection) {
  return MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
}

}  // namespace

std::vector<std::string> host_addresses() {
  ifaddrs* all = nullptr;
  std::vector<std::string> addresses;
  if (::getifaddrs(&all) != 0) return addresses;
  for (const ifaddrs* i = all; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET || (i->ifa_flags & IFF_UP) == 0 ||
        (i->ifa_flags & IFF_LOOPBACK) != 0)
      continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    sockaddr_in address{};
    std::memcpy(&address, i->ifa_addr, sizeof address);
    if (::inet_ntop(AF_INET, &address.sin_addr, text.data(), text.size()) != nullptr)
      addresses.emplace_back(text.data());
  }
  ::freeifaddrs(all);
  return addresses;
}

bool is_loopback(const std::string& address) {
  if (address == "localhost") return true;
  in_addr parsed{};
  return ::inet_pton(AF_INET, address.c_str(), &parsed) == 1 && (ntohl(parsed.s_addr) >> 24) == 127;
}

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("the kernel gives no random numbers");
  std::string text;
  for (const unsigned char byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

struct PageServer::Impl {
  // One page's stream. Lives until its connection is over.
  struct Stream {
    Impl* server;
    MHD_Connection* connection;
    EventReader reader;  // page: the name that it gave itself, as its requests do
    std::uint64_t cursor = 0;
    Text text = nullptr;      // being sent
    std::size_t sent = 0;     // of it
    bool is_waiting = false;  // suspended; guarded by the hub's lock
  };

  Impl(const PageServerOptions& o, EventHub& h, PageRequests r)
      : options(o),
        hub(h),
        requests(std::move(r)),
        silent(std::chrono::seconds(o.request_s), std::size_t(std::max(1, o.most_silent))),
        sockets(h, o.timeout_s) {
    if (options.address == "localhost") options.address = "127.0.0.1";
    sockaddr_in address{};
    address.sin_family = AF_INET;
    if (::inet_pton(AF_INET, options.address.c_str(), &address.sin_addr) != 1)
      throw std::runtime_error("\"" + options.address + "\" is not an IPv4 address");
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur < std::min<rlim_t>(files.rlim_max, most_files)) {
      files.rlim_cur = std::min<rlim_t>(files.rlim_max, most_files);
      ::setrlimit(RLIMIT_NOFILE, &files);  // less is not fatal: then fewer pages
    }
    ::getrlimit(RLIMIT_NOFILE, &files);
    const auto most = static_cast<unsigned>(std::min<rlim_t>(static_cast<rlim_t>(options.most_connections),
                                                             files.rlim_cur > 200 ? files.rlim_cur - 100 : 50));
    listen(address, options.port, most);
    if (daemon == nullptr && errno == EADDRINUSE && options.or_any_free) listen(address, 0, most);
    if (daemon == nullptr)
      throw std::runtime_error("cannot listen on " + options.address + ":" + std::to_string(options.port) + ": " +
                               (errno != 0 ? std::strerror(errno) : "the HTTP server does not start") +
                               (errno == EADDRINUSE ? "; give another --port" : ""));
    const MHD_DaemonInfo* info = MHD_get_daemon_info(daemon, MHD_DAEMON_INFO_BIND_PORT);
    port = info != nullptr ? info->port : options.port;
    if (port != options.port) cookie_name = cookie_name_of(port);  // the port was unknown
    hub.on_news([this] { wake(); });
    doorman = std::jthread([this](const std::stop_token& stop) {
      std::unique_lock lock(door);
      while (!bell.wait_for(lock, stop, look_round_period, [&] { return stop.stop_requested(); })) {
        silent.close_those_that_are_due();
        give_back_memory();
      }
    });
  }

  // Starts `daemon`; nullptr: errno says why.
  void listen(sockaddr_in address, int on_port, unsigned most) {
    address.sin_port = htons(static_cast<std::uint16_t>(on_port));
    cookie_name = cookie_name_of(on_port);
    errno = 0;
    daemon = MHD_start_daemon(
        MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | MHD_ALLOW_UPGRADE | MHD_USE_TURBO, 0, nullptr,
        nullptr, &Impl::answer, this, MHD_OPTION_SOCK_ADDR, &address, MHD_OPTION_CONNECTION_LIMIT, most,
        MHD_OPTION_CONNECTION_TIMEOUT, static_cast<unsigned>(options.timeout_s), MHD_OPTION_CONNECTION_MEMORY_LIMIT,
        connection_memory, MHD_OPTION_NOTIFY_COMPLETED, &Impl::completed, this, MHD_OPTION_NOTIFY_CONNECTION,
        &Impl::note, this, MHD_OPTION_LISTEN_BACKLOG_SIZE, 1024U, MHD_OPTION_END);
  }

  ~Impl() {
    doorman = {};
    hub.on_news(nullptr);
    ends = true;
    hub.if_nothing_after(~std::uint64_t{0}, [this] { wake(); });
    {
      const std::scoped_lock lock(transfers_mutex);
      for (const auto& transfer : transfers)
        if (const auto going_on = transfer.lock()) going_on->download->fail("The page's server ends.");
    }
    sockets.end();  // the daemon stops when all that it has handed over is closed
    MHD_stop_daemon(daemon);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // Under the hub's lock.
  void wake() {
    for (Stream* stream : waiting) {
      stream->is_waiting = false;
      MHD_resume_connection(stream->connection);
    }
    waiting.clear();
    sockets.wake();
  }

  // The doorman's. Returns the memory of many closed connections to the system.
  void give_back_memory() {
    most_at_once = std::max<int>(most_at_once, connections);
    if (most_at_once < many_connections || connections > most_at_once / 2) return;
    ::malloc_trim(0);
    most_at_once = connections;
  }

  // ---- All below: the server's thread.

  static ssize_t read_stream(void* closure, std::uint64_t, char* buffer, std::size_t size) {
    auto* stream = static_cast<Stream*>(closure);
    Impl& self = *stream->server;
    std::size_t filled = 0;
    while (filled < size) {
      if (!stream->text || stream->sent == stream->text->size()) {
        stream->text = self.hub.next(stream->cursor, stream->reader);
        stream->sent = 0;
        if (!stream->text) break;
      }
      const std::size_t part = std::min(size - filled, stream->text->size() - stream->sent);
      std::memcpy(buffer + filled, stream->text->data() + stream->sent, part);
      stream->sent += part;
      filled += part;
    }
    if (filled > 0) return static_cast<ssize_t>(filled);
    if (self.ends) return MHD_CONTENT_READER_END_OF_STREAM;
    self.hub.if_nothing_after(stream->cursor, [&] {
      stream->is_waiting = true;
      self.waiting.insert(stream);
      MHD_suspend_connection(stream->connection);
    });
    return 0;
  }

  static void end_stream(void* closure) {
    auto* stream = static_cast<Stream*>(closure);
    Impl& self = *stream->server;
    self.hub.if_nothing_after(~std::uint64_t{0}, [&] { self.waiting.erase(stream); });
    --(stream->reader.only.empty() ? self.pages : self.listeners);
    delete stream;  // made in answer(), owned by MHD's response since
  }

  MHD_Result reply(MHD_Connection* connection, unsigned status, std::string_view text, const char* type,
                   bool is_permanent = false, const char* location = nullptr, const std::string& cookie = "") const {
    MHD_Response* response =
        is_permanent
            ? MHD_create_response_from_buffer(text.size(), const_cast<char*>(text.data()), MHD_RESPMEM_PERSISTENT)
            : MHD_create_response_from_buffer(text.size(), const_cast<char*>(text.data()), MHD_RESPMEM_MUST_COPY);
    if (response == nullptr) return MHD_NO;
    MHD_add_response_header(response, "Content-Type", type);
    add_safety(response);
    if (status == MHD_HTTP_METHOD_NOT_ALLOWED) MHD_add_response_header(response, "Allow", "GET, HEAD, POST");
    if (location != nullptr) MHD_add_response_header(response, "Location", location);
    if (!cookie.empty()) MHD_add_response_header(response, "Set-Cookie", cookie.c_str());
    const MHD_Result result = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return result;
  }

  MHD_Result refuse(MHD_Connection* connection, unsigned status, std::string_view why) const {
    return reply(connection, status, std::string(why) + "\n", "text/plain; charset=utf-8");
  }

  static constexpr const char* own_policy =
      "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; "
      "base-uri 'none'; form-action 'none'";
  static void add_safety(MHD_Response* response, const char* policy = own_policy) {
    MHD_add_response_header(response, "Cache-Control", "no-store");
    MHD_add_response_header(response, "X-Content-Type-Options", "nosniff");
    MHD_add_response_header(response, "X-Frame-Options", "DENY");
    MHD_add_response_header(response, "Referrer-Policy", "no-referrer");
    MHD_add_response_header(response, "Content-Security-Policy", policy);
  }

  // DNS rebinding: a page of another origin names that origin as the host.
  bool is_for_us(MHD_Connection* connection) const {
    if (!is_loopback(options.address)) return true;  // there the token decides
    const std::string_view host = host_name(header(connection, "Host"));
    return host == "localhost" || host == options.address || host == "127.0.0.1" || host == "[::1]";
  }

  // Our page's origin is the requested host. Programs send no origin: then the token decides, or loopback.
  static bool is_of_our_page(MHD_Connection* connection) {
    const std::string_view origin = header(connection, "Origin");
    return origin.empty() || origin == std::string("http://").append(header(connection, "Host"));
  }

  bool has_token(MHD_Connection* connection) const {
    if (options.token.empty()) return true;
    const char* in_address = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "token");
    const char* in_cookie = MHD_lookup_connection_value(connection, MHD_COOKIE_KIND, cookie_name.c_str());
    return (in_address != nullptr && equal_in_constant_time(in_address, options.token)) ||
           (in_cookie != nullptr && equal_in_constant_time(in_cookie, options.token));
  }

  // only: new events of this name; empty: all events of a page.
  MHD_Result stream(MHD_Connection* connection, const std::string& only = "") {
    if (pages + listeners >= options.most_pages)
      return refuse(connection, MHD_HTTP_SERVICE_UNAVAILABLE, "Too many pages are open.");
    const char* const page = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "client");
    auto* const stream = new Stream{.server = this,
                                    .connection = connection,
                                    .reader = {.page = page != nullptr ? page : "", .only = only},
                                    .cursor = only.empty() ? 0 : hub.last()};
    MHD_Response* response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, stream_block, &Impl::read_stream,
                                                               stream, &Impl::end_stream);
    if (response == nullptr) {
      delete stream;
      return MHD_NO;
    }
    ++(only.empty() ? pages : listeners);
    MHD_add_response_header(response, "Content-Type", "text/event-stream");
    add_safety(response);
    if (const std::string origin(header(connection, "Origin")); !only.empty() && is_allowed_origin(origin)) {
      MHD_add_response_header(response, "Access-Control-Allow-Origin", origin.c_str());
      MHD_add_response_header(response, "Vary", "Origin");
    }
    const MHD_Result result = MHD_queue_response(connection, MHD_HTTP_OK, response);
    MHD_destroy_response(response);
    return result;
  }

  bool is_allowed_origin(std::string_view origin) const {
    return std::ranges::find(options.allowed_origins, origin) != options.allowed_origins.end();
  }

  // What a connection that becomes a WebSocket needs to know. Made in web_socket(), deleted in upgraded().
  struct Upgrade {
    Impl* server;
    EventReader reader;
    std::uint64_t cursor;
  };
  static void upgraded(void* closure, MHD_Connection*, void*, const char* first, std::size_t first_size, MHD_socket fd,
                       MHD_UpgradeResponseHandle* handle) {
    const std::unique_ptr<Upgrade> upgrade(static_cast<Upgrade*>(closure));
    Impl& self = *upgrade->server;
    ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) | O_NONBLOCK);
    self.sockets.add(fd, upgrade->reader, upgrade->cursor, {first, first_size}, [&self, handle] {
      --self.listeners;
      MHD_upgrade_action(handle, MHD_UPGRADE_ACTION_CLOSE);
    });
  }

  // The same stream as a WebSocket. CORS does not apply to WebSockets: the origin is checked here.
  MHD_Result web_socket(MHD_Connection* connection, const std::string& only) {
    const std::string key(header(connection, "Sec-WebSocket-Key"));
    if (!is_of_our_page(connection) && !is_allowed_origin(header(connection, "Origin")))
      return refuse(connection, MHD_HTTP_FORBIDDEN, "This page may not read here: huetrack view --allow-origin.");
    if (key.empty() || header(connection, "Sec-WebSocket-Version") != "13")
      return refuse(connection, MHD_HTTP_BAD_REQUEST, "A WebSocket of version 13 is wanted.");
    if (pages + listeners >= options.most_pages)
      return refuse(connection, MHD_HTTP_SERVICE_UNAVAILABLE, "Too many pages are open.");
    auto upgrade = std::make_unique<Upgrade>(Upgrade{this, {.page = "", .only = only}, hub.last()});
    MHD_Response* response = MHD_create_response_for_upgrade(&Impl::upgraded, upgrade.get());
    if (response == nullptr) return MHD_NO;
    MHD_add_response_header(response, "Upgrade", "websocket");
    MHD_add_response_header(response, "Sec-WebSocket-Accept", web_socket_accept(key).c_str());
    const MHD_Result result = MHD_queue_response(connection, MHD_HTTP_SWITCHING_PROTOCOLS, response);
    if (result == MHD_YES) {
      static_cast<void>(upgrade.release());  // the connection's from now on
      ++listeners;
    }
    MHD_destroy_response(response);
    return result;
  }

  MHD_Result stream_or_socket(MHD_Connection* connection, const std::string& only) {
    const std::string_view upgrade = header(connection, "Upgrade");
    constexpr std::string_view wanted = "websocket";
    const bool is_socket =
        upgrade.size() == wanted.size() && ::strncasecmp(upgrade.data(), wanted.data(), wanted.size()) == 0;
    return is_socket ? web_socket(connection, only) : stream(connection, only);
  }

  // Libmicrohttpd asks for the next part of a recording.
  static ssize_t read_transfer(void* closure, std::uint64_t, char* buffer, std::size_t size) {
    const Transfer& transfer = **static_cast<std::shared_ptr<Transfer>*>(closure);
    if (const std::size_t part = transfer.download->read(buffer, size); part > 0) return static_cast<ssize_t>(part);
    switch (transfer.download->state()) {
      case RecordingDownload::State::failed:
        return MHD_CONTENT_READER_END_WITH_ERROR;  // the browser sees that it is not whole
      case RecordingDownload::State::ended:
        return MHD_CONTENT_READER_END_OF_STREAM;
      default:
        (*static_cast<std::shared_ptr<Transfer>*>(closure))->wait();
        return 0;
    }
  }
  static void end_transfer(void* closure) {
    delete static_cast<std::shared_ptr<Transfer>*>(closure);  // made in download(), owned by MHD's response since
  }

  // How a download is served.
  struct Served {
    const char* type;
    const char* policy = "sandbox; default-src 'none'";
    std::string saved_as = {};  // empty: the browser shows it
  };

  // NAME.tar, a recording, or NAME.jpg, its picture for the page's list. nullopt: another path.
  std::optional<MHD_Result> get_recording(MHD_Connection* connection, std::string_view path, Request& request) {
    const bool is_tar = path.ends_with(recording_kind);
    if (!path.starts_with(recordings_path) || (!is_tar && !path.ends_with(picture_kind))) return std::nullopt;
    static_assert(recording_kind.size() == picture_kind.size());
    const std::size_t length = path.size() - std::min(path.size(), recordings_path.size() + picture_kind.size());
    const std::string name(path.substr(recordings_path.size(), length));
    if (!idl::is_recording_name(name)) return refuse(connection, MHD_HTTP_NOT_FOUND, "That is no recording's name.");
    if (!is_tar) return download(connection, request, RecordingDownload::picture_words(name), {.type = "image/jpeg"});
    return download(connection, request, RecordingDownload::recording_words(name),
                    {.type = "application/x-tar", .policy = own_policy, .saved_as = name + ".tar"});
  }

  // The report comes from the bus and is not trusted: sandboxed.
  MHD_Result get_report(MHD_Connection* connection, Request& request) {
    return download(connection, request, RecordingDownload::report_words(),
                    {.type = "text/html; charset=utf-8",
                     .policy = "sandbox; default-src 'none'; img-src data:; style-src 'unsafe-inline'"});
  }

  // The query's words are checked by the service.
  MHD_Result get_board(MHD_Connection* connection, Request& request) {
    std::vector<std::string> board;
    const auto add = [](void* words, MHD_ValueKind, const char* key, const char* value) -> MHD_Result {
      auto& of = *static_cast<std::vector<std::string>*>(words);
      of.push_back(std::string(key) + "=" + (value != nullptr ? value : ""));
      return of.size() < idl::most_control_words ? MHD_YES : MHD_NO;
    };
    MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, add, &board);
    return download(connection, request, RecordingDownload::print_words(board),
                    {.type = "application/pdf", .saved_as = "board.pdf"});
  }

  // Called again when the first piece was received, or the service has refused.
  MHD_Result download(MHD_Connection* connection, Request& request, const std::vector<std::string>& words,
                      const Served& served) {
    // A page of another origin could not read it, but make the service read its disk.
    const std::string_view site = header(connection, "Sec-Fetch-Site");
    if (!is_of_our_page(connection) || (!site.empty() && site != "same-origin" && site != "none"))
      return refuse(connection, MHD_HTTP_FORBIDDEN, "This request comes from another server's page.");
    if (!request.transfer) {
      std::string why_not = "There is nothing to download here.";
      auto coming = requests.download ? requests.download(words, why_not) : nullptr;
      if (!coming) return refuse(connection, MHD_HTTP_SERVICE_UNAVAILABLE, why_not);
      request.transfer = std::make_shared<Transfer>(std::move(coming), connection);
      const std::scoped_lock lock(transfers_mutex);
      std::erase_if(transfers, [](const auto& transfer) { return transfer.expired(); });
      transfers.push_back(request.transfer);
    }
    const RecordingDownload& coming = *request.transfer->download;
    switch (coming.state()) {
      case RecordingDownload::State::awaited:
        request.transfer->wait();
        return MHD_YES;
      case RecordingDownload::State::failed:
        return refuse(connection, MHD_HTTP_NOT_FOUND, coming.failure());
      default:
        break;
    }
    auto closure = std::make_unique<std::shared_ptr<Transfer>>(request.transfer);
    MHD_Response* const response = MHD_create_response_from_callback(
        coming.bytes(), download_block, &Impl::read_transfer, closure.get(), &Impl::end_transfer);
    if (response == nullptr) return MHD_NO;
    static_cast<void>(closure.release());  // the response's from now on
    add_safety(response, served.policy);
    MHD_add_response_header(response, "Content-Type", served.type);
    if (!served.saved_as.empty())
      MHD_add_response_header(response, "Content-Disposition",
                              ("attachment; filename=\"" + served.saved_as + "\"").c_str());
    const MHD_Result result = MHD_queue_response(connection, MHD_HTTP_OK, response);
    MHD_destroy_response(response);
    return result;
  }

  MHD_Result get(MHD_Connection* connection, std::string_view path, Request& request) {
    if (!has_token(connection))
      return refuse(connection, MHD_HTTP_FORBIDDEN,
                    "A token is needed: open the address that `huetrack view` printed.");
    if (path == "/api/events") return stream(connection);
    if (const auto sent = get_recording(connection, path, request)) return *sent;
    if (path == report_path) return get_report(connection, request);
    if (path == board_path) return get_board(connection, request);
    if (path == "/api/v1/positions") return stream_or_socket(connection, "position");
    if (path == "/api/v1/camera_poses") return stream_or_socket(connection, "camera_pose");
    // The token moves from the address into a cookie, so that it stays out of histories and links.
    if (path == "/" && !options.token.empty() &&
        MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "token") != nullptr)
      return reply(connection, MHD_HTTP_SEE_OTHER, "", "text/plain", false, "/",
                   cookie_name + "=" + options.token + "; HttpOnly; SameSite=Strict; Path=/");
    const auto file = page_file(path);
    if (!file) return refuse(connection, MHD_HTTP_NOT_FOUND, "There is no such page.");
    return reply(connection, MHD_HTTP_OK, file->content, file->type, true);
  }

  MHD_Result post(MHD_Connection* connection, std::string_view path, const Request& request) {
    if (!has_token(connection)) return refuse(connection, MHD_HTTP_FORBIDDEN, "A token is needed.");
    const PageRequests::OnRequest* const on_request = path == "/api/teach"     ? &requests.teach
                                                      : path == "/api/control" ? &requests.control
                                                                               : nullptr;
    if (on_request == nullptr || !*on_request) return refuse(connection, MHD_HTTP_NOT_FOUND, "There is no such page.");
    if (!is_of_our_page(connection))
      return refuse(connection, MHD_HTTP_FORBIDDEN, "This request comes from another server's page.");
    // Pages of other origins cannot send JSON without asking first (CORS), and we do not answer that question.
    if (!is_json(header(connection, "Content-Type")))
      return refuse(connection, MHD_HTTP_UNSUPPORTED_MEDIA_TYPE, "The body must be application/json.");
    if (request.is_too_long) return refuse(connection, MHD_HTTP_CONTENT_TOO_LARGE, "The request is too long.");
    const std::string why_not = (*on_request)(request.body);
    if (!why_not.empty()) return refuse(connection, MHD_HTTP_BAD_REQUEST, why_not);
    return reply(connection, MHD_HTTP_ACCEPTED, "{}\n", "application/json");
  }

  // Called with the headers first, then for every part of the body, then once more without one.
  static MHD_Result answer(void* closure, MHD_Connection* connection, const char* url, const char* method, const char*,
                           const char* data, std::size_t* data_size, void** per_request) {
    auto& self = *static_cast<Impl*>(closure);
    auto* request = static_cast<Request*>(*per_request);
    if (request == nullptr) {
      *per_request = new Request;  // deleted in completed()
      return MHD_YES;
    }
    if (*data_size > 0) {
      request->is_too_long |=
          request->body.size() + *data_size > most_body_bytes || self.body_bytes + *data_size > most_bodies;
      if (!request->is_too_long) {
        request->body.append(data, *data_size);
        self.body_bytes += *data_size;
      }
      *data_size = 0;
      return MHD_YES;
    }
    self.silent.end(socket_of(connection));
    if (!self.is_for_us(connection))
      return self.refuse(connection, MHD_HTTP_MISDIRECTED_REQUEST, "This server answers to localhost only.");
    const std::string_view verb = method;
    if (verb == "GET" || verb == "HEAD") return self.get(connection, url, *request);
    if (verb == "POST") return self.post(connection, url, *request);
    return self.refuse(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "Only GET, HEAD and POST.");
  }

  static void completed(void* closure, MHD_Connection* connection, void** per_request, MHD_RequestTerminationCode how) {
    auto& self = *static_cast<Impl*>(closure);
    if (const auto* request = static_cast<Request*>(*per_request)) {
      self.body_bytes -= request->body.size();
      delete request;
    }
    *per_request = nullptr;
    if (how == MHD_REQUEST_TERMINATED_COMPLETED_OK) self.silent.begin(socket_of(connection));  // for its next one
  }

  static void note(void* closure, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode what) {
    auto& self = *static_cast<Impl*>(closure);
    if (what == MHD_CONNECTION_NOTIFY_STARTED) {
      ++self.connections;
      self.silent.begin(socket_of(connection));
    } else {
      --self.connections;
      self.silent.end(socket_of(connection));
    }
  }

  PageServerOptions options;
  EventHub& hub;
  const PageRequests requests;
  SilentConnections silent;
  std::size_t body_bytes = 0;  // the server's thread's: of the requests that come in
  std::mutex door;             // guards nothing: the doorman waits with it
  std::condition_variable_any bell;
  std::jthread doorman;
  int most_at_once = 0;  // the doorman's: connections, since memory was given back
  std::atomic<int> connections = 0;
  std::atomic<bool> ends = false;
  std::atomic<int> pages = 0;
  std::atomic<int> listeners = 0;  // programs that read positions or poses
  std::set<Stream*> waiting;       // guarded by the hub's lock
  std::mutex transfers_mutex;
  std::vector<std::weak_ptr<Transfer>> transfers;  // guarded by transfers_mutex; recordings that are being sent
  WebSockets sockets;
  MHD_Daemon* daemon = nullptr;
  int port = 0;
  std::string cookie_name;
};

PageServer::PageServer(const PageServerOptions& options, EventHub& hub, PageRequests requests)
    : impl_(std::make_unique<Impl>(options, hub, std::move(requests))) {}
PageServer::~PageServer() = default;

int PageServer::port() const {
  return impl_->port;
}

int PageServer::pages() const {
  return impl_->pages;
}

int PageServer::listeners() const {
  return impl_->listeners;
}

}  // namespace huetrack::live_view
