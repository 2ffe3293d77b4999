#include "benchmark/camera_sequence.h"

#include <Eigen/Dense>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

#include "calib/model/rig_yaml.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::figures {
namespace {

std::vector<std::vector<double>> numbers_of(const std::filesystem::path& file, char separator,
                                            std::size_t skip_columns = 0) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error(file.string() + ": cannot be read");
  std::vector<std::vector<double>> rows;
  std::string line;
  while (std::getline(in, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::string word;
    std::vector<double> row;
    for (std::size_t i = 0; std::getline(words, word, separator); ++i) {
      if (i < skip_columns) continue;
      char* end = nullptr;
      const double x = std::strtod(word.c_str(), &end);
      if (end == word.c_str()) break;  // a heading
      row.push_back(x);
    }
    if (!row.empty()) rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

std::filesystem::path shared_camera_data() {
  return HUETRACK_SHARED_DATA;
}

CameraSequence load_camera_sequence(const std::filesystem::path& folder, const std::string& truth,
                                    std::size_t max_frames) {
  CameraSequence out;
  out.name = folder.filename().string();
  const calib::CameraRig rig = calib::read_rig(folder / "rig.yaml");
  out.camera = rig.cameras.at(0);
  const recordings::Recording recording = recordings::read_recording(folder);
  const std::vector<std::string> names{out.camera.name};
  recordings::ReplaySource source(recording, names);
  while (auto frame = source.next({})) {
    out.frames.push_back(std::move(*frame));
    if (out.frames.size() == max_frames) break;
  }
  std::map<long, calib::Rigid3d> poses;  // by millisecond
  for (const auto& r : numbers_of(folder / truth, ' ')) {
    if (r.size() < 8) throw std::runtime_error((folder / truth).string() + ": a line has fewer than 8 numbers");
    poses[std::lround(1e3 * r[0])] = {Eigen::Quaterniond(r[7], r[4], r[5], r[6]).normalized(), {r[1], r[2], r[3]}};
  }
  for (const capture::Frame& f : out.frames) {
    const auto it = poses.find(std::lround(1e3 * capture::seconds(f.captured_at)));
    out.world_from_camera.push_back(it == poses.end() ? std::nullopt : std::optional(it->second));
  }
  return out;
}

camera_tracking::RectangleStart desk_rectangle() {
  camera_tracking::RectangleStart start;
  for (const auto& r : numbers_of(shared_camera_data() / "rendered/desk/rectangle.csv", ',', 2))
    start.corners.emplace_back(r[0], r[1], r[2]);
  return start;
}

camera_tracking::PointsStart kitchen_points() {
  camera_tracking::PointsStart start;
  for (const auto& r : numbers_of(shared_camera_data() / "hand_held_7scenes/start_points.csv", ',')) {
    start.pixels.emplace_back(r[0], r[1]);
    start.points.emplace_back(r[2], r[3], r[4]);
  }
  return start;
}

std::vector<camera_tracking::CameraEstimate> run(camera_tracking::CameraTracker& tracker,
                                                 const CameraSequence& sequence) {
  std::vector<camera_tracking::CameraEstimate> out;
  for (const capture::Frame& frame : sequence.frames) out.push_back(tracker.update(frame));
  return out;
}

PoseErrors errors_of(const std::vector<camera_tracking::CameraEstimate>& estimates, const CameraSequence& sequence,
                     std::size_t from, std::size_t to) {
  PoseErrors e;
  int inside = 0;
  for (std::size_t i = from; i < std::min(to, estimates.size()); ++i) {
    const camera_tracking::CameraEstimate& x = estimates[i];
    e.coasting += x.state == camera_tracking::PoseState::coasting;
    if (x.state != camera_tracking::PoseState::tracking || !sequence.world_from_camera[i]) continue;
    const calib::Rigid3d& t = *sequence.world_from_camera[i];
    const Eigen::Vector3d d = t.translation - x.world_from_camera.translation;
    const Eigen::AngleAxisd turn((t.rotation * x.world_from_camera.rotation.inverse()).normalized());
    const double angle = std::remainder(turn.angle(), 2 * M_PI);
    Eigen::Matrix<double, 6, 1> error;
    error << d, angle * turn.axis();
    const double nees = error.dot(x.covariance.ldlt().solve(error));
    const double deg = std::abs(angle) * 180 / M_PI;
    ++e.tracked;
    e.rms_m += d.squaredNorm(), e.rms_deg += deg * deg;
    if (d.norm() > e.max_m) e.max_m = d.norm(), e.max_at = static_cast<int>(i);
    e.max_deg = std::max(e.max_deg, deg);
    e.mean_nees += nees;
    inside += nees < 12.592;
  }
  const double n = std::max(1, e.tracked);
  e.rms_m = std::sqrt(e.rms_m / n), e.rms_deg = std::sqrt(e.rms_deg / n), e.mean_nees /= n, e.inside_95 = inside / n;
  return e;
}

std::optional<int> frames_until_tracked(const std::vector<camera_tracking::CameraEstimate>& estimates,
                                        std::size_t first) {
  for (std::size_t i = first; i < estimates.size(); ++i) {
    if (estimates[i].state == camera_tracking::PoseState::tracking) return static_cast<int>(i - first);
  }
  return std::nullopt;
}

AlignedError aligned_error(const std::vector<camera_tracking::CameraEstimate>& estimates,
                           const CameraSequence& sequence, bool lever_arm) {
  std::vector<Eigen::Vector3d> from, to;
  std::vector<Eigen::Matrix3d> rotation;  // of the truth, world from camera
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    if (estimates[i].state != camera_tracking::PoseState::tracking || !sequence.world_from_camera[i]) continue;
    from.push_back(estimates[i].world_from_camera.translation);
    to.push_back(sequence.world_from_camera[i]->translation);
    rotation.push_back(sequence.world_from_camera[i]->rotation.toRotationMatrix());
  }
  AlignedError out;
  out.count = static_cast<int>(from.size());
  if (out.count < 3) return out;
  const auto n = static_cast<Eigen::Index>(from.size());
  Eigen::Vector3d arm = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < (lever_arm ? 50 : 1); ++iteration) {
    Eigen::Matrix3Xd a(3, n), b(3, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      a.col(i) = from[k], b.col(i) = to[k] + rotation[k] * arm;
    }
    const Eigen::Matrix4d t = Eigen::umeyama(a, b, true);
    out.scale = std::cbrt(t.topLeftCorner<3, 3>().determinant());
    double sum = 0;
    Eigen::Vector3d next = Eigen::Vector3d::Zero();
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Vector3d aligned = t.topLeftCorner<3, 3>() * a.col(i) + t.topRightCorner<3, 1>();
      sum += (aligned - b.col(i)).squaredNorm();
      next += rotation[static_cast<std::size_t>(i)].transpose() * (aligned - to[static_cast<std::size_t>(i)]) /
              static_cast<double>(n);
    }
    out.rms_m = std::sqrt(sum / static_cast<double>(n));
    arm = next;
  }
  return out;
}

}  // namespace huetrack::figures
