// The keyframe camera tracker under a rolling shutter: a rendered desk (tests/scene/desk_scene.h) by a hand that turns
// the camera at up to 130 degrees a second, the same motion at readouts of 0, 15 and 30 ms, the readout known or
// learnt.
//   build/release/tests/benchmark/camera_shutter [--seeds N] [--first SEED] [--moving] [--upwards] [--readout MS]
//   [--tremor DEG] [--frames]
// --readout: that one alone, besides 0. --moving: without rest at the beginning. --tremor: of the hand, besides.
// --upwards: sensors that read from the last row to the first. Exit status 1 when a rolling shutter costs more than
// half of the global shutter's error, or a frame.
#include <chrono>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/camera_sequence.h"
#include "camera_tracking/methods/make_camera_tracker.h"
#include "scene/desk_scene.h"

using namespace huetrack;

namespace {

constexpr double ratio_bar = 1.5, rest_s = 0.35;

struct Options {
  std::uint64_t seeds = 4, first = 1;
  double only_ms = 0, tremor_deg = 0;
  bool moving = false, upwards = false, frames = false;
};

struct Run {
  figures::PoseErrors errors, at_the_end;
  double ms_per_frame = 0;
  double readout_s = 0, readout_sigma_s = 0;  // as the last frame has them
};

Run run(figures::CameraSequence& sequence, std::optional<double> known_readout_s, bool print_frames) {
  sequence.camera.timing = {};
  if (known_readout_s)
    sequence.camera.timing.readout_s = known_readout_s, sequence.camera.timing.readout_sigma_s = 5e-4;
  camera_tracking::CameraTrackerOptions options;
  options.start = camera_tracking::RectangleStart{scene::DeskScene::rectangle_corners(), {}};
  const auto tracker = camera_methods::make_camera_tracker(sequence.camera, options);
  const auto from = std::chrono::steady_clock::now();
  const auto estimates = figures::run(*tracker, sequence);
  Run out;
  out.ms_per_frame = 1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - from).count() /
                     static_cast<double>(estimates.size());
  out.errors = figures::errors_of(estimates, sequence);
  out.readout_s = estimates.back().readout_s, out.readout_sigma_s = estimates.back().readout_sigma_s;
  const auto resting = static_cast<std::size_t>(rest_s * 30);
  out.at_the_end = figures::errors_of(estimates, sequence, estimates.size() - resting);
  if (print_frames) {
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      const camera_tracking::CameraEstimate& e = estimates[i];
      const calib::Rigid3d& t = *sequence.world_from_camera[i];
      std::printf("  %3zu %-9s %7.1f mm %6.2f deg  sigma %6.1f mm  %3d of %3d  map %3d  readout %6.2f +- %5.2f ms\n", i,
                  std::string(camera_tracking::name(e.state)).c_str(),
                  1e3 * (e.world_from_camera.translation - t.translation).norm(),
                  e.world_from_camera.rotation.angularDistance(t.rotation) * 180 / M_PI,
                  1e3 * std::sqrt(e.covariance.topLeftCorner<3, 3>().trace()), e.features_matched, e.features_in_view,
                  e.map_points, 1e3 * e.readout_s, 1e3 * e.readout_sigma_s);
    }
  }
  return out;
}

void print(const char* what, double readout_s, const Run& r, const Run& global, std::size_t frames) {
  std::printf(
      "  %-6s %5.0f ms  %6.2f %5.2f  %6.1f mm  %6.2f mm  %3d of %zu  NEES %5.1f  %6.2f +- %4.2f ms  %5.2f %5.2f  %4.1f "
      "ms\n",
      what, 1e3 * readout_s, 1e3 * r.errors.rms_m, r.errors.rms_deg, 1e3 * r.errors.max_m, 1e3 * r.at_the_end.rms_m,
      r.errors.tracked, frames, r.errors.mean_nees, 1e3 * r.readout_s, 1e3 * r.readout_sigma_s,
      r.errors.rms_m / global.errors.rms_m, r.errors.rms_deg / global.errors.rms_deg, r.ms_per_frame);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--seeds") == 0 && i + 1 < argc)
      options.seeds = std::stoull(argv[++i]);
    else if (std::strcmp(argv[i], "--first") == 0 && i + 1 < argc)
      options.first = std::stoull(argv[++i]);
    else if (std::strcmp(argv[i], "--readout") == 0 && i + 1 < argc)
      options.only_ms = std::stod(argv[++i]);
    else if (std::strcmp(argv[i], "--tremor") == 0 && i + 1 < argc)
      options.tremor_deg = std::stod(argv[++i]);
    else if (std::strcmp(argv[i], "--moving") == 0)
      options.moving = true;
    else if (std::strcmp(argv[i], "--upwards") == 0)
      options.upwards = true;
    else if (std::strcmp(argv[i], "--frames") == 0)
      options.frames = true;
    else {
      std::fprintf(stderr,
                   "camera_shutter: '%s' is none of --seeds N, --first SEED, --moving, --upwards, --readout MS, "
                   "--tremor DEG, --frames\n",
                   argv[i]);
      return 2;
    }
  }
  bool all = true;
  for (std::uint64_t seed = options.first; seed < options.first + options.seeds; ++seed) {
    const scene::DeskScene desk(seed);
    const scene::HandHeld hand({.seed = seed, .still_s = options.moving ? 0 : 0.4, .tremor_deg = options.tremor_deg});
    std::printf(
        "seed %llu: readout; rms mm, deg; worst; rms at the end; tracked; NEES; readout; ratios mm, deg; per frame\n",
        static_cast<unsigned long long>(seed));
    std::optional<Run> global;
    for (const double ms : options.only_ms != 0 ? std::vector{0.0, options.only_ms} : std::vector{0.0, 15.0, 30.0}) {
      const double readout_s = 1e-3 * (options.upwards ? -ms : ms);
      figures::CameraSequence sequence;
      sequence.camera = desk.camera;
      sequence.frames = scene::render(desk, hand, {.readout_s = readout_s, .seed = seed});
      for (const capture::Frame& f : sequence.frames)
        sequence.world_from_camera.emplace_back(hand.world_from_camera(capture::seconds(f.captured_at)));
      const Run known = run(sequence, readout_s, options.frames);
      if (!global) global = known;
      const Run learnt = run(sequence, std::nullopt, options.frames);
      print("known", readout_s, known, *global, sequence.frames.size());
      print("learnt", readout_s, learnt, *global, sequence.frames.size());
      for (const Run& r : {known, learnt})
        all = all && r.errors.tracked == static_cast<int>(sequence.frames.size()) &&
              r.errors.rms_m <= ratio_bar * global->errors.rms_m &&
              r.errors.rms_deg <= ratio_bar * global->errors.rms_deg;
    }
  }
  return all ? 0 : 1;
}
