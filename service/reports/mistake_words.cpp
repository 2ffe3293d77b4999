#include "reports/mistake_words.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <numbers>

#include "reports/radius_advice.h"

namespace huetrack::reports {
namespace {

constexpr double error_of_a_period = 0.25;  // of a lateness: some ms at usual rates

// "a, b and c"
std::string listed(const std::vector<std::string>& names) {
  if (names.size() < 3) return fmt::format("{}", fmt::join(names, " and "));
  return fmt::format("{} and {}", fmt::join(names.begin(), names.end() - 1, ", "), names.back());
}

// How times that vary are mended.
std::string even_times_advice(bool is_recorded) {
  return is_recorded ? "give every frame its own time (recording.yaml: timestamps), or use cameras whose driver stamps "
                       "the frames"
                     : "use cameras whose driver stamps the frames, or record, and give every frame its own time";
}

}  // namespace

std::string mistake_text(const view_watch::Mistake& mistake, const object_tracking::TargetOptions& target,
                         const std::vector<std::string>& cameras, bool is_recorded, bool are_times_in_doubt) {
  using view_watch::MistakeKind;
  std::vector<std::string> names;
  for (const int c : mistake.cameras) names.push_back(cameras.at(std::size_t(c)));
  const std::string which = listed(names);
  const bool is_either = names.size() == 2;  // the views do not show which of the two is wrong
  const std::string disagrees = is_either
                                    ? fmt::format("{} disagree by {:.0f} px", which, mistake.off_px)
                                    : fmt::format("{} disagrees with the others by {:.0f} px", which, mistake.off_px);
  const std::string it = is_either ? "one of them" : "it";
  const auto unless_by_times = [&](const char* advice) {
    return are_times_in_doubt ? "first correct the time stamps, as the other warnings say" : advice;
  };
  const char* const latency = is_recorded ? "timing.latency_s" : "latency_offset_s";  // a live camera's key
  switch (mistake.kind) {
    case MistakeKind::swapped:
      return fmt::format(
          "{} look swapped: their views are {:.0f} px apart, and agree if their frames are exchanged: exchange their "
          "{}, or calibrate again",
          which, mistake.off_px, is_recorded ? "videos" : "devices");
    case MistakeKind::late: {
      const double periods = std::abs(mistake.size) * mistake.shown_hz;
      const std::string row =
          is_recorded && std::abs(periods - 1) < error_of_a_period
              ? "; that is one frame: has its table of times a row too many or too few (a header that was counted)?"
              : "";
      if (mistake.off_px == 0)
        return fmt::format(
            "{} is about {:.2f} s {}, as the motion of {} shows; the tracker compensates for it: correct the time "
            "stamps or {}{}",
            is_either ? "one of " + which : which, std::abs(mistake.size),
            is_either || mistake.size > 0 ? "late" : "early", target.name, latency, row);
      return fmt::format(
          "{}, and by more the faster {} moves: {} is about {:.2f} s {}: correct its time stamps or {}{}", disagrees,
          target.name, it, std::abs(mistake.size), mistake.size > 0 ? "late" : "early", latency, row);
    }
    case MistakeKind::uneven_times:
      return fmt::format(
          "the time stamps of {} are wrong{}, by varying amounts, as the motion of {} shows: frames were dropped "
          "and not counted, {}or a network delays them: {}",
          which, mistake.is_size_known() ? fmt::format(" by up to {:.2f} s", mistake.size) : "", target.name,
          is_recorded ? "videos did not start together, " : "", even_times_advice(is_recorded));
    case MistakeKind::turned:
      return fmt::format(
          "{} wherever {} is: {} looks turned by {:.1f} degrees since it was calibrated{}: {}", disagrees, target.name,
          it, mistake.size * 180 / std::numbers::pi,
          mistake.zoom == 1 ? "" : fmt::format(", or its focal length is {:.2f} times the rig's (zoom)", mistake.zoom),
          "fasten it and calibrate again");
    case MistakeKind::zoomed:
      return fmt::format(
          "{}, and by more the farther {} is from the image centre: its focal length looks {:.2f} times the rig's "
          "(zoom, focus, another lens or crop): {}",
          disagrees, target.name, mistake.size, "restore it, or calibrate it again");
    case MistakeKind::mirrored:
      if (is_either)
        return fmt::format(
            "{}, and agree if left and right of one of them are exchanged: the pictures of one look mirrored, and two "
            "cameras do not show whose: switch that off in the camera or in the program that recorded it",
            disagrees);
      return fmt::format(
          "{}, and agrees if left and right are exchanged: its pictures look mirrored: switch that off in the camera "
          "or in the program that recorded it",
          disagrees);
    case MistakeKind::upside_down:
      return fmt::format(
          "{}, and agree{} if {} pictures are turned by 180 degrees: the camera, a program or a rotation tag turns "
          "them, and did not when the rig was calibrated: undo that{}, or "
          "calibrate again",
          names.empty() ? fmt::format("the cameras disagree by {:.0f} px", mistake.off_px) : disagrees,
          names.empty() ? "" : "s", names.empty() ? "all" : "its",
          is_recorded ? " (a tag: ffmpeg -i IN -c copy -metadata:s:v rotate=0 OUT)" : "");
    case MistakeKind::other_rig:
      return fmt::format(
          "no two cameras agree on the position of {}, their views are {:.0f} px apart: the rig looks like that of "
          "another room or of other cameras, or the times are far apart: {}",
          target.name, mistake.off_px, unless_by_times("give the right rig, or offset_s, or calibrate again"));
    case MistakeKind::contradiction:
      return fmt::format(
          "the views of {} are up to {:.0f} px apart, and which camera is wrong cannot be determined: {}, and "
          "errors may exceed the covariance where few cameras see it: {}",
          target.name, mistake.off_px,
          are_times_in_doubt ? "time stamps are in doubt" : "the rig does not fit the cameras",
          unless_by_times("calibrate again"));
    case MistakeKind::wrong_order:
      return fmt::format(
          "{} jumps by up to {:.1f} m from one frame set to the next in all views at once, {} times within seconds, "
          "and moves smoothly in between: the pictures are probably not in the order in which they were taken: check "
          "{}",
          target.name, mistake.size, mistake.jumps,
          is_recorded ? "the names of image files, or what made the videos" : "what sends them");
    case MistakeKind::converted: {
      const double repeats = mistake.shown_hz / mistake.source_hz;
      const bool is_whole = std::abs(repeats - std::round(repeats)) < 0.1 && repeats > 1.5;
      return fmt::format(
          "{}'s film looks converted from about {:.0f} to {:.4g} pictures a second, as the path of {} shows: {}, so "
          "its times are off by {:.0f} ms (1 sigma): {}",
          which, mistake.source_hz, mistake.shown_hz, target.name,
          repeats > 1 ? "pictures are shown repeatedly" : "pictures were dropped at regular places", 1e3 * mistake.size,
          !is_recorded ? "let the camera send each picture that it takes, once"
          : is_whole   ? fmt::format("play every: {:.0f} pictures (recording.yaml), or give the film as the camera "
                                       "recorded it",
                                     std::round(repeats))
                       : "give the film as the camera recorded it");
    }
    case MistakeKind::exchanged:
      return fmt::format(
          "every two pictures of {} are shown in the wrong order, as the path of {} shows, as by a program that took "
          "the wrong field for the first one (deinterlacing): {}",
          which, target.name,
          is_recorded ? "convert the film again with the other field order"
                      : "let what sends them use the other field order");
    case MistakeKind::delayed:
      return fmt::format(
          "the times of {}'s pictures vary by {:.0f} ms (1 sigma), but the path of {} is smooth at even ones: they are "
          "those at which the pictures arrived: {}",
          which, 1e3 * mistake.size, target.name,
          is_recorded ? fmt::format("give fps (about {:.3g}) instead of timestamps", mistake.shown_hz)
                      : "use a camera whose driver stamps its frames");
    case MistakeKind::radius:
      return radius_advice(mistake.range_m, target);
    case MistakeKind::shared_color:
      return fmt::format(
          "the colour of {} covers {:.0f} % of {}'s picture, far more than the object can: narrow the colour, or "
          "ignore what shares it",
          target.name, 100 * mistake.size, which);
  }
  return {};
}

}  // namespace huetrack::reports
