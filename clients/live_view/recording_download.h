// The download of a recording or its picture, a calibration report, or a board to print from a service. Pieces are
// requested as fast as they are read; at most two are in memory.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "idl/huetrack_view.h"

namespace huetrack::live_view {

// thread-safe: one thread requests and takes pieces (the bus'), another one reads.
class RecordingDownload {
 public:
  using Clock = std::chrono::steady_clock;
  // words: the request of a piece without its offset: recording_words(), picture_words(), report_words() or
  // print_words(). client: unique name of the requester.
  RecordingDownload(std::vector<std::string> words, std::string client, std::string host, std::uint32_t pid);

  static std::vector<std::string> recording_words(const std::string& name) { return {"record", "read", name}; }
  static std::vector<std::string> picture_words(const std::string& name) { return {"record", "picture", name}; }
  static std::vector<std::string> report_words() { return {"calibrate", "report"}; }
  // board: as `calibrate print` takes them (idl/README.md), "type=charuco".
  static std::vector<std::string> print_words(const std::vector<std::string>& board);

  const std::string& client() const { return client_; }

  // The request to send now; nullopt: none. Requests without a reply are repeated, and fail after some seconds.
  std::optional<msg::ControlRequest> next_request(Clock::time_point now);
  void take(const msg::ControlReply& reply);  // to this client
  void fail(const std::string& why);          // ends it

  enum class State : std::uint8_t { awaited, begun, ended, failed };
  State state() const;          // awaited: no piece yet. ended: all of it has been read
  std::string failure() const;  // one sentence
  std::uint64_t bytes() const;  // total; once it has begun

  // Takes at most so many unread bytes. 0: none now.
  std::size_t read(char* buffer, std::size_t size);

  // Called under a lock when there are bytes to read or state() changed: must be fast and must not call back.
  void on_news(std::function<void()> listener);
  // Runs `what` under that lock if there is nothing to read but more will come: no change is missed between the check
  // and the decision to wait.
  void if_nothing(const std::function<void()>& what) const;

 private:
  void end(std::string why);  // under mutex_

  const std::vector<std::string> words_;
  const std::string client_, host_;
  const std::uint32_t pid_;
  mutable std::mutex mutex_;                        // guards all that follows
  std::optional<std::uint64_t> total_;              // bytes of the whole
  std::string identity_;                            // of the file: pieces of another version are refused
  std::uint64_t got_ = 0;                           // received bytes
  std::vector<std::uint8_t> ready_;                 // the piece that is being read; the next one is then requested
  std::size_t read_ = 0;                            // of it
  std::optional<std::vector<std::uint8_t>> ahead_;  // the one after it
  std::uint32_t number_ = 0;
  bool is_asked_ = false;  // number_ is on its way
  Clock::time_point asked_at_{}, first_asked_at_{};
  std::string failure_;
  std::function<void()> listener_;
};

}  // namespace huetrack::live_view
