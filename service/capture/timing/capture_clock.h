// From the driver's clock to UNIX time.
#pragma once

#include <chrono>

#include "capture/frames/frame.h"

namespace huetrack::capture {

// Drivers stamp frames with CLOCK_MONOTONIC; the road of a frame, and what we publish, speak UNIX time. The offset
// between the two clocks is measured once, the first time that anybody asks, and kept for the life of the process:
//   - CLOCK_MONOTONIC is slewed by NTP together with the wall clock, so the two do not drift apart in days;
//   - a step of the wall clock (a user, NTP at boot) does not tear a hole into the track. The times that we give are
//   then
//     off by that step until the process is started anew: wall_clock_step() says so.
// Latencies are differences to unix_now(), never to std::chrono::system_clock::now().
// All of these are thread-safe and do not throw.

// since_boot: CLOCK_MONOTONIC, which is also std::chrono::steady_clock.
Timestamp unix_time_of(std::chrono::nanoseconds since_boot) noexcept;
Timestamp unix_now() noexcept;

// By how much the wall clock has been stepped since the offset was measured; 0 within its own error (microseconds).
Duration wall_clock_step() noexcept;

}  // namespace huetrack::capture
