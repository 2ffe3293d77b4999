// A program of films ends as huetrackd does: when SIGINT or SIGTERM asks it to.
#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <stop_token>
#include <thread>

namespace huetrack::soak {

inline std::atomic<bool> is_ended = false;
static_assert(std::atomic<bool>::is_always_lock_free);

// body(stop) runs until a signal, or until it returns by itself.
template <typename Body>
auto until_ended(Body&& body) {
  for (const int signal : {SIGTERM, SIGINT}) std::signal(signal, [](int) { is_ended = true; });
  std::stop_source stop;
  const std::jthread ending([&](const std::stop_token& done) {
    while (!is_ended && !done.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop.request_stop();
  });
  return body(stop.get_token());
}

}  // namespace huetrack::soak
