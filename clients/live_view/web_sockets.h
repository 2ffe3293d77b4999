// WebSockets (RFC 6455) for the streams of /api/v1: each event is one text message, {"event":"position","data":{...}}.
// Own implementation: Debian builds libmicrohttpd without WebSockets.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

#include "clients/live_view/event_hub.h"

namespace huetrack::live_view {

// Sec-WebSocket-Accept for a Sec-WebSocket-Key.
std::string web_socket_accept(std::string_view key);

// The text frame of an event.
std::string web_socket_frame(const std::string& event);

// Parses a client's frames: answers pings and the close frame, ignores the rest within bounds. Pure.
class WebSocketInput {
 public:
  // Takes bytes; what has to be sent because of them is appended to `answer`. False: the connection is over once that
  // is sent, for the client says so, or breaks the rules.
  bool take(std::string_view bytes, std::string& answer);

 private:
  std::string bytes_;  // of a frame that is not whole yet
};

// All of them, in one thread of its own: one that reads slowly, or not at all, has its own small buffer and time limit.
// thread-safe.
class WebSockets {
 public:
  WebSockets(EventHub& hub, int timeout_s);
  ~WebSockets();  // end()s
  WebSockets(const WebSockets&) = delete;
  WebSockets& operator=(const WebSockets&) = delete;

  //   fd       connected and nonblocking, the handshake is done; on_end, called once, closes it
  //   cursor   of the hub: what comes after it is sent
  //   first    bytes that came already
  void add(int fd, const EventReader& reader, std::uint64_t cursor, std::string_view first,
           std::function<void()> on_end);
  void wake();  // the hub has news; quick, does not call the hub
  void end();   // all are closed when it returns; none is added any more

 private:
  struct Socket;
  void run(const std::stop_token& stop);
  bool serve(Socket& socket, bool is_readable) const;

  EventHub& hub_;
  const int timeout_s_;
  int bell_ = -1;  // an eventfd
  std::atomic<int> count_ = 0;
  std::mutex mutex_;
  std::list<Socket> added_;  // guarded by mutex_; the thread takes them
  bool has_ended_ = false;   // guarded by mutex_
  std::jthread thread_;
};

}  // namespace huetrack::live_view
