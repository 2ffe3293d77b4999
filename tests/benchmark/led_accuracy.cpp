// led_accuracy [huetrack|herranz] [SEED] [PARTICLES] [-v]: by both methods or one, the pose of the camera of
// data/rendered/leds against its truth.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "benchmark/led_sequence.h"
#include "camera_tracking/methods/make_camera_tracker.h"

namespace {

using namespace huetrack;

void measure(const figures::LedSequence& sequence, const camera_tracking::CameraTrackerOptions& options, bool verbose);

}  // namespace

int main(int argc, char** argv) {
  camera_tracking::CameraTrackerOptions options;
  std::vector<camera_tracking::CameraMethod> methods{camera_tracking::CameraMethod::huetrack,
                                                     camera_tracking::CameraMethod::herranz};
  bool verbose = false;
  int numbers = 0;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "herranz") == 0)
      methods = {camera_tracking::CameraMethod::herranz};
    else if (std::strcmp(argv[i], "huetrack") == 0)
      methods = {camera_tracking::CameraMethod::huetrack};
    else if (std::strcmp(argv[i], "-v") == 0)
      verbose = true;
    else if (numbers++ == 0)
      options.seed = std::strtoull(argv[i], nullptr, 10);
    else
      options.particle_count = std::atoi(argv[i]);
  }
  const auto sequence = figures::load_led_sequence(std::string(HUETRACK_SHARED_DATA) + "/rendered/leds");
  if (!sequence) {
    std::fprintf(stderr, "led_accuracy: " HUETRACK_SHARED_DATA "/rendered/leds is not there\n");
    return 1;
  }
  options.start = sequence->start;
  for (const camera_tracking::CameraMethod method : methods) {
    options.method = method;
    measure(*sequence, options, verbose);
  }
  return 0;
}

namespace {

void measure(const figures::LedSequence& sequence, const camera_tracking::CameraTrackerOptions& options, bool verbose) {
  const auto tracker = camera_methods::make_camera_tracker(sequence.rig.cameras[0], options);
  int first = -1, poses = 0, samples = 0, wrong = 0;
  double metres2 = 0, degrees2 = 0, worst_m = 0, worst_deg = 0, nees = 0, busy_ms = 0, longest_ms = 0;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const camera_tracking::CameraEstimate e = tracker->update(sequence.frames[i]);
    const double ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    busy_ms += ms, longest_ms = std::max(longest_ms, ms);
    if (!e.has_pose()) {
      if (verbose) std::printf("%3zu %s  %.1f ms\n", i, std::string(camera_tracking::name(e.state)).c_str(), ms);
      continue;
    }
    const figures::PoseError error = figures::pose_error(e.world_from_camera, sequence.world_from_camera[i]);
    if (first < 0) first = static_cast<int>(i);
    ++poses;
    wrong += error.metres > 0.05;
    const double n = figures::pose_nees(e, sequence.world_from_camera[i]);
    if (verbose)
      std::printf("%3zu %s  %.2f mm %.3f deg  nees %.1f  sigma %.2f mm %.3f deg  %d/%d  ess %.0f  %.1f ms\n", i,
                  std::string(camera_tracking::name(e.state)).c_str(), 1e3 * error.metres, error.degrees, n,
                  1e3 * std::sqrt(e.covariance.topLeftCorner<3, 3>().trace()),
                  57.3 * std::sqrt(e.covariance.bottomRightCorner<3, 3>().trace()), e.features_matched,
                  e.features_in_view, e.effective_sample_size, ms);
    if (i < 16) continue;
    ++samples;
    metres2 += error.metres * error.metres, degrees2 += error.degrees * error.degrees;
    worst_m = std::max(worst_m, error.metres), worst_deg = std::max(worst_deg, error.degrees);
    nees += n;
  }
  const double frames = static_cast<double>(sequence.frames.size());
  std::printf("%s, seed %llu: first pose in frame %d, %d of %.0f frames with a pose, %d of them over 5 cm off\n",
              std::string(camera_tracking::name(options.method)).c_str(), static_cast<unsigned long long>(options.seed),
              first, poses, frames, wrong);
  if (samples > 0)
    std::printf(
        "  from frame 16 on (%d poses): rms %.2f mm, %.3f deg; at most %.2f mm, %.3f deg; mean NEES %.1f (6 is "
        "perfect)\n",
        samples, 1e3 * std::sqrt(metres2 / samples), std::sqrt(degrees2 / samples), 1e3 * worst_m, worst_deg,
        nees / samples);
  std::printf("  %.2f ms per frame, at most %.2f\n", busy_ms / frames, longest_ms);
}

}  // namespace
