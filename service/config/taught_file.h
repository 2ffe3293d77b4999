// Writes what was taught into the taught file (service_config.h), beside the configuration, whose own text stays as its
// author left it. Every file is read anew, so that what somebody changed in the meantime stays; what was written is
// read back, and must say what was meant, before it takes the place of the old file. Atomic: that is the old one or the
// new one, with its rights, or the configuration's where it is the first. Returns its path. throws std::runtime_error
// of one readable line: the configuration is not right as it stands now, or the taught file cannot be written.
#pragma once

#include <filesystem>
#include <optional>

#include "object_tracking/object_tracker.h"

namespace huetrack::config {

// A target's colours, and the ignored rectangles of all cameras when they are given. What the configuration says of
// them is no longer in force; what it says of the target's other keys is.
std::filesystem::path save_taught(const std::filesystem::path& config, const object_tracking::TargetOptions& target,
                                  const std::optional<object_tracking::IgnoredRegions>& ignored);
std::filesystem::path save_ignored(const std::filesystem::path& config, const object_tracking::IgnoredRegions& ignored);

// What was there before the last save takes its place again, and the other way round: undone twice is as it was. Every
// save keeps the file before it, as <taught file>.before; before the first one there was none. Returns the taught
// file's path. throws std::runtime_error: nothing was saved.
std::filesystem::path undo_taught(const std::filesystem::path& config);

}  // namespace huetrack::config
