// The HTTP server of the pages: files, one stream of server-sent events per page, requests. One thread, non-blocking;
// each connection has small buffers and a time limit, so that a slow or broken one does not delay others.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clients/live_view/event_hub.h"
#include "clients/live_view/recording_download.h"

namespace huetrack::live_view {

struct PageServerOptions {
  std::string address = "127.0.0.1";  // IPv4 of this host, or localhost; 0.0.0.0: all
  int port = 8765;                    // 0..65535; 0: any free one
  bool or_any_free = false;           // port is in use: listens on any free one
  std::string token;                  // required in every request; empty: none, for loopback only
  // Origins ("http://localhost:8000") whose pages may read the streams of /api/v1, in addition to our own page.
  std::vector<std::string> allowed_origins;
  int most_connections = 4000;  // as far as the limit of open files allows
  int timeout_s = 10;           // without any data, after which a connection is closed
  // From a connection's begin, or its last response, to the next complete request; then it is closed. Not for streams.
  int request_s = 15;
  // Connections without a request; beyond, the oldest is closed, which hurts only a client that opens many.
  int most_silent = 256;
  int most_pages = 400;  // streams, those of programs included; the next one is refused
};

// Handlers of requests; called by the server's thread, must be fast.
struct PageRequests {
  // body: JSON. Returns an empty string, or why it is refused.
  using OnRequest = std::function<std::string(const std::string& body)>;
  OnRequest teach = nullptr, control = nullptr;
  // Starts a download (words: of RecordingDownload); nullptr: refused, see why_not.
  std::function<std::shared_ptr<RecordingDownload>(const std::vector<std::string>& words, std::string& why_not)>
      download = nullptr;
};

// thread-safe.
class PageServer {
 public:
  // Listens when it returns. Throws std::runtime_error: not an address of this host, the port is in use, ...
  PageServer(const PageServerOptions& options, EventHub& hub, PageRequests requests);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  int port() const;
  int pages() const;      // open streams of pages
  int listeners() const;  // open streams of programs (/api/v1)

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

bool is_loopback(const std::string& address);
std::vector<std::string> host_addresses();  // IPv4 of this host's active interfaces, without loopback
std::string random_token();                 // 128 bits from the kernel, hexadecimal

}  // namespace huetrack::live_view
