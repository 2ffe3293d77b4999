#include "config/taught_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <tuple>
#include <vector>

#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "calib/model/rig_yaml.h"
#include "capture/frames/file_descriptor.h"
#include "config/service_config.h"

namespace huetrack::config {
namespace {

namespace fs = std::filesystem;
using color::HsiRange;

bool is_below(const yaml::KeyPath& path, const yaml::KeyPath& above) {
  return path.size() >= above.size() && std::equal(above.begin(), above.end(), path.begin());
}

// The configuration of the two files, to be edited.
struct Draft {
  ServiceConfig config;
  std::vector<yaml::YamlReader::Leaf> written;  // set by the configuration itself

  bool is_written(const yaml::KeyPath& path) const {
    return std::ranges::any_of(written, [&](const auto& leaf) { return is_below(leaf.path, path); });
  }
  bool is_said(const yaml::KeyPath& path) const { return config.taught.given.contains(path) || is_written(path); }

  void give(const yaml::KeyPath& path) {
    std::erase_if(config.taught.removed, [&](const auto& removed) { return is_below(path, removed); });
    config.taught.given.insert(path);
  }
  void take_away(const yaml::KeyPath& path) {
    std::erase_if(config.taught.given, [&](const auto& given) { return is_below(given, path); });
    if (is_written(path)) config.taught.removed.insert(path);
  }
};

void set_color(Draft& draft, const object_tracking::TargetOptions& taught) {
  const auto target = std::ranges::find(draft.config.targets, taught.name, &object_tracking::TargetOptions::name);
  if (target == draft.config.targets.end())
    throw std::runtime_error(fmt::format("{} no longer has a target {}", draft.config.file.string(), taught.name));
  const yaml::KeyPath color = {"targets", taught.name, "color"}, cameras = {"targets", taught.name, "camera_colors"};
  const auto key_of = [](yaml::KeyPath path, const char* key) {
    path.emplace_back(key);
    return path;
  };
  for (const char* key : {"hue_deg", "saturation", "intensity"}) draft.give(key_of(color, key));

  const auto is_of = [](const std::string& camera) {
    return [&camera](const auto& entry) { return entry.first == camera; };
  };
  for (const auto& [camera, old] : target->camera_colors)
    if (std::ranges::none_of(taught.camera_colors, is_of(camera))) draft.take_away(key_of(cameras, camera.c_str()));
  for (const auto& [camera, range] : taught.camera_colors) {
    // Untaught values stay in their file. Values of neither file were those of the target's colour, which has changed.
    const auto old = std::ranges::find_if(target->camera_colors, is_of(camera));
    const bool is_new = old == target->camera_colors.end();
    const HsiRange was = is_new ? HsiRange{} : old->second;
    const yaml::KeyPath own = key_of(cameras, camera.c_str());
    const auto set = [&](const char* key, bool is_same) {
      if (is_new || !is_same || !draft.is_said(key_of(own, key))) draft.give(key_of(own, key));
    };
    set("hue_deg", was.hue_min_deg == range.hue_min_deg && was.hue_max_deg == range.hue_max_deg);
    set("saturation", was.saturation_min == range.saturation_min && was.saturation_max == range.saturation_max);
    set("intensity", was.intensity_min == range.intensity_min && was.intensity_max == range.intensity_max);
  }
  target->color = taught.color;
  target->camera_colors = taught.camera_colors;
}

// Rounds to tenths of a millimetre.
void set_radius(Draft& draft, const std::string& name, double radius_m) {
  const auto target = std::ranges::find(draft.config.targets, name, &object_tracking::TargetOptions::name);
  target->radius_m = std::max(1.0, std::round(radius_m * 1e4)) / 1e4;
  target->is_radius_assumed = false;
  draft.give({"targets", name, "radius_m"});
}

void set_ignored(Draft& draft, object_tracking::IgnoredRegions ignored) {
  std::erase_if(ignored, [](const auto& camera) { return camera.second.empty(); });
  const auto is_in = [](const object_tracking::IgnoredRegions& regions, const std::string& camera) {
    return std::ranges::find(regions, camera, [](const auto& entry) { return entry.first; }) != regions.end();
  };
  for (const auto& [camera, boxes] : draft.config.ignored)
    if (!is_in(ignored, camera)) draft.take_away({"ignore", camera});
  for (const auto& [camera, boxes] : ignored)
    if (std::ranges::find(draft.config.ignored, std::pair(camera, boxes)) == draft.config.ignored.end())
      draft.give({"ignore", camera});
  draft.config.ignored = std::move(ignored);
}

// All values of a configuration, independent of the order of cameras in its files.
std::string all_of(ServiceConfig config) {
  for (auto& target : config.targets)
    std::ranges::sort(target.camera_colors, {}, [](const auto& entry) { return entry.first; });
  std::ranges::sort(config.ignored, {}, [](const auto& entry) { return entry.first; });
  return to_yaml(config);
}

std::runtime_error cannot_write(const fs::path& file) {
  return std::runtime_error(fmt::format("cannot write {}: {}", file.string(), std::strerror(errno)));
}

// Writes to disk with the permissions of `like`. throws before `file` is changed.
void write_all(const fs::path& fresh, const std::string& text, const fs::path& like, const fs::path& file) {
  struct stat rights {};
  if (::stat(like.c_str(), &rights) != 0) throw cannot_write(file);
  const capture::FileDescriptor to(
      ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, rights.st_mode & 07777));
  if (to.get() < 0) throw cannot_write(file);
  if (files::write_all(to.get(), text) < text.size()) throw cannot_write(file);
  if (::fchmod(to.get(), rights.st_mode & 07777) != 0) throw cannot_write(file);
  // Only root may change the owner.
  if (::geteuid() == 0 && ::fchown(to.get(), rights.st_uid, rights.st_gid) != 0) throw cannot_write(file);
  if (::fsync(to.get()) != 0) throw cannot_write(file);  // before the rename, so that a power cut leaves no empty file
}

// Earlier versions, the newest first: <file>.before, .before.2, ...
class FileStack {
 public:
  FileStack(const fs::path& file, const char* suffix) : name_(file.string() + suffix) {}

  int size() const {
    int n = 0;
    while (n < most && fs::exists(at(n))) ++n;
    return n;
  }
  // Shifts the versions and returns the name for the newest. Deletes the oldest if there are too many.
  fs::path push() const {
    for (int n = std::min(size(), most - 1); n > 0; --n) fs::rename(at(n - 1), at(n));
    return at(0);
  }
  void pop_into(const fs::path& file) const {
    const int before = size();
    fs::rename(at(0), file);
    for (int n = 1; n < before; ++n) fs::rename(at(n), at(n - 1));
  }
  fs::path newest() const { return at(0); }
  void clear() const {
    std::error_code none;
    for (int n = size(); n-- > 0;) fs::remove(at(n), none);
  }

 private:
  static constexpr int most = 20;
  fs::path at(int n) const { return n == 0 ? name_ : name_ + "." + std::to_string(n + 1); }
  std::string name_;
};
FileStack before(const fs::path& file) {
  return {file, ".before"};
}
FileStack undone(const fs::path& file) {
  return {file, ".undone"};
}

void keep(const fs::path& file) {
  undone(file).clear();
  // There was no file before: the save is undone to nothing.
  if (!fs::exists(file)) return before(file).clear();
  const fs::path kept = before(file).push();
  std::error_code error;
  fs::copy_file(file, kept, fs::copy_options::overwrite_existing, error);
  if (error) throw std::runtime_error(fmt::format("cannot write {}: {}", kept.string(), error.message()));
}

void replace(const fs::path& file, const std::string& text, const fs::path& config) {
  const fs::path fresh = file.parent_path() / fmt::format(".{}-{}", file.filename().string(), ::getpid());
  try {
    write_all(fresh, text, fs::exists(file) ? file : config, file);
    keep(file);
    if (::rename(fresh.c_str(), file.c_str()) != 0) throw cannot_write(file);
  } catch (const std::runtime_error&) {
    std::error_code not_begun;
    fs::remove(fresh, not_begun);
    throw;
  }
}

constexpr std::string_view change_prefix = "# Last change: ";

// Of a version that save() has written; empty: another file, or none.
std::string change_of(const fs::path& version) {
  std::ifstream in(version);
  for (std::string line; std::getline(in, line) && line.starts_with('#');)
    if (line.starts_with(change_prefix)) return files::printable(line.substr(change_prefix.size()));
  return "";
}

// what: the change in words, in one line.
fs::path save(const fs::path& config_file, const std::string& what, const std::function<void(Draft&)>& change) {
  const fs::path file = taught_file(config_file);
  Draft draft{.config = load_service_config(config_file), .written = yaml::YamlReader::file(config_file).leaves()};
  change(draft);
  const std::string name = fs::weakly_canonical(config_file).filename().string();
  const std::string text = fmt::format(
      "# What huetrackd was taught. It replaces the values of {0} for the same keys; null removes a key.\n"
      "# `huetrackd check {0}` shows which values come from here.\n"
      "# Written by `huetrackd teach` and by the page, every time as a whole: comments of yours would be lost. Delete "
      "a key\n"
      "# to have it as {0} says, or delete this file; then reload (SIGHUP).\n"
      "{1}{2}\n"
      "{3}",
      name, change_prefix, what, to_taught_yaml(draft.config));
  std::string why_not;
  try {
    if (all_of(load_service_config(config_file, text)) != all_of(draft.config))
      why_not = "the new file would not have the intended values";
  } catch (const files::ConfigError& error) {  // for example too many rectangles
    why_not = error.what();
  }
  if (!why_not.empty()) throw std::runtime_error(fmt::format("{} was not changed: {}", file.string(), why_not));
  replace(file, text, config_file);
  return file;
}

}  // namespace

fs::path save_taught(const fs::path& config, const object_tracking::TargetOptions& target,
                     const std::optional<object_tracking::IgnoredRegions>& ignored, std::optional<double> radius_m) {
  const std::string what = fmt::format("colour{}{} of {}", radius_m ? " and radius" : "",
                                       ignored ? " and ignored rectangles" : "", target.name);
  return save(config, what, [&](Draft& draft) {
    set_color(draft, target);
    if (radius_m) set_radius(draft, target.name, *radius_m);
    if (ignored) set_ignored(draft, *ignored);
  });
}

fs::path undo_taught(const fs::path& config) {
  const fs::path file = taught_file(config);
  const bool has_older = before(file).size() > 0;
  if (!fs::exists(file) && !has_older)
    throw std::runtime_error(fmt::format("{}: there is nothing to undo", config.string()));
  if (fs::exists(file)) fs::rename(file, undone(file).push());
  if (has_older) before(file).pop_into(file);
  return file;
}

fs::path redo_taught(const fs::path& config) {
  const fs::path file = taught_file(config);
  if (undone(file).size() == 0) throw std::runtime_error(fmt::format("{}: there is nothing to redo", config.string()));
  if (fs::exists(file)) fs::rename(file, before(file).push());
  undone(file).pop_into(file);
  return file;
}

TaughtHistory taught_history(const fs::path& config) {
  const fs::path file = taught_file(config);
  return {.undoable = before(file).size() + (fs::exists(file) ? 1 : 0),
          .redoable = undone(file).size(),
          .undoes = change_of(file),
          .redoes = change_of(undone(file).newest())};
}

namespace {

using Targets = std::vector<object_tracking::TargetOptions>;

Targets::iterator find_target(Targets& targets, const std::string& name) {
  return std::ranges::find(targets, name, &object_tracking::TargetOptions::name);
}

// throws std::runtime_error
Targets::iterator target_in(Draft& draft, const std::string& name) {
  const auto target = find_target(draft.config.targets, name);
  if (target == draft.config.targets.end())
    throw std::runtime_error(fmt::format("there is no target {} in {}", name, draft.config.file.string()));
  return target;
}

// Names are part of topic names; at most a hundred targets.
void refuse_name(Draft& draft, const std::string& name) {
  if (find_target(draft.config.targets, name) != draft.config.targets.end())
    throw std::runtime_error(fmt::format("there already is a target {}", name));
  publish::EstimatePublisherOptions published = draft.config.dds.publisher;
  published.targets.push_back(name);
  published.counts.push_back(1);
  if (const auto problems = published.problems(); !problems.empty()) throw std::runtime_error(problems.front());
}

HsiRange edited(HsiRange range, const TargetEdit& edit) {
  if (range == untaught_color) range = {};
  if (edit.hue_deg) std::tie(range.hue_min_deg, range.hue_max_deg) = *edit.hue_deg;
  if (edit.saturation) std::tie(range.saturation_min, range.saturation_max) = *edit.saturation;
  if (edit.intensity) std::tie(range.intensity_min, range.intensity_max) = *edit.intensity;
  return range;
}

void set_target(Draft& draft, const TargetEdit& edit) {
  const auto target = target_in(draft, edit.target);
  if (edit.radius_m) {
    target->radius_m = *edit.radius_m;
    target->is_radius_assumed = false;
    draft.give({"targets", edit.target, "radius_m"});
  }
  if (!edit.hue_deg && !edit.saturation && !edit.intensity) return;
  object_tracking::TargetOptions taught = *target;
  if (edit.camera.empty()) {
    taught.color = edited(target->color, edit);
    taught.camera_colors.clear();
  } else {
    if (!draft.config.rig.index_of(edit.camera))
      throw std::runtime_error(fmt::format("there is no camera {}", edit.camera));
    const HsiRange own = edited(target->color_in(edit.camera), edit);
    const auto old = std::ranges::find_if(taught.camera_colors, [&](const auto& c) { return c.first == edit.camera; });
    if (old == taught.camera_colors.end()) {
      taught.camera_colors.emplace_back(edit.camera, own);
    } else {
      old->second = own;
    }
  }
  set_color(draft, taught);
}

// From now on the taught file has all values of the target. They replace a removed target of the same name in the
// configuration completely.
void give_whole(Draft& draft, const object_tracking::TargetOptions& target) {
  const yaml::KeyPath path = {"targets", target.name};
  const auto place = [&](const object_tracking::TargetOptions& one) {
    return std::ranges::find_if(draft.written,
                                [&](const auto& leaf) {
                                  return is_below(leaf.path, {"targets", one.name});
                                }) -
           draft.written.begin();
  };
  std::ranges::stable_sort(draft.config.targets, {}, place);
  const auto give = [&](std::initializer_list<const char*> keys) {
    yaml::KeyPath key = path;
    for (const char* part : keys) key.emplace_back(part);
    draft.give(key);
  };
  if (!target.is_radius_assumed) give({"radius_m"});
  for (const char* key : {"shape", "count"}) give({key});
  if (target.color != untaught_color)
    for (const char* key : {"hue_deg", "saturation", "intensity", "adapt"}) give({"color", key});
  for (const auto& [camera, range] : target.camera_colors)
    for (const char* key : {"hue_deg", "saturation", "intensity"}) give({"camera_colors", camera.c_str(), key});
  for (const auto& leaf : draft.written) {
    if (!is_below(leaf.path, path) || draft.config.taught.given.contains(leaf.path)) continue;
    yaml::KeyPath gone = leaf.path;
    if (gone.size() > 4 && gone[2] == "camera_colors") {  // a camera without its own colour, completely
      const auto is_its = [&](const auto& own) { return own.first == gone[3]; };
      if (std::ranges::none_of(target.camera_colors, is_its)) gone.resize(4);
    }
    draft.config.taught.removed.insert(gone);
  }
}

}  // namespace

fs::path save_target(const fs::path& config, const TargetEdit& edit) {
  const bool is_color = edit.hue_deg || edit.saturation || edit.intensity;
  const std::string what = fmt::format("{} of {}{}",
                                       !is_color       ? "radius"
                                       : edit.radius_m ? "colour and radius"
                                                       : "colour",
                                       edit.target, edit.camera.empty() ? "" : " in " + edit.camera);
  return save(config, what, [&](Draft& draft) { set_target(draft, edit); });
}

fs::path add_target(const fs::path& config, const TargetEdit& edit) {
  return save(config, "new target " + edit.target, [&](Draft& draft) {
    refuse_name(draft, edit.target);
    object_tracking::TargetOptions fresh;
    fresh.name = edit.target;
    fresh.is_radius_assumed = true;
    fresh.color = untaught_color;
    fresh.ignored = draft.config.ignored;
    draft.config.targets.push_back(fresh);
    give_whole(draft, fresh);
    set_target(draft, edit);
  });
}

fs::path rename_target(const fs::path& config, const std::string& from, const std::string& to) {
  return save(config, fmt::format("renaming of {} to {}", from, to), [&](Draft& draft) {
    object_tracking::TargetOptions target = *target_in(draft, from);
    refuse_name(draft, to);
    draft.config.targets.erase(find_target(draft.config.targets, from));
    draft.take_away({"targets", from});
    target.name = to;
    draft.config.targets.push_back(target);
    give_whole(draft, target);
  });
}

fs::path remove_target(const fs::path& config, const std::string& target) {
  return save(config, "removal of " + target, [&](Draft& draft) {
    draft.config.targets.erase(target_in(draft, target));
    draft.take_away({"targets", target});
  });
}

fs::path save_rig(const fs::path& config, const fs::path& rig, const std::optional<CalibratedBy>& by) {
  return save(config, "calibration", [&](Draft& draft) {
    const bool was_calibrated = draft.config.is_calibrated();
    draft.config.rig_file = rig;
    draft.give({"rig"});
    const auto waved = by ? find_target(draft.config.targets, by->target) : draft.config.targets.end();
    if (waved != draft.config.targets.end() && waved->is_radius_assumed && by->radius_m)
      set_radius(draft, by->target, *by->radius_m);
    const yaml::KeyPath min = {"object_tracking", "volume", "min"}, max = {"object_tracking", "volume", "max"};
    if (was_calibrated || draft.is_said(min) || draft.is_said(max)) return;
    const auto box = box_seen_by_two(calib::read_rig(rig), by ? by->middle : Eigen::Vector3d(0, 0, 0));
    if (!box) return;
    draft.config.object_tracking.volume = *box;
    draft.give(min);
    draft.give(max);
  });
}

std::optional<object_tracking::Volume> box_seen_by_two(const calib::CameraRig& rig, const Eigen::Vector3d& middle) {
  constexpr double reach = 1.5;  // times the cameras' mean distance from the middle
  constexpr int steps = 32;      // along each axis of a cube
  double distance_m = 0;
  for (const calib::Camera& camera : rig.cameras)
    distance_m += (camera.centre() - middle).norm() / double(rig.cameras.size());
  const double half_m = reach * distance_m, step_m = 2 * half_m / steps;
  constexpr double none = std::numeric_limits<double>::infinity();
  object_tracking::Volume box{Eigen::Vector3d::Constant(none), Eigen::Vector3d::Constant(-none)};
  for (int i = 0; i < steps * steps * steps; ++i) {
    const Eigen::Array3d cell = Eigen::Array3i(i % steps, i / steps % steps, i / (steps * steps)).cast<double>();
    const Eigen::Vector3d p = middle + Eigen::Vector3d((cell + 0.5) * step_m - half_m);
    const auto views = std::ranges::count_if(rig.cameras, [&](const calib::Camera& camera) {
      const auto pixel = camera.project_world(p);
      return pixel && camera.contains(*pixel) && (p - camera.centre()).norm() < half_m;
    });
    if (views < 2) continue;
    box.min = box.min.cwiseMin(p);
    box.max = box.max.cwiseMax(p);
  }
  if (!(box.min.array() < box.max.array()).all()) return std::nullopt;
  constexpr double per_m = 100;  // centimetres
  box.min = ((box.min.array() - step_m / 2) * per_m).floor() / per_m;
  box.max = ((box.max.array() + step_m / 2) * per_m).ceil() / per_m;
  return box;
}

fs::path save_controls(const fs::path& config, const std::string& camera,
                       std::span<const capture::ControlSetting> settings) {
  return save(config, "controls of " + camera, [&](Draft& draft) {
    const auto live = std::ranges::find(draft.config.cameras, camera, &LiveCameraConfig::name);
    if (live == draft.config.cameras.end())
      throw std::runtime_error(fmt::format("{} has no live camera {}", draft.config.file.string(), camera));
    for (const capture::ControlSetting& setting : settings) {
      const auto old = std::ranges::find(live->controls, setting.name, &capture::ControlSetting::name);
      if (old == live->controls.end()) {
        live->controls.push_back(setting);
      } else {
        old->value = setting.value;
      }
      draft.give({"cameras", camera, "controls", setting.name});
    }
  });
}

fs::path save_ignored(const fs::path& config, const object_tracking::IgnoredRegions& ignored) {
  return save(config, "ignored rectangles", [&](Draft& draft) { set_ignored(draft, ignored); });
}

}  // namespace huetrack::config
