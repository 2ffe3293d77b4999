#include "calib/report/rig_check_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "calib/report/sentences.h"

namespace huetrack::report {
namespace {

const std::string& name_in(const calib::CameraRig& rig, int camera) {
  return rig.cameras[static_cast<std::size_t>(camera)].name;
}

Check scale_check(const solver::RigCheck& check) {
  return {Verdict::failed, "scale",
          fmt::format("everything fits ({:.2f} px rms instead of {:.2f}) if all distances between the cameras are "
                      "{:.4f} times those of the rig",
                      check.best_px, check.as_is_px, *check.scale),
          "is the board file of this board (its square's size), and the one that the rig was made with?"};
}

Check names_check(const solver::RigCheck& check, const calib::CameraRig& rig) {
  return {Verdict::failed, "names",
          fmt::format("cameras {} and {} look swapped: with their names exchanged the rig fits",
                      name_in(rig, check.swapped->first), name_in(rig, check.swapped->second)),
          "give each camera's images under its own name (did a reboot exchange the devices?)"};
}

Check mirrored_check(const solver::RigCheck& check, const calib::CameraRig& rig) {
  return {Verdict::failed, "images of " + name_in(rig, *check.mirrored),
          fmt::format("the images of {} are mirrored (left and right swapped): mirrored back, they fit the rig",
                      name_in(rig, *check.mirrored)),
          "switch mirroring off in the camera or its driver, and check again"};
}

// The camera that moved, as far as the views determine it.
std::string who(const solver::RigCheck& check, const calib::CameraRig& rig, const solver::MovedCamera& moved) {
  const std::string& name = name_in(rig, moved.camera);
  if (check.alternatives.empty() || &moved != &check.moved.front()) return name;
  std::vector<std::string> others;
  for (const int other : check.alternatives) others.push_back(name_in(rig, other));
  return fmt::format("{} or {} (these views do not determine which; figures for {})", name,
                     fmt::to_string(fmt::join(others, " or ")), name);
}

Check moved_check(const solver::RigCheck& check, const calib::CameraRig& rig, const solver::MovedCamera& moved) {
  constexpr double deg = 180 / std::numbers::pi;
  constexpr double hardly_visible_px = 0.5;  // more than at best
  const bool is_slight = check.as_is_px < check.best_px + hardly_visible_px;
  return {is_slight ? Verdict::doubtful : Verdict::failed, "pose of " + name_in(rig, moved.camera),
          fmt::format("{}: was moved by {:.1f} mm (+- {:.1f}) and turned by {:.2f} degrees (+- {:.2f}); {:.2f} px rms "
                      "with the rig as it is, {:.2f} px with it moved",
                      who(check, rig, moved), 1000 * moved.moved_m, 1000 * moved.moved_sigma_m, deg * moved.turned_rad,
                      deg * moved.turned_sigma_rad, check.as_is_px, check.with_moved_px),
          "put it back, or take its new pose with --mend OUT.yaml, or calibrate the extrinsics anew"};
}

void add_camera(std::vector<Check>& checks, const solver::RigCheck& check, const calib::CameraRig& rig, std::size_t c) {
  const std::string& name = rig.cameras[c].name;
  if (check.shared_views[c] < solver::RigCheck::enough_views) {
    checks.push_back(
        {Verdict::doubtful, "views of " + name,
         fmt::format("{}: only {} views shared with another camera: too few for a check", name, check.shared_views[c]),
         "show the board to it and a neighbour together, at some ten places"});
    return;
  }
  if (const auto& lens = check.lenses[c]) {
    checks.push_back({Verdict::doubtful, "lens of " + name, contradiction_text(*lens, name),
                      "its focus or zoom was changed, or another camera is in its place: calibrate it anew"});
  }
  const auto moved = std::ranges::find(check.moved, static_cast<int>(c), &solver::MovedCamera::camera);
  if (moved != check.moved.end()) {
    checks.push_back(moved_check(check, rig, *moved));
    return;
  }
  checks.push_back(
      {Verdict::usable,
       "pose of " + name,
       fmt::format("{}: unchanged ({:.2f} px rms, {} shared views)", name, check.rms_px[c], check.shared_views[c]),
       {}});
}

}  // namespace

RigCheckReport report_on(const solver::RigCheck& check, const calib::CameraRig& rig, const std::string& board_doubt) {
  RigCheckReport report;
  if (!board_doubt.empty())
    report.checks.push_back({Verdict::doubtful, "board file", board_doubt, "measure the board, and correct its file"});
  if (check.scale) {
    report.checks.push_back(scale_check(check));
  } else if (check.swapped) {
    report.checks.push_back(names_check(check, rig));
  } else if (check.mirrored) {
    report.checks.push_back(mirrored_check(check, rig));
  } else {
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) add_camera(report.checks, check, rig, c);
  }
  std::ranges::stable_sort(report.checks, std::greater<>{}, &Check::verdict);
  report.verdict = report.checks.front().verdict;
  return report;
}

std::string to_text(const RigCheckReport& report, const solver::RigCheck& check) {
  std::string out = report.verdict == Verdict::usable     ? "The rig FITS.\n"
                    : report.verdict == Verdict::doubtful ? "DOUBTFUL.\n"
                                                          : "The rig DOES NOT FIT.\n";
  for (const Check& one : report.checks) {
    out += one.verdict == Verdict::usable ? "    " : one.verdict == Verdict::doubtful ? "  ? " : "  ! ";
    out += one.finding + ".\n";
    if (one.verdict != Verdict::usable) out += "    -> " + one.advice + ".\n";
  }
  if (check.mirrored) return out;  // nothing was measured
  return out + fmt::format("{} cameras; corners fit to {:.3f} px rms with the rig as it is, to {:.3f} px at best.\n",
                           check.rms_px.size(), check.as_is_px, check.best_px);
}

}  // namespace huetrack::report
