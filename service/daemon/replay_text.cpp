#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "calib/files/text_file.h"
#include "daemon/replay.h"
#include "reports/search_advice.h"
#include "view_watch/view_watch.h"

namespace huetrack::daemon {
namespace {

std::string shown(const std::filesystem::path& file) {
  return files::printable(file.string(), files::longest_message);
}

std::string times_real_time(double recorded_s, double busy_s) {
  const double faster = busy_s > 0 ? recorded_s / busy_s : 0;
  return faster < 10 ? fmt::format("{:.1f}x", faster) : fmt::format("{:.0f}x", faster);
}

std::string frames_text(const ReplaySummary& s) {
  std::uint64_t frames = 0, repeated = 0;
  for (const auto& camera : s.figures.cameras) frames += camera.frames + camera.corrupted, repeated += camera.repeated;
  const auto& sets = s.figures.frame_sets;
  std::string text =
      fmt::format("{}{} frame sets of {} frames: {:.3f} s of recording in {:.3f} s, {:.1f}x real time{}\n",
                  s.stopped ? "stopped: " : "", s.figures.sets_tracked, frames, s.recorded_s, s.wall_s,
                  s.wall_s > 0 ? s.recorded_s / s.wall_s : 0,
                  s.held_s > 0 ? fmt::format("; paused for {:.1f} s in addition", s.held_s) : "");
  text += fmt::format("  frames  {} missing, {} corrupted, {} late; {} sets without every camera\n", s.missing_frames,
                      s.corrupted_frames, sets.late_frames, sets.incomplete_sets);
  if (repeated > 0)
    text += fmt::format("          {} repeat their camera's previous picture and were not used\n", repeated);
  for (const auto& sentence : s.ended_early) text += "          " + sentence + "\n";
  return text;
}

// "track 0.120 (0.118)": wall clock (processor) seconds.
std::string stage_text(const char* stage, const pipeline::StageTime& time) {
  return fmt::format("{} {:.3f} ({:.3f})", stage, capture::seconds(time.wall), capture::seconds(time.cpu));
}

std::string times_text(const ReplaySummary& s) {
  const auto& f = s.figures;
  std::string text = fmt::format("  time    decode {:.3f} s (CPU {:.3f}), {}, {}, {}", capture::seconds(f.decode.wall),
                                 capture::seconds(f.decode.cpu), stage_text("synchronise", f.synchronise),
                                 stage_text("track", f.track), stage_text("publish and write", f.publish));
  if (f.watch.wall.count() > 0) text += ", " + stage_text("watch the calibration", f.watch);
  if (s.camera) text += ", " + stage_text("camera", f.camera_track);
  if (s.pictures > 0) text += ", " + stage_text("draw", f.draw);
  // The camera's thread runs in parallel: the sum is what one core would need.
  const double own_s =
      capture::seconds(f.synchronise.wall + f.watch.wall + f.track.wall + f.camera_track.wall + f.publish.wall);
  text += fmt::format("\n          without decoding{}: {} real time", s.pictures > 0 ? " and drawing" : "",
                      times_real_time(s.recorded_s, own_s));
  if (!s.targets.empty()) {
    const double first_s = capture::seconds(f.track_first.wall);
    text += fmt::format("; also without the first set ({:.3f} s, colour tables): {}", first_s,
                        times_real_time(s.recorded_s, own_s - first_s));
  }
  return text + "\n";
}

// " tracking 95.0 % lost 5.0 %"
template <typename State>
std::string shares_text(const std::map<State, std::uint64_t>& counts) {
  std::uint64_t all = 0;
  for (const auto& [_, count] : counts) all += count;
  std::string text;
  for (const auto& [state, count] : counts)
    text += fmt::format(" {} {:.1f} %", name(state), 100.0 * double(count) / double(all));
  return text;
}

std::string target_text(const TargetSummary& target) {
  std::string text = fmt::format("  {:<7} ", target.name);
  text += target.first_tracking_set
              ? fmt::format("tracking from set {} on ({:.3f} s);", *target.first_tracking_set, target.first_tracking_s)
              : "never tracking;";
  text += shares_text(target.sets) + "\n";
  if (!target.color.empty()) text += "          " + target.color + "\n";
  if (target.objects > 0)
    text += fmt::format("          objects found: {}, at most {} at once\n", target.objects, target.most_objects);
  if (target.outlines.radius_m) {
    const auto [least_m, largest_m] = view_watch::radius_range(target.outlines, target.radius_m);
    text += fmt::format("          radius by its outlines: {:.1f} mm; blur, shade and hands leave {:.0f} to {:.0f}\n",
                        1e3 * *target.outlines.radius_m, 1e3 * least_m, 1e3 * largest_m);
  }
  if (!target.unset_radius.empty()) text += "          " + target.unset_radius + "\n";
  if (target.truth) text += "          " + tracks::to_text(*target.truth) + "\n";
  if (target.objects_truth) text += "          " + tracks::to_text(*target.objects_truth) + "\n";
  if (target.explanation) text += "          " + truth::to_text(*target.explanation, {}) + "\n";
  return text;
}

std::string camera_text(const CameraSummary& camera, const pipeline::PipelineFigures& f) {
  std::uint64_t all = 0;
  for (const auto& [_, count] : camera.frames) all += count;
  const auto& why = f.tracked_camera.why;
  std::string text = fmt::format("  {:<7} ", camera.name);
  if (camera.first_pose_frame) {
    text += fmt::format("pose from frame {} on;", *camera.first_pose_frame);
  } else {
    text += why.empty() ? "never a pose;" : "never a pose: " + why + "\n         ";
  }
  const auto ms_per_frame = [all](capture::Duration time) {
    return all > 0 ? 1e3 * capture::seconds(time) / double(all) : 0;
  };
  text += shares_text(camera.frames);
  text += fmt::format("; {:.2f} ms per frame (CPU {:.2f})\n", ms_per_frame(f.camera_track.wall),
                      ms_per_frame(f.camera_track.cpu));
  if (const std::string readout = pipeline::readout_text(f.tracked_camera); !readout.empty())
    text += "          " + readout + "\n";
  if (camera.first_pose_frame && f.tracked_camera.without_since)
    text += fmt::format("          lost at the end{}{}\n", why.empty() ? "" : ": ", why);
  return text;
}

std::string bus_text(const ReplaySummary& s) {
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  const std::int64_t ns = s.clock_offset.count();
  return fmt::format(
      "  bus     {} samples, {} failures; {}\n"
      "          published capture times are the recording's plus {}.{:09} s\n",
      s.published, s.publish_failures, s.bus, ns / ns_per_s, std::abs(ns % ns_per_s));
}

}  // namespace

std::string to_text(const ReplaySummary& s, const ReplayCommand& command) {
  std::string text = frames_text(s) + times_text(s);
  for (const auto& target : s.targets) text += target_text(target);
  if (s.camera) text += camera_text(*s.camera, s.figures);
  for (const auto& sentence : s.times) text += "  times   " + sentence + "\n";
  if (!command.poses.empty()) text += "  poses   " + shown(command.poses) + "\n";
  if (!command.tracks.empty()) text += "  tracks  " + shown(command.tracks) + "\n";
  if (s.pictures > 0) text += fmt::format("  pictures {} in {}\n", s.pictures, shown(command.pictures));
  if (!s.bus.empty()) text += bus_text(s);
  return text + problems_text(s);
}

bool has_trouble(const ReplaySummary& s) {
  const auto is_hardly_tracked = [](const TargetSummary& target) {
    return !target.first_tracking_set || target.is_seen_in_vain;
  };
  return !s.mistakes.empty() || s.has_camera_trouble || s.has_lost_color ||
         std::ranges::any_of(s.targets, is_hardly_tracked);
}

// The most important explanation is last.
std::string problems_text(const ReplaySummary& s) {
  std::string text;
  for (const auto& sentence : s.light) text += "  light   " + sentence + "\n";
  for (const auto& sentence : s.clutter) text += "  room    " + sentence + "\n";
  for (const auto& sentence : s.calibration) text += "  cameras " + sentence + "\n";
  for (const auto& target : s.targets)
    if (!target.advice.empty()) text += fmt::format("  search  {}: {}\n", target.name, target.advice);
  for (const auto& sentence : s.mistakes) text += "  mistake " + sentence + "\n";
  return text;
}

}  // namespace huetrack::daemon
