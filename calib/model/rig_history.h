// When a rig was calibrated, at which temperature, and the checks since. Pure values.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::calib {

using UtcTime = std::chrono::sys_seconds;

// "2026-11-22T16:04:08Z" and back; nullopt: another format, or no valid time.
std::string utc_text(UtcTime at);
std::optional<UtcTime> utc_time(std::string_view text);
// "3 days", "14 months": the largest unit that fits at least twice; "less than 2 minutes".
std::string age_text(std::chrono::seconds age);

// Verdict of a note that is not a check: the rig was mended and has not been checked since.
inline constexpr std::string_view mended_verdict = "mended";

// The result of one check of the rig.
struct RigCheckNote {
  UtcTime at{};
  std::string verdict;  // "usable", "doubtful", "failed"; or mended_verdict
  std::string text;     // one sentence: the finding
  bool operator==(const RigCheckNote&) const = default;
};

struct RigHistory {
  static constexpr std::size_t max_checks = 10;  // capacity: in a rig file

  std::optional<UtcTime> at;            // of the calibration; nullopt: unknown
  std::optional<double> temperature_c;  // at that time, if known
  std::vector<RigCheckNote> checks;     // oldest first

  bool is_empty() const { return !at && !temperature_c && checks.empty(); }
  void add(RigCheckNote note);  // drops the oldest beyond max_checks
  // One line for people: "calibrated 3 days ago at 21.5 C; last checked 2 hours ago: usable". Empty: unknown.
  std::string text(UtcTime now) const;
  bool operator==(const RigHistory&) const = default;
};

}  // namespace huetrack::calib
