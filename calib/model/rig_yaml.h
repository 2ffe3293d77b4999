// The rig file (rig.yaml): read and write. Its form is documented in calib/formats.md.
#pragma once

#include <filesystem>
#include <string>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

CameraRig read_rig(const std::filesystem::path& file);                    // throws ConfigError
std::string to_yaml(const CameraRig& rig);                                // reads back to exactly the same numbers
void write_rig(const CameraRig& rig, const std::filesystem::path& file);  // atomic (temporary file + rename); throws
// SHA-256-like identity is not needed: FNV-1a 64 over to_yaml(), as 16 hex digits. Published in the status sample.
// What is noted of its history (RigHistory) is not part of it: it gives the same positions.
std::string rig_identity(const CameraRig& rig);

}  // namespace huetrack::calib
