// huetrack-calibrate accept: replaces a rig by the one that huetrackd mended, and keeps a copy.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>

#include "calib/gather/find_boards.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/outcome.h"

namespace huetrack::program {
namespace {

namespace fs = std::filesystem;

struct AcceptOptions {
  fs::path rig, from;  // from: empty: NAME.mended.yaml beside it
};

constexpr double min_rad = 1e-5, min_m = 1e-5;  // unit: smaller differences are rounding

fs::path beside(const fs::path& rig, const std::string& what) {
  return rig.parent_path() / (rig.stem().string() + what + rig.extension().string());
}

fs::path backup_of(const fs::path& rig) {
  const std::string name = fmt::format(".before-{:%Y%m%dT%H%M%SZ}", fmt::gmtime(std::chrono::system_clock::now()));
  fs::path backup = beside(rig, name);
  for (int i = 2; fs::exists(backup); ++i) backup = beside(rig, fmt::format("{}-{}", name, i));
  return backup;
}

// The differences, one line per camera. throws InputError: other cameras or lenses.
std::string differences(const calib::CameraRig& before, const calib::CameraRig& after, const fs::path& file) {
  if (before.cameras.size() != after.cameras.size())
    throw gather::InputError(file.string() + ": is of another rig: its cameras differ");
  std::string text;
  for (std::size_t c = 0; c < before.cameras.size(); ++c) {
    const calib::Camera &a = before.cameras[c], &b = after.cameras[c];
    if (a.name != b.name || a.image_size != b.image_size)
      throw gather::InputError(file.string() + ": is of another rig: its cameras differ");
    const calib::Rigid3d change = b.cam_from_world * calib::inverse(a.cam_from_world);
    const double turned = calib::log({change.rotation, Eigen::Vector3d::Zero()}).norm();
    const double moved = (b.centre() - a.centre()).norm();
    if (turned > min_rad || moved > min_m)
      text += fmt::format("{}: turned by {:.2f} degrees, moved by {:.1f} mm\n", a.name, turned * 180 / std::numbers::pi,
                          1e3 * moved);
    if (!(a.timing == b.timing)) text += fmt::format("{}: another timing\n", a.name);
  }
  return text;
}

// A mended rig may be older than the latest calibration, which it must not replace.
void require_same_calibration(const calib::CameraRig& before, const calib::CameraRig& after, const AcceptOptions& o,
                              const fs::path& from) {
  const auto when = [](const calib::CameraRig& rig) {
    return rig.made.at ? "the calibration of " + calib::utc_text(*rig.made.at) : std::string("one without a date");
  };
  if (before.made.at != after.made.at)
    throw gather::InputError(fmt::format("{}: was mended from {}, but {} is {}: it is out of date; delete it",
                                         from.string(), when(after), o.rig.string(), when(before)));
}

std::string in_one_line(std::string lines) {
  lines.pop_back();
  for (auto end = lines.find('\n'); end != std::string::npos; end = lines.find('\n', end)) lines.replace(end, 1, "; ");
  return lines;
}

ExitStatus accept(const AcceptOptions& o) {
  const fs::path from = o.from.empty() ? beside(o.rig, ".mended") : o.from;
  if (!fs::exists(from))
    throw gather::InputError(from.string() +
                             ": no such file. huetrackd run writes it with calibration: {watch: mend} after a "
                             "camera was moved, and replay with --write-rig");
  const calib::CameraRig before = calib::read_rig(o.rig);
  calib::CameraRig after = calib::read_rig(from);
  const std::string differs = differences(before, after, from);
  require_same_calibration(before, after, o, from);
  if (differs.empty()) {
    std::printf("no difference: %s is unchanged\n", o.rig.c_str());
    return ExitStatus::usable;
  }
  const fs::path backup = backup_of(o.rig);
  fs::copy_file(o.rig, backup);
  // The checks of the old rig do not apply.
  after.made.add({utc_now(), std::string(calib::mended_verdict), "mended by huetrackd: " + in_one_line(differs)});
  calib::write_rig(after, o.rig);
  if (o.from.empty()) fs::remove(from);
  std::fputs(differs.c_str(), stdout);
  std::printf("%s (previous version: %s)\n", o.rig.c_str(), backup.c_str());
  return ExitStatus::usable;
}

}  // namespace

void add_accept_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<AcceptOptions>();
  CLI::App* command =
      app.add_subcommand("accept", "replace a rig by the one that huetrackd mended; keeps a copy of the old one");
  command->add_option("rig", o->rig, "the rig in use")->required()->check(CLI::ExistingFile);
  command->add_option("--from", o->from,
                      "the mended rig; default: NAME.mended.yaml next to the rig, which is then removed");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token&) { return accept(*o); }; });
}

}  // namespace huetrack::program
