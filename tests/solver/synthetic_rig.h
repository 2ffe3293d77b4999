// A rig and boards that are exactly known, and what the cameras see of them with a stated noise.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/umeyama.h"
#include "drawn.h"

namespace huetrack::solver {

struct SyntheticCapture {
  calib::CameraRig rig;
  board::Board board;
  std::vector<calib::Rigid3d> world_from_board;
  std::vector<BoardView> views;
};

struct SyntheticOptions {
  int cameras = 4;
  int sets = 30;
  double noise_px = 0.1;  // standard deviation per axis
  std::uint64_t seed = 1;
  double distance_m = 2.2;  // of the cameras from the middle of the volume, horizontally
  int columns = 9;          // of the chessboard
  int rows = 6;
  // Of the board's back, which the cameras with odd numbers see from the other side of the volume; nullopt: none.
  std::optional<board::BoardBack> back{};
  std::vector<calib::CameraModel> models{};  // per camera; empty: three different pinholes in turn
};

inline calib::Rigid3d looking_at(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d z = (to - from).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d cam_from_world;
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  return {Eigen::Quaterniond(cam_from_world), -cam_from_world * from};
}

inline double uniform(std::mt19937_64& rng) {
  return static_cast<double>(rng() >> 11) * 0x1p-53;
}
inline double normal(std::mt19937_64& rng) {
  const double radius = std::sqrt(-2 * std::log(1 - uniform(rng)));
  return radius * std::cos(2 * std::numbers::pi * uniform(rng));
}

// Cameras on an arc of 120 degrees around the volume; boards inside it, facing the cameras' side, tilted by up to 40
// degrees.
inline SyntheticCapture synthetic_capture(const SyntheticOptions& options = {}) {
  SyntheticCapture capture;
  capture.board.columns = options.columns;
  capture.board.rows = options.rows;
  capture.board.pitch = {0.06, 0.06};
  capture.board.back = options.back;
  std::mt19937_64 rng(options.seed);
  const std::vector<calib::CameraModel> usual{
      calib::CameraModel(calib::PinholeRadtan{620, 618, 322, 236, {-0.25, 0.08, 0.0006, -0.0004}}),
      calib::CameraModel(calib::PinholeRadtan{560, 561, 315, 243, {-0.12, 0.03, -0.0003, 0.0005}}),
      calib::CameraModel(calib::PinholeRadtan{700, 700, 330, 238, {-0.3, 0.1, 0, 0}})};
  for (int c = 0; c < options.cameras; ++c) {
    const double angle = options.cameras > 1 ? (c / (options.cameras - 1.0) - 0.5) * 2 * std::numbers::pi / 3 : 0;
    const auto& models = options.models.empty() ? usual : options.models;
    const double side = options.back && c % 2 == 1 ? -1 : 1;
    const Eigen::Vector3d place(side * options.distance_m * std::cos(angle), options.distance_m * std::sin(angle), 1.8);
    capture.rig.cameras.push_back({"cam" + std::to_string(c),
                                   {640, 480},
                                   models[static_cast<std::size_t>(c) % models.size()],
                                   looking_at(place, {0, 0, 1.0}),
                                   {}});
  }
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (int id = 0; id < capture.board.point_count(); ++id)
    centre += capture.board.point(id) / capture.board.point_count();
  for (int s = 0; s < options.sets; ++s) {
    const Eigen::Vector3d place =
        Eigen::Vector3d(0.6, 1.2, 0.8).cwiseProduct(drawn<3>(rng, uniform)) + Eigen::Vector3d(-0.2, -0.6, 0.6);
    // Board z points away from the viewer: towards -x of the world; tilted at random, turned in its plane.
    Eigen::Matrix3d facing;
    facing.col(2) = -Eigen::Vector3d::UnitX();
    facing.col(0) = Eigen::Vector3d::UnitY();
    facing.col(1) = facing.col(2).cross(facing.col(0));
    const Eigen::Vector3d tilt = 0.7 * (2 * drawn<3>(rng, uniform) - Eigen::Vector3d::Ones());
    const Eigen::Quaterniond rotation = Eigen::AngleAxisd(tilt.norm(), tilt.normalized()) * Eigen::Quaterniond(facing);
    capture.world_from_board.push_back({rotation, place - rotation * centre});
  }
  for (int s = 0; s < options.sets; ++s) {
    for (int c = 0; c < options.cameras; ++c) {
      const calib::Camera& camera = capture.rig.cameras[static_cast<std::size_t>(c)];
      BoardView view{c, s, camera.name + " set " + std::to_string(s), {}, {}};
      const calib::Rigid3d& pose = capture.world_from_board[static_cast<std::size_t>(s)];
      const Eigen::Vector3d into_board = pose.rotation * Eigen::Vector3d::UnitZ();
      const bool sees_back = options.back && into_board.dot(camera.centre() - pose * centre) > 0;
      const int first = sees_back ? capture.board.side_point_count() : 0;
      for (int id = first; id < first + capture.board.side_point_count(); ++id) {
        const auto px = camera.project_world(pose * capture.board.point(id));
        const Eigen::Vector2d error = options.noise_px * drawn<2>(rng, normal);
        if (!px || !camera.contains({px->px + error})) continue;
        view.ids.push_back(id);
        view.px.push_back(px->px + error);
      }
      if (view.ids.size() >= 12) capture.views.push_back(std::move(view));
    }
  }
  return capture;
}

// Where rays from the pixels meet: the point of least reprojection error.
inline Eigen::Vector3d triangulate(const calib::CameraRig& rig,
                                   const std::vector<std::pair<int, Eigen::Vector2d>>& pixels) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const auto& [c, px] : pixels) {
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
    const auto ray = camera.model.ray({px});
    if (!ray) continue;
    const Eigen::Vector3d d = camera.cam_from_world.rotation.conjugate() * *ray;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * camera.centre();
  }
  Eigen::Vector3d p = a.ldlt().solve(b);
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const auto& [c, px] : pixels) {
      const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
      calib::CameraModel::Jacobian by_point;
      const auto projected = camera.model.project(camera.cam_from_world * p, by_point);
      if (!projected) continue;
      const Eigen::Matrix<double, 2, 3> j = by_point * camera.cam_from_world.rotation.toRotationMatrix();
      h += j.transpose() * j;
      g += j.transpose() * (projected->px - px);
    }
    p -= h.ldlt().solve(g);
  }
  return p;
}

// rms distance of points of a volume, projected by the true rig and triangulated with the found one, after the best
// rigid alignment: what a calibration is worth. Metres.
inline double volume_rms_m(const calib::CameraRig& truth, const calib::CameraRig& found, const Eigen::Vector3d& low,
                           const Eigen::Vector3d& high) {
  std::vector<Eigen::Vector3d> true_points, found_points;
  constexpr int steps = 8;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k) {
        const Eigen::Vector3d p = low + (high - low).cwiseProduct(Eigen::Vector3d(i, j, k) / steps);
        std::vector<std::pair<int, Eigen::Vector2d>> pixels;
        for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
          const auto px = truth.cameras[c].project_world(p);
          if (px && truth.cameras[c].contains(*px)) pixels.emplace_back(static_cast<int>(c), px->px);
        }
        if (pixels.size() < 2) continue;
        true_points.push_back(p);
        found_points.push_back(triangulate(found, pixels));
      }
    }
  }
  Eigen::Matrix3Xd a(3, true_points.size()), b(3, true_points.size());
  for (std::size_t k = 0; k < true_points.size(); ++k) {
    a.col(static_cast<Eigen::Index>(k)) = true_points[k];
    b.col(static_cast<Eigen::Index>(k)) = found_points[k];
  }
  const Eigen::Matrix4d t = umeyama(b, a, false);
  const Eigen::Matrix3Xd off = ((t.topLeftCorner<3, 3>() * b).colwise() + t.topRightCorner<3, 1>()) - a;
  return std::sqrt(off.squaredNorm() / static_cast<double>(true_points.size()));
}

}  // namespace huetrack::solver
