#include "camera_tracking/keyframes/local_bundle.h"

#include <gmock/gmock.h>

#include "camera_tracking/drawn_rectangle.h"
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

}  // namespace
}  // namespace huetrack::keyframes
