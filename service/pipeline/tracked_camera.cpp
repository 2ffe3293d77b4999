#include "pipeline/tracked_camera.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "object_tracking/sighting.h"
#include "pipeline/without_numbers.h"

namespace huetrack::pipeline {
namespace {

struct TrackedCameraTuning {
  double longest_start_s = 3;  // s; a start or a re-detection takes less
};
constexpr TrackedCameraTuning tracked_camera_tuning{};

}  // namespace

void TrackedCameraFigures::add(const camera_tracking::CameraEstimate& estimate, const std::string& why_no_pose) {
  state = estimate.state;
  at = estimate.at;
  readout_s = estimate.readout_s, readout_sigma_s = estimate.readout_sigma_s;
  if (estimate.has_pose()) {
    had_pose = true;
    without_since.reset();
    why.clear();
    return;
  }
  if (!without_since) without_since = at;
  if (!why_no_pose.empty()) why = why_no_pose;
}

std::string no_pose_warning(const std::string& camera, const TrackedCameraFigures& figures) {
  if (!figures.without_since ||
      figures.at - *figures.without_since < capture::duration_of(tracked_camera_tuning.longest_start_s))
    return {};
  return fmt::format("camera {}: no pose for {:.0f} s ({}){}{}", camera,
                     capture::seconds(figures.at - *figures.without_since), camera_tracking::name(figures.state),
                     figures.why.empty() ? "" : ": ", figures.why);
}

// Empty unless the readout's sigma is below `same_time_s`.
std::string readout_text(const TrackedCameraFigures& figures) {
  if (!(figures.readout_sigma_s < object_tracking::sighting_tuning.same_time_s)) return {};
  return fmt::format("readout {:.1f} ms +- {:.1f}", 1e3 * figures.readout_s, 1e3 * figures.readout_sigma_s);
}

void NoPoseLog::log(const std::string& camera, const TrackedCameraFigures& figures) {
  if (!figures.without_since) logged_.clear();
  const std::string warning = no_pose_warning(camera, figures);
  if (!warning.empty() && logged_.insert(without_numbers(warning)).second) spdlog::warn("{}", warning);
}

void save_map(const camera_tracking::CameraTracker& tracker, const TrackedCameraFigures& figures,
              const std::filesystem::path& file) {
  if (figures.had_pose) {
    tracker.save_map(file);
  } else {
    spdlog::warn("{}: map not saved, because the camera never had a pose", file.string());
  }
}

}  // namespace huetrack::pipeline
