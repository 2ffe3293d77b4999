#include "config/board_start.h"

#include <memory>

#include "calib/board/board_detector.h"
#include "calib/board/board_yaml.h"
#include "camera_tracking/grey_image.h"

namespace huetrack::config {

camera_tracking::FoundStart board_start(const std::filesystem::path& file) {
  const auto detector = std::make_shared<const board::BoardDetector>(board::read_board(file));
  return {[detector](const capture::Image& image) -> std::optional<camera_tracking::PointsStart> {
    const camera_tracking::GreyImage grey = camera_tracking::grey_of(image);
    const board::BoardDetection found = detector->detect({grey.data, grey.width, grey.height, grey.stride});
    if (!found.found()) return std::nullopt;
    camera_tracking::PointsStart start;
    start.pixels = found.px;
    // The board's z points away from the viewer, the world's z up: a half turn about x.
    for (const int id : found.ids) {
      const Eigen::Vector3d p = detector->board().point(id);
      start.points.emplace_back(p.x(), -p.y(), -p.z());
    }
    return start;
  }};
}

}  // namespace huetrack::config
