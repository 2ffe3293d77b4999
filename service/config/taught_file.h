// Writes what was taught into the taught file (service_config.h), beside the configuration, whose own text stays as its
// author left it. Every file is read anew, so that what somebody changed in the meantime stays; what was written is
// read back, and must say what was meant, before it takes the place of the old file. Atomic: that is the old one or the
// new one, with its rights, or the configuration's where it is the first. Returns its path. throws std::runtime_error
// of one readable line: the configuration is not right as it stands now, or the taught file cannot be written.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "calib/model/camera_rig.h"
#include "capture/v4l2/v4l2_device.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::config {

// A target's colours, its radius and the ignored rectangles of all cameras when they are given. What the configuration
// says of them is no longer in force; what it says of the target's other keys is.
std::filesystem::path save_taught(const std::filesystem::path& config, const object_tracking::TargetOptions& target,
                                  const std::optional<object_tracking::IgnoredRegions>& ignored,
                                  std::optional<double> radius_m = {});
std::filesystem::path save_ignored(const std::filesystem::path& config, const object_tracking::IgnoredRegions& ignored);

// ---- Targets by hand. A target that the configuration does not have stands in the taught file with its shape and
// count, which nothing else writes there: by them it is told from what is left of one that somebody renamed.

struct TargetEdit {
  std::string target;
  std::optional<double> radius_m = {};  // of a target that is added, and not given: teaching it proposes one
  // What is not given stays; of a target that nobody has taught yet, what a configuration without these keys says.
  std::optional<std::pair<double, double>> hue_deg = {}, saturation = {}, intensity = {};
  std::string camera = {};  // the colour is this camera's own from now on; empty: it is that of all cameras
};
std::filesystem::path save_target(const std::filesystem::path& config, const TargetEdit& edit);
// throw std::runtime_error as well: there is one of that name already, or none; that can be no name.
std::filesystem::path add_target(const std::filesystem::path& config, const TargetEdit& edit);
std::filesystem::path rename_target(const std::filesystem::path& config, const std::string& from,
                                    const std::string& to);
std::filesystem::path remove_target(const std::filesystem::path& config, const std::string& target);

// The rig that was found takes the place of the one that the configuration names, or of none. Where there was none, and
// neither file says where targets may be, that is where two of its cameras see from then on: its world is one that
// nobody has thought of.
std::filesystem::path save_rig(const std::filesystem::path& config, const std::filesystem::path& rig);
// The box around what two cameras or more see, to half as far again as they are from the world's origin, in whole
// centimetres. nullopt: nothing that way.
std::optional<object_tracking::Volume> box_seen_by_two(const calib::CameraRig& rig);

// Controls of a live camera of the configuration: what is given, beside what it says of the others.
std::filesystem::path save_controls(const std::filesystem::path& config, const std::string& camera,
                                    std::span<const capture::ControlSetting> settings);

// ---- What is left of earlier saves: the last twenty, as <taught file>.before, .before.2, ...; before the first one
// there was none. Those that were undone are <taught file>.undone, ..., until the next save.
// Each returns the taught file's path. throws std::runtime_error: there is nothing to undo, or to redo.
std::filesystem::path undo_taught(const std::filesystem::path& config);
std::filesystem::path redo_taught(const std::filesystem::path& config);
struct TaughtHistory {
  int undoable = 0, redoable = 0;
};
TaughtHistory taught_history(const std::filesystem::path& config);

}  // namespace huetrack::config
