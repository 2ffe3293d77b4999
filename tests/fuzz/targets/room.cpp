// What was kept of the still room.
#include <stdexcept>

#include "calib/files/config_error.h"
#include "config/room_file.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(room) {
  constexpr const char* rig = "0123456789abcdef";
  std::vector<config::KeptRoom> room;
  try {
    room = config::read_room(fuzz::file_with("room.yaml", input), rig);
  } catch (const files::ConfigError&) {
  }
  if (room.empty()) return;
  // What was accepted must be written so that it reads back as the same: an error here is a finding.
  const std::string text = config::room_to_yaml(room, rig);
  if (config::room_to_yaml(config::read_room(fuzz::file_with("again.yaml", text), rig), rig) != text)
    throw std::logic_error("the room does not read back");
}
