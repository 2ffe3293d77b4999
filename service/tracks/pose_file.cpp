#include "tracks/pose_file.h"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <system_error>

#include "calib/files/number_text.h"

namespace huetrack::tracks {
namespace {

// Recognises lines of eight numbers after comments (#); comments alone are not enough.
bool begins_with_a_pose(std::string_view text) {
  while (text.starts_with('#')) {
    const auto end = text.find('\n');
    if (end == std::string_view::npos) return false;
    text.remove_prefix(end + 1);
  }
  int numbers = 0;
  for (std::string_view line = text.substr(0, text.find('\n')); !line.empty(); ++numbers) {
    double value = 0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value);
    if (error != std::errc{}) return false;
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    line.remove_prefix(std::min(line.find_first_not_of(" \r"), line.size()));
  }
  return numbers == 8;
}

}  // namespace

std::string to_tum_line(const camera_tracking::CameraEstimate& e) {
  std::string line = files::seconds_text(e.at.time_since_epoch().count());
  const auto& t = e.world_from_camera.translation;
  const auto& q = e.world_from_camera.rotation;
  for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()})
    line += ' ', files::append_shortest(line, value);
  return line;
}

PoseFileWriter::PoseFileWriter(std::filesystem::path file) : file_(std::move(file), {"poses", begins_with_a_pose}) {}

void PoseFileWriter::write(const camera_tracking::CameraEstimate& estimate) {
  if (estimate.state == camera_tracking::PoseState::tracking) file_.write(to_tum_line(estimate));
}

}  // namespace huetrack::tracks
