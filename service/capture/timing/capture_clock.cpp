#include "capture/timing/capture_clock.h"

namespace huetrack::capture {
namespace {

// UNIX time of CLOCK_MONOTONIC's zero, from the fastest of several readings: it was not interrupted.
Duration measured_offset() noexcept {
  Duration offset{0};
  Duration shortest = Duration::max();
  for (int i = 0; i < 16; ++i) {
    const Duration before = std::chrono::steady_clock::now().time_since_epoch();
    const Duration wall = std::chrono::system_clock::now().time_since_epoch();
    const Duration after = std::chrono::steady_clock::now().time_since_epoch();
    if (after - before >= shortest) continue;
    shortest = after - before;
    offset = wall - before - shortest / 2;
  }
  return offset;
}

Duration offset_of_process() noexcept {
  static const Duration offset = measured_offset();
  return offset;
}

}  // namespace

Timestamp unix_time_of(std::chrono::nanoseconds since_boot) noexcept {
  return Timestamp{since_boot + offset_of_process()};
}

Timestamp unix_now() noexcept {
  return unix_time_of(std::chrono::steady_clock::now().time_since_epoch());
}

Duration wall_clock_step() noexcept {
  const Duration kept = offset_of_process();
  return measured_offset() - kept;
}

}  // namespace huetrack::capture
