#include "clients/live_view/web_sockets.h"

#include <openssl/evp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <utility>
#include <vector>

namespace huetrack::live_view {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t most_waiting = 64 * 1024;  // bytes of a socket's, not sent yet, until it gets no more
constexpr std::size_t longest_control = 125;     // RFC 6455, 5.5
constexpr std::size_t longest_input = 4096;      // of a frame: clients send only control frames

enum Opcode : unsigned { continuation = 0, words = 1, binary = 2, farewell = 8, ping = 9, pong = 10 };
constexpr unsigned last_frame = 0x80, masked = 0x80;
enum Reason : unsigned { wrong_protocol = 1002, too_long = 1009 };

std::string frame(Opcode opcode, std::string_view payload) {
  std::string out(1, static_cast<char>(last_frame | opcode));
  const auto add = [&](int bytes) {
    for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) out += static_cast<char>(payload.size() >> shift & 0xff);
  };
  if (payload.size() <= longest_control) {
    add(1);
  } else if (payload.size() <= 0xffff) {
    out += static_cast<char>(126);
    add(2);
  } else {
    out += static_cast<char>(127);
    add(8);
  }
  return out.append(payload);
}

std::string farewell_because(Reason reason) {
  const std::array<char, 2> code{static_cast<char>(reason >> 8U), static_cast<char>(reason & 0xffU)};
  return frame(farewell, std::string_view(code.data(), code.size()));
}

}  // namespace

std::string web_socket_accept(std::string_view key) {
  const std::string text_to_hash = std::string(key) + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";  // RFC 6455, 1.3
  std::array<unsigned char, 20> digest{};
  ::EVP_Digest(text_to_hash.data(), text_to_hash.size(), digest.data(), nullptr, ::EVP_sha1(), nullptr);
  std::array<unsigned char, 29> base64{};
  ::EVP_EncodeBlock(base64.data(), digest.data(), int(digest.size()));
  return reinterpret_cast<const char*>(base64.data());
}

std::string web_socket_frame(const std::string& event) {
  constexpr std::string_view name_begins = "event: ", data_begins = "\ndata: ";
  const auto data = event.find(data_begins);
  return frame(words, "{\"event\":\"" + event.substr(name_begins.size(), data - name_begins.size()) + "\",\"data\":" +
                          event.substr(data + data_begins.size(), event.size() - data - data_begins.size() - 2) + "}");
}

bool WebSocketInput::take(std::string_view bytes, std::string& answer) {
  bytes_ += bytes;
  const auto byte = [&](std::size_t i) { return unsigned(static_cast<unsigned char>(bytes_[i])); };
  while (bytes_.size() >= 2) {
    const unsigned opcode = byte(0) & 0x0fU;
    const bool is_control = opcode >= farewell;
    std::size_t length = byte(1) & 0x7fU, head = 2;
    const std::size_t further = length == 126 ? 2 : length == 127 ? 8 : 0;
    if (bytes_.size() < head + further) return true;
    if (further > 0) length = 0;
    for (std::size_t i = 0; i < further; ++i) length = length << 8U | byte(head++);
    if ((byte(0) & 0x70U) != 0 || (byte(1) & masked) == 0 ||
        (is_control && (length > longest_control || further > 0)) ||
        (opcode > binary && opcode != farewell && opcode != ping && opcode != pong)) {
      answer += farewell_because(wrong_protocol);
      return false;
    }
    if (length > longest_input) {
      answer += farewell_because(too_long);
      return false;
    }
    if (bytes_.size() < head + 4 + length) return true;
    std::string payload = bytes_.substr(head + 4, length);
    for (std::size_t i = 0; i < length; ++i) payload[i] = static_cast<char>(payload[i] ^ bytes_[head + i % 4]);
    bytes_.erase(0, head + 4 + length);
    if (opcode == farewell) {
      answer += frame(farewell, payload.substr(0, 2));
      return false;
    }
    if (opcode == ping) answer += frame(pong, payload);
  }
  return true;
}

struct WebSockets::Socket {
  int fd;
  EventReader reader;
  std::function<void()> on_end;
  std::uint64_t cursor;
  WebSocketInput input = {};
  std::string out = {};     // to be sent
  std::size_t sent = 0;     // of it
  bool is_leaving = false;  // over once all is sent
  Clock::time_point moved_at = Clock::now();
};

WebSockets::WebSockets(EventHub& hub, int timeout_s)
    : hub_(hub), timeout_s_(timeout_s), bell_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (bell_ < 0) throw std::runtime_error("the kernel gives no eventfd");
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

WebSockets::~WebSockets() {
  end();
  ::close(bell_);
}

void WebSockets::add(int fd, const EventReader& reader, std::uint64_t cursor, std::string_view first,
                     std::function<void()> on_end) {
  Socket socket{.fd = fd, .reader = reader, .on_end = std::move(on_end), .cursor = cursor};
  socket.is_leaving = !socket.input.take(first, socket.out);
  {
    const std::scoped_lock lock(mutex_);
    if (has_ended_) return socket.on_end();
    added_.push_back(std::move(socket));
    ++count_;
  }
  wake();
}

void WebSockets::wake() {
  if (count_ == 0) return;
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(bell_, &one, sizeof one);  // full: it rings already
}

void WebSockets::end() {
  {
    const std::scoped_lock lock(mutex_);
    if (std::exchange(has_ended_, true)) return;
  }
  thread_.request_stop();
  ++count_;  // so that it rings
  wake();
  thread_.join();
}

// False: it is over.
bool WebSockets::serve(Socket& socket, bool is_readable) const {
  std::array<char, 4096> buffer;
  while (is_readable) {
    const auto n = ::recv(socket.fd, buffer.data(), buffer.size(), 0);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) return false;
    if (n < 0) break;
    if (!socket.is_leaving && !socket.input.take({buffer.data(), std::size_t(n)}, socket.out)) socket.is_leaving = true;
    if (socket.out.size() - socket.sent > most_waiting) return false;  // it sends, but never reads
  }
  for (;;) {
    while (!socket.is_leaving && socket.out.size() - socket.sent < most_waiting) {
      const Text event = hub_.next(socket.cursor, socket.reader);
      if (!event) break;
      socket.out += web_socket_frame(*event);
    }
    if (socket.sent == socket.out.size()) {
      socket.out.clear();
      socket.sent = 0;
      socket.moved_at = Clock::now();
      return !socket.is_leaving;
    }
    const auto n = ::send(socket.fd, socket.out.data() + socket.sent, socket.out.size() - socket.sent, MSG_NOSIGNAL);
    if (n < 0) {
      if (errno == EINTR) continue;
      return errno == EAGAIN && Clock::now() - socket.moved_at < std::chrono::seconds(timeout_s_);
    }
    socket.moved_at = Clock::now();
    socket.sent += std::size_t(n);
    if (socket.sent > most_waiting) socket.out.erase(0, std::exchange(socket.sent, 0));
  }
}

void WebSockets::run(const std::stop_token& stop) {
  constexpr int look_round_ms = 1000;
  std::list<Socket> sockets;
  std::vector<pollfd> polled;
  while (!stop.stop_requested()) {
    {
      const std::scoped_lock lock(mutex_);
      sockets.splice(sockets.end(), added_);
    }
    polled.assign(1, {bell_, POLLIN, 0});
    for (const Socket& socket : sockets)
      polled.push_back({socket.fd, short(POLLIN | (socket.sent < socket.out.size() ? POLLOUT : 0)), 0});
    ::poll(polled.data(), polled.size(), look_round_ms);
    std::uint64_t rings = 0;
    [[maybe_unused]] const auto read_bytes = ::read(bell_, &rings, sizeof rings);
    std::size_t i = 1;
    for (auto socket = sockets.begin(); socket != sockets.end(); ++i) {
      if (serve(*socket, (polled[i].revents & (POLLIN | POLLHUP | POLLERR)) != 0)) {
        ++socket;
        continue;
      }
      socket->on_end();
      socket = sockets.erase(socket);
      --count_;
    }
  }
  const std::scoped_lock lock(mutex_);
  sockets.splice(sockets.end(), added_);
  for (const Socket& socket : sockets) socket.on_end();
}

}  // namespace huetrack::live_view
