// Signal handling.
#pragma once

#include <signal.h>

#include <functional>
#include <map>
#include <stop_token>
#include <thread>

namespace huetrack::daemon {

// A thread waits for signals; no code runs in signal handlers. SIGINT and SIGTERM request a stop, others call their
// mapped functions. A second SIGINT or SIGTERM ends the program at once. Create it before any other thread, so that all
// inherit the blocked signals.
class Signals {
 public:
  // Blocks signals until a Signals exists, so that early signals are neither lost nor end the program.
  static void hold();

  // code: the signal's si_code. Return true to stop.
  using Others = std::map<int, std::function<bool(int code)>>;
  explicit Signals(Others others);
  std::stop_token token() const { return stop_.get_token(); }

 private:
  void wait(const std::stop_token& end);

  Others others_;
  sigset_t signals_{};
  std::stop_source stop_;
  std::jthread thread_;
};

}  // namespace huetrack::daemon
