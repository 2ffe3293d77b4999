// huetrack-calibrate wave: camera poses from the coloured object itself, waved through the volume.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <memory>
#include <mutex>
#include <thread>

#include "calib/gather/picture_source.h"
#include "calib/gather/progress_line.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/outcome.h"
#include "calib/report/wave_report.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/wave/wave.h"
#include "capture/replay_source.h"
#include "config/service_config.h"
#include "pipeline/live_cameras.h"

namespace huetrack::program {
namespace {

struct WaveCommand {
  std::string recording, config, rig;
  std::vector<std::string> targets;
  std::vector<std::string> lenses, camera_distance;
  std::vector<double> hue, saturation{0.3, 1}, intensity{0.1, 0.95}, marks;
  double radius_mm = 40, rest_distance = 0, live_s = 0;
  bool no_poses = false, quiet = false, overwrite = false;
};

// What is to be calibrated, with which ball.
struct Input {
  calib::CameraRig rig;
  std::vector<object_tracking::TargetOptions> targets;
  std::optional<config::ServiceConfig> config;
};

std::string names_of(const std::vector<object_tracking::TargetOptions>& targets) {
  std::vector<std::string_view> names;
  for (const object_tracking::TargetOptions& target : targets) names.emplace_back(target.name);
  return fmt::to_string(fmt::join(names, ", "));
}

Input input_of(const WaveCommand& o) {
  Input in;
  if (!o.config.empty()) {
    if (!o.lenses.empty() || !o.hue.empty())
      throw gather::InputError("--config says lenses and colours: leave --lens and --hue out");
    in.config = config::load_service_config(o.config);
    in.rig = in.config->rig;
    const auto& known = in.config->targets;
    const std::string names = names_of(known);
    if (o.targets.empty() && known.size() > 1)
      throw gather::InputError(o.config + " has several targets: say which with --target: " + names);
    if (o.targets.empty()) in.targets = known;
    for (const auto& name : o.targets) {
      const auto target = std::ranges::find(known, name, &object_tracking::TargetOptions::name);
      if (target == known.end()) throw gather::InputError(o.config + " has no target " + name + ": it has " + names);
      if (!in.targets.empty() && in.targets.front().radius_m != target->radius_m)
        throw gather::InputError("--target: " + in.targets.front().name + " and " + name +
                                 " are not of one radius: wave one of them");
      in.targets.push_back(*target);
    }
  } else {
    if (o.lenses.empty() || o.hue.empty())
      throw gather::InputError(
          "give --config huetrackd.yaml; or, without one, --lens for every camera and the target's --hue and --radius");
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
  }
  return in;
}

wave::WaveOptions wave_options(const WaveCommand& o, const Input& in) {
  wave::WaveOptions options{.radius_m = in.targets.front().radius_m};
  options.has_poses = !o.no_poses && in.config.has_value();
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
    if (*end != 0) throw gather::InputError("--camera-distance: " + o.camera_distance[2] + " is no number of metres");
    options.camera_distance = d;
  }
  if (o.rest_distance > 0) options.rest_distance_m = o.rest_distance;
  for (std::size_t i = 0; i + 3 < o.marks.size(); i += 4)
    options.marks.push_back({o.marks[i], {o.marks[i + 1], o.marks[i + 2], o.marks[i + 3]}});
  if (in.config)
    options.volume = solver::WorldBox{in.config->object_tracking.volume.min, in.config->object_tracking.volume.max};
  for (const auto& problem : options.problems(in.rig)) throw gather::InputError(problem);
  return options;
}

// What is still needed: how much of each image the ball has been in, and which pairs saw it together how often.
class Needs {
 public:
  explicit Needs(const calib::CameraRig& rig) : rig_(rig), cells_(rig.cameras.size()), last_(rig.cameras.size(), -1e9) {
    shared_.assign(rig.cameras.size() * rig.cameras.size(), 0);
  }
  void add(const wave::BallFrame& frame) {
    if (frame.regions.empty()) return;
    const auto c = static_cast<std::size_t>(frame.camera);
    const calib::ImageSize size = rig_.cameras[c].image_size;
    const Eigen::Vector2d& px = frame.regions.front().centre;
    cells_[c] |= std::uint64_t{1} << (static_cast<int>(8 * (px.x() + 0.5) / size.width) +
                                      8 * static_cast<int>(6 * (px.y() + 0.5) / size.height));
    last_[c] = frame.t_s;
    for (std::size_t o = 0; o < last_.size(); ++o) {
      if (o != c && frame.t_s - last_[o] < 0.05) ++shared_[std::min(o, c) * last_.size() + std::max(o, c)];
    }
  }
  std::string text() const {
    std::string out;
    for (std::size_t c = 0; c < cells_.size(); ++c)
      out += " " + rig_.cameras[c].name + " " + std::to_string(100 * std::popcount(cells_[c]) / 48) + "%";
    std::string lacking;
    for (std::size_t a = 0; a < cells_.size(); ++a) {
      for (std::size_t b = a + 1; b < cells_.size(); ++b) {
        if (shared_[a * cells_.size() + b] < 40) lacking += " " + rig_.cameras[a].name + "+" + rig_.cameras[b].name;
      }
    }
    return "in view:" + out + (lacking.empty() ? "" : "; hardly together yet:" + lacking);
  }

 private:
  const calib::CameraRig& rig_;
  std::vector<std::uint64_t> cells_;
  std::vector<double> last_;
  std::vector<int> shared_;
};

using BallsFrames = std::vector<std::vector<wave::BallFrame>>;  // per target

// All targets in one frame.
class Finder {
 public:
  explicit Finder(const Input& in) {
    for (const object_tracking::TargetOptions& target : in.targets)
      finders_.push_back(std::make_unique<wave::BallFinder>(in.rig, target));
  }
  std::optional<wave::BallFrame> look(std::size_t ball, const capture::Frame& frame) {
    return finders_[ball]->look(frame);
  }
  std::size_t unusable_frames() const { return finders_.front()->unusable_frames(); }

 private:
  std::vector<std::unique_ptr<wave::BallFinder>> finders_;
};

BallsFrames frames_of_recording(const WaveCommand& o, const Input& in, const std::stop_token& stop) {
  std::vector<std::string> names;
  for (const calib::Camera& camera : in.rig.cameras) names.push_back(camera.name);
  const capture::Recording recording = capture::read_recording(o.recording);
  for (const auto& warning : recording.warnings) std::printf("note: %s\n", warning.c_str());
  capture::ReplaySource source(recording, names);
  for (std::size_t c = 0; c < names.size(); ++c) {
    const capture::ReplayCamera& camera = source.cameras()[c];
    const calib::ImageSize size = in.rig.cameras[c].image_size;
    if (camera.width != size.width || camera.height != size.height) {
      throw gather::InputError(camera.file.string() + " is " + std::to_string(camera.width) + "x" +
                               std::to_string(camera.height) + ", and " + names[c] + "'s lens was calibrated at " +
                               std::to_string(size.width) + "x" + std::to_string(size.height));
    }
  }
  Finder finder(in);
  Needs needs(in.rig);
  gather::ProgressLine progress(!o.quiet);
  BallsFrames frames(in.targets.size());
  wave::Background background(names.size());
  const auto expected = source.expected_frames();
  for (int done = 0; auto frame = source.next(stop); ++done) {
    background.add(*frame);
    for (std::size_t ball = 0; ball < frames.size(); ++ball) {
      auto found = finder.look(ball, *frame);
      if (!found) continue;
      needs.add(*found);
      frames[ball].push_back(std::move(*found));
    }
    if (progress.due())
      progress.draw(gather::progress_text("looking for the ball", done,
                                          expected ? std::optional<int>(static_cast<int>(*expected)) : std::nullopt,
                                          needs.text()));
  }
  for (auto& of_ball : frames) wave::sharpen(of_ball, background, in.rig, progress.progress());
  progress.clear();
  if (stop.stop_requested()) throw gather::InputError("stopped");
  for (const auto& warning : source.take_warnings()) std::printf("note: %s\n", warning.c_str());
  if (finder.unusable_frames() > 0) std::printf("note: %zu damaged frames left out\n", finder.unusable_frames());
  return frames;
}

// Every camera has its own thread, which looks for the ball as well: of the pictures only what is around it is kept.
BallsFrames frames_of_cameras(const WaveCommand& o, const Input& in, const std::stop_token& stop) {
  std::vector<pipeline::LiveCamera> cameras = pipeline::open_cameras(*in.config);
  if (cameras.size() < 2) throw gather::InputError(o.config + ": cameras: two live cameras or more are needed");
  std::mutex mutex;
  BallsFrames frames(in.targets.size());  // guarded by mutex
  Needs needs(in.rig);                    // guarded by mutex
  std::optional<double> start;            // guarded by mutex
  std::stop_source end;
  {
    std::vector<std::jthread> threads;
    for (pipeline::LiveCamera& camera : cameras) {
      threads.emplace_back([&, source = camera.source.get()] {
        Finder finder(in);
        wave::Background background(in.rig.cameras.size());
        BallsFrames seen(in.targets.size());
        while (const auto frame = source->next(end.get_token())) {
          background.add(*frame);
          for (std::size_t ball = 0; ball < in.targets.size(); ++ball) {
            auto found = finder.look(ball, *frame);
            if (!found) continue;
            const std::lock_guard lock(mutex);
            if (!start) start = found->t_s;
            found->t_s -= *start;
            needs.add(*found);
            seen[ball].push_back(std::move(*found));
          }
        }
        for (std::size_t ball = 0; ball < seen.size(); ++ball) {
          wave::sharpen(seen[ball], background, in.rig);
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
      progress.draw(
          gather::progress_text("wave the ball", static_cast<int>(s), static_cast<int>(o.live_s), needs.text()));
    }
    progress.clear();
    end.request_stop();
  }
  return frames;
}

ExitStatus wave(const WaveCommand& o, const std::stop_token& stop) {
  if (o.recording.empty() == (o.live_s <= 0)) throw gather::InputError("give a recording, or --live SECONDS");
  if (o.live_s > 0 && o.config.empty())
    throw gather::InputError("--live needs --config: it says where the cameras are");
  if (o.marks.size() % 4 != 0) throw gather::InputError("--mark has four numbers: SECONDS X Y Z");
  const Input in = input_of(o);
  wave::WaveOptions options = wave_options(o, in);
  std::vector<wave::BallFrame> frames = wave::one_after_the_other(
      o.live_s > 0 ? frames_of_cameras(o, in, stop) : frames_of_recording(o, in, stop), in.rig.cameras.size());
  gather::ProgressLine progress(!o.quiet);
  options.progress = progress.progress();
  wave::WaveResult result = wave::calibrate_wave(in.rig, std::move(frames), options);
  progress.clear();
  const report::WaveReport report = report::report_on(result);
  std::fputs(report::to_text(report, result).c_str(), stdout);

  const double expected_m = result.expected_in_volume_m.value_or(result.expected_m);
  result.rig.made_by = {{"tool", "huetrack-calibrate " HUETRACK_VERSION " wave"},
                        {"input", o.live_s > 0 ? "live" : o.recording},
                        {"target", names_of(in.targets)},
                        {"verdict", std::string(report::name(report.verdict))},
                        {"scale_from", report.scale_from},
                        {"rms_px", fmt::format("{:.3f}", result.rms_px)},
                        {"expected_error_mm", fmt::format("{:.2f}", 1e3 * expected_m)}};
  for (const auto& problem : result.rig.problems())
    throw solver::CalibrationError("what came out is no rig: " + problem);
  const std::filesystem::path file = place_for(report.verdict, o.rig, o.overwrite);
  calib::write_rig(result.rig, file);
  std::printf("%s\n", file.c_str());
  return status_of(report.verdict);
}

}  // namespace

void add_wave_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<WaveCommand>();
  CLI::App* command =
      app.add_subcommand("wave", "find or refine the cameras' poses from the coloured ball, waved through the volume");
  command->add_option("recording", o->recording, "recording.yaml, or the folder that holds it");
  command->add_option("--config", o->config, "huetrackd.yaml: targets, the rig to start from, live cameras");
  command->add_option("--target", o->targets, "which of its targets is waved; again for another ball of the same size");
  command->add_option("--rig", o->rig, "the rig file to write")->required();
  command->add_option("--live", o->live_s, "look at the live cameras for so many seconds")->check(CLI::PositiveNumber);
  command->add_flag("--no-poses", o->no_poses, "the rig's poses mean nothing: find them without");
  command
      ->add_option("--camera-distance", o->camera_distance,
                   "CAMERA CAMERA METRES: measured between two cameras; sets the scale")
      ->expected(3);
  command
      ->add_option("--rest-distance", o->rest_distance,
                   "metres between the two places where the ball was held still; sets the scale")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--mark", o->marks,
                   "SECONDS X Y Z: the ball's centre was there then; two set the scale, three the world too")
      ->expected(4)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--lens", o->lenses, "without --config: a rig file whose cameras' lenses are used, once or more");
  command->add_option("--hue", o->hue, "without --config: the target's range of hue, degrees")->expected(2);
  command->add_option("--saturation", o->saturation, "likewise, 0..1")->expected(2);
  command->add_option("--intensity", o->intensity, "likewise, 0..1")->expected(2);
  command->add_option("--radius", o->radius_mm, "likewise, mm (default 40)")->check(CLI::PositiveNumber);
  command->add_flag("--overwrite", o->overwrite, "replace the rig file even when the result is doubtful");
  command->add_flag("--quiet", o->quiet, "no progress");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return wave(*o, stop); }; });
}

}  // namespace huetrack::program
