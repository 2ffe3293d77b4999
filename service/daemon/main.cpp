// huetrackd: the service, on live cameras and on recordings.
#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <iterator>
#include <map>
#include <stop_token>
#include <thread>

#include "config/service_config.h"
#include "daemon/doctor.h"
#include "daemon/live.h"
#include "daemon/replay.h"
#include "daemon/service_manager.h"
#include "daemon/teach.h"
#include "publish/estimate_publisher.h"
#include "tracks/track_csv.h"
#include "tracks/truth.h"

namespace {

using namespace huetrack;

// One of these words, as its value. (CLI11's own transformer names the choices by their numbers when a word is wrong.)
template <typename Value>
CLI::Validator word_of(const std::map<std::string, Value>& words) {
  return CLI::Validator(
      [words](std::string& text) {
        if (const auto word = words.find(text); word != words.end()) {
          text = std::to_string(static_cast<int>(word->second));
          return std::string();
        }
        std::string choices;
        for (const auto& [word, _] : words) choices += (choices.empty() ? "" : " or ") + word;
        return "it is " + choices + ", not '" + text + "'";
      },
      "");
}

// SIGINT and SIGTERM become a stop request, others what they are mapped to, taken by a thread that waits for them:
// nothing runs inside a signal handler. A second SIGINT or SIGTERM ends the program at once. Create it before any other
// thread, so that all inherit the blocked signals.
class Signals {
 public:
  // Until there is one, a signal waits: one of the first milliseconds is not lost, nor does it end the program.
  static void hold() {
    sigset_t all;
    sigemptyset(&all);
    for (const int signal : held) sigaddset(&all, signal);
    pthread_sigmask(SIG_BLOCK, &all, nullptr);
  }

  // code: the signal's si_code. True: stop.
  using Others = std::map<int, std::function<bool(int code)>>;
  explicit Signals(Others others) : others_(std::move(others)) {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    for (const auto& [signal, _] : others_) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    sigset_t unwanted;
    sigemptyset(&unwanted);
    for (const int signal : held)
      if (sigismember(&signals_, signal) == 0) sigaddset(&unwanted, signal);
    pthread_sigmask(SIG_UNBLOCK, &unwanted, nullptr);
    thread_ = std::jthread([this](const std::stop_token& end) {
      while (!end.stop_requested()) {
        const timespec patience{.tv_sec = 0, .tv_nsec = 50'000'000};
        siginfo_t info{};
        const int signal = sigtimedwait(&signals_, &info, &patience);
        if (signal < 0) continue;
        if (const auto other = others_.find(signal); other != others_.end()) {
          if (!other->second(info.si_code)) continue;
        }
        if (!stop_.request_stop()) std::_Exit(128 + signal);
        spdlog::info("stopping: {}", signal == SIGINT    ? "SIGINT"
                                     : signal == SIGTERM ? "SIGTERM"
                                                         : "the terminal is gone");
      }
    });
  }
  std::stop_token token() const { return stop_.get_token(); }

 private:
  static constexpr std::array held{SIGINT, SIGTERM, SIGHUP, SIGUSR1};

  Others others_;
  sigset_t signals_{};
  std::stop_source stop_;
  std::jthread thread_;
};

// The status to end with; or the end, when a thread still hangs in the driver of a camera that has locked up.
int end_with(int status) {
  const auto names = capture::abandoned_cameras();
  if (names.empty()) return status;
  for (const auto& name : names) spdlog::warn("camera {}: it does not answer, the end does not wait for it", name);
  spdlog::default_logger()->flush();
  std::fflush(nullptr);
  std::_Exit(status);
}

void check(const std::filesystem::path& file) {
  const config::ServiceConfig config = config::load_service_config(file);
  auto warnings = config::warnings_of(config);
  if (config.dds.enabled)
    std::ranges::copy(publish::EstimatePublisher::check(config.dds.publisher), std::back_inserter(warnings));
  for (const auto& warning : warnings) spdlog::warn("{}: {}", config.file.string(), warning);
  std::printf("# %s, resolved; identity %s\n%s", config.file.c_str(), config::config_identity(config).c_str(),
              config::to_yaml_with_origins(config).c_str());
  if (config.targets.empty()) return;
  const auto coverage = config::volume_coverage(config.rig, config.object_tracking.volume);
  std::printf("# of the volume are seen: by two or more cameras %.0f %%, by one or more %.0f %%", 100 * coverage.by_two,
              100 * coverage.by_one);
  for (std::size_t c = 0; c < config.rig.cameras.size(); ++c) {
    std::printf(", by %s %.0f %%", config.rig.cameras[c].name.c_str(), 100 * coverage.per_camera[c]);
  }
  std::printf("\n");
}

void run(const std::filesystem::path& file, const daemon::LiveOptions& options, daemon::LiveRequests& requests,
         const std::stop_token& stop) {
  const config::ServiceConfig config = config::load_service_config(file);
  daemon::set_log_level(config.log_level);
  const daemon::LiveSummary summary =
      daemon::run_live(config, daemon::open_cameras(config, stop), options, requests, stop);
  spdlog::info("stopped after {} frame sets, {} samples published", summary.figures.sets_tracked, summary.published);
}

void record(const std::filesystem::path& file, daemon::LiveOptions options, daemon::LiveRequests& requests,
            const std::stop_token& stop) {
  const config::ServiceConfig config = config::load_service_config(file);
  daemon::set_log_level(config.log_level);
  options.track = false;
  const daemon::LiveSummary summary =
      daemon::run_live(config, daemon::open_cameras(config, stop), options, requests, stop);
  std::printf("%s\n", options.record_to.c_str());
  for (const auto& camera : config.cameras) {
    const auto c = std::size_t(config.rig.index_of(camera.name).value());
    const capture::RecordedCameraFigures& recorded = summary.recorded.cameras[c];
    std::printf("  %-10s %llu frames, %.1f MB; %llu lost by the camera, %llu by the disk, %llu left out\n",
                camera.name.c_str(), static_cast<unsigned long long>(recorded.frames), double(recorded.bytes) / 1e6,
                static_cast<unsigned long long>(summary.figures.cameras[c].dropped),
                static_cast<unsigned long long>(summary.recorded.dropped[c]),
                static_cast<unsigned long long>(recorded.left_out));
  }
  if (summary.recorded.failure) throw std::runtime_error(*summary.recorded.failure);
  if (std::ranges::all_of(summary.recorded.cameras, [](const auto& camera) { return camera.frames == 0; }))
    throw std::runtime_error(options.record_to.string() +
                             ": no camera has delivered a frame: the recording is empty; huetrackd doctor says why");
}

void compare(const std::filesystem::path& tracks_file, const std::filesystem::path& truth_file, double clock_offset_s) {
  tracks::Truth truth = tracks::Truth::read(truth_file);
  auto tracks = tracks::read_track_csv(tracks_file);
  std::vector<std::string> targets;
  for (const auto& [target, _] : tracks) targets.push_back(target);
  for (const auto& sentence : truth.match(targets)) spdlog::warn("{}: {}", truth_file.string(), sentence);
  for (auto& [target, track] : tracks) {
    if (!truth.targets().contains(target)) continue;
    tracks::TruthComparison comparison(truth, target);
    for (object_tracking::ObjectEstimate& estimate : track) {
      estimate.at -= capture::duration_of(clock_offset_s);
      comparison.add(estimate);
    }
    std::printf("%s: %zu samples; %s\n", target.c_str(), track.size(), tracks::to_text(comparison.figures()).c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  Signals::hold();
  daemon::set_up_log();
  signal(SIGXFSZ, SIG_IGN);  // a recording that meets the limit of file sizes ends with a message, the program does not

  CLI::App app("huetrackd: tracks coloured objects in 3-D with calibrated cameras, and publishes them over DDS");
  app.set_version_flag("--version", "huetrackd " HUETRACK_VERSION);
  app.require_subcommand(1);

  std::filesystem::path config_file;
  CLI::App* check_command =
      app.add_subcommand("check", "validate a configuration and print it resolved: every key, default or given");
  check_command->add_option("config", config_file, "huetrackd.yaml")->required();

  daemon::ReplayCommand command;
  bool quiet = false;
  CLI::App* replay_command = app.add_subcommand("replay", "track a recording");
  replay_command->add_option("config", command.config, "huetrackd.yaml")->required();
  replay_command->add_option("recording", command.recording, "recording.yaml, or the folder that holds it")->required();
  const std::map<std::string, daemon::ReplaySpeed> speeds{{"real", daemon::ReplaySpeed::real},
                                                          {"max", daemon::ReplaySpeed::max}};
  replay_command
      ->add_option("--speed", command.speed,
                   "real: as it was recorded; max (default): as fast as possible, never dropping a frame")
      ->transform(word_of(speeds))
      ->type_name("max|real");
  replay_command->add_option("--tracks", command.tracks, "write the tracks to this CSV file");
  const char* const poses_help =
      "write the tracked camera's poses to this file, as TUM text: those of state tracking only";
  replay_command->add_option("--poses", command.poses, poses_help);
  replay_command->add_option("--pictures", command.pictures,
                             "draw every view of every frame set, and the track, into this folder");
  replay_command->add_option("--pictures-every", command.pictures_every, "only every so many-th frame set")
      ->check(CLI::Range(1, 1'000'000));
  replay_command->add_option("--truth", command.truth, "compare with this CSV file (columns ball, t, x, y, z)");
  const std::map<std::string, daemon::ReplayStamps> stamps{{"now", daemon::ReplayStamps::now},
                                                           {"recording", daemon::ReplayStamps::recording}};
  replay_command
      ->add_option("--stamps", command.stamps,
                   "published capture times: now (default at speed real), as if captured in this moment, or recording "
                   "(default at speed max)")
      ->transform(word_of(stamps))
      ->type_name("now|recording");
  replay_command->add_option("--threads", command.threads, "instead of the configuration's")->check(CLI::Range(1, 64));
  replay_command
      ->add_option("--wait-for-subscriber", command.wait_for_subscriber_s,
                   "wait up to so many seconds for a DDS subscriber before the first frame")
      ->check(CLI::Range(0.0, 86400.0));
  replay_command->add_flag("--hold", command.hold,
                           "hold after the first frame set, until Go on is pressed on the page: colours may be taught");
  replay_command->add_flag("--no-dds", command.no_dds, "do not publish");
  replay_command->add_flag("--quiet", quiet, "no progress bar and no summary");

  daemon::LiveOptions live;
  CLI::App* run_command = app.add_subcommand("run", "track with the live cameras of the configuration");
  run_command->add_option("config", config_file, "huetrackd.yaml")->required();
  run_command->add_option("--tracks", live.tracks, "write the tracks to this CSV file");
  run_command->add_option("--poses", live.poses, poses_help);
  run_command->add_flag("--no-dds", live.no_dds, "do not publish");

  CLI::App* record_command = app.add_subcommand("record", "record the live cameras of the configuration");
  record_command->add_option("config", config_file, "huetrackd.yaml")->required();
  record_command->add_option("out", live.record_to, "a new folder for the recording")->required();
  record_command->add_option("--seconds", live.seconds, "end so long after the first frame")
      ->check(CLI::Range(0.001, 1e9));

  daemon::DoctorOptions doctor_options;
  CLI::App* doctor_command = app.add_subcommand(
      "doctor", "examine this host's cameras, USB, permissions and network, and say what to do about what is wrong");
  doctor_command->add_option("config", doctor_options.config, "huetrackd.yaml: examine what it says, too");
  doctor_command->add_option("--seconds", doctor_options.seconds, "how long all cameras stream at once (3)")
      ->check(CLI::Range(0.5, 3600.0));
  doctor_command->add_flag("!--no-stream", doctor_options.streams, "look at the cameras without starting them");

  std::filesystem::path tracks_file, truth_file;
  CLI::App* compare_command =
      app.add_subcommand("compare", "hold a track CSV (of replay or of huetrack watch) to the truth");
  compare_command->add_option("tracks", tracks_file, "CSV of tracks")->required();
  compare_command->add_option("truth", truth_file, "CSV with columns ball, t, x, y, z")->required();
  double clock_offset_s = 0;
  compare_command->add_option("--clock-offset", clock_offset_s,
                              "seconds that the tracks' clock is ahead of the truth's");

  daemon::TeachCommand teaching;
  CLI::App* teach_command = app.add_subcommand(
      "teach", "learn a target's colour from where you point, and write it into a file beside the configuration");
  teach_command->add_option("config", teaching.config, "huetrackd.yaml")->required();
  teach_command
      ->add_option("recording", teaching.recording, "recording.yaml, the folder that holds it, or the word live")
      ->required();
  teach_command
      ->add_option("--at", teaching.at, "the object: CAMERA,FRAME,U,V (frames from 0, pixels); once per camera")
      ->allow_extra_args(false);
  teach_command->add_option("--target", teaching.target, "which one, where there are several");
  teach_command->add_flag("--accept", teaching.accept, "where you did not point, take the place that is suggested");
  teach_command->add_flag("--only", teaching.only,
                          "write it though a suggestion in another camera is neither confirmed nor taken");
  teach_command->add_option("--wider", teaching.wider, "widen the ranges by so many steps; negative: narrow them")
      ->check(CLI::Range(-50, 50));
  teach_command
      ->add_option("--ignore", teaching.ignore,
                   "CAMERA,U_MIN,V_MIN,U_MAX,V_MAX: nothing matches in there; may be repeated")
      ->allow_extra_args(false);
  teach_command->add_option("--pictures", teaching.pictures,
                            "draw what matches, one picture per camera, into this folder");
  teach_command->add_flag("--dry-run", teaching.dry_run, "only say what would be learnt");

  CLI11_PARSE(app, argc, argv);

  daemon::LiveRequests requests;
  Signals::Others on_signal;
  const auto ask = [](std::atomic<bool>& what) {
    return [&what](int) {
      what = true;
      return false;
    };
  };
  if (run_command->parsed()) {
    on_signal[SIGHUP] = ask(requests.reload);
    on_signal[SIGUSR1] = ask(requests.save);
  } else if (record_command->parsed()) {
    on_signal[SIGHUP] = [](int) { return true; };  // its terminal is gone: the recording is ended well
    on_signal[SIGUSR1] = [](int) { return false; };
  } else if (replay_command->parsed()) {
    command.reload = &requests.reload;
    on_signal[SIGHUP] = [&](int code) {
      if (code == SI_KERNEL) return true;  // nobody's kill -HUP: its terminal is gone
      requests.reload = true;
      return false;
    };
  }
  const Signals signals(std::move(on_signal));
  try {
    if (check_command->parsed()) {
      check(config_file);
    } else if (doctor_command->parsed()) {
      if (daemon::doctor(doctor_options, signals.token()) > 0) return 1;
    } else if (compare_command->parsed()) {
      compare(tracks_file, truth_file, clock_offset_s);
    } else if (teach_command->parsed()) {
      const int status = daemon::teach(teaching, signals.token());
      if (status != 0) return end_with(status);
    } else if (run_command->parsed()) {
      run(config_file, live, requests, signals.token());
    } else if (record_command->parsed()) {
      record(config_file, live, requests, signals.token());
    } else {
      command.progress = !quiet;
      const daemon::ReplaySummary summary = daemon::replay(command, signals.token());
      if (!quiet) std::fputs(daemon::to_text(summary, command).c_str(), stdout);
    }
  } catch (const std::exception& error) {  // the user's input or the outside world: said once, in one line, here
    std::fprintf(stderr, "%shuetrackd: %s\n", daemon::journal_prefix(), error.what());
    return end_with(1);
  }
  if (std::fflush(stdout) != 0) {
    std::fprintf(stderr, "huetrackd: cannot write to standard output\n");
    return end_with(1);
  }
  return end_with(0);
}
