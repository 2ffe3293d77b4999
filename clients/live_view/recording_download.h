// A recording, a calibration's report, or a board to print, on its way from a service to somebody on this side: asked
// for piece by piece, as fast as it is taken, so that however large it is, two pieces of it are in memory.
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

// thread-safe: one thread asks and takes what comes (the bus'), another one reads.
class RecordingDownload {
 public:
  using Clock = std::chrono::steady_clock;
  // words: that ask for a piece of it, but for the last one, where the piece begins: recording_words(),
  // report_words() or print_words(). client: who asks, as of other requests; nobody else has it.
  RecordingDownload(std::vector<std::string> words, std::string client, std::string host, std::uint32_t pid);

  static std::vector<std::string> recording_words(const std::string& name) { return {"record", "read", name}; }
  static std::vector<std::string> report_words() { return {"calibrate", "report"}; }
  // board: as `calibrate print` takes them (idl/README.md), "type=charuco".
  static std::vector<std::string> print_words(const std::vector<std::string>& board);

  const std::string& client() const { return client_; }

  // What is to be sent now; nullopt: nothing, as a piece is on its way, or not read yet, or all have come. A request
  // that is not answered is sent again, and after a while given up.
  std::optional<msg::ControlRequest> next_request(Clock::time_point now);
  void take(const msg::ControlReply& reply);  // of this client
  void fail(const std::string& why);          // nothing more will come

  enum class State : std::uint8_t { awaited, begun, ended, failed };
  State state() const;          // awaited: nothing has come yet. ended: all of it has been read
  std::string failure() const;  // one sentence
  std::uint64_t bytes() const;  // of the whole; once it has begun

  // What has come and was not read yet, at most so much, and takes it away. 0: nothing now.
  std::size_t read(char* buffer, std::size_t size);

  // Called when there is something to read, or to see in state(), under a lock: must be quick, and must not call back.
  void on_news(std::function<void()> listener);
  // Runs it, under that lock, while there is nothing to read and something is still to come: no news is missed between
  // the look and the decision to wait.
  void if_nothing(const std::function<void()>& what) const;

 private:
  void end(std::string why);  // under mutex_

  const std::vector<std::string> words_;
  const std::string client_, host_;
  const std::uint32_t pid_;
  mutable std::mutex mutex_;            // guards all that follows
  std::optional<std::uint64_t> total_;  // bytes of the whole
  std::string identity_;                // of what is read: pieces of another one do not fit
  std::uint64_t got_ = 0;               // bytes that have come
  std::vector<std::uint8_t> ready_;     // the last piece; the next one is asked for when this one is begun to be read
  std::size_t read_ = 0;                // of it
  std::optional<std::vector<std::uint8_t>> ahead_;  // the one after it
  std::uint32_t number_ = 0;
  bool is_asked_ = false;  // number_ is on its way
  Clock::time_point asked_at_{}, first_asked_at_{};
  std::string failure_;
  std::function<void()> listener_;
};

}  // namespace huetrack::live_view
