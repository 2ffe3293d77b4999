#include "reports/mistake_words.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <numbers>

#include "reports/search_advice.h"

namespace huetrack::reports {

std::string mistake_text(const view_watch::Mistake& mistake, const object_tracking::TargetOptions& target,
                         const std::vector<std::string>& cameras) {
  using view_watch::MistakeKind;
  std::vector<std::string> names;
  for (const int c : mistake.cameras) names.push_back(cameras.at(std::size_t(c)));
  const std::string who = fmt::format("{}", fmt::join(names, " and "));
  // One of two cameras, and nobody can tell which.
  const bool is_either = names.size() == 2;
  const std::string disagrees = is_either
                                    ? fmt::format("{} disagree by {:.0f} px", who, mistake.off_px)
                                    : fmt::format("{} disagrees with the others by {:.0f} px", who, mistake.off_px);
  const std::string it = is_either ? "one of them" : "it";
  switch (mistake.kind) {
    case MistakeKind::swapped:
      return fmt::format(
          "{} look swapped: as they are, the views are {:.0f} px apart, and with their frames exchanged they agree: "
          "exchange their videos or devices, or calibrate anew",
          who, mistake.off_px);
    case MistakeKind::late:
      if (mistake.off_px == 0)
        return fmt::format(
            "{} is some {:.2f} s {} by its time stamps, as the motion of {} shows, by which it is allowed for: correct "
            "the time stamps or timing.latency_s",
            is_either ? "one of " + who : who, std::abs(mistake.size), is_either || mistake.size > 0 ? "late" : "early",
            target.name);
      return fmt::format(
          "{} and by more the faster {} moves: {} is some {:.2f} s {}: correct its time stamps or its "
          "timing.latency_s",
          disagrees, target.name, it, std::abs(mistake.size), mistake.size > 0 ? "late" : "early");
    case MistakeKind::uneven_times:
      return fmt::format(
          "the pictures of {} do not come when their time stamps say, by up to {:.2f} s and not always by as much, as "
          "the motion of {} shows: frames were dropped and not counted, videos did not begin at one moment, or a "
          "network "
          "delays them: give every frame its own time (recording.yaml: timestamps), or take cameras whose driver "
          "stamps "
          "their frames",
          who, mistake.size, target.name);
    case MistakeKind::turned:
      return fmt::format(
          "{} wherever {} is: {} looks turned by {:.1f} degrees since it was calibrated{}: fix it, and calibrate anew",
          disagrees, target.name, it, mistake.size * 180 / std::numbers::pi,
          mistake.zoom == 1 ? "" : fmt::format(", or its focal length is {:.2f} times the rig's (zoom)", mistake.zoom));
    case MistakeKind::zoomed:
      return fmt::format(
          "{}, and by more the further from the middle of its picture {} is: its focal length looks {:.2f} times the "
          "rig's (zoom, focus, another lens or crop): set it as it was calibrated, or calibrate it anew",
          disagrees, target.name, mistake.size);
    case MistakeKind::mirrored:
      return fmt::format(
          "{}, and agrees with left and right exchanged: its pictures look mirrored: switch that off in the camera or "
          "the program that recorded it",
          disagrees);
    case MistakeKind::other_rig:
      return fmt::format(
          "no two cameras agree about where {} is, they are {:.0f} px apart: the rig looks like that of another room "
          "or "
          "of other cameras",
          target.name, mistake.off_px);
    case MistakeKind::contradiction:
      return fmt::format(
          "the views of {} are up to {:.0f} px apart, and which camera is wrong cannot be told from them: the rig does "
          "not fit the cameras as they stand. Positions are as unsure as is said, and may be off further where few see "
          "it: calibrate anew",
          target.name, mistake.off_px);
    case MistakeKind::radius:
      if (mistake.is_of_outlines)
        return fmt::format(
            "the outlines of {} say in every view that it has a radius of {:.3f} m, or a few per cent more where it is "
            "a "
            "few pixels large, not of {:.3g}: measure it, and correct radius_m",
            target.name, mistake.size, target.radius_m);
      return fmt::format(
          "the views of {} agree that it has a radius of about {:.2g} m, a quarter less where it is a few pixels large "
          "(blur), not of {:.3g}: measure it, and correct radius_m; or, if it is right, the colour is too wide or too "
          "narrow",
          target.name, mistake.size, target.radius_m);
    case MistakeKind::shared_color:
      return fmt::format(
          "the colour of {} covers {:.0f} % of {}'s picture, far more than it could itself: narrow its colour, or "
          "ignore "
          "what shares it",
          target.name, 100 * mistake.size, who);
    case MistakeKind::opencv_hue: {
      objects::SearchFindings findings;
      findings.is_found_at_twice_the_hue = true;
      return fmt::format("{}: {}", target.name, search_advice(findings, target, cameras));
    }
  }
  return {};
}

}  // namespace huetrack::reports
