#include "calib/model/rig_history.h"

#include <fmt/format.h>

#include <array>

namespace huetrack::calib {

std::string utc_text(UtcTime at) {
  const auto day = std::chrono::floor<std::chrono::days>(at);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss time(at - day);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), time.hours().count(),
                     time.minutes().count(), time.seconds().count());
}

std::optional<UtcTime> utc_time(std::string_view text) {
  int year = 0, hour = 0, minute = 0, second = 0;
  unsigned month = 0, day = 0;
  if (std::sscanf(std::string(text).c_str(), "%4d-%2u-%2uT%2d:%2d:%2dZ", &year, &month, &day, &hour, &minute,
                  &second) != 6)
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)};
  if (!date.ok()) return std::nullopt;
  const UtcTime at = std::chrono::sys_days(date) + std::chrono::hours(hour) + std::chrono::minutes(minute) +
                     std::chrono::seconds(second);
  if (utc_text(at) != text) return std::nullopt;  // 25 o'clock, a missing digit, trailing text
  return at;
}

std::string age_text(std::chrono::seconds age) {
  struct Unit {
    std::int64_t seconds;
    const char* name;
  };
  constexpr std::array<Unit, 5> units{Unit{31'557'600, "years"}, Unit{2'629'800, "months"}, Unit{86'400, "days"},
                                      Unit{3600, "hours"}, Unit{60, "minutes"}};
  for (const Unit& unit : units) {
    if (age.count() >= 2 * unit.seconds) return fmt::format("{} {}", age.count() / unit.seconds, unit.name);
  }
  return "less than 2 minutes";
}

void RigHistory::add(RigCheckNote note) {
  checks.push_back(std::move(note));
  if (checks.size() > max_checks) checks.erase(checks.begin());
}

std::string RigHistory::text(UtcTime now) const {
  const auto ago = [&](UtcTime then) {
    return then > now ? "at " + utc_text(then) + ", which is in the future" : age_text(now - then) + " ago";
  };
  std::string out;
  if (at) out = "calibrated " + ago(*at);
  if (temperature_c) out += fmt::format("{} at {:.4g} C", out.empty() ? "calibrated" : "", *temperature_c);
  if (!checks.empty() && checks.back().verdict == mended_verdict)
    out += fmt::format("{}mended {}, not checked since", out.empty() ? "" : "; ", ago(checks.back().at));
  else if (!checks.empty())
    out += fmt::format("{}last checked {}: {}", out.empty() ? "" : "; ", ago(checks.back().at), checks.back().verdict);
  return out;
}

}  // namespace huetrack::calib
