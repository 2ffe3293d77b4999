// huetrack-calibrate time: latency and readout of the cameras from the waved ball, with known poses.
#include <CLI/CLI.hpp>
#include <memory>

#include "calib/gather/picture_source.h"
#include "calib/program/commands.h"
#include "calib/program/rig_pictures.h"
#include "calib/program/waved_ball.h"
#include "calib/wave/wave.h"

namespace huetrack::program {
namespace {

ExitStatus time(const WavedOptions& o, const std::stop_token& stop) {
  const WavedInput in = configured_input(o);
  config::require_rig(*in.config);
  const wave::WaveOptions options{.radius_m = in.targets.front().radius_m, .hold_poses = true};
  for (const auto& problem : options.problems(in.rig)) throw gather::InputError(problem);
  return calibrate_and_write(o, in, options, stop, [&](wave::WaveResult& result, const report::WaveReport& report) {
    note_in(result.rig, "timing",
            "huetrack-calibrate " HUETRACK_VERSION " time, from " + (o.live_s > 0 ? "live cameras" : o.recording) +
                ", " + std::string(report::name(report.verdict)));
  });
}

}  // namespace

void add_time_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<WavedOptions>();
  CLI::App* command =
      app.add_subcommand("time", "estimate the cameras' latencies and readouts from the waved ball, with known poses");
  add_waved_options(*command, *o);
  command->get_option("--config")->required();
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return time(*o, stop); }; });
}

}  // namespace huetrack::program
