// What this machine knows of its own clock: which one it is, and how well somebody keeps it.
#pragma once

#include <cstdint>
#include <optional>

#include "capture/frames/frame.h"
#include "hosts/clock_offset.h"

namespace huetrack::hosts {

struct MachineClock {
  // One number for all programs of a machine since it was started, another one for any other machine; 0: not known.
  std::int64_t machine = 0;
  capture::Timestamp zero{};     // UNIX time of CLOCK_MONOTONIC's zero as this program takes it (capture_clock.h)
  std::optional<double> kept_s;  // standard deviation to UTC, or to the PTP master's time; nullopt: nobody keeps it
};

// As chrony, ntpd, systemd-timesyncd or PTP's phc2sys have told the kernel (adjtimex(2)). Does not throw.
MachineClock machine_clock() noexcept;

// What is known of the offset of `theirs` to `ours` without asking.
KeptTogether kept_together(const MachineClock& ours, const MachineClock& theirs) noexcept;

// Of the kernel's own words, in microseconds, for machine_clock(). is_kept: somebody has set the clock and goes on.
std::optional<double> kept_by(bool is_kept, long estimated_error_us, long largest_error_us, double stepped_s) noexcept;

}  // namespace huetrack::hosts
