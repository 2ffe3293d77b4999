// huetrack-calibrate: calibrates cameras, and judges whether the result can be trusted.
#include <pthread.h>
#include <signal.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stop_token>
#include <string>
#include <thread>
#include <variant>

#include "calib/files/text_file.h"
#include "calib/program/command_line.h"
#include "calib/report/advice.h"

namespace {

using namespace huetrack;

// Turns SIGINT and SIGTERM into a stop request, in a waiting thread instead of a signal handler; the second signal ends
// the program at once. Create it before any other thread.
class Signals {
 public:
  Signals() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    thread_ = std::jthread([this](const std::stop_token& end) {
      while (!end.stop_requested()) {
        const timespec patience{.tv_sec = 0, .tv_nsec = 50'000'000};
        const int signal = sigtimedwait(&signals_, nullptr, &patience);
        if (signal >= 0 && !stop_.request_stop()) std::_Exit(128 + signal);
      }
    });
  }
  std::stop_token token() const { return stop_.get_token(); }

 private:
  sigset_t signals_{};
  std::stop_source stop_;
  std::jthread thread_;
};

// Prints an error in one line.
int fail(const std::string& why) {
  std::fprintf(stderr, "huetrack-calibrate: %s\n", files::printable(why, files::longest_message).c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const Signals signals;  // first, so that an early signal is handled
  const auto asked = program::read_command_line(argc, argv);
  if (const auto* ended = std::get_if<int>(&asked)) return *ended;
  program::ExitStatus status = program::ExitStatus::failed;
  try {
    status = std::get<program::Command>(asked)(signals.token());
  } catch (const solver::CalibrationError& error) {
    return fail(report::with_advice(error));
  } catch (const std::exception& error) {
    return fail(error.what());
  }
  if (std::fflush(stdout) != 0) {
    std::fprintf(stderr, "huetrack-calibrate: cannot write to standard output\n");
    return 1;
  }
  return static_cast<int>(status);
}
