#include "service_health.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "calib/files/text_file.h"
#include "clients/live_view/events.h"
#include "idl/names.h"
#include "sample_format.h"

namespace huetrack::client {
namespace {

// The status is published every second; clocks of two hosts may differ by some seconds.
constexpr double old_s = 10;

std::string list_of(const std::vector<std::string>& sentences) {
  std::vector<std::string> quoted;
  std::ranges::transform(sentences, std::back_inserter(quoted), files::in_json_quotes);
  return fmt::format("[{}]", fmt::join(quoted, ","));
}

std::string head(bool is_healthy, const std::vector<std::string>& problems) {
  return std::string(R"({"version":1,"healthy":)") + (is_healthy ? "true" : "false") + R"(,"problems":)" +
         list_of(problems);
}

// A recording's camera may have ended, and a held one does not deliver: no faults.
bool is_well(const msg::CameraStatus& camera, const std::string& mode) {
  if (camera.health() == msg::CAMERA_HEALTH_DELIVERING) return true;
  if (mode == "held")
    return camera.health() == msg::CAMERA_HEALTH_WAITING || camera.health() == msg::CAMERA_HEALTH_STALLED;
  return mode == "replay" && camera.health() == msg::CAMERA_HEALTH_ENDED;
}

}  // namespace

std::vector<std::string> problems_of(const msg::ServiceStatus& status, std::int64_t now) {
  std::vector<std::string> problems;
  for (const msg::CameraStatus& camera : status.cameras())
    if (!is_well(camera, status.mode()))
      problems.push_back("camera " + camera.name() + ": " + std::string(idl::name(camera.health())) +
                         (camera.message().empty() ? "" : ": " + camera.message()));
  std::ranges::copy(status.warnings(), std::back_inserter(problems));
  const double age_s =
      (static_cast<double>(now) - static_cast<double>(status.at())) * 1e-9;  // in double: no overflow for any value
  if (age_s > old_s)
    problems.push_back(fmt::format("its last status is {:.0f} s old: it hangs, or the hosts' clocks differ", age_s));
  return problems;
}

std::string status_json(const msg::ServiceStatus& status, std::int64_t now, const msg::CameraTimes* times,
                        std::span<const msg::CameraPose> poses, const msg::HostClocks* clocks) {
  const std::vector<std::string> problems = problems_of(status, now);
  std::string out = head(problems.empty(), problems);
  out += R"(,"status":)" + live_view::to_json(status, static_cast<double>(now) * 1e-9);
  out += R"(,"times":)" + (times == nullptr ? "null" : live_view::to_json(*times));
  std::vector<std::string> known;
  for (const msg::CameraPose& pose : poses)
    if (std::ranges::any_of(status.cameras(), [&](const auto& camera) { return camera.name() == pose.camera(); }))
      known.push_back(live_view::to_json(pose));
  out += fmt::format(R"(,"poses":[{}],"clocks":{})", fmt::join(known, ","),
                     clocks == nullptr ? "null" : live_view::to_json(*clocks));
  return out + "}\n";
}

std::string no_status_json(const std::string& why) {
  return head(false, {why}) + R"(,"status":null,"times":null,"poses":[],"clocks":null})" + "\n";
}

}  // namespace huetrack::client
