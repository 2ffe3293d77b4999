#include "camera_tracking/keyframes/local_bundle.h"

#include <gmock/gmock.h>

#include <Eigen/LU>

#include "camera_tracking/random_scene.h"
#include "particle_filter/random.h"

namespace huetrack::keyframes {
namespace {

using camera_tracking::camera;
using camera_tracking::look_at;

TEST(LocalBundle, CorrectsPosesAndPoints) {
  const calib::Camera c = camera();
  particle_filter::Rng rng(6);
  BundleProblem problem;
  std::vector<calib::Rigid3d> truth;
  for (int k = 0; k < 4; ++k) truth.push_back(look_at({0.1 * k, -0.5, 0.4}, {0.02, 0.03, 0}));
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 40; ++i)
    points.emplace_back(0.3 * rng.uniform() - 0.15, 0.3 * rng.uniform() - 0.15, 0.1 * rng.uniform());
  for (int k = 0; k < 4; ++k) {
    calib::Tangent6d off = calib::Tangent6d::Constant(k < 2 ? 0.0 : 0.01);
    problem.poses.push_back({calib::exp(off) * truth[static_cast<std::size_t>(k)], k < 2});
  }
  for (int i = 0; i < 40; ++i) {
    problem.points.push_back({});
    problem.points.back().position = points[static_cast<std::size_t>(i)] + Eigen::Vector3d(0.01, -0.01, 0.01);
    for (int k = 0; k < 4; ++k)
      problem.observations.push_back(
          {k, i, c.model.project(truth[static_cast<std::size_t>(k)] * points[static_cast<std::size_t>(i)])->px, 0.5,
           false});
  }
  problem.observations[10].px += Eigen::Vector2d(12, -9);
  adjust(c.model, problem, 30);
  EXPECT_TRUE(problem.observations[10].outlier);
  EXPECT_FALSE(problem.observations[11].outlier);
  EXPECT_LT(calib::log(problem.poses[3].cam_from_world * calib::inverse(truth[3])).norm(), 2e-3);
  EXPECT_LT((problem.points[20].position - points[20]).norm(), 2e-3);
}

TEST(LocalBundle, UsesThePoseOfEachRow) {
  const calib::Camera c = camera();
  particle_filter::Rng rng(7);
  BundleProblem problem;
  std::vector<camera_tracking::SweptPose> truth;
  for (int k = 0; k < 4; ++k) {
    camera_tracking::Sweep sweep;
    sweep.last_row = 239;
    sweep.motion << 0.01 * k, 0.05 - 0.03 * k, 0.01, 0.005, -0.004 * k, 0.002;
    truth.push_back({look_at({0.1 * k, -0.5, 0.4}, {0.02, 0.03, 0}), sweep});
    const calib::Tangent6d off = calib::Tangent6d::Constant(k < 2 ? 0.0 : 0.005);
    problem.poses.push_back({calib::exp(off) * truth.back().cam_from_world, k < 2, sweep});
  }
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 40; ++i) {
    points.emplace_back(0.3 * rng.uniform() - 0.15, 0.3 * rng.uniform() - 0.15, 0.1 * rng.uniform());
    problem.points.push_back({});
    problem.points.back().position = points.back() + Eigen::Vector3d(0.005, -0.005, 0.005);
    for (int k = 0; k < 4; ++k)
      problem.observations.push_back(
          {k, i, project_swept(c.model, truth[static_cast<std::size_t>(k)], points.back())->px, 0.5, false});
  }
  adjust(c.model, problem, 30);
  const calib::Rigid3d off = problem.poses[3].cam_from_world * calib::inverse(truth[3].cam_from_world);
  EXPECT_LT(calib::log(off).norm(), 2e-4);
  EXPECT_LT((problem.points[20].position - points[20]).norm(), 2e-4);
}

// ---- Properties

using camera_tracking::distance;
using camera_tracking::RandomScene;

// Four views of some points, two of them fixed, with perturbed poses and points.
struct RandomBundle {
  explicit RandomBundle(std::uint64_t seed, double sigma_px = 0.5, double error = 0.01, int points_count = 30) {
    RandomScene scene(seed);
    for (int k = 0; k < 4; ++k) {
      truth.push_back({scene.pose(), {scene.tangent(0.01, 0.003), calib::Tangent6d::Zero(), 239}});
      problem.poses.push_back({truth.back().cam_from_world, k < 2, truth.back().sweep});
      if (k >= 2)
        problem.poses.back().cam_from_world = calib::exp(scene.tangent(error, error / 2)) * truth.back().cam_from_world;
    }
    for (int i = 0; i < points_count; ++i) {
      points.push_back(scene.point());
      problem.points.push_back({});
      problem.points.back().position =
          points.back() + error / 2 * Eigen::Vector3d(scene.normal(), scene.normal(), scene.normal());
      for (int k = 0; k < 4; ++k) {
        const Eigen::Vector2d px = project_swept(camera().model, truth[static_cast<std::size_t>(k)], points.back())->px;
        problem.observations.push_back(
            {k, i, px + sigma_px * Eigen::Vector2d(scene.normal(), scene.normal()), 0.5, false});
      }
    }
  }
  std::vector<camera_tracking::SweptPose> truth;
  std::vector<Eigen::Vector3d> points;
  BundleProblem problem;
};

double largest_point_error(const BundleProblem& a, const BundleProblem& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.points.size(); ++i)
    most = std::max(most, (a.points[i].position - b.points[i].position).norm());
  return most;
}

TEST(LocalBundleProperties, ExactMeasurementsGiveTheTruth) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    RandomBundle bundle(seed, 0);
    const BundleResult result = adjust(camera().model, bundle.problem, 50);
    EXPECT_TRUE(result.converged);
    EXPECT_LT(result.rms, 0.02);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_LT(distance(bundle.problem.poses[k].cam_from_world, bundle.truth[k].cam_from_world), 1e-3) << seed;
  }
}

TEST(LocalBundleProperties, FixedPosesDoNotMove) {
  RandomBundle bundle(11);
  const BundleProblem before = bundle.problem;
  adjust(camera().model, bundle.problem, 10);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(bundle.problem.poses[k].cam_from_world.translation, before.poses[k].cam_from_world.translation);
    EXPECT_EQ(bundle.problem.poses[k].cam_from_world.rotation.coeffs(),
              before.poses[k].cam_from_world.rotation.coeffs());
  }
  EXPECT_GT(distance(bundle.problem.poses[2].cam_from_world, before.poses[2].cam_from_world), 1e-3);
}

// 1 for normal residuals of the stated sigma, less the parameters' share: 240 residuals, 102 parameters.
TEST(LocalBundleProperties, RmsMatchesTheNoise) {
  double mean = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    RandomBundle bundle(seed);
    mean += adjust(camera().model, bundle.problem, 20).rms / 20;
  }
  EXPECT_NEAR(mean, std::sqrt((240 - 102) / 240.0), 0.06);
}

TEST(LocalBundleProperties, DoesNotDependOnTheOrderOfPoints) {
  RandomBundle bundle(12);
  BundleProblem reversed = bundle.problem;
  const int n = static_cast<int>(reversed.points.size());
  std::ranges::reverse(reversed.points);
  for (BundleObservation& o : reversed.observations) o.point = n - 1 - o.point;
  std::ranges::stable_sort(reversed.observations, {}, &BundleObservation::point);
  adjust(camera().model, bundle.problem, 30);
  adjust(camera().model, reversed, 30);
  std::ranges::reverse(reversed.points);
  EXPECT_LT(largest_point_error(bundle.problem, reversed), 1e-7);
  EXPECT_LT(distance(bundle.problem.poses[3].cam_from_world, reversed.poses[3].cam_from_world), 1e-7);
}

TEST(LocalBundleProperties, EquivariantToTheWorldFrame) {
  RandomScene scene(13);
  RandomBundle bundle(14);
  BundleProblem moved = bundle.problem;
  const calib::Rigid3d new_from_old = scene.transform(), old_from_new = calib::inverse(new_from_old);
  for (BundlePose& p : moved.poses) p.cam_from_world = p.cam_from_world * old_from_new;
  for (BundlePoint& p : moved.points) p.position = new_from_old * p.position;
  adjust(camera().model, bundle.problem, 30);
  adjust(camera().model, moved, 30);
  // Up to the convergence threshold: the damping of the points depends on the axes.
  for (BundlePoint& p : moved.points) p.position = old_from_new * p.position;
  EXPECT_LT(largest_point_error(bundle.problem, moved), 1e-4);
  EXPECT_LT(distance(bundle.problem.poses[3].cam_from_world * old_from_new, moved.poses[3].cam_from_world), 1e-4);
}

TEST(LocalBundleProperties, EquivariantToTheUnitOfLength) {
  RandomBundle bundle(15);
  BundleProblem scaled = bundle.problem;
  constexpr double s = 4;
  for (BundlePose& p : scaled.poses) {
    p.cam_from_world = camera_tracking::scaled(p.cam_from_world, s);
    p.sweep.motion = camera_tracking::unit_change(s) * p.sweep.motion;
  }
  for (BundlePoint& p : scaled.points) p.position *= s;
  adjust(camera().model, bundle.problem, 30);
  adjust(camera().model, scaled, 30);
  for (BundlePoint& p : scaled.points) p.position /= s;
  EXPECT_LT(largest_point_error(bundle.problem, scaled), 1e-4);
}

// Given the poses. 3 for normal residuals; Huber's weights make the information a few per cent too small.
TEST(LocalBundleProperties, PointCovarianceMatchesMonteCarlo) {
  double nees = 0;
  int n = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    RandomBundle bundle(seed, 0.5, 0.004, 10);
    for (std::size_t k = 0; k < 4; ++k) {
      bundle.problem.poses[k].fixed = true;
      bundle.problem.poses[k].cam_from_world = bundle.truth[k].cam_from_world;
    }
    adjust(camera().model, bundle.problem, 20);
    for (std::size_t i = 0; i < bundle.points.size(); ++i) {
      const BundlePoint& p = bundle.problem.points[i];
      const Eigen::Vector3d error = p.position - bundle.points[i];
      nees += error.dot(p.covariance.inverse() * error), ++n;
    }
  }
  EXPECT_GT(nees / n, 2.3);
  EXPECT_LT(nees / n, 3.6);
}

TEST(LocalBundleProperties, APriorWeighsAsItsSigma) {
  double last = 1;
  for (const double sigma_m : {1.0, 2e-3, 1e-5}) {
    RandomBundle bundle(16);
    const Eigen::Vector3d prior = bundle.points[4] + Eigen::Vector3d(0.003, 0, 0);
    bundle.problem.points[4].prior = prior, bundle.problem.points[4].prior_sigma_m = sigma_m;
    adjust(camera().model, bundle.problem, 30);
    const double error = (bundle.problem.points[4].position - prior).norm();
    EXPECT_LT(error, last) << sigma_m;
    last = error;
  }
  EXPECT_LT(last, 1e-4);
}

TEST(LocalBundleProperties, FindsTheOutliers) {
  RandomBundle bundle(17);
  for (std::size_t i = 0; i < bundle.problem.observations.size(); i += 20)
    bundle.problem.observations[i].px += Eigen::Vector2d(9, -7);
  adjust(camera().model, bundle.problem, 30);
  int false_alarms = 0;  // beyond 3.5 robust sigmas, by noise: some 3 %
  for (std::size_t i = 0; i < bundle.problem.observations.size(); ++i) {
    if (i % 20 == 0) {
      EXPECT_TRUE(bundle.problem.observations[i].outlier) << i;
    }
    false_alarms += i % 20 != 0 && bundle.problem.observations[i].outlier;
  }
  EXPECT_LE(false_alarms, 8);
}

}  // namespace
}  // namespace huetrack::keyframes
