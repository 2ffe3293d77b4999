#include "hosts/machine_clock.h"

#include <sys/timex.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>
#include <string>

#include "capture/timing/capture_clock.h"

namespace huetrack::hosts {
namespace {

constexpr double least_kept_s = 20e-6;  // of reading a clock; PTP's own error is smaller
// Of a service that reports no error (systemd-timesyncd): it polls one server of the internet now and then.
constexpr double unreported_error_s = 2e-3;
// chrony's and ntpd's largest error is the whole round trip to the time source.
constexpr double sigmas_in_largest = 3;

std::int64_t id_of_machine() noexcept {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string text, digits;
  if (!(file >> text)) return 0;
  std::ranges::copy_if(text, std::back_inserter(digits), [](char c) { return c != '-'; });
  digits.resize(std::min<std::size_t>(digits.size(), 15));  // 60 random bits
  std::int64_t id = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), id, 16);
  return id;
}

}  // namespace

std::optional<double> kept_by(bool is_kept, long estimated_error_us, long largest_error_us, double stepped_s) noexcept {
  if (!is_kept) return std::nullopt;
  const double largest_s = 1e-6 * static_cast<double>(largest_error_us) / sigmas_in_largest;
  const double error_s = estimated_error_us > 0 ? std::min(1e-6 * static_cast<double>(estimated_error_us), largest_s)
                                                : std::max(unreported_error_s, largest_s);
  return std::hypot(std::max(least_kept_s, error_s), stepped_s);
}

MachineClock machine_clock() noexcept {
  static const std::int64_t machine = id_of_machine();
  timex state{};
  const int result = ::adjtimex(&state);
  const bool is_kept = result >= 0 && result != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
  return {.machine = machine,
          .zero = capture::unix_time_of(std::chrono::nanoseconds{0}),
          .kept_s = kept_by(is_kept, state.esterror, state.maxerror, capture::seconds(capture::wall_clock_step()))};
}

ClockSync clock_sync(const MachineClock& ours, const MachineClock& theirs) noexcept {
  if (ours.machine != 0 && ours.machine == theirs.machine) return {.offset = theirs.zero - ours.zero, .sigma_s = 0};
  if (!ours.kept_s || !theirs.kept_s) return {};
  return {.sigma_s = std::hypot(*ours.kept_s, *theirs.kept_s)};
}

}  // namespace huetrack::hosts
