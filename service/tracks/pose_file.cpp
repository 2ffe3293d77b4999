#include "tracks/pose_file.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <system_error>

namespace huetrack::tracks {
namespace {

[[noreturn]] void cannot_write(const std::filesystem::path& file) {
  throw std::system_error(errno != 0 ? errno : EIO, std::generic_category(), "cannot write " + file.string());
}

}  // namespace

std::string to_tum_line(const camera_tracking::CameraEstimate& e) {
  const std::int64_t ns = e.at.time_since_epoch().count();
  std::string line = std::to_string(std::abs(ns));
  if (line.size() < 10) line.insert(0, 10 - line.size(), '0');  // at least 0.000000000
  line.insert(line.size() - 9, 1, '.');
  if (ns < 0) line.insert(0, 1, '-');
  const auto& t = e.world_from_camera.translation;
  const auto& q = e.world_from_camera.rotation;
  for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
    std::array<char, 32> digits{};
    line += ' ';
    line.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
  }
  return line;
}

PoseFileWriter::PoseFileWriter(std::filesystem::path file) : file_(std::move(file)) {
  errno = 0;
  stream_.open(file_, std::ios::binary | std::ios::trunc);
  if (!stream_) cannot_write(file_);
}

void PoseFileWriter::write(const camera_tracking::CameraEstimate& estimate) {
  if (estimate.state != camera_tracking::PoseState::tracking) return;  // only that is a claim
  errno = 0;
  stream_ << to_tum_line(estimate) << '\n';
  if (!stream_) cannot_write(file_);
}

void PoseFileWriter::flush() {
  errno = 0;
  if (!stream_.flush()) cannot_write(file_);
}

}  // namespace huetrack::tracks
