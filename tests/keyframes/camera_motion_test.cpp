#include "camera_tracking/keyframes/camera_motion.h"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

namespace huetrack::keyframes {
namespace {

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

}  // namespace
}  // namespace huetrack::keyframes
