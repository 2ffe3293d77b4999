// This machine's clock: its identity, and how well NTP or PTP synchronises it.
#pragma once

#include <cstdint>
#include <optional>

#include "capture/frames/frame.h"
#include "hosts/clock_offset.h"

namespace huetrack::hosts {

struct MachineClock {
  // The same number for all programs of a machine since its boot, and another one for any other machine; 0: unknown.
  std::int64_t machine = 0;
  capture::Timestamp zero{};     // this program's UNIX time of CLOCK_MONOTONIC's zero (capture_clock.h)
  std::optional<double> kept_s;  // 1 sigma to UTC, or to the PTP master's time; nullopt: not synchronised
};

// From the kernel, as set by chrony, ntpd, systemd-timesyncd or PTP's phc2sys (adjtimex(2)). Does not throw.
MachineClock machine_clock() noexcept;

// What is known of the offset of `theirs` to `ours` without exchanges.
ClockSync clock_sync(const MachineClock& ours, const MachineClock& theirs) noexcept;

// MachineClock::kept_s from the kernel's figures, in microseconds. is_kept: a service has set the clock and keeps
// adjusting it.
std::optional<double> kept_by(bool is_kept, long estimated_error_us, long largest_error_us, double stepped_s) noexcept;

}  // namespace huetrack::hosts
