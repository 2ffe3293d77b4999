#include "daemon/signals.h"

#include <pthread.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cstdlib>
#include <utility>

namespace huetrack::daemon {
namespace {

constexpr std::array held{SIGINT, SIGTERM, SIGHUP, SIGUSR1};

}  // namespace

namespace {

// Called by the dynamic linker before the libraries' constructors, which take long.
[[gnu::section(".preinit_array"), gnu::used]] void (*const before_all_constructors)() = &Signals::hold;

}  // namespace

void Signals::hold() {
  sigset_t all;
  sigemptyset(&all);
  for (const int signal : held) sigaddset(&all, signal);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
}

Signals::Signals(Others others) : others_(std::move(others)) {
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGINT);
  sigaddset(&signals_, SIGTERM);
  for (const auto& [signal, _] : others_) sigaddset(&signals_, signal);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  ::signal(SIGUSR1, SIG_IGN);  // ignored unless mapped
  sigset_t unwanted;
  sigemptyset(&unwanted);
  for (const int signal : held)
    if (sigismember(&signals_, signal) == 0) sigaddset(&unwanted, signal);
  pthread_sigmask(SIG_UNBLOCK, &unwanted, nullptr);
  thread_ = std::jthread([this](const std::stop_token& end) { wait(end); });
}

void Signals::wait(const std::stop_token& end) {
  while (!end.stop_requested()) {
    const timespec patience{.tv_sec = 0, .tv_nsec = 50'000'000};
    siginfo_t info{};
    const int signal = sigtimedwait(&signals_, &info, &patience);
    if (signal < 0) continue;
    if (const auto other = others_.find(signal); other != others_.end()) {
      if (!other->second(info.si_code)) continue;
    }
    if (!stop_.request_stop()) std::_Exit(128 + signal);
    spdlog::info("stopping: {}", signal == SIGINT ? "SIGINT" : signal == SIGTERM ? "SIGTERM" : "the terminal is gone");
  }
}

}  // namespace huetrack::daemon
