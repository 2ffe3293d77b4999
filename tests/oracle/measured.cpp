// Two figures of the oracle that no replay gives.
//   measured update    the time of one update as a ratio to what a user would write with OpenCV, in one run: median of
//   rounds that alternate measured shutter   our camera tracker on a rendered desk (tests/scene/desk_scene.h), global
//   shutter and 30 ms of readout, learnt
#include <cstdio>
#include <cstring>

#include "benchmark/camera_sequence.h"
#include "benchmark/speed_run.h"
#include "camera_tracking/methods/make_camera_tracker.h"
#include "scene/desk_scene.h"

using namespace huetrack;

namespace {

void print_update(const char* name, const figures::Sequence& sequence, int particle_count, int rounds) {
  figures::OpenCvPass pass(sequence.rig, figures::lime_ball());
  std::vector<double> opencv_us;
  const auto opencv = [&](const capture::FrameSet& set) {
    opencv_us.push_back(figures::microseconds_of([&] { pass.run(set); }));
  };
  const figures::Timing t =
      figures::time_update(sequence, object_tracking::Observation::huetrack, particle_count, rounds, 20, opencv);
  std::printf("update, %s: %.1f us, %.1f times as fast as OpenCV's pass\n", name, t.us,
              calib::median(opencv_us) / t.us);
}

void print_shutter(double readout_s) {
  constexpr std::uint64_t seed = 1;
  const scene::DeskScene desk(seed);
  const scene::HandHeld hand({.seed = seed});
  figures::CameraSequence sequence;
  sequence.camera = desk.camera;
  sequence.frames = scene::render(desk, hand, {.readout_s = readout_s, .seed = seed});
  for (const capture::Frame& f : sequence.frames)
    sequence.world_from_camera.emplace_back(hand.world_from_camera(capture::seconds(f.captured_at)));
  sequence.camera.timing = {};
  camera_tracking::CameraTrackerOptions options;
  options.start = camera_tracking::RectangleStart{scene::DeskScene::rectangle_corners(), {}};
  const auto tracker = camera_methods::make_camera_tracker(sequence.camera, options);
  const figures::PoseErrors e = figures::errors_of(figures::run(*tracker, sequence), sequence);
  std::printf("rms_mm %.4f rms_deg %.4f nees %.4f tracking_pct %.4f\n", 1e3 * e.rms_m, e.rms_deg, e.mean_nees,
              100.0 * e.tracked / static_cast<double>(sequence.frames.size()));
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  cv::setNumThreads(1);
  if (what == "update") {
    print_update("2 cameras of 320x240", figures::scene_at(2, 320, 240, 30), 200, 50);
    print_update("4 cameras of 1920x1080", figures::scene_at(4, 1920, 1080, 4), 2000, 8);
  } else if (what == "shutter" && argc > 2) {
    print_shutter(1e-3 * std::stod(argv[2]));
  } else {
    std::fprintf(stderr, "usage: measured update | measured shutter READOUT_MS\n");
    return 2;
  }
  return 0;
}
