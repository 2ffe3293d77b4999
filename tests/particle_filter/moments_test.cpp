#include "particle_filter/moments.h"

#include <gtest/gtest.h>

#include <vector>

#include "particle_filter/random.h"
#include "particle_filter/resample.h"

namespace huetrack::particle_filter {
namespace {

struct Cloud {
  std::vector<float> x, y, z, weight;
};

Cloud cloud(std::size_t n, std::uint64_t seed, const Eigen::Vector3f& at) {
  Cloud c{std::vector<float>(n), std::vector<float>(n), std::vector<float>(n), std::vector<float>(n)};
  Rng rng(seed);
  rng.fill_normal(c.x), rng.fill_normal(c.y), rng.fill_normal(c.z), rng.fill_uniform(c.weight);
  for (std::size_t i = 0; i < n; ++i) {
    c.x[i] = at.x() + 0.01f * c.x[i], c.y[i] = at.y() + 0.02f * c.y[i],
    c.z[i] = at.z() + 0.03f * c.z[i] + (c.x[i] - at.x());
  }
  normalize_weights(c.weight);
  return c;
}

TEST(WeightedMoments, agreeWithAPlainDoubleLoop) {
  for (const std::size_t n : {1u, 2u, 15u, 16u, 17u, 31u, 200u, 2003u}) {
    const Eigen::Vector3f at(100, -20, 3);  // far from the world's origin, where squares would eat all digits
    const Cloud c = cloud(n, n, at);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
      mean += static_cast<double>(c.weight[i]) * Eigen::Vector3f(c.x[i], c.y[i], c.z[i]).cast<double>();
      sum += static_cast<double>(c.weight[i]);
    }
    mean /= sum;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector3d d = Eigen::Vector3f(c.x[i], c.y[i], c.z[i]).cast<double>() - mean;
      covariance += static_cast<double>(c.weight[i]) / sum * d * d.transpose();
    }
    const WeightedMoments m = weighted_moments(c.x.data(), c.y.data(), c.z.data(), c.weight.data(), n, at);
    EXPECT_LT((m.mean - mean).norm(), 1e-7) << n;
    EXPECT_LT((m.covariance - covariance).norm(), 1e-9) << n;
    EXPECT_EQ(m.covariance, m.covariance.transpose());
    for (std::size_t i = 0; i < n; ++i) {
      if (i < m.best) {
        EXPECT_LT(c.weight[i], c.weight[m.best]) << n;
      } else {
        EXPECT_LE(c.weight[i], c.weight[m.best]) << n;
      }
    }
  }
}

TEST(WeightedMoments, firstOfSeveralBest) {
  for (std::size_t first = 0; first < 40; ++first) {
    std::vector<float> x(41, 1.0f), weight(41, 0.0f);
    weight[first] = weight[40] = 0.5f;
    const WeightedMoments m = weighted_moments(x.data(), x.data(), x.data(), weight.data(), x.size(), {1, 1, 1});
    EXPECT_EQ(m.best, first);
  }
}

// Particles of no weight count for nothing, wherever they are.
TEST(WeightedMoments, twoHeavyParticles) {
  const std::vector<float> x{0, 2, 50}, y{0, 4, -70}, z{1, 1, 9}, weight{0.5f, 0.5f, 0};
  const WeightedMoments m = weighted_moments(x.data(), y.data(), z.data(), weight.data(), 3, {0, 0, 0});
  EXPECT_EQ(m.mean, Eigen::Vector3d(1, 2, 1));
  Eigen::Matrix3d expected;
  expected << 1, 2, 0, 2, 4, 0, 0, 0, 0;
  EXPECT_EQ(m.covariance, expected);
}

}  // namespace
}  // namespace huetrack::particle_filter
