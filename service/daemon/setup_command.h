// `huetrackd setup`: from cameras alone to the page, which leads from there. The first configuration is written, for
// whoever has none; then it is run, with the page beside it.
#pragma once

#include <filesystem>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/v4l2/v4l2_device.h"
#include "daemon/live.h"

namespace huetrack::daemon {

// A camera of this host, as a configuration names it.
struct SetUpCamera {
  std::filesystem::path device;  // its port's name where udev gives one: it stays the same
  int width = 0, height = 0;
  std::string model;       // for people
  double fps = 0;          // to ask for; 0: it does not say which it has
  double bytes_per_s = 0;  // about what its frames take at that rate, as they come from it
};

// Those that can be used, by their device files' numbers; what is left out, and why, is added to `left_out`.
std::vector<SetUpCamera> cameras_of_this_host(std::vector<std::string>& left_out, const std::stop_token& stop);

// At this size: the rate nearest to 30 frames/s that a format of ours has, as whoever asks for no rate gets what the
// driver happens to be set to; and what it takes. Pure.
void choose_rate(std::span<const capture::OfferedFormat> formats, SetUpCamera& camera);

// A configuration of these cameras, not calibrated, without a target, that the page may change. memory_bytes: of this
// host; the last minute, which the page calibrates from, is kept in as much as a quarter of it.
std::string first_configuration(std::span<const SetUpCamera> cameras, double memory_bytes);

struct SetUpCommand {
  std::filesystem::path config;
  bool with_page = true;  // false: it is only written, and nothing runs
};

// An existing configuration is run as it stands. throws std::exceptions of one readable line: there are not two
// cameras, the file cannot be written; and as run() does.
void set_up(const SetUpCommand& command, LiveRequests& requests, const std::stop_token& stop);

}  // namespace huetrack::daemon
