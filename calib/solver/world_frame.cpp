#include "calib/solver/world_frame.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "calib/model/index.h"
#include "calib/solver/umeyama.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

calib::Rigid3d with_axes(const Vector3d& x, const Vector3d& z, const Vector3d& origin) {
  Matrix3d new_from_old;
  const Vector3d across = z.cross(x).normalized();
  new_from_old << across.cross(z).normalized().transpose(), across.transpose(), z.normalized().transpose();
  return {Eigen::Quaterniond(new_from_old).normalized(), -new_from_old * origin};
}

// Second principal extent of the points over the first.
double breadth(const std::vector<Vector3d>& points) {
  Eigen::Matrix3Xd m(3, points.size());
  for (std::size_t k = 0; k < points.size(); ++k) m.col(static_cast<Eigen::Index>(k)) = points[k];
  const Eigen::Matrix3Xd centred = m.colwise() - Vector3d(m.rowwise().mean());
  const Matrix3d spread = centred * centred.transpose();
  const Vector3d s2 = Eigen::SelfAdjointEigenSolver<Matrix3d>(spread, Eigen::EigenvaluesOnly).eigenvalues();
  return s2(2) > 0 ? std::sqrt(std::max(0.0, s2(1)) / s2(2)) : 0;
}

void require_spread(const std::vector<Vector3d>& points) {
  if (points.size() < 3)
    throw CalibrationError("three points are needed at least, there are " + std::to_string(points.size()));
  constexpr double least = 0.05;
  if (breadth(points) < least)
    throw CalibrationError("the points are collinear: the rotation about their line is not determined",
                           Fault::collinear_points);
}

}  // namespace

calib::CameraRig in_world(calib::CameraRig rig, const WorldChange& change) {
  for (calib::Camera& camera : rig.cameras) {
    const calib::Rigid3d new_cam{camera.cam_from_world.rotation, change.scale * camera.cam_from_world.translation};
    camera.cam_from_world = new_cam * calib::inverse(change.new_from_old);
  }
  if (!rig.uncertainty || change.scale == 1) return rig;  // it is in the cameras' own axes
  for (const calib::RigUncertainty::CameraParameters& camera : rig.uncertainty->cameras) {
    if (camera.has_pose) rig.uncertainty->sigma.segment<3>(camera.pose_at() + 3) *= change.scale;
  }
  return rig;
}

Adjustment in_world(Adjustment adjustment, const calib::Rigid3d& new_from_old) {
  const calib::Rigid3d old_from_new = calib::inverse(new_from_old);
  for (AdjustedCamera& camera : adjustment.cameras) camera.cam_from_world = camera.cam_from_world * old_from_new;
  for (calib::Rigid3d& pose : adjustment.world_from_board) pose = new_from_old * pose;
  return adjustment;
}

calib::Rigid3d upright_guess(const Adjustment& a) {
  Matrix3d level = Matrix3d::Zero();
  Vector3d down = Vector3d::Zero();
  for (const AdjustedCamera& camera : a.cameras) {
    const Matrix3d axes = camera.cam_from_world.rotation.toRotationMatrix();  // its rows are the camera's axes
    const Vector3d x = axes.row(0).transpose(), y = axes.row(1).transpose();
    constexpr double of_columns = 0.001;  // cameras are tilted more often than rolled; decides where rows do not
    level += x * x.transpose() + of_columns * (Matrix3d::Identity() - y * y.transpose());
    down += y;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(level);
  Vector3d up = solver.eigenvectors().col(0);
  if (up.dot(down) > 0) up = -up;
  Vector3d middle = Vector3d::Zero();
  std::set<int> sets;
  for (const BoardView& view : a.views) {
    if (!sets.insert(view.set).second) continue;
    middle += a.world_from_board[index(view.set)] * a.board_point(view.ids[view.ids.size() / 2]);
  }
  middle /= static_cast<double>(std::max<std::size_t>(1, sets.size()));
  Vector3d forward = middle - calib::inverse(a.cameras.front().cam_from_world).translation;
  if (forward.cross(up).norm() < 0.1 * forward.norm()) {  // looks straight down
    forward = a.cameras.front().cam_from_world.rotation.conjugate() * Vector3d(0, -1, 0);
  }
  return with_axes(forward - up * up.dot(forward), up, middle);
}

std::optional<KeptWorld> world_of(const calib::CameraRig& before, const Adjustment& adjusted) {
  struct Both {
    std::string name;
    calib::Rigid3d old_world, new_world;  // from the camera
  };
  std::vector<Both> both;
  for (const AdjustedCamera& camera : adjusted.cameras) {
    const auto old = before.index_of(camera.name);
    if (!old) continue;
    both.push_back({camera.name, calib::inverse(before.cameras[static_cast<std::size_t>(*old)].cam_from_world),
                    calib::inverse(camera.cam_from_world)});
  }
  if (both.size() < 2) return std::nullopt;
  // Relative poses now and then: a bumped camera differs by more, a calibration hardly.
  constexpr double as_before_share = 0.03, as_before_rad = 0.04;  // of their distance
  const auto agrees = [&](const Both& a, const Both& b) {
    const calib::Rigid3d then = calib::inverse(a.old_world) * b.old_world,
                         now = calib::inverse(a.new_world) * b.new_world;
    return (then.translation - now.translation).norm() < as_before_share * now.translation.norm() &&
           then.rotation.angularDistance(now.rotation) < as_before_rad;
  };
  std::vector<std::size_t> best;
  for (const Both& anchor : both) {
    std::vector<std::size_t> same;
    for (std::size_t c = 0; c < both.size(); ++c) {
      if (&both[c] == &anchor || agrees(anchor, both[c])) same.push_back(c);
    }
    if (same.size() > best.size()) best = std::move(same);
  }
  if (best.size() < 2) return std::nullopt;
  KeptWorld kept;
  double size = 0;
  for (const std::size_t c : best)
    size = std::max(size, (both[c].new_world.translation - both[best.front()].new_world.translation).norm());
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t c = 0; c < both.size(); ++c) {
    const bool is_unchanged = std::ranges::find(best, c) != best.end();
    (is_unchanged ? kept.by : kept.moved).push_back(both[c].name);
    if (!is_unchanged) continue;
    // Its centre, and points along its axes, so that the rotation counts as much.
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(size, 0, 0), Eigen::Vector3d(0, size, 0),
                                     Eigen::Vector3d(0, 0, size)}) {
      from.push_back(both[c].new_world * p);
      to.push_back(both[c].old_world * p);
    }
  }
  kept.new_from_old = align_points(from, to, false).new_from_old;
  return kept;
}

calib::Rigid3d floor_from_board(const calib::Rigid3d& world_from_board, double height) {
  const Vector3d x = world_from_board.rotation * Vector3d::UnitX(), up = world_from_board.rotation * -Vector3d::UnitZ();
  return with_axes(x, up, world_from_board.translation - height * up);
}

WorldChange align_points(const std::vector<Vector3d>& old_points, const std::vector<Vector3d>& new_points,
                         bool with_scale) {
  require_spread(old_points);
  require_spread(new_points);
  Eigen::Matrix3Xd from(3, old_points.size()), to(3, new_points.size());
  for (std::size_t k = 0; k < old_points.size(); ++k) {
    from.col(static_cast<Eigen::Index>(k)) = old_points[k];
    to.col(static_cast<Eigen::Index>(k)) = new_points[k];
  }
  const Eigen::Matrix4d t = umeyama(from, to, with_scale);
  WorldChange change;
  change.scale = t.topLeftCorner<3, 3>().col(0).norm();
  change.new_from_old.rotation = Eigen::Quaterniond(Matrix3d(t.topLeftCorner<3, 3>() / change.scale)).normalized();
  change.new_from_old.translation = t.topRightCorner<3, 1>();
  return change;
}

calib::Rigid3d floor_from_points(const std::vector<Vector3d>& points, const calib::CameraRig& rig) {
  require_spread(points);
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& p : points) middle += p / static_cast<double>(points.size());
  Matrix3d spread = Matrix3d::Zero();
  for (const Vector3d& p : points) spread += (p - middle) * (p - middle).transpose();
  Vector3d up = Eigen::SelfAdjointEigenSolver<Matrix3d>(spread).eigenvectors().col(0);
  int above = 0;
  for (const calib::Camera& camera : rig.cameras) above += (camera.centre() - middle).dot(up) > 0 ? 1 : -1;
  if (above == 0)
    throw CalibrationError("as many cameras stand on one side of the floor as on the other", Fault::undecided_floor);
  if (above < 0) up = -up;
  const Vector3d x = points[1] - points[0];
  return with_axes(x - up * up.dot(x), up, points[0] - up * up.dot(points[0] - middle));
}

MeasuredPoint measure_point(const calib::CameraRig& rig, const std::vector<std::pair<int, Vector2d>>& pixels) {
  Matrix3d a = Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  std::set<int> cameras;
  for (const auto& [c, px] : pixels) {
    const calib::Camera& camera = rig.cameras[index(c)];
    const auto ray = camera.model.ray({px});
    if (!ray) {
      throw CalibrationError("camera " + camera.name + " sees nothing at pixel (" + std::to_string(px.x()) + ", " +
                             std::to_string(px.y()) + "): its lens model does not reach there");
    }
    const Vector3d d = camera.cam_from_world.rotation.conjugate() * *ray;
    const Matrix3d across = Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * camera.centre();
    cameras.insert(c);
  }
  if (cameras.size() < 2) throw CalibrationError("a point is fixed by its pixels in two or more cameras");
  MeasuredPoint point;
  point.p_world = a.ldlt().solve(b);
  double sum = 0;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Matrix3d h = Matrix3d::Zero();
    Vector3d g = Vector3d::Zero();
    sum = 0;
    for (const auto& [c, px] : pixels) {
      const calib::Camera& camera = rig.cameras[index(c)];
      calib::CameraModel::Jacobian by_point;
      const auto projected = camera.model.project(camera.cam_from_world * point.p_world, by_point);
      if (!projected)
        throw CalibrationError("the rays through the pixels do not meet in front of camera " + camera.name);
      const Eigen::Matrix<double, 2, 3> j = by_point * camera.cam_from_world.rotation.toRotationMatrix();
      const Vector2d r = projected->px - px;
      h += j.transpose() * j;
      g += j.transpose() * r;
      sum += r.squaredNorm();
    }
    if (iteration + 1 < 20) point.p_world -= h.ldlt().solve(g);
  }
  point.rms_px = std::sqrt(sum / static_cast<double>(pixels.size()));
  return point;
}

}  // namespace huetrack::solver
