#include "daemon/commands.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <type_traits>

#include "daemon/capture_command.h"
#include "daemon/check.h"
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
    "recording.yaml, or the folder that holds it, or the cameras' videos: left=a.mp4 right=b.mp4";
constexpr auto write_rig_help =
    "write the rig here at the end, with the cameras' times (latency, readout) as learnt and those that were moved "
    "where they stand now; not over an existing file";
constexpr auto poses_help = "write the tracked camera's poses to this file, as TUM text: those of state tracking only";

// One of these words, as its value. (CLI11's own transformer names the choices by their numbers when a word is wrong.)
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
        return fmt::format("it is {}, not '{}'", fmt::join(choices, " or "), text);
      },
      "");
}

// Nothing ends, but something is asked for.
std::function<bool(int)> ask(std::atomic<bool>& what) {
  return [&what](int) {
    what = true;
    return false;
  };
}

}  // namespace

// What is done when it is this command that was given, and what signals do meanwhile. run(stop) returns the exit
// status, or nothing: 0.
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
      app.add_subcommand("check", "validate a configuration and print every key's value, and where it comes from");
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
  command->add_option("recording", replay_options.recording, recording_help)->required();
  const std::map<std::string, ReplaySpeed> speeds{{"real", ReplaySpeed::real}, {"max", ReplaySpeed::max}};
  command
      ->add_option("--speed", replay_options.speed,
                   "real: as it was recorded; max (default): as fast as possible, never dropping a frame")
      ->transform(word_of(speeds))
      ->type_name("max|real");
  command->add_option("--tracks", replay_options.tracks, "write the tracks to this CSV file");
  command->add_option("--poses", replay_options.poses, poses_help);
  command->add_option("--pictures", replay_options.pictures,
                      "draw every view of every frame set, and the track, into this folder");
  command->add_option("--pictures-every", replay_options.pictures_every, "only every so many-th frame set")
      ->check(CLI::Range(1, 1'000'000));
  command->add_option("--truth", replay_options.truth,
                      "compare with this CSV file (columns ball or target, t, x, y, z)");
  command->add_option("--write-rig", replay_options.write_rig, write_rig_help);
  const std::map<std::string, ReplayStamps> stamps{{"now", ReplayStamps::now}, {"recording", ReplayStamps::recording}};
  command
      ->add_option("--stamps", replay_options.stamps,
                   "published capture times: now (default at speed real), as if captured in this moment, or recording "
                   "(default at speed max)")
      ->transform(word_of(stamps))
      ->type_name("now|recording");
  command->add_option("--threads", replay_options.threads, "instead of the configuration's")->check(CLI::Range(1, 64));
  command
      ->add_option("--wait-for-subscriber", replay_options.wait_for_subscriber_s,
                   "wait up to so many seconds for a DDS subscriber before the first frame")
      ->check(CLI::Range(0.0, 86400.0));
  command
      ->add_option("--subscribers", replay_options.subscribers, "how many subscribers --wait-for-subscriber waits for")
      ->check(CLI::Range(1, 1000));
  command->add_flag(
      "--hold", replay_options.hold,
      "hold after the first frame set of all cameras, until Go on is pressed on the page: colours may be taught");
  command->add_flag("--no-dds", replay_options.no_dds, "do not publish");
  command->add_flag("--quiet", options->quiet,
                    "no progress bar, and of the summary only warnings and mistakes, to stderr");
  command->add_flag(
      "--strict", options->is_strict,
      "exit status 3 when the tracks show a mistake in rig or configuration (lines `mistake` of the summary), a camera "
      "was moved, blinded or hidden (lines `cameras told`), or a colour left what is looked for (lines `light`)");
  const auto reload = [options](int code) {
    if (code == SI_KERNEL) return true;  // nobody's kill -HUP: its terminal is gone
    options->reload = true;
    return false;
  };
  const auto run = [options](const std::stop_token& stop) {
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

// What run and record share.
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
      "setup", "begin: write a configuration of this host's cameras, run it, and show the page that leads from there");
  command->add_option("config", options->setup.config, "the file to write; one that is there is run as it stands")
      ->capture_default_str();
  command->add_flag("!--only-write", options->setup.with_page, "write the file, and run nothing");
  on_choice(*command, chosen,
            [options](const std::stop_token& stop) { set_up(options->setup, options->requests, stop); },
            {{SIGHUP, ask(options->requests.reload)}, {SIGUSR1, ask(options->requests.save)}});
}

void add_capture_command(CLI::App& app, Command& chosen) {
  const auto config = std::make_shared<std::filesystem::path>();
  CLI::App* command =
      app.add_subcommand("capture", "give this host's cameras to trackers on other hosts, which name them by host:");
  command->add_option("config", *config, "a camera host's configuration: cameras, host, dds, log_level")->required();
  on_choice(*command, chosen, [config](const std::stop_token& stop) { capture_cameras(*config, stop); });
}

void add_record_command(CLI::App& app, Command& chosen) {
  const auto service = std::make_shared<Service>();
  CLI::App* command = app.add_subcommand("record", "record the live cameras of the configuration");
  command->add_option("config", service->config, config_help)->required();
  command->add_option("out", service->live.record_to, "a new folder for the recording")->required();
  command->add_option("--seconds", service->live.seconds, "end so long after the first frame")
      ->check(CLI::Range(0.001, 1e9));
  const auto end = [](int) { return true; };  // its terminal is gone: the recording is ended well
  const auto go_on = [](int) { return false; };
  on_choice(*command, chosen,
            [service](const std::stop_token& stop) { record(service->config, service->live, service->requests, stop); },
            {{SIGHUP, end}, {SIGUSR1, go_on}});
}

void add_doctor_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<doctor::DoctorOptions>();
  CLI::App* command = app.add_subcommand(
      "doctor", "examine this host's cameras, USB, permissions and network, and say what to do about what is wrong");
  command->add_option("config", options->config, "huetrackd.yaml, or a camera host's: examine what it says, too");
  command->add_option("--seconds", options->seconds, "how long all cameras stream at once (3)")
      ->check(CLI::Range(0.5, 3600.0));
  command->add_flag("!--no-stream", options->streams, "look at the cameras without starting them");
  on_choice(*command, chosen,
            [options](const std::stop_token& stop) { return doctor::doctor(*options, stop) > 0 ? 1 : 0; });
}

void add_compare_command(CLI::App& app, Command& chosen) {
  struct Options {
    std::filesystem::path tracks, truth;
    double clock_offset_s = 0;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("compare", "hold a track CSV (of replay or of huetrack watch) to the truth");
  command->add_option("tracks", options->tracks, "CSV of tracks")->required();
  command->add_option("truth", options->truth, "CSV with columns ball or target, t, x, y, z")->required();
  command->add_option("--clock-offset", options->clock_offset_s,
                      "seconds that the tracks' clock is ahead of the truth's");
  on_choice(*command, chosen,
            [options](const std::stop_token&) { compare(options->tracks, options->truth, options->clock_offset_s); });
}

void add_teach_command(CLI::App& app, Command& chosen) {
  const auto teaching = std::make_shared<page::TeachCommand>();
  CLI::App* command = app.add_subcommand(
      "teach", "learn a target's colour from where you point, and write it into a file beside the configuration");
  command->add_option("config", teaching->config, config_help)->required();
  command->add_option("recording", teaching->recording, recording_help + std::string("; or the word live"));
  command->add_option("--at", teaching->at, "the object: CAMERA,FRAME,U,V (frames from 0, pixels); once per camera")
      ->allow_extra_args(false);
  command->add_option("--target", teaching->target, "which one, where there are several");
  command->add_flag("--accept", teaching->accept, "where you did not point, take the place that is suggested");
  command->add_flag("--radius", teaching->radius,
                    "take the radius that the pictures tell, though the configuration says another one");
  command->add_flag("--only", teaching->only,
                    "write it though a suggestion in another camera is neither confirmed nor taken");
  command->add_option("--wider", teaching->wider, "widen the ranges by so many steps; negative: narrow them")
      ->check(CLI::Range(-50, 50));
  command
      ->add_option("--ignore", teaching->ignore,
                   "CAMERA,U_MIN,V_MIN,U_MAX,V_MAX: nothing matches in there; may be repeated; without --at and a "
                   "recording, only these rectangles are saved")
      ->allow_extra_args(false);
  command->add_option("--pictures", teaching->pictures, "draw what matches, one picture per camera, into this folder");
  command->add_flag("--dry-run", teaching->dry_run, "only say what would be learnt");
  CLI::Option* const undo = command->add_flag(
      "--undo", teaching->undo, "what was there before the last save takes its place again; the last twenty are kept");
  command->add_flag("--redo", teaching->redo, "what was undone last is done again")->excludes(undo);

  on_choice(*command, chosen, [teaching](const std::stop_token& stop) { return page::teach(*teaching, stop); });
}

}  // namespace huetrack::daemon
