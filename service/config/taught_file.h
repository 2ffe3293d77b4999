// Writes taught values into the taught file (service_config.h); the configuration itself is never changed. Both files
// are read again first, to keep concurrent changes. The new text is read back and compared with the intended values
// before it replaces the old file, atomically and with the old file's permissions (at first, those of the
// configuration). All functions return the taught file's path and throw std::runtime_error with one readable line if
// the configuration is invalid at that time, or the file cannot be written.
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

// Saves a target's colours, and its radius and the ignored rectangles of all cameras if given. They replace the
// configuration's values; the target's other keys stay in force.
std::filesystem::path save_taught(const std::filesystem::path& config, const object_tracking::TargetOptions& target,
                                  const std::optional<object_tracking::IgnoredRegions>& ignored,
                                  std::optional<double> radius_m = {});
std::filesystem::path save_ignored(const std::filesystem::path& config, const object_tracking::IgnoredRegions& ignored);

// ---- Editing targets. A target that exists only in the taught file has its shape and count there; these distinguish
// it from leftovers of a target that was renamed in the configuration.

struct TargetEdit {
  std::string target;
  std::optional<double> radius_m = {};  // not given for a new target: teaching proposes one
  // Missing values stay, or are the defaults for an untaught target.
  std::optional<std::pair<double, double>> hue_deg = {}, saturation = {}, intensity = {};
  std::string camera = {};  // colour for this camera only; empty: for all cameras
};
std::filesystem::path save_target(const std::filesystem::path& config, const TargetEdit& edit);
// Also throw std::runtime_error for an existing, unknown or invalid name.
std::filesystem::path add_target(const std::filesystem::path& config, const TargetEdit& edit);
std::filesystem::path rename_target(const std::filesystem::path& config, const std::string& from,
                                    const std::string& to);
std::filesystem::path remove_target(const std::filesystem::path& config, const std::string& target);

// The target that a rig was calibrated by.
struct CalibratedBy {
  std::string target;
  Eigen::Vector3d middle;          // of the places where it was, in the rig's world
  std::optional<double> radius_m;  // as the cameras saw it; nullopt: nothing but a guess of it gave the scale
};
// Replaces the configuration's rig, or `rig: none`. If there was none and no volume is set, the volume becomes
// box_seen_by_two(), because the new world frame is arbitrary: around where the target was, or the world's origin,
// where a board was. A measured radius replaces the default of the target.
std::filesystem::path save_rig(const std::filesystem::path& config, const std::filesystem::path& rig,
                               const std::optional<CalibratedBy>& by = {});
// Bounding box of the points that at least two cameras see, up to 1.5 times their mean distance from the middle, in
// whole centimetres. nullopt: no such points.
std::optional<object_tracking::Volume> box_seen_by_two(const calib::CameraRig& rig, const Eigen::Vector3d& middle);

// Saves the given controls of a live camera; others stay.
std::filesystem::path save_controls(const std::filesystem::path& config, const std::string& camera,
                                    std::span<const capture::ControlSetting> settings);

// ---- History: the last twenty versions as <taught file>.before, .before.2, ...; undone versions as <taught
// file>.undone, ..., until the next save. Each version names the change that it made in a comment. throws
// std::runtime_error if there is nothing to undo or redo.
std::filesystem::path undo_taught(const std::filesystem::path& config);
std::filesystem::path redo_taught(const std::filesystem::path& config);
struct TaughtHistory {
  int undoable = 0, redoable = 0;
  std::string undoes{}, redoes{};  // the change that the next undo or redo is about, as in "colour of lime"; or empty
};
TaughtHistory taught_history(const std::filesystem::path& config);

}  // namespace huetrack::config
