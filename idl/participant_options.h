// Options of dds_participant.h, without Fast DDS' headers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace huetrack::idl {

struct ParticipantOptions {
  std::string name{};                     // shown by DDS tools
  std::optional<int> domain{};            // 0..232; nullopt: ROS_DOMAIN_ID, or 0
  std::vector<std::string> interfaces{};  // use only these, and loopback: names or IPv4 addresses; empty: all
  std::filesystem::path profiles{};       // Fast DDS XML; empty: none. FASTRTPS_DEFAULT_PROFILES_FILE is honoured too.
};

}  // namespace huetrack::idl
