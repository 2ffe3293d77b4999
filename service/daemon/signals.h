// How signals reach the program.
#pragma once

#include <signal.h>

#include <functional>
#include <map>
#include <stop_token>
#include <thread>

namespace huetrack::daemon {

// SIGINT and SIGTERM become a stop request, others what they are mapped to, taken by a thread that waits for them:
// nothing runs inside a signal handler. A second SIGINT or SIGTERM ends the program at once. Create it before any other
// thread, so that all inherit the blocked signals.
class Signals {
 public:
  // Until there is one, a signal waits: one of the first milliseconds is not lost, nor does it end the program.
  static void hold();

  // code: the signal's si_code. True: stop.
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
