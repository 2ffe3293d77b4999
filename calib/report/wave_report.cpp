#include "calib/report/wave_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <numbers>
#include <sstream>

#include "calib/report/advice.h"

namespace huetrack::report {
namespace {

using wave::WaveCamera;
using wave::WaveResult;
using wave::WaveScale;

constexpr double deg = 180 / std::numbers::pi;

// From here on a figure is doubtful.
constexpr double far_mark_m = 0.03;                    // a tape measure and a hand do better
constexpr double poor_scale = 0.01;                    // relative; a distance of a metre, taped to 5 mm, does better
constexpr double small_ball = 0.65, large_ball = 1.5;  // over its radius; light and blur make less of a difference
constexpr double few_agree = 0.6;                      // of a camera's frames with the colour in them
constexpr double far_from_rig = 0.3;                   // a camera, over the distance of the cameras from the ball
constexpr double far_turned_rad = 0.35;                // 20 degrees
constexpr double little_coverage = 0.15;               // of a camera's image
constexpr double large_rms_px = 1.5;
constexpr double large_error = 0.003;        // of positions, over the distance of the cameras
constexpr double large_difference = 0.006;   // of the halves, over the same distance: with unexpected_difference
constexpr double unexpected_difference = 2;  // times what their covariance says: with large_difference
constexpr double much_wander_s = 0.0015;     // from second to second: with sure_wander
constexpr double sure_wander = 4;            // times what the noise makes of it: with much_wander_s
constexpr double much_scatter_s = 0.003;     // from frame to frame, of stamps that are smoothed
constexpr double unsure_readout_s = 0.003;   // by which a good wave is off
constexpr double unsure_latency_s = 0.004;   // with the poses held; a good wave tells it to 1 ms
constexpr double many_repeated = 0.2, some_repeated = 0.03;  // of the fast frames

std::string scale_text(const WaveResult& result) {
  const WaveScale& scale = result.scale;
  const auto name = [&](int c) { return result.rig.cameras[static_cast<std::size_t>(c)].name; };
  switch (scale.source) {
    case WaveScale::Source::camera_distance:
      return fmt::format("the distance between {} and {}, {:.3f} m", name(scale.a), name(scale.b), scale.measured_m);
    case WaveScale::Source::rest_distance:
      return fmt::format("the distance between the two places where the ball rested, {:.3f} m", scale.measured_m);
    case WaveScale::Source::marks:
      return fmt::format("{} marked points", scale.marks);
    case WaveScale::Source::rig_poses:
      return "the rig's own poses";
    case WaveScale::Source::ball_size:
      break;
  }
  return "the ball's radius, roughly";
}

void doubt_scale(WaveReport& report, const WaveResult& result) {
  const bool is_measured = result.scale.measured_m > 0;
  if (result.scale.sigma > poor_scale) {
    report.doubts.push_back(fmt::format("the scale is from {}, which is good to {:.1f} % only: {}", report.scale_from,
                                        1e2 * result.scale.sigma,
                                        is_measured ? "measure a longer distance, or places further apart"
                                                    : "give --camera-distance, --rest-distance or two marked points"));
  }
  if (is_measured && (result.size_ratio < small_ball || result.size_ratio > large_ball)) {
    report.doubts.push_back(
        fmt::format("at this scale the ball looks {:.2f} times as large as its radius of {:.1f} mm says: is the "
                    "radius, or the measured distance, wrong?",
                    result.size_ratio, 1e3 * result.radius_m));
  }
}

// The rig against what was measured, by far more than its poses are off among one another.
void doubt_measured(WaveReport& report, const WaveResult& result) {
  constexpr double least_off = 0.05, sigmas = 3;
  const WaveScale& scale = result.scale;
  if (std::abs(scale.over_rig - 1) <= std::max(least_off, sigmas * std::hypot(scale.rig_sigma, scale.sigma))) return;
  report.doubts.push_back(fmt::format(
      "{} makes all {:.2f} times as large as the rig had it, whose own poses say how large all is to {:.1f} %, and the "
      "ball {:.2f} times as large as its radius says: was it measured from lens to lens, in metres? If the rig's scale "
      "was only a guess, this one is right: accept it",
      report.scale_from, scale.over_rig, 1e2 * scale.rig_sigma, result.size_ratio));
}

void doubt_camera(WaveReport& report, const WaveResult& result, const WaveCamera& camera, const std::string& name) {
  if (camera.used < few_agree * camera.seen) {
    report.doubts.push_back(
        fmt::format("{}: only {} of the {} frames with the target's colour agree with the other cameras: other things "
                    "of that colour, wrong times, or the wrong lens",
                    name, camera.used, camera.seen));
  }
  if (result.had_poses &&
      (camera.moved_m > far_from_rig * result.camera_distance_m || camera.turned_rad > far_turned_rad)) {
    report.doubts.push_back(fmt::format(
        "{} is {:.2f} m and {:.0f} degrees from where the rig had it: are the cameras' names swapped, or is "
        "it the wrong rig?",
        name, camera.moved_m, camera.turned_rad * 180 / std::numbers::pi));
  }
  if (!result.held_poses && camera.coverage < little_coverage) {
    report.doubts.push_back(fmt::format("{} saw the ball in {:.0f} % of its image only: wave it where the rest looks",
                                        name, 1e2 * camera.coverage));
  }
}

// A camera whose times are wrong pulls the others' along: only the worst is named.
void doubt_times(WaveReport& report, const WaveResult& result) {
  const auto worst = std::ranges::max_element(result.cameras, {}, &WaveCamera::wander_s) - result.cameras.begin();
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const WaveCamera& camera = result.cameras[c];
    const std::string& name = result.rig.cameras[c].name;
    if (camera.repeated > many_repeated) {
      report.doubts.push_back(fmt::format(
          "{}: {:.0f} % of its frames show the ball where it was a frame earlier, as if it repeated frames: "
          "set a rate that it keeps in this light, and switch automatic exposure off",
          name, 1e2 * camera.repeated));
    } else if (static_cast<std::ptrdiff_t>(c) == worst && camera.wander_s > much_wander_s &&
               camera.wander_sigmas > sure_wander) {
      report.doubts.push_back(fmt::format(
          "{}: the ball is off along its way, the more the faster it is, by {:.1f} ms and another way from second to "
          "second, as if its stamps wandered: its latency changes, its clock runs at another rate, or lost frames are "
          "not counted. Record the driver's own stamps",
          name, 1e3 * camera.wander_s));
    }
    const double unsure_s = result.held_poses ? result.rig.cameras[c].timing.latency_sigma_s.value_or(0) : 0;
    if (unsure_s > unsure_latency_s) {
      report.doubts.push_back(fmt::format(
          "{}: how late it is is known to +- {:.0f} ms only: wave faster, for longer, and in every direction", name,
          1e3 * unsure_s));
    }
    const double readout_s = std::abs(result.rig.cameras[c].timing.readout_s.value_or(0));
    if (camera.frame_s > 0 && readout_s > camera.frame_s + unsure_readout_s) {
      report.doubts.push_back(fmt::format(
          "{}: its rows would take {:.0f} ms from the first to the last, and its frames come every {:.0f} ms, which no "
          "camera does: the times or the poses are not right. Wave faster, through more of its image",
          name, 1e3 * readout_s, 1e3 * camera.frame_s));
    }
    if (camera.scatter_s > much_scatter_s) {
      report.doubts.push_back(
          fmt::format("{}: the ball is off along its way, the more the faster it is, by {:.1f} ms and another way in "
                      "every frame, as if its stamps were late at random: record the driver's own stamps",
                      name, 1e3 * camera.scatter_s));
    }
  }
}

void doubt_positions(WaveReport& report, const WaveResult& result) {
  if (result.rms_px > large_rms_px) {
    report.doubts.push_back(
        fmt::format("the ball is {:.1f} px off on average: the lenses, the cameras' times or the colour are not right",
                    result.rms_px));
  }
  const double expected_m = result.expected_in_volume_m.value_or(result.expected_m);
  if (expected_m > large_error * result.camera_distance_m) {
    report.doubts.push_back(fmt::format(
        "positions would be off by {:.0f} mm: wave for longer, and through more of the volume", 1e3 * expected_m));
  }
  if (result.halves_m > large_difference * result.camera_distance_m &&
      result.halves_m > unexpected_difference * result.halves_sigma_m) {
    report.doubts.push_back(
        fmt::format("the two halves of the recording disagree by {:.0f} mm: did a camera move meanwhile? Otherwise "
                    "wave for longer",
                    1e3 * result.halves_m));
  }
}

std::vector<std::string> notes_on(const WaveResult& result) {
  std::vector<std::string> notes;
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    if (result.cameras[c].has_static_clutter)
      notes.push_back(result.rig.cameras[c].name +
                      ": something of the target's colour stands still in its view; it is left out");
    if (const double share = result.cameras[c].repeated; share > some_repeated && share <= many_repeated)
      notes.push_back(fmt::format("{}: some {:.0f} % of its frames show the one before once more; they are left out",
                                  result.rig.cameras[c].name, 1e2 * share));
  }
  notes.push_back(
      result.rig.cameras[0].name +
      "'s latency stays as it was: a shift of all times cannot be seen, and the others' are told against it");
  if (result.marks_error_m) {
    notes.push_back(fmt::format("the marked points fit to {:.1f} mm", 1e3 * *result.marks_error_m));
  } else if (!result.had_poses) {
    notes.push_back("the world's origin is " + result.rig.cameras[0].name +
                    ", with z up in its image; set it with huetrack-calibrate world");
  }
  return notes;
}

std::string camera_line(const WaveCamera& camera, const std::string& name) {
  return fmt::format("{:12} {:7} {:7} {:7} {:8.2f} {:8.0f}% {:15.1f} {:13.3f} {:10.1f} {:9.2f}\n", name, camera.frames,
                     camera.seen, camera.used, camera.rms_px, 1e2 * camera.coverage, 1e3 * camera.centre_sigma_m.norm(),
                     deg * camera.rotation_sigma_rad.norm(), 1e3 * camera.moved_m, deg * camera.turned_rad);
}

std::string positions_text(const WaveReport& report, const WaveResult& result) {
  std::string out =
      fmt::format("expected error of positions where the ball was: {:.1f} mm rms, and by the scale {:.1f} mm\n",
                  1e3 * result.expected_m, 1e3 * result.by_scale_m);
  if (result.expected_in_volume_m)
    out += fmt::format("in the whole volume: {:.1f} mm rms, and by the scale {:.1f} mm\n",
                       1e3 * *result.expected_in_volume_m, 1e3 * result.by_scale_in_volume_m);
  out += fmt::format("the two halves of the recording differ by {:.1f} mm there; {:.1f} mm was to be expected\n",
                     1e3 * result.halves_m, 1e3 * result.halves_sigma_m);
  out += fmt::format("scale: from {}; good to {:.2f} %; the ball looks {:.2f} times as large as its radius says\n",
                     report.scale_from, 1e2 * result.scale.sigma, result.size_ratio);
  return out;
}

std::string times_text(const WaveResult& result) {
  const std::string& first = result.rig.cameras[0].name;
  std::string out = fmt::format("{:12} {:>12} {:>8} {:>12} {:>8}   (latency: against {}'s, which stays)\n", "times",
                                "latency ms", "+- ms", "readout ms", "+- ms", first);
  for (const calib::Camera& camera : result.rig.cameras) {
    const calib::CameraTiming& t = camera.timing;
    out += fmt::format("{:12} {:12.2f} {:8.2f} {:12.2f} {:8.2f}\n", camera.name, 1e3 * t.latency_s.value_or(0),
                       1e3 * t.latency_sigma_s.value_or(0), 1e3 * t.readout_s.value_or(0),
                       1e3 * t.readout_sigma_s.value_or(0));
  }
  return out;
}

}  // namespace

WaveReport report_on(const WaveResult& result) {
  WaveReport report;
  if (!result.held_poses) report.scale_from = scale_text(result);
  report.notes = notes_on(result);
  if (result.marks_error_m && *result.marks_error_m > far_mark_m) {
    report.doubts.push_back(fmt::format("a marked point is off by {:.0f} mm: measure them again, and check the times",
                                        1e3 * *result.marks_error_m));
  }
  if (!result.held_poses) {
    if (result.is_in_a_plane()) report.doubts.push_back(told({wave::motion_in_a_plane(result.extent_m)}));
    doubt_scale(report, result);
    doubt_measured(report, result);
  }
  for (std::size_t c = 0; c < result.cameras.size(); ++c)
    doubt_camera(report, result, result.cameras[c], result.rig.cameras[c].name);
  doubt_times(report, result);
  doubt_positions(report, result);
  if (result.rejected_rig_poses)
    report.doubts.emplace_back("the rig's poses were no use as a start: check that its cameras' names are not swapped");
  report.verdict = report.doubts.empty() ? Verdict::usable : Verdict::doubtful;
  return report;
}

namespace {

// A text's lines, each a paragraph of its own.
void paragraphs(Document& document, const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) document.paragraph(line);
}

Table cameras_table(const WaveResult& result) {
  Table table{.head = {"camera", "frames", "seen", "used", "rms px", "of the image", "position +- mm", "axes +- deg",
                       "moved mm", "turned deg"},
              .rows = {}};
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const WaveCamera& camera = result.cameras[c];
    table.rows.push_back({result.rig.cameras[c].name, fmt::to_string(camera.frames), fmt::to_string(camera.seen),
                          fmt::to_string(camera.used), fmt::format("{:.2f}", camera.rms_px),
                          fmt::format("{:.0f} %", 1e2 * camera.coverage),
                          fmt::format("{:.1f}", 1e3 * camera.centre_sigma_m.norm()),
                          fmt::format("{:.3f}", deg * camera.rotation_sigma_rad.norm()),
                          fmt::format("{:.1f}", 1e3 * camera.moved_m), fmt::format("{:.2f}", deg * camera.turned_rad)});
  }
  return table;
}

Table times_table(const WaveResult& result) {
  Table table{.head = {"camera", "latency ms", "+- ms", "readout ms", "+- ms"}, .rows = {}};
  for (const calib::Camera& camera : result.rig.cameras) {
    const calib::CameraTiming& t = camera.timing;
    table.rows.push_back({camera.name, fmt::format("{:.2f}", 1e3 * t.latency_s.value_or(0)),
                          fmt::format("{:.2f}", 1e3 * t.latency_sigma_s.value_or(0)),
                          fmt::format("{:.2f}", 1e3 * t.readout_s.value_or(0)),
                          fmt::format("{:.2f}", 1e3 * t.readout_sigma_s.value_or(0))});
  }
  return table;
}

}  // namespace

std::string summary(const WaveReport& report, const WaveResult& result) {
  std::string text = fmt::format("the ball is {:.2f} px rms off", result.rms_px);
  if (!result.held_poses)
    text += fmt::format(", positions are expected to be off by {:.1f} mm",
                        1e3 * result.expected_in_volume_m.value_or(result.expected_m));
  if (!report.doubts.empty()) text += "; " + report.doubts.front();
  return text;
}

Document document_of(const WaveReport& report, const WaveResult& result) {
  Document document;
  document.title = "Calibration from the waved object";
  document.subtitle = fmt::format("{:.1f} s of waving through {:.2f} x {:.2f} x {:.2f} m", result.duration_s,
                                  result.extent_m.x(), result.extent_m.y(), result.extent_m.z());
  document.banner(report.verdict, report.verdict == Verdict::usable ? "USABLE" : "DOUBTFUL", summary(report, result));
  for (const auto& doubt : report.doubts) document.paragraph("? " + doubt + ".");
  document.heading("Cameras");
  document.table(cameras_table(result));
  for (const wave::WavePair& pair : result.pairs)
    document.paragraph(fmt::format("{} and {} saw it together in {} frames.",
                                   result.rig.cameras[static_cast<std::size_t>(pair.a)].name,
                                   result.rig.cameras[static_cast<std::size_t>(pair.b)].name, pair.shared));
  if (!result.held_poses) {
    document.heading("Positions");
    paragraphs(document, positions_text(report, result));
  }
  document.heading("Times");
  document.table(times_table(result));
  if (!report.notes.empty()) document.heading("Notes");
  for (const auto& note : report.notes) document.paragraph(note + ".");
  return document;
}

std::string to_text(const WaveReport& report, const WaveResult& result) {
  std::string out = fmt::format("VERDICT: {}\n", name(report.verdict));
  for (const auto& doubt : report.doubts) out += "  - " + doubt + "\n";
  out += fmt::format(
      "{:.1f} s of waving, {:.2f} x {:.2f} x {:.2f} m, jerks of {:.0f} m/s^3; the ball is {:.2f} px rms off\n",
      result.duration_s, result.extent_m.x(), result.extent_m.y(), result.extent_m.z(), result.jerk_m_s3,
      result.rms_px);
  if (!result.held_poses) out += positions_text(report, result);
  out += fmt::format("{:12} {:>7} {:>7} {:>7} {:>8} {:>9} {:>15} {:>13} {:>10} {:>9}\n", "camera", "frames", "seen",
                     "used", "rms px", "coverage", "position +- mm", "axes +- deg", "moved mm", "turned");
  for (std::size_t c = 0; c < result.cameras.size(); ++c)
    out += camera_line(result.cameras[c], result.rig.cameras[c].name);
  out += times_text(result);
  for (const wave::WavePair& pair : result.pairs) {
    out += fmt::format("{} and {} saw it together in {} frames\n",
                       result.rig.cameras[static_cast<std::size_t>(pair.a)].name,
                       result.rig.cameras[static_cast<std::size_t>(pair.b)].name, pair.shared);
  }
  for (const auto& note : report.notes) out += "note: " + note + "\n";
  return out;
}

}  // namespace huetrack::report
