// `huetrackd demo`: the bundled recording in the place of live cameras, and the web page.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "daemon/live.h"

namespace huetrack::daemon {

struct DemoCommand {
  std::filesystem::path folder;  // for its files; created if needed; empty: a temporary one, removed at the end
  bool with_page = true;         // false: only the service
  std::optional<int> port;       // of the page; nullopt: its default
};

// The folder with the demo's configuration and recording: installed (share/huetrack/demo) or of the source tree
// (configs/demo), below a folder that holds `program`. throws std::runtime_error: there is none
std::filesystem::path bundled_demo(const std::filesystem::path& program);

// Copies the demo's files to `to`, unless a configuration is there already; the copy lists the cameras of its rig as
// live cameras. Returns its configuration. throws std::exceptions of one readable line.
std::filesystem::path copy_demo(const std::filesystem::path& from, const std::filesystem::path& to);

// Tracks until a stop. Everything that `run` can do on the page can be done here, too. throws as run() does.
void run_demo(const DemoCommand& command, LiveRequests& requests, const std::stop_token& stop);

}  // namespace huetrack::daemon
