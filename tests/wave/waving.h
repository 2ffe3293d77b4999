// A rig and a waved ball that are exactly known, and the regions that the cameras see of it with a stated noise.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/umeyama.h"
#include "calib/wave/ball_finder.h"
#include "calib/wave/wave_adjustment.h"
#include "drawn.h"

namespace huetrack::wave {

// Cameras on an arc that look at the middle of the volume.
inline calib::CameraRig rig_of(int count) {
  calib::CameraRig rig;
  for (int c = 0; c < count; ++c) {
    calib::Camera camera;
    camera.name = "cam" + std::to_string(c);
    camera.image_size = {640, 480};
    camera.model =
        calib::CameraModel(calib::PinholeRadtan{480.0 + 5 * c, 482.0, 320.3, 238.8, {-0.1, 0.02, 0.0004, -0.0003}});
    const double angle = 1.1 * c;
    const Eigen::Vector3d centre(2.6 * std::cos(angle), 2.6 * std::sin(angle), 1.6 + 0.2 * c), middle(0, 0, 1);
    const Eigen::Vector3d z = (middle - centre).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized(),
                          y = z.cross(x);
    Eigen::Matrix3d r;
    r << x.transpose(), y.transpose(), z.transpose();
    camera.cam_from_world = {Eigen::Quaterniond(r).normalized(), -(r * centre)};
    rig.cameras.push_back(camera);
  }
  return rig;
}

inline Eigen::Vector3d lissajous(double t) {
  return {0.7 * std::sin(1.3 * t), 0.7 * std::sin(1.7 * t + 0.5), 1 + 0.5 * std::sin(2.3 * t + 1)};
}

struct Waving {
  double seconds = 8;
  double noise_px = 0.15;
  std::vector<double> offset_s{};   // per camera: when its first frame is
  std::vector<CameraTime> times{};  // per camera
  std::function<bool(int camera, double t)> hidden = {};
  std::function<Eigen::Vector3d(double t)> path = lissajous;
  double wrong = 0;  // share of frames with a second, larger region somewhere
};

inline std::vector<BallFrame> waved(const calib::CameraRig& rig, const Waving& w) {
  constexpr double radius_m = 0.04;
  std::mt19937_64 rng(7);
  std::normal_distribution<double> noise(0, w.noise_px);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<BallFrame> frames;
  for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
    for (int i = 0; i < static_cast<int>(30 * w.seconds); ++i) {
      const double middle_s = i / 30.0 + (w.offset_s.empty() ? 0 : w.offset_s[static_cast<std::size_t>(c)]);
      const CameraTime time = w.times.empty() ? CameraTime{} : w.times[static_cast<std::size_t>(c)];
      BallFrame frame{c, middle_s + time.latency_s, {}};
      // The outline's centre is that of a cone around the ball, and is seen when its own row is exposed.
      double exposed_s = middle_s;
      Eigen::Vector3d p;
      std::optional<calib::RawPixel> px;
      for (int round = 0; round < 4; ++round) {
        p = camera.cam_from_world * w.path(exposed_s);
        px = camera.model.project({p.x(), p.y(), p.z() - radius_m * radius_m / p.z()});
        if (px) exposed_s = middle_s + below_middle(camera, px->px) * time.readout_s;
      }
      const double r = radius_m * camera.model.fx() / p.z();
      const auto add = [&](const Eigen::Vector2d& at, double radius) {
        color::ColorRegion region;
        region.area = static_cast<int>(std::lround(std::numbers::pi * radius * radius));
        region.centre = at;
        region.spread = radius * radius / 4 * Eigen::Matrix2d::Identity();
        frame.regions.push_back(region);
      };
      if (uniform(rng) < w.wrong) add({640 * uniform(rng), 480 * uniform(rng)}, 1.3 * r);
      if (px && camera.contains(*px) && !(w.hidden && w.hidden(c, middle_s))) {
        const double radius = r * (1 + 0.02 * noise(rng));
        add(px->px + drawn<2>(rng, noise), radius);
      }
      frames.push_back(std::move(frame));
    }
  }
  return frames;
}

inline calib::CameraRig spoilt(calib::CameraRig rig, double metres, double degrees) {
  std::mt19937_64 rng(3);
  std::normal_distribution<double> normal;
  for (calib::Camera& camera : rig.cameras) {
    const Eigen::Vector3d centre = camera.centre() + metres * drawn<3>(rng, normal).normalized();
    const Eigen::AngleAxisd turn(degrees * std::numbers::pi / 180, drawn<3>(rng, normal).normalized());
    camera.cam_from_world.rotation = (turn * camera.cam_from_world.rotation).normalized();
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
  }
  return rig;
}

// Worst camera after rigid alignment of the centres and axes.
struct Off {
  double metres = 0, degrees = 0;
};
inline Off off(const calib::CameraRig& found, const calib::CameraRig& truth) {
  // Points in front of each camera, so that two cameras are enough for an alignment.
  Eigen::Matrix3Xd a(3, 4 * found.cameras.size()), b(3, 4 * found.cameras.size());
  const auto points = [](const calib::CameraRig& rig, Eigen::Matrix3Xd& m) {
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      for (int i = 0; i < 4; ++i)
        m.col(static_cast<Eigen::Index>(4 * c) + i) =
            calib::inverse(rig.cameras[c].cam_from_world) *
            (i == 3 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(Eigen::Vector3d::Unit(i)));
    }
  };
  points(found, a);
  points(truth, b);
  const Eigen::Matrix4d t = solver::umeyama(a, b, false);
  const Eigen::Matrix3d rotation = t.topLeftCorner<3, 3>();
  Off out;
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    out.metres =
        std::max(out.metres,
                 (rotation * found.cameras[c].centre() + t.topRightCorner<3, 1>() - truth.cameras[c].centre()).norm());
    const Eigen::Quaterniond q = found.cameras[c].cam_from_world.rotation * Eigen::Quaterniond(rotation).conjugate();
    out.degrees =
        std::max(out.degrees, q.angularDistance(truth.cameras[c].cam_from_world.rotation) * 180 / std::numbers::pi);
  }
  return out;
}

}  // namespace huetrack::wave
