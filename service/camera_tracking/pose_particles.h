// A set of weighted camera poses, as the camera's particle filters have it: structure of arrays, single precision.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "calib/model/batch_projector.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/camera_estimate.h"
#include "particle_filter/random.h"

namespace huetrack::camera_tracking {

// A state is (q, c): cam_from_world's rotation as a quaternion, and the camera's centre in the world, metres. The
// papers' state is (q, t) with p_cam = R z + t; with the centre in place of t a step of the rotation turns the camera
// about itself, wherever the world's origin lies. thread-compatible.
class PoseParticles {
 public:
  PoseParticles() = default;
  PoseParticles(std::size_t count, const calib::Rigid3d& cam_from_world) { reset(count, cam_from_world); }

  void reset(std::size_t count, const calib::Rigid3d& cam_from_world);  // all at one pose, equal weights
  std::size_t size() const { return weight.size(); }

  // Pupilli, eq. (2): every component uniform within +-v of where it was.
  //   rotation_rad, position_m: half widths, per axis (rotation about the camera's axes)
  void walk_uniform(float rotation_rad, float position_m, particle_filter::Rng& rng);
  // Lee, eq. (3): q times a small random rotation, c plus a random step, both normal. Standard deviations per axis.
  void walk_normal(float rotation_rad, float position_m, particle_filter::Rng& rng);
  // The same step for all: cam_from_world becomes step * cam_from_world (a velocity, for instance).
  void move(const calib::Rigid3d& step);

  void resample(particle_filter::Rng& rng, std::size_t count);  // systematic; equal weights afterwards
  void resample(particle_filter::Rng& rng) { resample(rng, size()); }

  // Where each particle sees a point of the world. The projector has the camera's lens and the identity as its pose.
  //   u, v  (n,) out; BatchProjector::outside where the point has no pixel
  void project(const calib::BatchProjector& lens, const Eigen::Vector3d& p_world, std::span<float> u,
               std::span<float> v);

  calib::Rigid3d mean() const;               // cam_from_world; weighted
  calib::Rigid3d pose(std::size_t i) const;  // cam_from_world
  // Of world_from_camera's errors about the mean, as CameraEstimate::covariance has it.
  Covariance6d covariance(const calib::Rigid3d& mean_cam_from_world) const;

  std::vector<float> qw, qx, qy, qz;  // unit
  std::vector<float> cx, cy, cz;
  std::vector<float> weight;  // sum 1

 private:
  // By what scratch_ holds: six numbers of each, the second ones `apart` from the first ones.
  void walk(std::size_t apart, float rotation_rad, float position_m);
  void update_rotations();
  std::array<std::vector<float>, 9> rotation_;  // of the quaternions, row by row
  bool rotations_hold_ = false;
  std::vector<float> scratch_, x_, y_, z_;
  std::vector<std::uint32_t> ancestor_;
};

// The camera with the identity as its pose: what the projector of PoseParticles::project() is made of.
calib::Camera without_pose(calib::Camera camera);

// Weighted mean and 2x2 covariance of projections, those without a pixel left out. weight_sum: of those that have one.
struct CloudMoments {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double weight_sum = 0;
  float u_min = 0, u_max = 0, v_min = 0, v_max = 0;  // of those that have a pixel
};
CloudMoments cloud_moments(std::span<const float> u, std::span<const float> v, std::span<const float> weight);

}  // namespace huetrack::camera_tracking
