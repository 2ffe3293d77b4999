// HTTP for the pages: the files, one stream of server-sent events per page, and the requests. One thread, no blocking:
// a page that reads slowly, not at all, or sends nonsense has its own small buffers and time limit, and nobody waits
// for it.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clients/live_view/event_hub.h"
#include "clients/live_view/recording_download.h"

namespace huetrack::live_view {

struct PageServerOptions {
  std::string address = "127.0.0.1";  // IPv4 of this host, or localhost; 0.0.0.0: every one
  int port = 8765;                    // 0..65535; 0: any free one
  std::string token;                  // must be given by every request; empty: none is needed. Only sane on loopback
  // Origins ("http://localhost:8000") whose pages may read the streams of /api/v1; and nothing else, but our own page.
  std::vector<std::string> allowed_origins;
  int most_connections = 4000;  // as far as the limit of open files allows
  int timeout_s = 10;           // a connection on which nothing moves for so long is closed
  // From its begin, or its last answer, to its next: a connection that has not asked by then is closed, however it
  // trickles. A page's stream has asked.
  int request_s = 15;
  // So many connections may be without a request at once. Then the one that has waited longest is closed: whoever opens
  // many takes the room from himself, and a request that is on its way takes milliseconds.
  int most_silent = 256;
  int most_pages = 400;  // streams, those of programs too; the next is refused
};

// What pages ask for. Called from the server's thread: quick.
struct PageRequests {
  // body is JSON. Returns an empty string, or why it is refused.
  using OnRequest = std::function<std::string(const std::string& body)>;
  OnRequest teach = nullptr, control = nullptr;
  // A recording, or the last calibration's report, is to come (RecordingDownload's words); nullptr: why_not says so.
  std::function<std::shared_ptr<RecordingDownload>(const std::vector<std::string>& words, std::string& why_not)>
      download = nullptr;
};

// thread-safe.
class PageServer {
 public:
  // Listens when it returns. throws std::runtime_error: the address is none of this host's, the port is taken, ...
  PageServer(const PageServerOptions& options, EventHub& hub, PageRequests requests);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  int port() const;
  int pages() const;      // streams of pages that are open
  int listeners() const;  // and of programs that read positions or poses (/api/v1)

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

bool is_loopback(const std::string& address);
std::vector<std::string> host_addresses();  // IPv4, of this host's networks that are up, but the loopback
std::string random_token();                 // 128 bits from the kernel, as hex

}  // namespace huetrack::live_view
