// Lenses as glass makes them, which no model of ours holds exactly, and a capture that they see: for what a calibration
// does where its model is not the truth. The true mappings, theta being the angle from the axis and r the radius over
// the focal length:
//    70 degrees  r = tan(theta) (1 - 0.06 (1 - cos(3.2 theta)))                      a moustache
//   100 degrees  r = 0.6 tan(theta) + 0.4 sin(theta) - 0.03 theta (1 - cos(5 theta))
//   130 degrees  r = 2 sin(theta / 2) (1 + 0.002 (1 - cos(4 theta)))                 equisolid, nearly
// then the sensor's tilt: (x, y) / (1 + a x + b y), by 0.34 and 0.23 degrees (a third of that at 130 degrees, whose
// radii are measured in larger angles), and a pixel that is 0.1 % higher than wide.
#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>

#include "solver/synthetic_rig.h"

namespace huetrack::solver {

class OddLens {
 public:
  // width_deg: 70, 100 or 130, the field of view across the image.
  OddLens(int width_deg, calib::ImageSize size) : width_deg_(width_deg), size_(size) {
    f_ = size.width / 2.0 / radius(width_deg * std::numbers::pi / 360);
    const double share = width_deg == 130 ? 1.0 / 3 : 1;
    tilt_ = share * Eigen::Vector2d(0.006, -0.004);
  }

  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p) const {
    const double rho = p.head<2>().norm(), theta = std::atan2(rho, p.z());
    constexpr double beyond = 84 * std::numbers::pi / 180;
    if (theta > beyond) return std::nullopt;
    const Eigen::Vector2d flat = rho > 0 ? Eigen::Vector2d(p.head<2>() * (radius(theta) / rho)) : Eigen::Vector2d(0, 0);
    const Eigen::Vector2d tilted = flat / (1 + tilt_.dot(flat));
    return Eigen::Vector2d(f_ * tilted.x() + size_.width / 2.0 + 6, 1.001 * f_ * tilted.y() + size_.height / 2.0 - 5);
  }

  bool contains(const Eigen::Vector2d& px) const {
    return px.x() >= 0 && px.y() >= 0 && px.x() <= size_.width - 1 && px.y() <= size_.height - 1;
  }

  // Unit vector; by bisection.
  Eigen::Vector3d ray(const Eigen::Vector2d& px) const {
    const Eigen::Vector2d tilted((px.x() - size_.width / 2.0 - 6) / f_,
                                 (px.y() - size_.height / 2.0 + 5) / (1.001 * f_));
    const Eigen::Vector2d flat = tilted / (1 - tilt_.dot(tilted));
    double low = 0, high = 84 * std::numbers::pi / 180;
    for (int i = 0; i < 60; ++i) (radius((low + high) / 2) < flat.norm() ? low : high) = (low + high) / 2;
    const double r = flat.norm();
    const Eigen::Vector2d side = r > 0 ? Eigen::Vector2d(flat / r * std::sin(low)) : Eigen::Vector2d(0, 0);
    return {side.x(), side.y(), std::cos(low)};
  }

 private:
  double radius(double t) const {
    if (width_deg_ == 70) return std::tan(t) * (1 - 0.06 * (1 - std::cos(3.2 * t)));
    if (width_deg_ == 100) return 0.6 * std::tan(t) + 0.4 * std::sin(t) - 0.03 * t * (1 - std::cos(5 * t));
    return 2 * std::sin(t / 2) * (1 + 0.002 * (1 - std::cos(4 * t)));
  }

  int width_deg_;
  calib::ImageSize size_;
  double f_ = 1;
  Eigen::Vector2d tilt_;
};

struct OddCapture {
  std::vector<OddLens> lenses;
  SyntheticCapture of;  // the models of its rig's cameras mean nothing
};

// Cameras on an arc around a volume, one per lens. Boards at `sets` places: half of them amid the volume, where all see
// them, the others before one camera after another, near and out to its image's corners.
inline OddCapture odd_capture(const std::vector<int>& widths_deg, double noise_px, std::uint64_t seed, int sets = 60) {
  const calib::ImageSize size{1280, 720};
  OddCapture capture;
  SyntheticCapture& of = capture.of;
  of.board.columns = 9;
  of.board.rows = 6;
  of.board.pitch = {0.06, 0.06};
  const auto cameras = static_cast<int>(widths_deg.size());
  for (int c = 0; c < cameras; ++c) {
    capture.lenses.emplace_back(widths_deg[static_cast<std::size_t>(c)], size);
    const double angle = cameras > 1 ? (c / (cameras - 1.0) - 0.5) * 2 * std::numbers::pi / 3 : 0;
    of.rig.cameras.push_back({"cam" + std::to_string(c),
                              size,
                              calib::CameraModel(calib::PinholeRadtan{500, 500, 640, 360, {}}),
                              looking_at({2.0 * std::cos(angle), 2.0 * std::sin(angle), 1.6}, {0, 0, 1.0}),
                              {}});
  }
  std::mt19937_64 rng(seed);
  const Eigen::Vector3d middle(0.24, 0.15, 0);
  for (int s = 0; s < sets; ++s) {
    const Eigen::Vector3d tilt = 0.6 * (2 * drawn<3>(rng, uniform) - Eigen::Vector3d::Ones());
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(tilt.norm(), tilt.normalized()));
    if (s % 2 == 0) {
      const Eigen::Vector3d place(0.8 * uniform(rng) - 0.4, 1.2 * uniform(rng) - 0.6, 0.5 + 1.0 * uniform(rng));
      Eigen::Matrix3d facing;
      facing.col(2) = -Eigen::Vector3d::UnitX();
      facing.col(0) = Eigen::Vector3d::UnitY();
      facing.col(1) = facing.col(2).cross(facing.col(0));
      const Eigen::Quaterniond rotation = turn * Eigen::Quaterniond(facing);
      of.world_from_board.push_back({rotation, place - rotation * middle});
      continue;
    }
    // Along the ray of a pixel anywhere in the image, its corners above all, facing the camera.
    const auto c = static_cast<std::size_t>(s / 2 % cameras);
    const auto edge = [&](double extent) {
      return extent * (0.5 + 0.46 * std::sin(std::numbers::pi * (uniform(rng) - 0.5)));
    };
    const Eigen::Vector3d ray = capture.lenses[c].ray({edge(size.width), edge(size.height)});
    Eigen::Matrix3d facing;
    facing.col(2) = ray;
    facing.col(0) = Eigen::Vector3d::UnitY().cross(ray).normalized();
    facing.col(1) = facing.col(2).cross(facing.col(0));
    const Eigen::Quaterniond rotation = turn * Eigen::Quaterniond(facing);
    const calib::Rigid3d cam_from_board{rotation, (0.45 + 0.35 * uniform(rng)) * ray - rotation * middle};
    of.world_from_board.push_back(calib::inverse(of.rig.cameras[c].cam_from_world) * cam_from_board);
  }
  for (int s = 0; s < sets; ++s) {
    for (int c = 0; c < cameras; ++c) {
      const calib::Rigid3d cam_from_board =
          of.rig.cameras[static_cast<std::size_t>(c)].cam_from_world * of.world_from_board[static_cast<std::size_t>(s)];
      BoardView view{c, s, "cam" + std::to_string(c) + " set " + std::to_string(s), {}, {}};
      for (int id = 0; id < of.board.point_count(); ++id) {
        const auto px = capture.lenses[static_cast<std::size_t>(c)].project(cam_from_board * of.board.point(id));
        const Eigen::Vector2d error = noise_px * drawn<2>(rng, normal);
        if (!px || !capture.lenses[static_cast<std::size_t>(c)].contains(*px + error)) continue;
        view.ids.push_back(id);
        view.px.push_back(*px + error);
      }
      const bool from_front = (cam_from_board.rotation * Eigen::Vector3d::UnitZ()).dot(cam_from_board * middle) > 0;
      if (view.ids.size() >= 12 && from_front) of.views.push_back(std::move(view));
    }
  }
  return capture;
}

// By how much the found lens puts rays elsewhere than the true one, px, after the best turn, over the parts of the
// image where boards were: what 95 % are below.
inline double rays_off_px(const OddLens& truth, const calib::CameraModel& found, const std::vector<BoardView>& views,
                          int camera, calib::ImageSize size) {
  constexpr int columns = 32, rows = 18;
  std::vector<bool> covered(columns * rows, false);
  for (const BoardView& view : views) {
    if (view.camera != camera) continue;
    for (const auto& px : view.px)
      covered[static_cast<std::size_t>(std::min(rows - 1, static_cast<int>(px.y() / size.height * rows)) * columns +
                                       std::min(columns - 1, static_cast<int>(px.x() / size.width * columns)))] = true;
  }
  std::vector<Eigen::Vector3d> rays;
  std::vector<Eigen::Vector2d> pixels;
  for (int i = 0; i < columns * rows; ++i) {
    if (!covered[static_cast<std::size_t>(i)]) continue;
    const Eigen::Vector2d px((i % columns + 0.5) / columns * size.width, (i / columns + 0.5) / rows * size.height);
    rays.push_back(truth.ray(px));
    pixels.push_back(px);
  }
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  std::vector<double> off;
  for (int iteration = 0; iteration < 6; ++iteration) {
    Eigen::Matrix3d normal = 1e-12 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    off.clear();
    for (std::size_t k = 0; k < rays.size(); ++k) {
      const Eigen::Vector3d ray = turn * rays[k];
      calib::CameraModel::Jacobian by_point;
      const auto px = found.project(ray, by_point);
      if (!px) {
        off.push_back(1e3);
        continue;
      }
      off.push_back((px->px - pixels[k]).norm());
      Eigen::Matrix3d cross;
      cross << 0, -ray.z(), ray.y(), ray.z(), 0, -ray.x(), -ray.y(), ray.x(), 0;
      const Eigen::Matrix<double, 2, 3> by_turn = -by_point * cross;
      normal += by_turn.transpose() * by_turn;
      gradient += by_turn.transpose() * (px->px - pixels[k]);
    }
    const Eigen::Vector3d step = -normal.ldlt().solve(gradient);
    turn = Eigen::AngleAxisd(step.norm(), step.normalized()).toRotationMatrix() * turn;
  }
  std::ranges::sort(off);
  return off[static_cast<std::size_t>(0.95 * static_cast<double>(off.size() - 1))];
}

}  // namespace huetrack::solver
