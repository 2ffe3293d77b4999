#include "pipeline/tracked_camera.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "pipeline/without_numbers.h"

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;

constexpr capture::Duration longest_start = 3s;  // a start or a return takes less
constexpr double told_readout_s = 0.002;         // a tenth of a usual rolling shutter's

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
  if (!figures.without_since || figures.at - *figures.without_since < longest_start) return {};
  return fmt::format("camera {}: no pose for {:.0f} s ({}){}{}", camera,
                     capture::seconds(figures.at - *figures.without_since), camera_tracking::name(figures.state),
                     figures.why.empty() ? "" : ": ", figures.why);
}

std::string readout_text(const TrackedCameraFigures& figures) {
  if (!(figures.readout_sigma_s < told_readout_s)) return {};
  return fmt::format("rows over {:.1f} ms +- {:.1f}", 1e3 * figures.readout_s, 1e3 * figures.readout_sigma_s);
}

void NoPoseLog::tell(const std::string& camera, const TrackedCameraFigures& figures) {
  if (!figures.without_since) told_.clear();
  const std::string warning = no_pose_warning(camera, figures);
  if (!warning.empty() && told_.insert(without_numbers(warning)).second) spdlog::warn("{}", warning);
}

void save_map(const camera_tracking::CameraTracker& tracker, const TrackedCameraFigures& figures,
              const std::filesystem::path& file) {
  if (figures.had_pose) {
    tracker.save_map(file);
  } else {
    spdlog::warn("{}: map not saved: there never was a pose", file.string());
  }
}

}  // namespace huetrack::pipeline
