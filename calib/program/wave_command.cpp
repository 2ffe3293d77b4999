// huetrack-calibrate wave: camera poses and timing from the coloured object, waved through the volume.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>

#include "calib/gather/picture_source.h"
#include "calib/gather/progress_line.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/outcome.h"
#include "calib/program/waved_ball.h"
#include "calib/wave/wave.h"
#include "recordings/recording.h"

namespace huetrack::program {
namespace {

struct WaveCommand : WavedOptions {
  std::vector<std::string> lenses, camera_distance;
  std::vector<double> hue, saturation{0.3, 1}, intensity{0.1, 0.95}, marks;
  double radius_mm = 40, rest_distance = 0;
  std::optional<double> g, latitude, ball_mass_g;
  bool no_poses = false, guess_lenses = false, floor = false;
};

WavedInput input_of(const WaveCommand& o) {
  if (!o.config.empty()) {
    if (!o.lenses.empty() || !o.hue.empty())
      throw gather::InputError("--config has lenses and colours: omit --lens and --hue");
    return configured_input(o);
  }
  constexpr double least_mm = 2;  // a ball of less is a slip of the unit
  if (o.radius_mm < least_mm)
    throw gather::InputError(
        fmt::format("--radius {:g} is in millimetres: did you mean {:g}?", o.radius_mm, 1e3 * o.radius_mm));
  if (o.hue.empty())
    throw gather::InputError("give --config huetrackd.yaml; or, without one, the target's --hue and --radius");
  WavedInput in;
  if (o.lenses.empty()) {
    if (o.recording.empty()) throw gather::InputError("without --config and --lens, give a recording");
    std::vector<std::string> names;
    for (const auto& camera : recordings::read_recording(o.recording).cameras) names.push_back(camera.name);
    in.rig = guessed_rig(o.recording, names);
    in.has_rig = false;
  }
  for (const auto& file : o.lenses) {
    const calib::CameraRig lens = calib::read_rig(file);
    in.rig.cameras.insert(in.rig.cameras.end(), lens.cameras.begin(), lens.cameras.end());
  }
  object_tracking::TargetOptions target;
  target.name = o.targets.empty() ? "target" : o.targets.front();
  target.radius_m = o.radius_mm / 1e3;
  target.color = {o.hue[0], o.hue[1], o.saturation[0], o.saturation[1], o.intensity[0], o.intensity[1]};
  for (const auto& problem : target.problems()) throw gather::InputError(problem);
  in.targets.push_back(std::move(target));
  for (std::size_t a = 0; a < in.rig.cameras.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      if (in.rig.cameras[a].name == in.rig.cameras[b].name)
        throw gather::InputError("--lens: two cameras are called " + in.rig.cameras[a].name);
    }
  }
  return in;
}

wave::WaveOptions wave_options(const WaveCommand& o, const WavedInput& in) {
  wave::WaveOptions options{.radius_m = in.targets.front().radius_m};
  options.has_poses = !o.no_poses && in.config.has_value() && in.has_rig;
  options.guessed_lenses = o.guess_lenses || !in.has_rig;
  options.guessed_radius = in.targets.front().is_radius_assumed;
  if (!o.camera_distance.empty()) {
    wave::CameraDistance d;
    for (const int i : {0, 1}) {
      const auto index = in.rig.index_of(o.camera_distance[static_cast<std::size_t>(i)]);
      if (!index)
        throw gather::InputError("--camera-distance: the rig has no camera " +
                                 o.camera_distance[static_cast<std::size_t>(i)]);
      (i == 0 ? d.a : d.b) = *index;
    }
    char* end = nullptr;
    d.metres = std::strtod(o.camera_distance[2].c_str(), &end);
    if (*end != 0)
      throw gather::InputError("--camera-distance: " + o.camera_distance[2] + " is not a number of metres");
    options.camera_distance = d;
  }
  if (o.rest_distance > 0) options.rest_distance_m = o.rest_distance;
  for (std::size_t i = 0; i + 3 < o.marks.size(); i += 4)
    options.marks.push_back({o.marks[i], {o.marks[i + 1], o.marks[i + 2], o.marks[i + 3]}});
  options.g_m_s2 = o.g;
  options.latitude_deg = o.latitude;
  if (o.ball_mass_g) options.ball_kg = *o.ball_mass_g / 1e3;
  options.floor = o.floor;
  if (in.config && in.has_rig)
    options.volume = solver::WorldBox{in.config->object_tracking.volume.min, in.config->object_tracking.volume.max};
  for (const auto& problem : options.problems(in.rig)) throw gather::InputError(problem);
  return options;
}

// For a calling program: where the ball was, and its radius by the measured scale.
void send_ball(const wave::WaveResult& result) {
  const Eigen::Vector3d middle = (result.path_min + result.path_max) / 2;
  const double radius_m = result.radius_m * result.size_ratio;
  gather::send_to_program(
      "ball", {fmt::format("{:.3f}", middle.x()), fmt::format("{:.3f}", middle.y()), fmt::format("{:.3f}", middle.z()),
               result.scale.is_measured() ? fmt::format("{:.4f}", radius_m) : ""});
}

ExitStatus wave(const WaveCommand& o, const std::stop_token& stop) {
  if (o.marks.size() % 4 != 0) throw gather::InputError("--mark has four numbers: SECONDS X Y Z");
  const WavedInput in = input_of(o);
  const auto note = [&](wave::WaveResult& result, const report::WaveReport& report) {
    if (gather::ProgressLine::is_machine_readable()) send_ball(result);
    result.rig.made = {.at = utc_now(), .temperature_c = o.temperature_c, .checks = {}};
    result.rig.made_by = {{"tool", "huetrack-calibrate " HUETRACK_VERSION " wave"},
                          {"input", o.live_s > 0 ? "live" : o.recording},
                          {"target", names_of(in.targets)},
                          {"verdict", std::string(report::name(report.verdict))},
                          {"scale_from", report.scale_from},
                          {"rms_px", fmt::format("{:.3f}", result.rms_px)},
                          {"expected_error_mm", fmt::format("{:.1f}", 1e3 * report::expected_error_m(result))}};
    if (!report.doubts.empty()) result.rig.made_by.emplace_back("doubt", report.doubts.front());
  };
  return calibrate_and_write(o, in, wave_options(o, in), stop, note);
}

}  // namespace

void add_wave_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<WaveCommand>();
  CLI::App* command = app.add_subcommand(
      "wave", "estimate or refine the cameras' poses and timing from the coloured ball, waved through the volume");
  add_waved_options(*command, *o);
  command->add_flag("--no-poses", o->no_poses, "do not use the rig's poses as a start");
  command
      ->add_option("--camera-distance", o->camera_distance,
                   "CAMERA CAMERA METRES: measured distance of two cameras; sets the scale, with the throws")
      ->expected(3);
  command
      ->add_option("--rest-distance", o->rest_distance,
                   "metres between two places where the ball rested; sets the scale")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--mark", o->marks,
                   "SECONDS X Y Z: known position of the ball's centre; two set the scale, three the world")
      ->expected(4)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--g", o->g, "gravity, m/s^2: throws set scale and vertical (default: 9.806, good to 0.15 %)")
      ->check(CLI::Range(9.0, 10.0));
  command->add_option("--latitude", o->latitude, "degrees: gravity there, good to 0.01 %")
      ->check(CLI::Range(-90.0, 90.0))
      ->excludes("--g");
  command->add_option("--ball-mass", o->ball_mass_g, "grams: the air's drag on a thrown ball; else its flights show it")
      ->check(CLI::PositiveNumber);
  command->add_flag("--floor", o->floor,
                    "the ball was laid on the floor, which becomes z = 0; at three places without throws");
  command->add_option("--lens", o->lenses,
                      "without --config: a rig file with lenses; may be repeated. Without any, lenses are estimated");
  command->add_flag("--guess-lenses", o->guess_lenses, "the lenses of --config's rig are guesses: estimate them");
  command->add_option("--hue", o->hue, "without --config: the target's range of hue, degrees")->expected(2);
  command->add_option("--saturation", o->saturation, "without --config: its range of saturation, 0..1")->expected(2);
  command->add_option("--intensity", o->intensity, "without --config: its range of intensity, 0..1")->expected(2);
  command->add_option("--radius", o->radius_mm, "without --config: its radius, mm (default 40)")
      ->check(CLI::PositiveNumber);
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return wave(*o, stop); }; });
}

}  // namespace huetrack::program
