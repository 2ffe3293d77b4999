// `huetrackd setup`: from cameras alone to the page, which leads from there. The first configuration is written, for
// whoever has none; then it is run, with the page beside it.
#pragma once

#include <filesystem>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/live.h"

namespace huetrack::daemon {

// A camera of this host, as a configuration names it.
struct SetUpCamera {
  std::filesystem::path device;  // its port's name where udev gives one: it stays the same
  int width = 0, height = 0;
  std::string model;  // for people
};

// Those that can be used, by their device files' numbers; what is left out, and why, is added to `left_out`.
std::vector<SetUpCamera> cameras_of_this_host(std::vector<std::string>& left_out, const std::stop_token& stop);

// A configuration of these cameras, not calibrated, without a target, that the page may change.
std::string first_configuration(std::span<const SetUpCamera> cameras);

struct SetUpCommand {
  std::filesystem::path config;
  bool with_page = true;  // false: it is only written, and nothing runs
};

// An existing configuration is run as it stands. throws std::exceptions of one readable line: there are not two
// cameras, the file cannot be written; and as run() does.
void set_up(const SetUpCommand& command, LiveRequests& requests, const std::stop_token& stop);

}  // namespace huetrack::daemon
