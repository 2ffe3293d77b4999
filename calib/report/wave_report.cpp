#include "calib/report/wave_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/report/advice.h"

namespace huetrack::report {
namespace {

using wave::WaveCamera;
using wave::WaveResult;
using wave::WaveScale;
using Kind = wave::ScaleSource::Kind;

constexpr double deg = 180 / std::numbers::pi;

// Limits beyond which a figure is doubtful.
constexpr double far_mark_m = 0.03;                    // a tape measure held by hand does better
constexpr double poor_scale = 0.01;                    // relative; a metre, taped to 5 mm, does better
constexpr double small_ball = 0.65, large_ball = 1.5;  // apparent over configured radius; light and blur cause less
constexpr double few_agree = 0.6;                      // of a camera's frames with the colour
constexpr double wrong_lens_px = 1;                    // lenses given from boards are exact to some tenths
constexpr double wrong_focal = 0.005;                  // relative; below, other parameters are the cause
constexpr double far_from_rig = 0.3;                   // displacement of a camera / its distance to the ball
constexpr double far_turned_rad = 0.35;                // 20 degrees
constexpr double little_coverage = 0.15;               // of a camera's image
constexpr double large_rms_px = 1.5;
constexpr double large_error = 0.003;                        // of positions / distance of the cameras
constexpr double large_difference = 0.006;                   // of the halves / the same distance; and
constexpr double unexpected_difference = 2;                  // times their covariance
constexpr double much_wander_s = 0.0015;                     // from second to second; and
constexpr double sure_wander = 4;                            // times the noise
constexpr double much_scatter_s = 0.003;                     // from frame to frame, of smoothed stamps
constexpr double unsure_latency_s = 0.004;                   // with fixed poses; a good wave gives 1 ms
constexpr double many_repeated = 0.2, some_repeated = 0.03;  // of the fast frames

std::string source_text(const wave::ScaleSource& source, const WaveResult& result) {
  const auto name = [&](int c) { return result.rig.cameras[static_cast<std::size_t>(c)].name; };
  switch (source.kind) {
    case Kind::camera_distance:
      return fmt::format("the distance between {} and {}, {:.3f} m", name(source.a), name(source.b), source.measured_m);
    case Kind::rest_distance:
      return fmt::format("the distance between the two places where the ball rested, {:.3f} m", source.measured_m);
    case Kind::marks:
      return fmt::format("{} marked points", source.count);
    case Kind::throws:
      return fmt::format("{} free flights of the ball", source.count);
    case Kind::rig_poses:
      return "the rig's own poses";
    case Kind::ball_size:
      break;
  }
  return result.guessed_radius ? "a guess of the ball's radius" : "the ball's radius, roughly";
}

// All sources that count.
std::string scale_text(const WaveResult& result) {
  constexpr double counts = 0.01;
  std::string text;
  for (const wave::ScaleSource& source : result.scale.sources) {
    if (!text.empty() && source.weight < counts) continue;
    text += (text.empty() ? "" : ", and ") + source_text(source, result);
  }
  return text;
}

std::string scale_advice(const WaveResult& result, Reader reader) {
  if (result.scale.is_measured())
    return "measure a longer distance, or places further apart, or throw the ball more often";
  const std::string throws = "throw the ball five times and let it bounce, or ";
  if (reader == Reader::terminal) return throws + "give --camera-distance, --rest-distance or two marked points";
  return throws + "type the distance of two cameras";
}

void doubt_scale(WaveReport& report, const WaveResult& result, Reader reader) {
  const bool is_measured = result.scale.is_measured();
  if (result.scale.sigma > poor_scale) {
    report.doubts.push_back(fmt::format("the scale is from {}, which is accurate to only {:.1f} %: {}",
                                        report.scale_from, 1e2 * result.scale.sigma, scale_advice(result, reader)));
  }
  if (is_measured && !result.guessed_radius && (result.size_ratio < small_ball || result.size_ratio > large_ball)) {
    report.doubts.push_back(fmt::format(
        "at this scale the ball appears {:.2f} times as large as its radius of {:.1f} mm says: is the radius, "
        "or the measured distance, wrong?",
        result.size_ratio, 1e3 * result.radius_m));
  }
}

// Says: a source's name in a contradiction.
std::string_view witness(const wave::ScaleSource& source) {
  static constexpr std::string_view names[] = {
      "the tape between the cameras says", "the distance of the rests says", "the marked points say", "the throws say",
      "the rig's own poses say",           "the ball's radius says"};
  return names[std::size_t(source.kind)];
}

// Two sources of the scale that contradict one another, in metres of what was measured.
void doubt_sources(WaveReport& report, const WaveResult& result) {
  constexpr double sigmas = 3;
  const std::vector<wave::ScaleSource>& sources = result.scale.sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    for (std::size_t k = i + 1; k < sources.size(); ++k) {
      const bool is_first = sources[i].measured_m > 0;
      const wave::ScaleSource &a = sources[is_first ? i : k], &b = sources[is_first ? k : i];
      const double both = std::hypot(a.sigma, b.sigma);
      if (a.kind == Kind::ball_size || b.kind == Kind::ball_size ||
          std::abs(std::log(a.ratio / b.ratio)) < sigmas * both)
        continue;
      constexpr double metre = 1;  // of nothing that was measured
      const double a_m = a.measured_m > 0 ? a.measured_m : metre, b_m = a_m * b.ratio / a.ratio;
      report.doubts.push_back(
          fmt::format("the scale is contradictory: {} {:.3f} +- {:.3f} m, {} {:.3f} +- {:.3f} m for the same length. "
                      "Measure again, and check the lenses",
                      witness(a), a_m, a_m * a.sigma, witness(b), b_m, b_m * b.sigma));
    }
  }
}

// The measured scale differs from the rig's by far more than the rig's poses differ among one another.
void doubt_measured(WaveReport& report, const WaveResult& result) {
  constexpr double least_off = 0.05, sigmas = 3;
  const WaveScale& scale = result.scale;
  if (std::abs(scale.over_rig - 1) <= std::max(least_off, sigmas * std::hypot(scale.rig_sigma, scale.sigma))) return;
  report.doubts.push_back(fmt::format(
      "{} makes everything {:.2f} times as large as in the rig, whose poses give the scale to {:.1f} %, "
      "and the ball {:.2f} times as large as its radius says: was it measured from lens to lens, in metres? If "
      "the rig's scale was only a guess, this one is right: accept it",
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
    report.doubts.push_back(
        fmt::format("{} is {:.2f} m and {:.0f} degrees from its pose in the rig: are the cameras' names swapped, or is "
                    "it the wrong rig?",
                    name, camera.moved_m, camera.turned_rad * 180 / std::numbers::pi));
  }
  if (!result.held_poses && camera.coverage < little_coverage) {
    report.doubts.push_back(
        fmt::format("{} saw the ball in only {:.0f} % of its image: wave it in the rest of its view, too", name,
                    1e2 * camera.coverage));
  }
}

bool is_held(const WaveResult& result) {
  return std::ranges::any_of(result.cameras,
                             [](const WaveCamera& c) { return c.partly_seen > WaveCamera::much_partly; });
}

// A hand moves the centres of outlines in one direction for long: the covariance knows only a part of that.
void doubt_hands(WaveReport& report, const WaveResult& result) {
  if (!is_held(result)) return;
  std::string shares;
  for (std::size_t c = 0; c < result.cameras.size(); ++c)
    shares += fmt::format("{}{} {:.0f} %", c == 0 ? "" : ", ", result.rig.cameras[c].name,
                          1e2 * result.cameras[c].partly_seen);
  report.doubts.push_back(
      fmt::format("a hand, or something else, hides a part of the ball ({} of the frames), and {} may be several times "
                  "less accurate than stated: wave it on a thin stick or a string, or throw it",
                  shares, result.held_poses ? "times" : "positions and times"));
}

// A given lens that the ball contradicts.
void note_lenses(WaveReport& report, const WaveResult& result, Reader reader) {
  for (std::size_t c = 0; c < result.cameras.size() && !result.guessed_lenses; ++c) {
    const WaveCamera& camera = result.cameras[c];
    if (camera.lens_px < wrong_lens_px) continue;
    const bool is_focal = std::abs(camera.longer) > std::max(wrong_focal, 3 * camera.longer_sigma);
    report.notes.push_back(
        fmt::format("{}'s lens does not fit: {}its pixels are {:.1f} px off (rms); the rig has the corrected lens. A "
                    "lens from a board is more accurate",
                    result.rig.cameras[c].name,
                    is_focal ? fmt::format("its focal length is {:.1f} % {} than given, ",
                                           1e2 * std::abs(camera.longer), camera.longer > 0 ? "longer" : "shorter")
                             : "",
                    camera.lens_px));
    // Experiment (calib/wave/EXPERIMENTS.md): the stated error is 2 to 4 times too small then.
    if (is_focal)
      report.doubts.push_back(
          fmt::format("{}'s focal length was given wrong, and positions may be several times less accurate than "
                      "stated: calibrate its lens with a board{}",
                      result.rig.cameras[c].name,
                      reader == Reader::terminal ? ", or give the lenses as guesses (--guess-lenses)" : ""));
  }
}

// A camera with wrong times biases the others': only the worst is reported.
void doubt_times(WaveReport& report, const WaveResult& result) {
  const auto worst = std::ranges::max_element(result.cameras, {}, &WaveCamera::wander_s) - result.cameras.begin();
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const WaveCamera& camera = result.cameras[c];
    const std::string& name = result.rig.cameras[c].name;
    if (camera.repeated > many_repeated) {
      report.doubts.push_back(
          fmt::format("{}: {:.0f} % of its frames show the ball where it was a frame earlier, as if it repeated "
                      "frames: set a rate that it keeps in this light, and switch automatic exposure off",
                      name, 1e2 * camera.repeated));
    } else if (static_cast<std::ptrdiff_t>(c) == worst && camera.wander_s > much_wander_s &&
               camera.wander_sigmas > sure_wander) {
      report.doubts.push_back(
          fmt::format("{}: its errors along the ball's path grow with the speed, {:.1f} ms, and change from second to "
                      "second, as if its time stamps drift: the latency changes, the clock has another rate, or lost "
                      "frames are not counted. Record the driver's own stamps",
                      name, 1e3 * camera.wander_s));
    }
    const double unsure_s = result.held_poses ? result.rig.cameras[c].timing.latency_sigma_s.value_or(0) : 0;
    if (unsure_s > unsure_latency_s) {
      report.doubts.push_back(
          fmt::format("{}: its latency is known to only +- {:.0f} ms: wave faster, for longer, and in every direction",
                      name, 1e3 * unsure_s));
    }
    const double readout_s = std::abs(result.rig.cameras[c].timing.readout_s.value_or(0));
    if (!wave::is_possible_readout(readout_s, camera.frame_s)) {
      report.doubts.push_back(
          fmt::format("{}: its readout would take {:.0f} ms, but its frames come every {:.0f} ms, which is impossible: "
                      "the times or the poses are wrong. Wave faster, through more of its image",
                      name, 1e3 * readout_s, 1e3 * camera.frame_s));
    }
    if (camera.scatter_s > much_scatter_s) {
      report.doubts.push_back(
          fmt::format("{}: its errors along the ball's path grow with the speed, {:.1f} ms, and change from frame to "
                      "frame, as if its time stamps are randomly late: record the driver's own stamps",
                      name, 1e3 * camera.scatter_s));
    }
  }
}

// Without the scale's part: waving does not mend the scale, and its error has its own limit.
bool is_error_large(const WaveResult& result) {
  return result.expected_in_volume_m.value_or(result.expected_m) > large_error * result.camera_distance_m;
}

std::string large_error_text(const WaveResult& result) {
  return fmt::format(
      "the expected error of positions is {:.1f} mm, {:.1f} mm without the scale's part, above the limit of {:.1f} mm, "
      "{:g} % of the cameras' distance: wave for longer, and through more of the volume",
      1e3 * expected_error_m(result), 1e3 * result.expected_in_volume_m.value_or(result.expected_m),
      1e3 * large_error * result.camera_distance_m, 1e2 * large_error);
}

void doubt_positions(WaveReport& report, const WaveResult& result) {
  if (result.rms_px > large_rms_px) {
    report.doubts.push_back(fmt::format("the ball has an rms error of {:.1f} px: {}", result.rms_px,
                                        is_held(result) ? "by what hides it, or wrong lenses or times"
                                                        : "the lenses, the cameras' times or the colour are wrong"));
  }
  if (is_error_large(result)) report.doubts.push_back(large_error_text(result));
  if (result.halves_m > large_difference * result.camera_distance_m &&
      result.halves_m > unexpected_difference * result.halves_sigma_m) {
    report.doubts.push_back(fmt::format(
        "the two halves of the recording disagree by {:.0f} mm: did a camera move meanwhile? Otherwise wave for longer",
        1e3 * result.halves_m));
  }
}

std::string vertical_text(const WaveResult& result, const wave::WaveVertical& vertical) {
  constexpr double sigmas = 3, same_rad = 1e-6;
  const std::string sure =
      fmt::format("+- {:.2f} degrees, by {} free flights of the ball", deg * vertical.sigma_rad, vertical.flights);
  if (vertical.tilt_rad < same_rad) return fmt::format("the world's z axis is vertical, {}", sure);
  return fmt::format(
      "the world's z axis, of {}, is {:.2f} degrees off the vertical, {}: {}",
      result.marks_error_m ? "the marked points" : "the rig", deg * vertical.tilt_rad, sure,
      vertical.tilt_rad < sigmas * vertical.sigma_rad ? "they agree" : "if z is meant to be up, set the world anew");
}

std::vector<std::string> notes_on(const WaveResult& result, Reader reader) {
  std::vector<std::string> notes;
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    if (result.cameras[c].has_static_clutter)
      notes.push_back(result.rig.cameras[c].name +
                      ": a static object of the target's colour is in its view; it is left out");
    if (const double share = result.cameras[c].repeated; share > some_repeated && share <= many_repeated)
      notes.push_back(fmt::format("{}: some {:.0f} % of its frames repeat the previous one; they are left out",
                                  result.rig.cameras[c].name, 1e2 * share));
  }
  notes.push_back(
      result.rig.cameras[0].name +
      "'s latency is kept: a shift of all times cannot be observed, and the others' latencies are relative to it");
  if (result.marks_error_m) {
    notes.push_back(fmt::format("the marked points fit to {:.1f} mm", 1e3 * *result.marks_error_m));
  } else if (!result.had_poses) {
    notes.push_back(fmt::format("the world's origin is {}, with z up {}{}", result.rig.cameras[0].name,
                                result.vertical ? "by the throws" : "in its image",
                                reader == Reader::terminal ? "; set it with huetrack-calibrate world" : ""));
  }
  if (result.vertical) notes.push_back(vertical_text(result, *result.vertical));
  return notes;
}

}  // namespace

WaveReport report_on(const WaveResult& result, Reader reader) {
  WaveReport report;
  if (!result.held_poses) report.scale_from = scale_text(result);
  report.notes = notes_on(result, reader);
  note_lenses(report, result, reader);
  if (result.marks_error_m && *result.marks_error_m > far_mark_m) {
    report.doubts.push_back(
        fmt::format("a marked point has an error of {:.0f} mm: measure them again, and check the times",
                    1e3 * *result.marks_error_m));
  }
  if (!result.held_poses) {
    if (result.is_in_a_plane()) report.doubts.push_back(with_advice({wave::motion_in_a_plane(result.extent_m)}));
    doubt_scale(report, result, reader);
    doubt_sources(report, result);
    doubt_measured(report, result);
  }
  for (std::size_t c = 0; c < result.cameras.size(); ++c)
    doubt_camera(report, result, result.cameras[c], result.rig.cameras[c].name);
  doubt_hands(report, result);
  doubt_times(report, result);
  doubt_positions(report, result);
  if (result.rejected_rig_poses)
    report.doubts.emplace_back(
        "the rig's poses could not be used as a start: check that its cameras' names are not swapped");
  report.verdict = report.doubts.empty() ? Verdict::usable : Verdict::doubtful;
  return report;
}

namespace {

Table scale_table(const WaveResult& result) {
  Table table{.head = {"the scale by", "+- %", "weight %", "larger than taken, %"}, .rows = {}};
  for (const wave::ScaleSource& source : result.scale.sources)
    table.rows.push_back({source_text(source, result), fmt::format("{:.2f}", 1e2 * source.sigma),
                          fmt::format("{:.1f}", 1e2 * source.weight),
                          fmt::format("{:+.2f}", 1e2 * (source.ratio - 1))});
  return table;
}

void add_positions(Document& document, const WaveReport& report, const WaveResult& result) {
  const auto expected = [&](std::string_view where, double error_m, double by_scale_m) {
    document.paragraph(fmt::format("expected error of positions {}: {:.1f} mm rms, and by the scale {:.1f} mm", where,
                                   1e3 * error_m, 1e3 * by_scale_m));
  };
  document.heading("Positions");
  expected("where the ball was", result.expected_m, result.by_scale_m);
  if (result.expected_in_volume_m)
    expected("in the whole volume", *result.expected_in_volume_m, result.by_scale_in_volume_m);
  document.paragraph(fmt::format("the two halves of the recording differ by {:.1f} mm there; {:.1f} mm is expected",
                                 1e3 * result.halves_m, 1e3 * result.halves_sigma_m));
  document.paragraph(
      fmt::format("scale: from {}; accurate to {:.2f} %; the ball appears {:.2f} times as large as its radius says",
                  report.scale_from, 1e2 * result.scale.sigma, result.size_ratio));
  document.table(scale_table(result));
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

Table lenses_table(const WaveResult& result) {
  Table table{.head = {"camera", "focal length px", "+- px", "picture deg wide", "off the given lens, px rms"},
              .rows = {}};
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const WaveCamera& camera = result.cameras[c];
    const calib::Camera& found = result.rig.cameras[c];
    const double fx = found.model.fx();
    table.rows.push_back({found.name, fmt::format("{:.1f}", fx), fmt::format("{:.1f}", fx * camera.longer_sigma),
                          fmt::format("{:.0f}", 2 * deg * std::atan(0.5 * found.image_size.width / fx)),
                          result.guessed_lenses ? "guessed" : fmt::format("{:.1f}", camera.lens_px)});
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

// with_error: and the error of positions, which no doubt states.
std::string figures_text(const WaveResult& result, bool with_error) {
  const std::string rms = fmt::format("the rms error of the ball is {:.2f} px", result.rms_px);
  if (result.held_poses || !with_error) return rms;
  return fmt::format("the expected error of positions is {:.1f} mm, {}", 1e3 * expected_error_m(result), rms);
}

}  // namespace

double expected_error_m(const WaveResult& result) {
  return result.expected_in_volume_m ? std::hypot(*result.expected_in_volume_m, result.by_scale_in_volume_m)
                                     : std::hypot(result.expected_m, result.by_scale_m);
}

std::string next_step_text(const WaveResult& result) {
  const auto text_of = [](const Eigen::Vector3d& p) {
    return fmt::format("[{:.2f}, {:.2f}, {:.2f}]", p.x(), p.y(), p.z());
  };
  return fmt::format(
      "The ball was in this part of the rig's world. Without a volume in the configuration, targets are searched in "
      "[-1, -1, 0] to [1, 1, 2]:\nobject_tracking: {{volume: {{min: {}, max: {}}}}}\n",
      text_of(result.path_min), text_of(result.path_max));
}

std::string summary(const WaveReport& report, const WaveResult& result) {
  if (report.doubts.empty()) return figures_text(result, true);
  const std::string& doubt = report.doubts.front();
  const bool says_error = is_error_large(result) && doubt == large_error_text(result);
  return figures_text(result, !says_error) + "; " + doubt;
}

Document document_of(const WaveReport& report, const WaveResult& result) {
  Document document;
  document.title = "Calibration from the waved object";
  document.subtitle =
      fmt::format("{:.1f} s of waving through {:.2f} x {:.2f} x {:.2f} m, jerks of {:.0f} m/s^3", result.duration_s,
                  result.extent_m.x(), result.extent_m.y(), result.extent_m.z(), result.jerk_m_s3);
  document.banner(report.verdict, report.verdict == Verdict::usable ? "USABLE" : "DOUBTFUL",
                  figures_text(result, !is_error_large(result)));  // the doubts follow
  for (const auto& doubt : report.doubts) document.paragraph("? " + doubt + ".");
  document.heading("Cameras");
  document.table(cameras_table(result));
  for (const wave::WavePair& pair : result.pairs)
    document.paragraph(fmt::format("{} and {} saw it together in {} frames.",
                                   result.rig.cameras[static_cast<std::size_t>(pair.a)].name,
                                   result.rig.cameras[static_cast<std::size_t>(pair.b)].name, pair.shared));
  if (!result.held_poses) {
    document.heading(result.guessed_lenses ? "Lenses, estimated from the ball; a board gives better ones" : "Lenses");
    document.table(lenses_table(result));
    add_positions(document, report, result);
  }
  document.heading("Times");
  document.table(times_table(result));
  if (!report.notes.empty()) document.heading("Notes");
  for (const auto& note : report.notes) document.paragraph(note + ".");
  return document;
}

std::string to_text(const WaveReport& report, const WaveResult& result) {
  return to_text(document_of(report, result));
}

}  // namespace huetrack::report
