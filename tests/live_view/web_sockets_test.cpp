#include "clients/live_view/web_sockets.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <future>

namespace huetrack::live_view {
namespace {

using namespace std::string_literals;
using ::testing::HasSubstr;

// A client's frame: masked by "abcd".
std::string sent(unsigned first_byte, const std::string& payload) {
  std::string out(1, static_cast<char>(first_byte));
  if (payload.size() < 126) {
    out += static_cast<char>(0x80 | payload.size());
  } else {
    out += static_cast<char>(0x80 | 126);
    out += static_cast<char>(payload.size() >> 8);
    out += static_cast<char>(payload.size() & 0xff);
  }
  out += "abcd";
  for (std::size_t i = 0; i < payload.size(); ++i) out += static_cast<char>(payload[i] ^ "abcd"[i % 4]);
  return out;
}

TEST(WebSocket, HandshakeOfTheSpecification) {
  EXPECT_EQ(web_socket_accept("dGhlIHNhbXBsZSBub25jZQ=="), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");  // RFC 6455, 1.3
}

TEST(WebSocket, EventsAreTextMessagesOfAnyLength) {
  EXPECT_EQ(web_socket_frame(to_event("position", "{\"t\":1}")),
            "\x81\x23{\"event\":\"position\",\"data\":{\"t\":1}}"s);
  const std::string middle = web_socket_frame(to_event("p", std::string(1000, 'x')));
  EXPECT_EQ(middle.substr(0, 4), "\x81\x7e\x03\xfd"s);  // 1021 bytes follow
  EXPECT_EQ(middle.size(), 4 + 1021U);
  const std::string large = web_socket_frame(to_event("p", std::string(70000, 'x')));
  EXPECT_EQ(large.substr(0, 10), "\x81\x7f\0\0\0\0\0\x01\x11\x85"s);
}

TEST(WebSocket, AnswersPingAndCloseInAnyFragments) {
  const std::string bytes = sent(0x89, "are you there") + sent(0x81, "hello") + sent(0x88, "\x03\xe8 bye");
  for (const std::size_t piece : {1U, 3U, 1000U}) {
    WebSocketInput input;
    std::string answer;
    bool goes_on = true;
    for (std::size_t i = 0; i < bytes.size(); i += piece) goes_on = input.take(bytes.substr(i, piece), answer);
    EXPECT_FALSE(goes_on);
    EXPECT_EQ(answer,
              "\x8a\x0d"
              "are you there"s +
                  "\x88\x02\x03\xe8"s);
  }
}

TEST(WebSocket, ProtocolErrorsEndIt) {
  const std::string unmasked = "\x81\x02hi"s, reserved = sent(0xc1, "hi"), unknown = sent(0x83, "hi"),
                    long_ping = sent(0x89, std::string(200, 'x'));
  for (const std::string& bytes : {unmasked, reserved, unknown, long_ping}) {
    std::string answer;
    EXPECT_FALSE(WebSocketInput().take(bytes, answer));
    EXPECT_EQ(answer, "\x88\x02\x03\xea"s);  // 1002
  }
  std::string answer;
  EXPECT_FALSE(WebSocketInput().take("\x82\xff\0\0\0\x7f\0\0\0\0"s, answer));  // half a terabyte is announced
  EXPECT_EQ(answer, "\x88\x02\x03\xf1"s);                                      // 1009
}

TEST(WebSockets, AStalledSocketDelaysNoOtherAndIsClosed) {
  EventHub hub;
  WebSockets sockets(hub, 1);
  std::array<int, 2> lazy{}, eager{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, lazy.data()), 0);
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, eager.data()), 0);
  std::promise<void> lazy_ended, eager_ended;
  for (const int fd : {lazy[0], eager[0]}) ::fcntl(fd, F_SETFL, O_NONBLOCK);
  sockets.add(lazy[0], {.page = "", .only = "position"}, 0, "", [&] { lazy_ended.set_value(); });
  sockets.add(eager[0], {.page = "", .only = "position"}, 0, "", [&] { eager_ended.set_value(); });
  std::string received;
  std::array<char, 65536> buffer;
  for (int i = 0; i < 2000; ++i) {
    hub.append(to_event("position", "{\"i\":" + std::to_string(i) + ",\"x\":\"" + std::string(1000, 'x') + "\"}"));
    hub.append(to_event("preview", "{}"));  // not asked for
    sockets.wake();
    for (;;) {
      const auto n = ::recv(eager[1], buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (n <= 0) break;
      received.append(buffer.data(), std::size_t(n));
    }
  }
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (received.find("\"i\":1999,") == std::string::npos && std::chrono::steady_clock::now() < until) {
    const auto n = ::recv(eager[1], buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n > 0)
      received.append(buffer.data(), std::size_t(n));
    else
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_THAT(received, HasSubstr("\"i\":1999,"));
  EXPECT_EQ(received.find("preview"), std::string::npos);
  EXPECT_EQ(lazy_ended.get_future().wait_for(std::chrono::seconds(10)), std::future_status::ready);
  auto eager_end = eager_ended.get_future();
  EXPECT_EQ(eager_end.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  sockets.end();
  EXPECT_EQ(eager_end.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  for (const int fd : {lazy[0], lazy[1], eager[0], eager[1]}) ::close(fd);
}

}  // namespace
}  // namespace huetrack::live_view
