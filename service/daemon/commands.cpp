#include "daemon/commands.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <type_traits>

#include "calib/files/number_text.h"
#include "daemon/capture_command.h"
#include "daemon/check.h"
#include "daemon/demo_command.h"
#include "daemon/live.h"
#include "daemon/replay.h"
#include "daemon/setup_command.h"
#include "doctor/doctor.h"
#include "page/teach.h"

namespace huetrack::daemon {
namespace {

constexpr int mistakes_status = 3;  // of replay --strict
constexpr auto config_help = "huetrackd.yaml";
constexpr auto recording_help =
    "recording.yaml, or its folder, a ROS bag, or the cameras' videos: left=a.mp4 right=b.mp4";
constexpr auto write_rig_help =
    "write the rig to this new file at the end, with the estimated timing (latency, readout) and the current poses of "
    "moved cameras";
constexpr auto poses_help = "write the tracked camera's poses in state tracking to this file, as TUM text";

// Maps words to values. (CLI11's own transformer shows numbers in its error message.)
template <typename Value>
CLI::Validator word_of(const std::map<std::string, Value>& words) {
  return CLI::Validator(
      [words](std::string& text) {
        if (const auto word = words.find(text); word != words.end()) {
          text = std::to_string(static_cast<int>(word->second));
          return std::string();
        }
        std::vector<std::string> choices;
        for (const auto& [word, _] : words) choices.push_back(word);
        return fmt::format("must be {}, not '{}'", fmt::join(choices, " or "), text);
      },
      "");
}

// max: 0, real: 1, or a number.
CLI::Validator play_speed() {
  static constexpr double slowest = 0.1, fastest = 10;
  return CLI::Validator(
      [](std::string& text) {
        if (text == "max") text = "0";
        if (text == "real") text = "1";
        const auto speed = files::number_of<double>(text);
        if (speed && (*speed == 0 || (*speed >= slowest && *speed <= fastest))) return std::string();
        return fmt::format("must be max, real, or a number from {} to {}, not '{}'", slowest, fastest, text);
      },
      "");
}

// A signal handler that sets a flag and does not stop the program.
std::function<bool(int)> ask(std::atomic<bool>& what) {
  return [&what](int) {
    what = true;
    return false;
  };
}

}  // namespace

// Sets the action of a command and its signal handlers. run(stop) returns the exit status, or void for 0.
template <typename Run>
void on_choice(CLI::App& command, Command& chosen, Run run, const Signals::Others& on_signal = {}) {
  command.callback([run, on_signal, &chosen] {
    chosen.on_signal = on_signal;
    chosen.run = [run](const std::stop_token& stop) -> int {
      if constexpr (!std::is_void_v<std::invoke_result_t<Run, const std::stop_token&>>) return run(stop);
      run(stop);
      return 0;
    };
  });
}

void add_check_command(CLI::App& app, Command& chosen) {
  const auto config = std::make_shared<std::filesystem::path>();
  CLI::App* command =
      app.add_subcommand("check", "validate a configuration and print every key with its value and origin");
  command->add_option("config", *config, config_help)->required();
  on_choice(*command, chosen, [config](const std::stop_token&) { check(*config); });
}

void add_replay_command(CLI::App& app, Command& chosen) {
  struct Options {
    ReplayCommand replay;
    bool quiet = false;
    bool is_strict = false;
    std::atomic<bool> reload = false;
  };
  const auto options = std::make_shared<Options>();
  ReplayCommand& replay_options = options->replay;
  CLI::App* command = app.add_subcommand("replay", "track a recording");
  command->add_option("config", replay_options.config, config_help)->required();
  command->add_option("recording", replay_options.recording, recording_help);
  command
      ->add_option("--speed", replay_options.speed,
                   "real: as recorded; 0.1 to 10: so many times that; max (default): as fast as possible, never "
                   "dropping a frame")
      ->transform(play_speed())
      ->type_name("max|real|0.1..10");
  command->add_flag(
      "--loop", replay_options.loops,
      "begin again at the end, until Ctrl-C; published times go on rising, and --truth compares the first pass");
  command->add_option("--tracks", replay_options.tracks, "write the tracks to this CSV file");
  command->add_option("--poses", replay_options.poses, poses_help);
  command->add_option("--pictures", replay_options.pictures,
                      "draw every view of every frame set, and the track, to this folder");
  command->add_option("--pictures-every", replay_options.pictures_every, "draw only every n-th frame set")
      ->check(CLI::Range(1, 1'000'000));
  command->add_option("--truth", replay_options.truth,
                      "compare with this CSV file (columns ball or target, t, x, y, z)");
  command->add_option("--write-rig", replay_options.write_rig, write_rig_help);
  const std::map<std::string, ReplayStamps> stamps{{"now", ReplayStamps::now}, {"recording", ReplayStamps::recording}};
  command
      ->add_option("--stamps", replay_options.stamps,
                   "published capture times: now (default unless at speed max), as if captured now, or recording "
                   "(default at speed max)")
      ->transform(word_of(stamps))
      ->type_name("now|recording");
  command->add_option("--threads", replay_options.threads, "instead of the configuration's")->check(CLI::Range(1, 64));
  command
      ->add_option("--wait-for-subscriber", replay_options.wait_for_subscriber_s,
                   "wait up to this many seconds for a DDS subscriber before the first frame")
      ->check(CLI::Range(0.0, 86400.0));
  command->add_option("--subscribers", replay_options.subscribers, "number of subscribers for --wait-for-subscriber")
      ->check(CLI::Range(1, 1000));
  command->add_flag(
      "--hold", replay_options.hold,
      "pause after the first frame set of all cameras, to teach colours, until Go on is pressed on the page");
  command->add_flag("--no-dds", replay_options.no_dds, "do not publish");
  command->add_flag("--quiet", options->quiet,
                    "no progress bar, and of the summary only warnings and mistakes, to stderr");
  command->add_flag("--strict", options->is_strict,
                    "exit status 3 if the tracks show a mistake in rig or configuration (lines `mistake` of the "
                    "summary), a target was never tracked, a camera was moved, blinded or hidden (lines `cameras`), or "
                    "a colour left its range (lines `light`)");
  const auto reload = [options](int code) {
    if (code == SI_KERNEL) return true;  // not kill -HUP: its terminal is gone
    options->reload = true;
    return false;
  };
  const auto run = [options](const std::stop_token& stop) {
    if (options->replay.recording.empty())
      throw std::runtime_error(options->replay.config.string() + ": no recording was given: " + recording_help);
    options->replay.progress = !options->quiet;
    options->replay.reload = &options->reload;
    const ReplaySummary summary = replay(options->replay, stop);
    if (options->quiet) {
      std::fputs(problems_text(summary).c_str(), stderr);
    } else {
      std::fputs(to_text(summary, options->replay).c_str(), stdout);
    }
    return options->is_strict && has_trouble(summary) ? mistakes_status : 0;
  };
  on_choice(*command, chosen, run, {{SIGHUP, reload}});
}

namespace {

// Options of run and record.
struct Service {
  std::filesystem::path config;
  LiveCommand live = {};
  LiveRequests requests;
};

}  // namespace

void add_run_command(CLI::App& app, Command& chosen) {
  const auto service = std::make_shared<Service>();
  CLI::App* command = app.add_subcommand("run", "track with the live cameras of the configuration");
  command->add_option("config", service->config, config_help)->required();
  command->add_option("--tracks", service->live.tracks, "write the tracks to this CSV file");
  command->add_option("--poses", service->live.poses, poses_help);
  command->add_option("--write-rig", service->live.write_rig, write_rig_help);
  command->add_flag("--no-dds", service->live.no_dds, "do not publish");
  on_choice(*command, chosen,
            [service](const std::stop_token& stop) { run(service->config, service->live, service->requests, stop); },
            {{SIGHUP, ask(service->requests.reload)}, {SIGUSR1, ask(service->requests.save)}});
}

void add_setup_command(CLI::App& app, Command& chosen) {
  struct Options {
    SetUpCommand setup{.config = "huetrackd.yaml"};
    LiveRequests requests;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "setup", "start here: write a configuration of this host's cameras, run it, and open the page, which guides you");
  command->add_option("config", options->setup.config, "the file to write; an existing file is run unchanged")
      ->capture_default_str();
  command->add_flag("!--only-write", options->setup.with_page, "only write the file");
  command
      ->add_option("--fov", options->setup.fov_deg,
                   "degrees that the picture of a single camera is wide; without it 60 is assumed")
      ->check(CLI::Range(10.0, 160.0));
  command->add_option("--film", options->setup.film,
                      "instead: write the configuration for this film of one camera that is not calibrated");
  on_choice(*command, chosen,
            [options](const std::stop_token& stop) {
              if (options->setup.film.empty())
                set_up(options->setup, options->requests, stop);
              else
                set_up_film(options->setup, stop);
            },
            {{SIGHUP, ask(options->requests.reload)}, {SIGUSR1, ask(options->requests.save)}});
}

void add_demo_command(CLI::App& app, Command& chosen) {
  struct Options {
    DemoCommand demo;
    LiveRequests requests;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("demo", "without cameras: play the bundled recording in their place, and open the page on it");
  command->add_option("folder", options->demo.folder,
                      "keep the demo's files, and what you teach and record, in this folder");
  command
      ->add_option("--port", options->demo.port,
                   "TCP port of the page; 0: any free one; default: 8765, or another one if that is in use")
      ->check(CLI::Range(0, 65535));
  command->add_flag("!--no-page", options->demo.with_page, "without the page");
  on_choice(*command, chosen,
            [options](const std::stop_token& stop) { run_demo(options->demo, options->requests, stop); },
            {{SIGHUP, ask(options->requests.reload)}, {SIGUSR1, ask(options->requests.save)}});
}

void add_capture_command(CLI::App& app, Command& chosen) {
  const auto config = std::make_shared<std::filesystem::path>();
  CLI::App* command = app.add_subcommand(
      "capture", "export this host's cameras to trackers on other hosts, which refer to them by host:");
  command->add_option("config", *config, "a camera host's configuration: cameras, host, dds, log_level")->required();
  on_choice(*command, chosen, [config](const std::stop_token& stop) { capture_cameras(*config, stop); });
}

void add_record_command(CLI::App& app, Command& chosen) {
  const auto service = std::make_shared<Service>();
  CLI::App* command = app.add_subcommand("record", "record the live cameras of the configuration");
  command->add_option("config", service->config, config_help)->required();
  command->add_option("out", service->live.record_to, "a new folder for the recording")->required();
  command->add_option("--seconds", service->live.seconds, "end this long after the first frame")
      ->check(CLI::Range(0.001, 1e9));
  const auto end = [](int) { return true; };  // its terminal is gone: end the recording properly
  const auto go_on = [](int) { return false; };
  on_choice(*command, chosen,
            [service](const std::stop_token& stop) { record(service->config, service->live, service->requests, stop); },
            {{SIGHUP, end}, {SIGUSR1, go_on}});
}

void add_doctor_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<doctor::DoctorOptions>();
  CLI::App* command = app.add_subcommand(
      "doctor", "examine this host's cameras, USB, permissions and network, with advice for each problem");
  command->add_option("config", options->config, "huetrackd.yaml, or that of a camera host: examine it, too");
  command->add_option("--seconds", options->seconds, "how long all cameras stream at once (3)")
      ->check(CLI::Range(0.5, 3600.0));
  command->add_flag("!--no-stream", options->streams, "examine the cameras without streaming");
  on_choice(*command, chosen,
            [options](const std::stop_token& stop) { return doctor::doctor(*options, stop) > 0 ? 1 : 0; });
}

void add_compare_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<CompareCommand>();
  CLI::App* command =
      app.add_subcommand("compare", "compare a track CSV (of replay or huetrack watch) with ground truth");
  command->add_option("tracks", options->tracks, "CSV of tracks")->required();
  command
      ->add_option("truth", options->truth,
                   "CSV with columns ball or target, t, x, y, z; CSV of Motive or Vicon, TSV of Qualisys, TUM")
      ->required();
  command->add_option("--clock-offset", options->clock_offset_s, "the tracks' clock minus the truth's, seconds");
  const std::map<std::string, truth::Freedom> freedoms{
      {"none", truth::Freedom::none}, {"rigid", truth::Freedom::rigid}, {"similarity", truth::Freedom::similarity}};
  command->add_option("--align", options->align, "first align the tracks with the truth; similarity: with a scale")
      ->transform(word_of(freedoms))
      ->type_name("none|rigid|similarity");
  command->add_flag("--align-time", options->align_time, "first estimate the clock offset, as far as both overlap");
  on_choice(*command, chosen, [options](const std::stop_token&) { compare(*options); });
}

void add_teach_command(CLI::App& app, Command& chosen) {
  const auto teaching = std::make_shared<page::TeachCommand>();
  CLI::App* command = app.add_subcommand(
      "teach", "learn a target's colour from a point on it, and save it in a file next to the configuration");
  command->add_option("config", teaching->config, config_help)->required();
  command->add_option("recording", teaching->recording, recording_help + std::string("; or the word live"));
  command->add_option("--at", teaching->at, "the object: CAMERA,FRAME,U,V (frames from 0, pixels); once per camera")
      ->allow_extra_args(false);
  command->add_option("--target", teaching->target, "the target, if there are several");
  command->add_flag("--accept", teaching->accept, "accept the suggested places in views without --at");
  command->add_flag("--radius", teaching->radius,
                    "use the radius measured in the pictures instead of the configured one");
  command->add_flag("--only", teaching->only,
                    "save it although a suggestion in another camera is neither confirmed nor accepted");
  command->add_flag("--force", teaching->force,
                    "save it although the object is not tracked with it in the recording; not what was accepted");
  command
      ->add_option(
          "--wider", teaching->wider,
          "widen the ranges by this many steps; negative: narrow them; 0: as a trial on the recording decides; with "
          "--at")
      ->check(CLI::Range(-50, 50));
  command
      ->add_option("--ignore", teaching->ignore,
                   "CAMERA,U_MIN,V_MIN,U_MAX,V_MAX: a rectangle to ignore; may be repeated; without --at and a "
                   "recording, only these rectangles are saved")
      ->allow_extra_args(false);
  command->add_option("--pictures", teaching->pictures,
                      "draw the matching pixels, one picture per camera, to this folder");
  command->add_flag("--dry-run", teaching->dry_run, "only print what would be learnt");
  CLI::Option* const undo = command->add_flag("--undo", teaching->undo, "undo the last save; the last twenty are kept");
  command->add_flag("--redo", teaching->redo, "redo the last undone save")->excludes(undo);

  on_choice(*command, chosen, [teaching](const std::stop_token& stop) { return page::teach(*teaching, stop); });
}

}  // namespace huetrack::daemon
