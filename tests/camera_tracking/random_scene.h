// Seeded random poses, points and measurements for property tests.
#pragma once

#include <random>
#include <vector>

#include "camera_tracking/drawn_rectangle.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/swept_pose.h"
#include "drawn.h"

namespace huetrack::camera_tracking {

class RandomScene {
 public:
  explicit RandomScene(std::uint64_t seed) : random_(seed) {}

  double normal() { return normal_(random_); }
  double uniform(double low, double high) { return low + (high - low) * uniform_(random_); }
  int integer(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
  std::mt19937_64& random() { return random_; }

  // Normal, standard deviations per axis.
  calib::Tangent6d tangent(double rad, double m) {
    calib::Tangent6d out;
    for (int i = 0; i < 6; ++i) out[i] = (i < 3 ? rad : m) * normal();
    return out;
  }
  // A camera about 0.6 m from the origin that looks at it, cam_from_world.
  calib::Rigid3d pose() {
    const double azimuth = uniform(-3, 3), distance = uniform(0.35, 0.5);
    return look_at({distance * std::cos(azimuth), distance * std::sin(azimuth), uniform(0.25, 0.5)}, {0, 0, 0});
  }
  calib::Rigid3d transform() { return calib::exp(tangent(1, 2)); }
  Eigen::Vector3d point() { return {uniform(-0.12, 0.12), uniform(-0.12, 0.12), uniform(0, 0.1)}; }

  // Random points as a camera sees them, with normal noise.
  std::vector<PoseObservation> observe(const SweptPose& pose, int points, double sigma_px) {
    std::vector<PoseObservation> out;
    for (int i = 0; i < points; ++i) {
      const Eigen::Vector3d p = point();
      const Eigen::Vector2d noise = drawn<2>(random_, normal_);
      out.push_back({p, project_swept(camera().model, pose, p)->px + sigma_px * noise, sigma_px > 0 ? sigma_px : 0.5});
    }
    return out;
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
};

inline double distance(const calib::Rigid3d& a, const calib::Rigid3d& b) {  // radians and metres together
  return calib::log(a * calib::inverse(b)).norm();
}

// diag(1, 1, 1, s, s, s): what a change of the unit of length by s does to a tangent.
inline Eigen::Matrix<double, 6, 6> unit_change(double s) {
  Eigen::Matrix<double, 6, 1> d;
  d << 1, 1, 1, s, s, s;
  return d.asDiagonal();
}
inline calib::Rigid3d scaled(const calib::Rigid3d& t, double s) {
  return {t.rotation, s * t.translation};
}

// World changes of a scene: the same pixels, seen from another world frame or in another unit.
inline std::vector<PoseObservation> moved(std::vector<PoseObservation> seen, const calib::Rigid3d& new_from_old) {
  for (PoseObservation& o : seen) o.p_world = new_from_old * o.p_world;
  return seen;
}
inline std::vector<PoseObservation> scaled(std::vector<PoseObservation> seen, double s) {
  for (PoseObservation& o : seen) o.p_world *= s;
  return seen;
}

}  // namespace huetrack::camera_tracking
