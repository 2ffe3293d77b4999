// From the driver's clock to UNIX time.
#pragma once

#include <chrono>

#include "capture/frames/frame.h"

namespace huetrack::capture {

// Drivers stamp frames with CLOCK_MONOTONIC; the pipeline and everything published use UNIX time. The offset between
// the two clocks is measured once, on first use, and kept for the life of the process:
//   - NTP slews CLOCK_MONOTONIC together with the wall clock, so the two do not drift apart in days;
//   - a step of the wall clock (a user, NTP at boot) does not tear a hole into the track. Our times then have the error
//     wall_clock_step() until the process is restarted.
// Latencies are differences to unix_now(), never to std::chrono::system_clock::now(). Thread-safe; nothing throws.

// since_boot: CLOCK_MONOTONIC, which is also std::chrono::steady_clock.
Timestamp unix_time_of(std::chrono::nanoseconds since_boot) noexcept;
Timestamp unix_now() noexcept;

// The wall clock's steps since the offset was measured; 0 within the measurement's error (microseconds).
Duration wall_clock_step() noexcept;

}  // namespace huetrack::capture
