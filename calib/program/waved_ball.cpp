#include "calib/program/waved_ball.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <memory>
#include <mutex>
#include <thread>

#include "calib/gather/picture_source.h"
#include "calib/gather/progress_line.h"
#include "calib/model/rig_yaml.h"
#include "calib/model/usual_lens.h"
#include "calib/program/outcome.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/wave/wave_coverage.h"
#include "pipeline/live_cameras.h"
#include "recordings/replay_source.h"

namespace huetrack::program {
namespace {

using BallsFrames = std::vector<std::vector<wave::BallFrame>>;  // per target

// All targets in one frame.
class Finder {
 public:
  explicit Finder(const WavedInput& in) {
    for (const object_tracking::TargetOptions& target : in.targets)
      finders_.push_back(std::make_unique<wave::BallFinder>(in.rig, target));
  }
  std::optional<wave::BallFrame> look(std::size_t ball, const capture::Frame& frame) {
    return finders_[ball]->detect(frame);
  }
  std::size_t unusable_frames() const { return finders_.front()->unusable_frames(); }

 private:
  std::vector<std::unique_ptr<wave::BallFinder>> finders_;
};

BallsFrames frames_of_recording(const WavedOptions& o, const WavedInput& in, const std::stop_token& stop) {
  const std::vector<std::string> names = in.rig.camera_names();
  const recordings::Recording recording = recordings::read_recording(o.recording);
  for (const auto& warning : recording.warnings) std::printf("note: %s\n", warning.c_str());
  recordings::ReplaySource source(recording, names);
  for (std::size_t c = 0; c < names.size(); ++c) {
    const recordings::ReplayCamera& camera = source.cameras()[c];
    const calib::ImageSize size = in.rig.cameras[c].image_size;
    if (camera.width != size.width || camera.height != size.height) {
      throw gather::InputError(camera.file.string() + " is " + std::to_string(camera.width) + "x" +
                               std::to_string(camera.height) + ", but " + names[c] + "'s lens was calibrated at " +
                               std::to_string(size.width) + "x" + std::to_string(size.height));
    }
  }
  Finder finder(in);
  wave::WaveCoverage coverage(in.rig);
  gather::ProgressLine progress(!o.quiet);
  BallsFrames frames(in.targets.size());
  wave::BackgroundSamples background(names.size());
  const auto expected = source.expected_frames();
  for (int done = 0; auto frame = source.next(stop); ++done) {
    background.add(*frame);
    for (std::size_t ball = 0; ball < frames.size(); ++ball) {
      auto found = finder.look(ball, *frame);
      if (!found) continue;
      coverage.add(*found, ball);
      frames[ball].push_back(std::move(*found));
    }
    if (progress.due())
      progress.show("looking for the ball", done,
                    expected ? std::optional<int>(static_cast<int>(*expected)) : std::nullopt, coverage.text());
  }
  for (auto& of_ball : frames) wave::refine_outlines(of_ball, background, in.rig, progress.progress());
  progress.clear();
  if (stop.stop_requested()) throw gather::InputError("stopped");
  for (const auto& warning : source.take_warnings()) std::printf("note: %s\n", warning.c_str());
  if (finder.unusable_frames() > 0) std::printf("note: %zu damaged frames omitted\n", finder.unusable_frames());
  return frames;
}

// One thread per camera captures and detects; only the surroundings of the ball are kept.
BallsFrames frames_of_cameras(const WavedOptions& o, const WavedInput& in, const std::stop_token& stop) {
  std::vector<pipeline::LiveCamera> cameras = pipeline::open_cameras(config::with_frames(*in.config));
  if (cameras.size() < 2) throw gather::InputError(o.config + ": cameras: at least two live cameras are needed");
  std::mutex mutex;
  BallsFrames frames(in.targets.size());  // guarded by mutex
  wave::WaveCoverage coverage(in.rig);    // guarded by mutex
  std::optional<double> start;            // guarded by mutex
  std::stop_source end;
  {
    std::vector<std::jthread> threads;
    for (pipeline::LiveCamera& camera : cameras) {
      threads.emplace_back([&, source = camera.source.get()] {
        Finder finder(in);
        wave::BackgroundSamples background(in.rig.cameras.size());
        BallsFrames seen(in.targets.size());
        while (const auto frame = source->next(end.get_token())) {
          background.add(*frame);
          for (std::size_t ball = 0; ball < in.targets.size(); ++ball) {
            auto found = finder.look(ball, *frame);
            if (!found) continue;
            const std::lock_guard lock(mutex);
            if (!start) start = found->t_s;
            found->t_s -= *start;
            coverage.add(*found, ball);
            seen[ball].push_back(std::move(*found));
          }
        }
        for (std::size_t ball = 0; ball < seen.size(); ++ball) {
          wave::refine_outlines(seen[ball], background, in.rig);
          const std::lock_guard lock(mutex);
          std::ranges::move(seen[ball], std::back_inserter(frames[ball]));
        }
      });
    }
    gather::ProgressLine progress(!o.quiet);
    const auto began = std::chrono::steady_clock::now();
    double s = 0;
    while (!stop.stop_requested() &&
           (s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count()) < o.live_s) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      const std::lock_guard lock(mutex);
      if (progress.due())
        progress.show("wave the ball", static_cast<int>(s), static_cast<int>(o.live_s), coverage.text());
    }
    progress.clear();
    end.request_stop();
  }
  return frames;
}

}  // namespace

void add_waved_options(CLI::App& command, WavedOptions& o) {
  command.add_option("recording", o.recording, "recording.yaml, or the folder that holds it");
  command.add_option("--config", o.config, "huetrackd.yaml: targets, the rig to start from, live cameras");
  command.add_option("--target", o.targets, "the waved target; repeat for another ball of the same size");
  command.add_option("--rig", o.rig, "the rig file to write")->required();
  command.add_option("--report", o.report, "write the report: NAME.html and NAME.pdf");
  command.add_option("--live", o.live_s, "use the live cameras for this many seconds")->check(CLI::PositiveNumber);
  command.add_option("--temperature", o.temperature_c, "of the room, degrees Celsius; saved in the rig file")
      ->check(CLI::Range(-90.0, 150.0));
  command.add_flag("--overwrite", o.overwrite, "a doubtful result may replace an existing rig");
  command.add_flag("--quiet", o.quiet, "no progress");
}

std::string names_of(const std::vector<object_tracking::TargetOptions>& targets) {
  std::vector<std::string_view> names;
  for (const object_tracking::TargetOptions& target : targets) names.emplace_back(target.name);
  return fmt::to_string(fmt::join(names, ", "));
}

calib::CameraRig guessed_rig(const std::string& recording, const std::vector<std::string>& names) {
  calib::CameraRig rig;
  for (const recordings::ReplayCamera& of :
       recordings::ReplaySource(recordings::read_recording(recording), names).cameras())
    rig.cameras.push_back(calib::guessed_camera(names[rig.cameras.size()], {of.width, of.height}));
  return rig;
}

WavedInput configured_input(const WavedOptions& o) {
  WavedInput in;
  in.config = config::load_service_config(o.config);
  in.has_rig = in.config->is_calibrated();
  in.rig = in.has_rig || o.recording.empty() ? in.config->rig : guessed_rig(o.recording, in.config->rig.camera_names());
  const auto& known = in.config->targets;
  const std::string names = names_of(known);
  if (o.targets.empty() && known.size() > 1)
    throw gather::InputError(o.config + " has several targets: choose with --target: " + names);
  if (o.targets.empty()) in.targets = known;
  for (const auto& name : o.targets) {
    const auto target = std::ranges::find(known, name, &object_tracking::TargetOptions::name);
    if (target == known.end()) throw gather::InputError(o.config + " has no target " + name + ": it has " + names);
    if (!in.targets.empty() && in.targets.front().radius_m != target->radius_m)
      throw gather::InputError("--target: " + in.targets.front().name + " and " + name +
                               " have different radii: wave one of them");
    in.targets.push_back(*target);
  }
  return in;
}

std::vector<wave::BallFrame> waved_frames(const WavedOptions& o, const WavedInput& in, const std::stop_token& stop) {
  if (o.recording.empty() == (o.live_s <= 0)) throw gather::InputError("give a recording, or --live SECONDS");
  if (o.live_s > 0 && o.config.empty()) throw gather::InputError("--live needs --config, which names the cameras");
  return wave::one_after_the_other(o.live_s > 0 ? frames_of_cameras(o, in, stop) : frames_of_recording(o, in, stop),
                                   in.rig.cameras.size());
}

ExitStatus calibrate_and_write(const WavedOptions& o, const WavedInput& in, wave::WaveOptions options,
                               const std::stop_token& stop,
                               const std::function<void(wave::WaveResult&, const report::WaveReport&)>& note) {
  std::vector<wave::BallFrame> frames = waved_frames(o, in, stop);
  gather::ProgressLine progress(!o.quiet);
  options.progress = progress.progress();
  wave::WaveResult result = wave::calibrate_wave(in.rig, std::move(frames), options);
  progress.clear();
  const report::WaveReport report = report::report_on(result, reader());
  std::fputs(report::to_text(report, result).c_str(), stdout);
  send_verdict(report.verdict, report::summary(report, result));
  if (!o.report.empty()) write_document(report::document_of(report, result), o.report);
  note(result, report);
  for (const auto& problem : result.rig.problems())
    throw solver::CalibrationError("the result is not a valid rig: " + problem);
  const std::filesystem::path file = place_for(report.verdict, o.rig, o.overwrite);
  calib::write_rig(result.rig, file);
  if (!options.hold_poses) std::printf("%s", report::next_step_text(result).c_str());
  std::printf("%s\n", file.c_str());
  return status_of(report.verdict);
}

}  // namespace huetrack::program
