#include "camera_tracking/keyframes/camera_motion.h"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "camera_tracking/random_scene.h"

namespace huetrack::keyframes {
namespace {

using camera_tracking::distance;
using camera_tracking::RandomScene;

capture::Timestamp at(double t_s) {
  return capture::Timestamp(capture::duration_of(t_s));
}

calib::Tangent6d turning(double rad) {
  calib::Tangent6d out = calib::Tangent6d::Zero();
  out[1] = rad, out[3] = 0.1 * rad;
  return out;
}

const Matrix6d exact = 1e-12 * Matrix6d::Identity();

double turn_sigma(const MotionPrior& prior) {
  return std::sqrt(prior.velocity_covariance(1, 1));
}

TEST(CameraMotion, VelocityRefersToTheMiddleRow) {
  CameraMotion motion;  // an even acceleration of 4 rad/s^2; a frame is missing
  const auto pose = [](double t) { return calib::exp(turning(2 * t * t)); };
  for (int i = 0; i < 12; ++i) motion.add(at(i / 30.0), pose(i / 30.0), exact);
  const double t = 13.0 / 30;
  const MotionPrior prior = motion.prior(at(t), {0.03, 0.001});
  EXPECT_NEAR(prior.velocity(pose(t))[1], 4 * t, 0.01 * 4 * t);
  const camera_tracking::Sweep sweep = prior.sweep(pose(t), 239);
  const calib::Rigid3d first_row = sweep.row_from_middle(0) * pose(t), last_row = sweep.row_from_middle(239) * pose(t);
  EXPECT_LT(calib::log(first_row * calib::inverse(pose(t - 0.015))).norm(), 3e-4);
  EXPECT_LT(calib::log(last_row * calib::inverse(pose(t + 0.015))).norm(), 3e-4);
}

TEST(CameraMotion, AGapOrALossForgetsTheVelocity) {
  CameraMotion motion;
  EXPECT_GT(turn_sigma(motion.prior(at(0), {})), 0.3);
  motion.add(at(0), {}, exact), motion.add(at(0.033), calib::exp(turning(0.05)), exact);
  EXPECT_GT(motion.prior(at(0.066), {}).velocity({}).norm(), 1);
  EXPECT_EQ(motion.prior(at(2), {}).velocity({}).norm(), 0);
  motion.forget();
  EXPECT_EQ(motion.prior(at(0.066), {}).velocity({}).norm(), 0);
}

TEST(CameraMotion, JerksInflateTheCovariance) {
  CameraMotion even, jerky;
  const Matrix6d seen = 1e-6 * Matrix6d::Identity();
  for (int i = 0; i < 20; ++i) {
    even.add(at(i / 30.0), calib::exp(turning(0.05 * i)), seen);
    jerky.add(at(i / 30.0), calib::exp(turning(0.05 * i + (i % 3 == 0 ? 0.02 : 0))), seen);
  }
  EXPECT_GT(turn_sigma(jerky.prior(at(20 / 30.0), {})), 5 * turn_sigma(even.prior(at(20 / 30.0), {})));
}

// Poses of a hand that sways once a second, each a milliradian off, stated as three: what they share, only the map's
// errors, is not known. Going on from two differences of poses would be 62 mrad/s off, were this frame's pose known.
TEST(CameraMotion, VelocitiesBeatPoseDifferencesAndAreConsistent) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1e-3);
  const auto angle = [](double t) { return 0.2 * std::sin(2 * M_PI * t); };
  CameraMotion motion;
  double off2 = 0, nees = 0;
  int n = 0;
  for (int i = 0; i < 600; ++i) {
    const double t = i / 30.0;
    const MotionPrior prior = motion.prior(at(t), {0.03, 0});
    if (i >= 20) {
      const double off = prior.velocity(calib::exp(turning(angle(t))))[1] - 0.4 * M_PI * std::cos(2 * M_PI * t);
      off2 += off * off, nees += off * off / prior.velocity_covariance(1, 1), ++n;
    }
    calib::Tangent6d seen = turning(angle(t));
    for (int axis = 0; axis < 6; ++axis) seen[axis] += noise(random);
    motion.add(at(t), calib::exp(seen), 9e-6 * Matrix6d::Identity());
  }
  EXPECT_LT(std::sqrt(off2 / n), 0.75 * 62e-3);
  EXPECT_GT(nees / n, 0.4);
  EXPECT_LT(nees / n, 2.5);
}

// The covariance of a filter that knows poses by a millionth of what it knows of accelerations stays one.
TEST(CameraMotion, StaysPositiveDefiniteAtRest) {
  CameraMotion motion;
  for (int i = 0; i < 2000; ++i) motion.add(at(i / 30.0), {}, exact);
  const MotionPrior prior = motion.prior(at(2000 / 30.0), {0.03, 0});
  EXPECT_EQ(prior.velocity_covariance.llt().info(), Eigen::Success);
  EXPECT_LT(prior.velocity({}).norm(), 1e-6);
}

TEST(MotionPrior, UnknownReadoutWidensTheSweepAlongTheVelocity) {
  MotionPrior prior;
  prior.readout = {0, 0.02}, prior.velocity_covariance = 1e-4 * Matrix6d::Identity();
  const Matrix6d c = prior.covariance(turning(2));
  EXPECT_NEAR(std::sqrt(c(1, 1)), 0.04, 1e-3);
  EXPECT_LT(std::sqrt(c(0, 0)), 1e-3);
}

TEST(ReadoutLearner, ConvergesWithAConsistentSigma) {
  ReadoutLearner unknown({});
  EXPECT_EQ(unknown.readout().mean_s, 0);
  EXPECT_NEAR(unknown.readout().sigma_s, 0.02, 1e-9);
  for (int i = 0; i < 100; ++i) unknown.add({0.028 + (i % 2 ? 0.001 : -0.001), 0.002});
  EXPECT_NEAR(unknown.readout().mean_s, 0.028, 3 * unknown.readout().sigma_s);
  EXPECT_LT(unknown.readout().sigma_s, 0.001);
  EXPECT_GT(unknown.readout().sigma_s, 0.002 / 10);  // frames that follow each other err alike
  calib::CameraTiming timing;
  timing.readout_s = 0.02, timing.readout_sigma_s = 1e-4;
  ReadoutLearner known(timing);
  for (int i = 0; i < 20; ++i) known.add({0.03, 0.002});
  EXPECT_NEAR(known.readout().mean_s, 0.02, 1e-4);
}

TEST(ReadoutLearner, DownWeightsAnOutlier) {
  ReadoutLearner learner({});
  for (int i = 0; i < 40; ++i) learner.add({0.028, 0.001});
  const double before = learner.readout().mean_s;
  learner.add({-0.05, 0.0005});
  EXPECT_NEAR(learner.readout().mean_s, before, 0.2e-3);
}

// ---- Properties

// Poses of a camera with Gauss-Markov accelerations (sigma_rad_s2, half of it in m/s^2), and their velocities.
struct RandomMotion {
  RandomMotion(std::uint64_t seed, double sigma_rad_s2, int frames) {
    RandomScene scene(seed);
    constexpr double dt = 1 / 30.0, correlation_s = 0.25;
    const double kept = std::exp(-dt / correlation_s);
    calib::Tangent6d v = scene.tangent(0.3, 0.1), a = scene.tangent(sigma_rad_s2, sigma_rad_s2 / 2);
    calib::Rigid3d pose = scene.pose();
    for (int i = 0; i < frames; ++i) {
      poses.push_back(pose), velocities.push_back(v);
      pose = calib::exp(calib::Tangent6d(dt * v + 0.5 * dt * dt * a)) * pose;
      v += dt * a;
      a = kept * a + std::sqrt(1 - kept * kept) * scene.tangent(sigma_rad_s2, sigma_rad_s2 / 2);
    }
  }
  std::vector<calib::Rigid3d> poses;
  std::vector<calib::Tangent6d> velocities;
};

const Matrix6d pose_covariance = 1e-6 * Matrix6d::Identity();

MotionPrior prior_after(const std::vector<calib::Rigid3d>& poses, double begin_s = 0) {
  CameraMotion motion;
  for (std::size_t i = 0; i < poses.size(); ++i)
    motion.add(at(begin_s + static_cast<double>(i) / 30), poses[i], pose_covariance);
  return motion.prior(at(begin_s + static_cast<double>(poses.size()) / 30), {0.03, 0.001});
}

TEST(CameraMotionProperties, InvariantToTheWorldFrame) {
  RandomScene scene(1);
  for (std::uint64_t run = 1; run <= 10; ++run) {
    const RandomMotion truth(run, 4, 12);
    const calib::Rigid3d old_from_new = scene.transform();
    std::vector<calib::Rigid3d> moved;
    for (const calib::Rigid3d& pose : truth.poses) moved.push_back(pose * old_from_new);
    const MotionPrior a = prior_after(truth.poses), b = prior_after(moved);
    EXPECT_LT(distance(a.expected * old_from_new, b.expected), 1e-9);
    EXPECT_LT((a.expected_velocity - b.expected_velocity).norm(), 1e-7);
    EXPECT_LT((a.velocity_covariance - b.velocity_covariance).norm(), 1e-6 * a.velocity_covariance.norm());
    EXPECT_LT((a.d_velocity_d_pose - b.d_velocity_d_pose).norm(), 1e-6 * a.d_velocity_d_pose.norm());
  }
}

TEST(CameraMotionProperties, InvariantToTheClocksZero) {
  const RandomMotion truth(3, 4, 12);
  const MotionPrior a = prior_after(truth.poses), b = prior_after(truth.poses, 1000);
  EXPECT_LT(distance(a.expected, b.expected), 1e-6);
  EXPECT_LT((a.expected_velocity - b.expected_velocity).norm(), 1e-4);
}

TEST(CameraMotionProperties, ForgetsEverythingBefore) {
  const RandomMotion before(4, 8, 20), truth(5, 4, 12);
  CameraMotion motion;
  for (std::size_t i = 0; i < before.poses.size(); ++i)
    motion.add(at(static_cast<double>(i) / 30), before.poses[i], pose_covariance);
  motion.forget();
  for (std::size_t i = 0; i < truth.poses.size(); ++i)
    motion.add(at(2 + static_cast<double>(i) / 30), truth.poses[i], pose_covariance);
  const MotionPrior a = prior_after(truth.poses, 2), b = motion.prior(at(2 + 12 / 30.0), {0.03, 0.001});
  EXPECT_EQ(a.expected.translation, b.expected.translation);
  EXPECT_EQ(a.expected_velocity, b.expected_velocity);
  EXPECT_EQ(a.velocity_covariance, b.velocity_covariance);
}

// For accelerations of the two calmer filters, with poses as certain as stated.
TEST(CameraMotionProperties, VelocityCovarianceIsConsistent) {
  double last_sigma = 0;
  for (const double sigma_rad_s2 : {2.0, 8.0}) {
    double nees = 0, sigma = 0;
    int n = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const RandomMotion truth(seed, sigma_rad_s2, 120);
      RandomScene noise(100 + seed);
      CameraMotion motion;
      for (std::size_t i = 0; i < truth.poses.size(); ++i) {
        const double t = static_cast<double>(i) / 30;
        if (i >= 20) {
          const MotionPrior prior = motion.prior(at(t), {0.03, 0});
          const calib::Tangent6d error = truth.velocities[i] - prior.velocity(truth.poses[i]);
          nees += error.dot(prior.velocity_covariance.ldlt().solve(error)) / 6;
          sigma += std::sqrt(prior.velocity_covariance(0, 0));
          ++n;
        }
        motion.add(at(t), calib::exp(noise.tangent(1e-3, 1e-3)) * truth.poses[i], pose_covariance);
      }
    }
    EXPECT_GT(nees / n, 0.3) << sigma_rad_s2;
    EXPECT_LT(nees / n, 2.5) << sigma_rad_s2;
    EXPECT_GT(sigma / n, 1.3 * last_sigma) << sigma_rad_s2;
    last_sigma = sigma / n;
  }
}

// A pose that deviates from the expected one implies that the velocity changed: between an error of the velocity (1/dt)
// and a constant acceleration (2/dt).
TEST(CameraMotionProperties, VelocityFollowsThePose) {
  const MotionPrior prior = prior_after(RandomMotion(6, 8, 30).poses);
  for (int axis = 0; axis < 6; ++axis) {
    const calib::Tangent6d deviation = 0.002 * calib::Tangent6d::Unit(axis);
    const calib::Tangent6d change = prior.velocity(calib::exp(deviation) * prior.expected) - prior.expected_velocity;
    EXPECT_GT(change[axis], 0.002 * 30 * 0.8) << axis;
    EXPECT_LT(change[axis], 0.002 * 30 * 2.2) << axis;
  }
}

TEST(CameraMotionProperties, PriorFromTheNextFrameMirrorsTheMotion) {
  const RandomMotion truth(7, 1, 2);
  const MotionPrior prior = CameraMotion::prior_from_next(at(0), at(1 / 30.0), truth.poses[1], {0.03, 0});
  EXPECT_LT(distance(prior.expected, truth.poses[1]), 1e-9);  // of an unknown velocity
  const calib::Tangent6d error = prior.velocity(truth.poses[0]) - truth.velocities[0];
  EXPECT_LT(error.head<3>().norm(), 0.15);  // rad/s
  EXPECT_LT(error.dot(prior.velocity_covariance.ldlt().solve(error)), 20);
}

TEST(MotionPriorProperties, SweepReachesTheFirstAndTheLastRow) {
  const RandomMotion truth(8, 4, 12);
  const MotionPrior prior = prior_after(truth.poses);
  for (const double row : {0.0, 80.0, 239.0}) {
    const double t = prior.readout.mean_s * (row / 239 - 0.5);
    const calib::Rigid3d expected =
        calib::exp(calib::Tangent6d(t * prior.expected_velocity + 0.5 * t * t * prior.expected_acceleration));
    EXPECT_LT(distance(prior.sweep(prior.expected, 239).row_from_middle(row), expected), 1e-9);
  }
}

// Of readout times velocity, both uncertain.
TEST(MotionPriorProperties, CovarianceMatchesMonteCarlo) {
  RandomScene scene(9);
  MotionPrior prior;
  prior.readout = {0.02, 0.005};
  prior.expected_velocity = scene.tangent(1, 0.5);
  Matrix6d root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = 0.1 * scene.normal();
  prior.velocity_covariance = root * root.transpose();
  constexpr int runs = 20000;
  const calib::Tangent6d mean = prior.readout.mean_s * prior.expected_velocity;
  Matrix6d sample = Matrix6d::Zero();
  for (int i = 0; i < runs; ++i) {
    const double readout_s = prior.readout.mean_s + prior.readout.sigma_s * scene.normal();
    const calib::Tangent6d motion = readout_s * (prior.expected_velocity + root * scene.tangent(1, 1)) - mean;
    sample += motion * motion.transpose() / runs;
  }
  EXPECT_LT((prior.covariance(prior.expected_velocity) - sample).norm(), 0.05 * sample.norm());
  EXPECT_LT(prior.without_uncertainty().covariance(prior.expected_velocity).norm(), 1e-12);
}

TEST(ReadoutLearnerProperties, SigmaNeverGrows) {
  RandomScene scene(10);
  ReadoutLearner learner({});
  double last = learner.readout().sigma_s;
  for (int i = 0; i < 200; ++i) {
    learner.add({0.02 + 0.003 * scene.normal(), scene.uniform(1e-3, 5e-3)});
    EXPECT_LE(learner.readout().sigma_s, last);
    last = learner.readout().sigma_s;
  }
  EXPECT_NEAR(learner.readout().mean_s, 0.02, 2e-3);
}

TEST(ReadoutLearnerProperties, FartherOutliersHaveLessInfluence) {
  double last = 1;
  for (const double outlier_s : {0.01, 0.03, 0.1, 0.3}) {
    ReadoutLearner learner({});
    for (int i = 0; i < 30; ++i) learner.add({0, 0.002});
    learner.add({outlier_s, 0.002});
    const double influence = learner.readout().mean_s / outlier_s;
    EXPECT_GT(influence, 0);
    EXPECT_LT(influence, last);
    last = influence;
  }
}

TEST(ReadoutLearnerProperties, CorrelatedFramesDoNotAverageOutLikeIndependentOnes) {
  ReadoutLearner learner({});
  for (int i = 0; i < 64; ++i) learner.add({0.02, 0.004});
  EXPECT_GT(learner.readout().sigma_s, 1.5 * 0.004 / 8);
  EXPECT_LT(learner.readout().sigma_s, 3 * 0.004 / 8);
}

}  // namespace
}  // namespace huetrack::keyframes
