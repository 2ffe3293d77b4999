// Weighted camera poses for particle filters: structure of arrays, single precision.
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

// A state is (q, c): cam_from_world's rotation and the camera's centre in the world, metres. The papers use (q, t) with
// p_cam = R z + t; with the centre, a step of the rotation does not depend on the world's origin. thread-compatible.
class PoseParticles {
 public:
  PoseParticles() = default;
  PoseParticles(std::size_t count, const calib::Rigid3d& cam_from_world) { reset(count, cam_from_world); }

  void reset(std::size_t count, const calib::Rigid3d& cam_from_world);  // all at one pose, equal weights
  std::size_t size() const { return weight.size(); }

  // Pupilli, eq. (2): a uniform random walk. Half widths per axis; rotation about the camera's axes.
  void walk_uniform(float rotation_rad, float position_m, particle_filter::Rng& rng);
  // Lee, eq. (3): a normal random walk. Standard deviations per axis.
  void walk_normal(float rotation_rad, float position_m, particle_filter::Rng& rng);
  void resample(particle_filter::Rng& rng, std::size_t count);  // systematic; equal weights afterwards
  void resample(particle_filter::Rng& rng) { resample(rng, size()); }

  // The raw pixel of a world point for each particle. lens: of without_pose(camera).
  //   u, v  (n,) out; BatchProjector::outside where the point has no pixel
  void project(const calib::BatchProjector& lens, const Eigen::Vector3d& p_world, std::span<float> u,
               std::span<float> v);

  calib::Rigid3d mean() const;                                             // cam_from_world; weighted
  calib::Rigid3d pose(std::size_t i) const;                                // cam_from_world
  std::vector<calib::Rigid3d> world_from_cameras(std::size_t most) const;  // of the first particles, for drawing
  // About the given mean, as CameraEstimate::covariance.
  Covariance6d covariance(const calib::Rigid3d& mean_cam_from_world) const;

  std::vector<float> qw, qx, qy, qz;  // unit
  std::vector<float> cx, cy, cz;
  std::vector<float> weight;  // sum 1

 private:
  // Steps by six blocks of random numbers in scratch_, `stride` apart.
  void walk(std::size_t stride, float rotation_rad, float position_m);
  void update_rotations();
  std::array<std::vector<float>, 9> rotation_;  // of the quaternions, row by row
  bool rotation_is_valid_ = false;
  std::vector<float> scratch_, x_, y_, z_;
  std::vector<std::uint32_t> ancestor_;
};

// The camera with the identity as its pose, for the projector of PoseParticles::project().
calib::Camera without_pose(calib::Camera camera);

// Weighted mean, covariance and bounds of the projections that have a pixel; weight_sum: their share of the weight.
struct CloudMoments {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double weight_sum = 0;
  float u_min = 0, u_max = 0, v_min = 0, v_max = 0;
};
CloudMoments cloud_moments(std::span<const float> u, std::span<const float> v, std::span<const float> weight);

}  // namespace huetrack::camera_tracking
