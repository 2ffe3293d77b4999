// When a rig was calibrated, at which temperature, and what has been seen of it since. Pure values.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::calib {

using UtcTime = std::chrono::sys_seconds;

// "2026-11-22T16:04:08Z", and back; nullopt: it is not written so, or there is no such time.
std::string utc_text(UtcTime at);
std::optional<UtcTime> utc_time(std::string_view text);
// "3 days", "5 hours", "14 months": the largest unit that is whole at least twice; "less than 2 minutes".
std::string age_text(std::chrono::seconds age);

// Of a note that is no check: the rig was mended, and nobody has looked yet whether it fits.
inline constexpr std::string_view mended_verdict = "mended";

// Somebody looked whether the rig still fits.
struct RigCheckNote {
  UtcTime at{};
  std::string verdict;  // "usable", "doubtful", "failed"; or mended_verdict
  std::string text;     // one sentence: what was seen
  bool operator==(const RigCheckNote&) const = default;
};

struct RigHistory {
  static constexpr std::size_t max_checks = 10;  // that a rig file keeps

  std::optional<UtcTime> at;            // the calibration's; nullopt: the file does not say
  std::optional<double> temperature_c;  // then, if somebody told
  std::vector<RigCheckNote> checks;     // oldest first

  bool is_empty() const { return !at && !temperature_c && checks.empty(); }
  void add(RigCheckNote note);  // and lets the oldest go
  // One line for people: "calibrated 3 days ago at 21.5 C; last checked 2 hours ago: usable". Empty: nothing is known.
  std::string text(UtcTime now) const;
  bool operator==(const RigHistory&) const = default;
};

}  // namespace huetrack::calib
