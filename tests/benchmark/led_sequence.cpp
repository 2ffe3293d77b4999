#include "benchmark/led_sequence.h"

#include <Eigen/Cholesky>
#include <fstream>
#include <numbers>
#include <sstream>

#include "calib/model/rig_yaml.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::figures {

namespace {

std::vector<std::vector<double>> rows_of(const std::filesystem::path& file, char separator) {
  std::vector<std::vector<double>> rows;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line.front() == '#' || std::isalpha(static_cast<unsigned char>(line.front())) != 0) continue;
    std::vector<double> row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, separator);)
      if (!cell.empty()) row.push_back(std::stod(cell));
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

std::optional<LedSequence> load_led_sequence(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "recording.yaml")) return std::nullopt;
  LedSequence sequence;
  sequence.rig = calib::read_rig(folder / "rig.yaml");
  for (const auto& row : rows_of(folder / "led_positions.csv", ','))
    sequence.start.leds.emplace_back(row[1], row[2], row[3]);
  for (const auto& row : rows_of(folder / "led_frames.csv", ','))
    sequence.start.schedule.push_back(static_cast<int>(row[2]));
  for (const auto& row : rows_of(folder / "groundtruth.txt", ' '))
    sequence.world_from_camera.push_back(
        {Eigen::Quaterniond(row[7], row[4], row[5], row[6]).normalized(), {row[1], row[2], row[3]}});
  const std::vector<std::string> names{sequence.rig.cameras[0].name};
  recordings::ReplaySource source(recordings::read_recording(folder), names, {.decoder_threads = 2});
  while (auto frame = source.next({})) sequence.frames.push_back(std::move(*frame));
  return sequence;
}

PoseError pose_error(const calib::Rigid3d& estimate, const calib::Rigid3d& truth) {
  return {(estimate.translation - truth.translation).norm(),
          estimate.rotation.angularDistance(truth.rotation) * 180 / std::numbers::pi};
}

double pose_nees(const camera_tracking::CameraEstimate& estimate, const calib::Rigid3d& truth) {
  Eigen::Matrix<double, 6, 1> e;
  e.head<3>() = truth.translation - estimate.world_from_camera.translation;
  e.tail<3>() =
      calib::log(calib::Rigid3d{(truth.rotation * estimate.world_from_camera.rotation.conjugate()).normalized(),
                                Eigen::Vector3d::Zero()})
          .head<3>();
  return e.dot(estimate.covariance.llt().solve(e));
}

}  // namespace huetrack::figures
