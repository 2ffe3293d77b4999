// The file in which the still room around the cameras is kept over restarts, so that a camera that was turned while
// nobody looked is noticed. It belongs to one rig: with another one it is as if it were not there.
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

// Empty where there is no such file, or it is of another rig. throws ConfigError: it is there and cannot be read.
std::vector<KeptRoom> read_room(const std::filesystem::path& file, const std::string& rig_identity);
// As a whole or not at all. throws std::system_error
void write_room(const std::filesystem::path& file, const std::vector<KeptRoom>& room, const std::string& rig_identity);
std::string room_to_yaml(const std::vector<KeptRoom>& room, const std::string& rig_identity);

}  // namespace huetrack::config
