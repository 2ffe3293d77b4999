// Reads and writes the rig file (rig.yaml); format: calib/formats.md.
#pragma once

#include <filesystem>
#include <string>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

CameraRig read_rig(const std::filesystem::path& file);                    // throws files::ConfigError
std::string to_yaml(const CameraRig& rig);                                // reads back to the same bits
void write_rig(const CameraRig& rig, const std::filesystem::path& file);  // atomic (temporary file + rename); throws
// FNV-1a 64 of to_yaml() without the history (RigHistory), as 16 hex digits. Published in the status sample.
std::string rig_identity(const CameraRig& rig);

}  // namespace huetrack::calib
