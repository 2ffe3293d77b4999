// The file that keeps the learnt still room over restarts, so that a camera that was turned meanwhile is detected. It
// belongs to one rig and is ignored with another one.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "room_watch/kept_patch.h"

namespace huetrack::config {

struct KeptRoom {
  std::string camera;  // its name in the rig
  std::vector<room_watch::KeptPatch> patches;
};

// Empty if there is no such file, or it belongs to another rig. throws ConfigError if it is invalid.
std::vector<KeptRoom> read_room(const std::filesystem::path& file, const std::string& rig_identity);
// Atomic. throws std::system_error
void write_room(const std::filesystem::path& file, const std::vector<KeptRoom>& room, const std::string& rig_identity);
std::string room_to_yaml(const std::vector<KeptRoom>& room, const std::string& rig_identity);

}  // namespace huetrack::config
