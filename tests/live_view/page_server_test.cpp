// The bridge's HTTP side against pages, and against what is no page: on loopback, with every connection bounded.
#include "clients/live_view/page_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <map>
#include <thread>

namespace huetrack::live_view {
namespace {

using namespace std::chrono_literals;
using namespace testing;
using Clock = std::chrono::steady_clock;

class Socket {
 public:
  explicit Socket(int port, int receive_buffer = 0) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (receive_buffer > 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    is_connected_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  ~Socket() { ::close(fd_); }
  Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)), is_connected_(other.is_connected_) {}
  Socket(const Socket&) = delete;

  bool is_connected() const { return is_connected_; }
  bool send(const std::string& text) const {
    std::size_t sent = 0;
    while (sent < text.size()) {
      const auto n = ::send(fd_, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) return false;
      sent += static_cast<std::size_t>(n);
    }
    return true;
  }
  // Until `end` is in it, the other side closes, or the time is over.
  std::string receive(const std::string& end, std::chrono::milliseconds at_most = 5s) {
    std::string text;
    const auto until = Clock::now() + at_most;
    while (end.empty() || text.find(end) == std::string::npos) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now()).count();
      pollfd wait{fd_, POLLIN, 0};
      if (left <= 0 || ::poll(&wait, 1, static_cast<int>(left)) <= 0) break;
      char buffer[4096];
      const auto n = ::recv(fd_, buffer, sizeof buffer, 0);
      if (n <= 0) break;
      text.append(buffer, static_cast<std::size_t>(n));
    }
    return text;
  }

 private:
  int fd_;
  bool is_connected_ = false;
};

class Server : public Test {
 protected:
  static PageServerOptions options() {
    PageServerOptions o;
    o.port = 0;
    o.timeout_s = 2;
    return o;
  }
  void start(const PageServerOptions& o = options()) {
    server.emplace(o, hub,
                   PageRequests{.teach = [this](const std::string& body) -> std::string {
                                  bodies.push_back(body);
                                  return body == "refuse" ? "No." : "";
                                },
                                .download =
                                    [this](const std::vector<std::string>& words, std::string& why_not) {
                                      const std::string& name = words.back();
                                      why_not = "Too many.";
                                      return downloads.contains(name) ? downloads.at(name) : nullptr;
                                    }});
  }
  std::string ask(const std::string& request) {
    Socket socket(server->port());
    socket.send(request);
    return socket.receive("");
  }
  std::string get(const std::string& path, const std::string& headers = "") {
    return ask("GET " + path + " HTTP/1.1\r\nHost: localhost:1\r\nConnection: close\r\n" + headers + "\r\n");
  }
  std::string post(const std::string& body, const std::string& type = "application/json",
                   const std::string& headers = "") {
    return ask("POST /api/teach HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + headers +
               "Content-Type: " + type + "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body);
  }
  // What the server finds under that name, the last of the words that its page's address makes.
  std::shared_ptr<RecordingDownload> offer(const std::string& name, const std::vector<std::string>& words) {
    return downloads[name] = std::make_shared<RecordingDownload>(words, "me", "host", 1);
  }
  EventHub hub;
  std::vector<std::string> bodies;  // written by the server's thread before it answers, read after the answer
  std::map<std::string, std::shared_ptr<RecordingDownload>> downloads;
  std::optional<PageServer> server;
};

const std::string listen_request = "GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n";

TEST_F(Server, ServesThePageAndNothingElse) {
  start();
  EXPECT_THAT(get("/"), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("text/html"), HasSubstr("Content-Security-Policy"),
                              HasSubstr("<title>huetrack")));
  EXPECT_THAT(get("/page.css"), HasSubstr("text/css"));
  EXPECT_THAT(get("/page.js"), HasSubstr("text/javascript"));
  EXPECT_THAT(get("/../../etc/passwd"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(ask("DELETE / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"), StartsWith("HTTP/1.1 405"));
}

// Answers the next request for a piece of `whole`, as a service does. Returns the request's words; empty: there was
// none.
std::vector<std::string> serve_piece(RecordingDownload& download, const std::string& whole, std::size_t bytes) {
  const auto request = download.next_request(RecordingDownload::Clock::now());
  if (!request) return {};
  msg::ControlReply reply;
  reply.number(request->number());
  reply.granted(true);
  reply.rows().emplace_back().columns({std::to_string(whole.size()), "a"});
  const std::string part = whole.substr(std::stoul(request->words().back()), bytes);
  reply.bytes({part.begin(), part.end()});
  download.take(reply);
  return request->words();
}

TEST_F(Server, ForwardsARecordingWhileItArrives) {
  start();
  const auto download = offer("run", RecordingDownload::recording_words("run"));
  std::string whole;
  for (int i = 0; i < 300'000; ++i) whole += char('a' + i % 26);
  const std::jthread service([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));  // it lets be waited for
      serve_piece(*download, whole, 100'000);
    }
  });
  const std::string answer = get("/api/recordings/run.tar");
  EXPECT_THAT(answer, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Length: 300000\r\n"),
                            HasSubstr("Content-Disposition: attachment; filename=\"run.tar\"\r\n"),
                            HasSubstr("Content-Type: application/x-tar\r\n"), EndsWith(whole)));
}

TEST_F(Server, ShowsAPictureOfARecording) {
  start();
  const auto download = offer("run", RecordingDownload::picture_words("run"));
  const std::string jpeg = "\xFF\xD8 a picture";
  const std::jthread service([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      serve_piece(*download, jpeg, 100'000);
    }
  });
  EXPECT_THAT(get("/api/recordings/run.jpg"),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Type: image/jpeg\r\n"),
                    HasSubstr("Content-Security-Policy: sandbox"), EndsWith(jpeg)));
  EXPECT_THAT(get("/api/recordings/..%2fetc.jpg"), StartsWith("HTTP/1.1 404"));
}

// It comes from the bus: as a page of ours it could ask the service for anything.
TEST_F(Server, SandboxesTheReport) {
  start();
  const auto download = offer("report", RecordingDownload::report_words());
  const std::string whole = "<html><script>alert(1)</script></html>";
  EXPECT_THAT(serve_piece(*download, whole, whole.size()), ElementsAre("calibrate", "report", "0"));
  EXPECT_THAT(get("/api/calibration.html"),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Type: text/html; charset=utf-8\r\n"),
                    HasSubstr("Content-Security-Policy: sandbox; default-src 'none';"),
                    HasSubstr("X-Content-Type-Options: nosniff"), EndsWith(whole)));
  EXPECT_THAT(get("/api/calibration.html", "Sec-Fetch-Site: cross-site\r\n"), StartsWith("HTTP/1.1 403"));
  downloads.clear();
  EXPECT_THAT(get("/api/calibration.html"), AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("Too many.")));
}

// The address' words are the service's, in their order.
TEST_F(Server, SendsABoard) {
  start();
  const auto download = offer("columns=9", RecordingDownload::print_words({"type=charuco", "columns=9"}));
  const std::string whole = "%PDF-1.4 board";
  EXPECT_THAT(serve_piece(*download, whole, whole.size()),
              ElementsAre("calibrate", "print", "type=charuco", "columns=9", "0"));
  EXPECT_THAT(get("/api/board.pdf?type=charuco&columns=9"),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Type: application/pdf\r\n"),
                    HasSubstr("filename=\"board.pdf\""), EndsWith(whole)));
  EXPECT_THAT(get("/api/board.pdf?columns=9", "Sec-Fetch-Site: cross-site\r\n"), StartsWith("HTTP/1.1 403"));
  const auto refused = offer("square_mm=90", RecordingDownload::print_words({"square_mm=90"}));
  refused->fail("It does not fit on A4.");
  EXPECT_THAT(get("/api/board.pdf?square_mm=90"), AllOf(StartsWith("HTTP/1.1 404"), HasSubstr("does not fit on A4")));
}

TEST_F(Server, RefusesOtherFilesThanRecordings) {
  start();
  const auto refused = offer("none", RecordingDownload::recording_words("none"));
  refused->fail("There is no recording none.");
  EXPECT_THAT(get("/api/recordings/none.tar"),
              AllOf(StartsWith("HTTP/1.1 404"), HasSubstr("There is no recording none.")));
  EXPECT_THAT(get("/api/recordings/many.tar"), AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("Too many.")));
  for (const std::string hostile : {"..", "a/b", "a%2fb", ".hidden", "a%0d%0aX:b", "%00", "a%22b"})
    EXPECT_THAT(get("/api/recordings/" + hostile + ".tar"), StartsWith("HTTP/1.1 404")) << hostile;
  for (const std::string path : {"/api/recordings/", "/api/recordings/.tar", "/api/recordings/run", "/api/recordings"})
    EXPECT_THAT(get(path), StartsWith("HTTP/1.1 404")) << path;
  EXPECT_THAT(get("/api/recordings/none.tar", "Sec-Fetch-Site: cross-site\r\n"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(get("/api/recordings/none.tar", "Origin: http://evil.example\r\n"), StartsWith("HTTP/1.1 403"));
}

TEST_F(Server, ReportsAnIncompleteRecording) {
  start();
  const auto download = offer("run", RecordingDownload::recording_words("run"));
  const std::string whole(200'000, 'x');
  std::jthread service([&] {
    while (serve_piece(*download, whole, 100'000).empty()) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    download->fail("The service is gone.");
  });
  const std::string answer = get("/api/recordings/run.tar");
  EXPECT_THAT(answer, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Length: 200000\r\n")));
  EXPECT_LT(answer.size(), 150'000u);
}

TEST_F(Server, EndsDuringADownload) {
  start();
  offer("run", RecordingDownload::recording_words("run"));
  Socket socket(server->port());
  socket.send("GET /api/recordings/run.tar HTTP/1.1\r\nHost: localhost\r\n\r\n");
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  server.reset();
  EXPECT_THAT(socket.receive(""), AnyOf(IsEmpty(), StartsWith("HTTP/1.1 404")));
}

TEST_F(Server, AllowedOriginsReadPositionsOnly) {
  PageServerOptions o = options();
  o.allowed_origins = {"http://localhost:8000"};
  start(o);
  const auto head_of = [&](const std::string& path, const std::string& origin) {
    Socket page(server->port());
    page.send("GET " + path + " HTTP/1.1\r\nHost: localhost:1\r\nOrigin: " + origin + "\r\n\r\n");
    return page.receive("\r\n\r\n");
  };
  EXPECT_THAT(head_of("/api/v1/positions", "http://localhost:8000"),
              HasSubstr("Access-Control-Allow-Origin: http://localhost:8000\r\n"));
  EXPECT_THAT(head_of("/api/v1/positions", "http://localhost:8001"), Not(HasSubstr("Access-Control")));
  EXPECT_THAT(head_of("/api/v1/positions", "*"), Not(HasSubstr("Access-Control")));
  EXPECT_THAT(head_of("/api/events", "http://localhost:8000"), Not(HasSubstr("Access-Control")));
  EXPECT_THAT(head_of("/", "http://localhost:8000"), Not(HasSubstr("Access-Control")));
  EXPECT_THAT(post("{}", "application/json", "Origin: http://localhost:8000\r\n"), StartsWith("HTTP/1.1 403"));
}

TEST_F(Server, StreamsPositionsOverAWebSocket) {
  PageServerOptions o = options();
  o.allowed_origins = {"http://localhost:8000"};
  start(o);
  const auto request = [](const std::string& origin) {
    return "GET /api/v1/positions HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n" +
           (origin.empty() ? "" : "Origin: " + origin + "\r\n") +
           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
  };
  for (const std::string origin : {"http://elsewhere", "null"}) {
    Socket stranger(server->port());
    stranger.send(request(origin));
    EXPECT_THAT(stranger.receive("\r\n\r\n"), StartsWith("HTTP/1.1 403"));
  }
  for (const std::string origin : {"", "http://localhost:8000", "http://localhost"}) {
    Socket client(server->port());
    client.send(request(origin));
    EXPECT_THAT(client.receive("\r\n\r\n"),
                AllOf(StartsWith("HTTP/1.1 101"), HasSubstr("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=")));
    EXPECT_EQ(server->listeners(), 1);
    hub.append(to_event("position", "{\"n\":1}"));
    EXPECT_THAT(client.receive("}}"), HasSubstr("{\"event\":\"position\",\"data\":{\"n\":1}}"));
    client.send(std::string("\x88\x80") + "abcd");
    EXPECT_EQ(client.receive(""), std::string("\x88\0", 2));
    for (int i = 0; i < 100 && server->listeners() > 0; ++i) std::this_thread::sleep_for(20ms);
    EXPECT_EQ(server->listeners(), 0);
  }
  Socket stays(server->port());
  stays.send(request(""));
  EXPECT_THAT(stays.receive("\r\n\r\n"), StartsWith("HTTP/1.1 101"));
  server.reset();  // ends with somebody there
  EXPECT_EQ(stays.receive("x"), "");
}

TEST_F(Server, StreamsStoredAndNewEvents) {
  start();
  hub.set("status", to_event("status", "{\"old\":1}"));
  Socket page(server->port());
  page.send(listen_request);
  EXPECT_THAT(page.receive("old"), AllOf(HasSubstr("text/event-stream"), HasSubstr("event: status")));
  hub.append(to_event("position", "{\"new\":2}"));
  EXPECT_THAT(page.receive("new"), HasSubstr("event: position\ndata: {\"new\":2}"));
  EXPECT_EQ(server->pages(), 1);
}

TEST_F(Server, ProgramsGetNewPositionsOnly) {
  start();
  hub.append(to_event("position", "{\"before\":1}"));
  Socket program(server->port());
  program.send("GET /api/v1/positions HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(program.receive("\r\n\r\n"), HasSubstr("text/event-stream"));
  const auto until = Clock::now() + 5s;
  while (server->listeners() == 0 && Clock::now() < until) std::this_thread::sleep_for(1ms);
  EXPECT_EQ(server->listeners(), 1);
  EXPECT_EQ(server->pages(), 0);  // for which pictures would be made
  hub.set("status", to_event("status", "{\"other\":1}"));
  hub.append(to_event("position", "{\"new\":2}"));
  EXPECT_THAT(program.receive("new"), AllOf(HasSubstr("event: position\ndata: {\"new\":2}"), Not(HasSubstr("before")),
                                            Not(HasSubstr("other"))));
}

TEST_F(Server, AcceptsRequestsOfOurPage) {
  start();
  EXPECT_THAT(post("{\"a\":1}"), StartsWith("HTTP/1.1 202"));
  EXPECT_THAT(bodies, ElementsAre("{\"a\":1}"));
  EXPECT_THAT(post("refuse"), AllOf(StartsWith("HTTP/1.1 400"), HasSubstr("No.")));
  bodies.clear();
  EXPECT_THAT(post("{}", "text/plain"), StartsWith("HTTP/1.1 415"));  // what another origin's page could send
  EXPECT_THAT(post(std::string(70'000, ' ')), StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(ask("GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n"), StartsWith("HTTP/1.1 421"));
  EXPECT_THAT(bodies, ElementsAre());
}

TEST_F(Server, OtherAddressesNeedTheToken) {
  PageServerOptions o = options();
  o.address = "0.0.0.0";
  o.token = random_token();
  ASSERT_EQ(o.token.size(), 32u);
  EXPECT_NE(o.token, random_token());
  start(o);
  EXPECT_THAT(get("/"), AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("token"), Not(HasSubstr(o.token))));
  EXPECT_THAT(get("/api/events"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(post("{}"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(get("/?token=" + o.token.substr(1)), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(get("/?token=" + o.token),
              AllOf(StartsWith("HTTP/1.1 303"), HasSubstr("Location: /\r\n"), HasSubstr("HttpOnly")));
  EXPECT_THAT(get("/", "Cookie: huetrack_token_" + std::to_string(server->port()) + "=" + o.token + "\r\n"),
              StartsWith("HTTP/1.1 200"));
}

TEST_F(Server, ReportsUnusableAddresses) {
  start();
  PageServerOptions taken = options();
  taken.port = server->port();
  EXPECT_THAT([&] { PageServer second(taken, hub, {}); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("cannot listen on 127.0.0.1"), HasSubstr("--port"))));
  PageServerOptions wrong = options();
  wrong.address = "some.host";
  EXPECT_THAT([&] { PageServer second(wrong, hub, {}); }, ThrowsMessage<std::runtime_error>(HasSubstr("IPv4")));
  PageServerOptions named = options();
  named.address = "localhost";
  EXPECT_GT(PageServer(named, hub, {}).port(), 0);
  taken.or_any_free = true;
  const int another = PageServer(taken, hub, {}).port();
  EXPECT_GT(another, 0);
  EXPECT_NE(another, taken.port);
}

TEST_F(Server, RefusesNonsenseAndHugeHeaders) {
  start();
  for (const std::string& nonsense :
       {std::string("\r\n\r\n\r\n"), std::string("GET\r\n\r\n"), std::string("\x16\x03\x01\x02\x00\x01\x00\x01", 8),
        std::string(3000, '\0'),
        std::string("POST /api/teach HTTP/1.1\r\nHost: localhost\r\nContent-Length: -5\r\n\r\n"),
        std::string("POST /api/teach HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzzzz\r\n"),
        std::string("GET / HTTP/9.9\r\nHost: localhost\r\n\r\n")}) {
    Socket socket(server->port());
    socket.send(nonsense);
    EXPECT_THAT(socket.receive("\r\n\r\n", 300ms), Not(StartsWith("HTTP/1.1 200")));
  }
  Socket socket(server->port());
  socket.send("GET / HTTP/1.1\r\nHost: localhost\r\n");
  for (int i = 0; i < 200 && socket.send("X-Filler: " + std::string(10'000, 'x') + "\r\n"); ++i) {
  }
  EXPECT_THAT(socket.receive(""), AnyOf(IsEmpty(), StartsWith("HTTP/1.1 4")));
  EXPECT_THAT(get("/"), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(bodies, ElementsAre());
}

// A page that never reads: the others get everything at once, and the slow one costs no more than its buffers.
TEST_F(Server, AStalledPageDelaysNoOther) {
  start();
  std::vector<Socket> dead;
  for (int i = 0; i < 5; ++i) {
    dead.emplace_back(server->port(), 4096);
    dead.back().send(listen_request);
  }
  Socket page(server->port());
  page.send(listen_request);
  page.receive("\r\n\r\n");
  auto longest = 0ms;
  for (int i = 0; i < 200; ++i) {  // 200 x 100 kB: far more than sockets hold
    const std::string mark = "mark" + std::to_string(i) + "!";
    const auto before = Clock::now();
    hub.set("preview", to_event("preview", std::string(100'000, 'x') + mark));
    ASSERT_THAT(page.receive(mark), HasSubstr(mark));
    longest = std::max(longest, std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - before));
  }
  EXPECT_LT(longest, 1s);  // a bound against waiting, not a measurement
  // They are let go after the time limit.
  const auto until = Clock::now() + 8s;
  while (server->pages() > 1 && Clock::now() < until) {
    hub.set("preview", to_event("preview", std::string(100'000, 'x') + "again!"));
    page.receive("again!");
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_EQ(server->pages(), 1);
}

TEST_F(Server, AcceptsAPageBesidesAThousandConnections) {
  rlimit files{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &files), 0);
  files.rlim_cur = std::min<rlim_t>(files.rlim_max, 8192);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &files), 0);
  if (files.rlim_cur < 2500) GTEST_SKIP() << "this host allows only " << files.rlim_cur << " open files";
  start();
  std::vector<Socket> idle;
  for (int i = 0; i < 1000; ++i) {
    idle.emplace_back(server->port());
    ASSERT_TRUE(idle.back().is_connected()) << i;
    if (i % 2 == 0) idle.back().send("GET / HTT");  // half of a request, and then nothing
  }
  EXPECT_THAT(get("/"), StartsWith("HTTP/1.1 200"));
  std::vector<Socket> pages;
  for (int i = 0; i < 100; ++i) {
    pages.emplace_back(server->port());
    pages.back().send(listen_request);
  }
  for (auto& page : pages) EXPECT_THAT(page.receive("\r\n\r\n"), HasSubstr("200 OK"));
  hub.append(to_event("position", "\"to all\""));
  for (auto& page : pages) EXPECT_THAT(page.receive("to all"), HasSubstr("to all"));
}

TEST_F(Server, RefusesRequestsOfOtherOrigins) {
  start();
  for (const char* type : {"application/jsonx", "application/json-seq", "text/plain; application/json", ""})
    EXPECT_THAT(post("{}", type), StartsWith("HTTP/1.1 415")) << type;
  for (const char* origin : {"http://evil.example", "null", "http://localhost:1", "https://localhost"})
    EXPECT_THAT(post("{}", "application/json", std::string("Origin: ") + origin + "\r\n"), StartsWith("HTTP/1.1 403"))
        << origin;
  EXPECT_THAT(bodies, ElementsAre());
  EXPECT_THAT(post("{}", "Application/JSON ; charset=utf-8", "Origin: http://localhost\r\n"),
              StartsWith("HTTP/1.1 202"));
}

// A byte now and then is not silence, and yet no request.
TEST_F(Server, BoundsTheTotalTimeOfARequest) {
  PageServerOptions o = options();
  o.request_s = 2;
  start(o);
  const Socket trickling(server->port());
  const auto began = Clock::now();
  while (Clock::now() < began + 10s && trickling.send("G")) std::this_thread::sleep_for(100ms);
  EXPECT_LT(Clock::now() - began, 4s);
  Socket page(server->port());  // one that has asked stays
  page.send(listen_request);
  page.receive("\r\n\r\n");
  std::this_thread::sleep_for(3s);
  hub.append(to_event("position", "\"still\""));
  EXPECT_THAT(page.receive("still"), HasSubstr("still"));
}

TEST_F(Server, RefusesTooManyPages) {
  PageServerOptions o = options();
  o.most_pages = 2;
  start(o);
  std::vector<Socket> pages;
  for (int i = 0; i < 3; ++i) {
    pages.emplace_back(server->port());
    pages.back().send(listen_request);
    EXPECT_THAT(pages.back().receive("\r\n\r\n"), HasSubstr(i < 2 ? "200 OK" : "503"));
  }
}

TEST_F(Server, EndsWithPagesOpen) {
  start();
  Socket page(server->port());
  page.send(listen_request);
  page.receive("\r\n\r\n");
  server.reset();
  page.receive("");
  hub.append("nobody is there");
}

}  // namespace
}  // namespace huetrack::live_view
