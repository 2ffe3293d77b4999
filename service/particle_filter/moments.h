// Weighted mean and covariance of a particle set, and its best particle, in one pass.
#pragma once

#include <Eigen/Core>
#include <cstddef>

namespace huetrack::particle_filter {

struct WeightedMoments {
  Eigen::Vector3d mean;        // in the units of the particles
  Eigen::Matrix3d covariance;  // sum of w d d^T, d from the mean; no correction for the sample's size
  std::size_t best = 0;        // of the largest weight; the first of them when several are
};

//   x, y, z  (n,) coordinates;  weight  (n,) >= 0, sum 1;  n >= 1
//   origin   any point near the particles: the sums are taken about it, so that single precision is enough
// Pure; the same bits on every x86-64 machine.
WeightedMoments weighted_moments(const float* x, const float* y, const float* z, const float* weight, std::size_t n,
                                 const Eigen::Vector3f& origin);

}  // namespace huetrack::particle_filter
