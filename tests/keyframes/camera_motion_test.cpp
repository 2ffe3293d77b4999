#include "camera_tracking/keyframes/camera_motion.h"

#include <gmock/gmock.h>

#include <cmath>

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

TEST(CameraMotion, velocityIsThatOfTheMiddleRow) {
  CameraMotion motion;  // an even acceleration of 4 rad/s^2; a frame is missing
  const auto pose = [](double t) { return calib::exp(turning(2 * t * t)); };
  for (const double t : {0.0, 1.0 / 30, 2.0 / 30}) motion.add(at(t), pose(t));
  const MotionPrior prior = motion.prior(at(4.0 / 30), {0.03, 0.001});
  EXPECT_NEAR(prior.velocity(pose(4.0 / 30))[1], 4 * 4.0 / 30, 1e-6);
  const camera_tracking::Sweep sweep = prior.sweep(pose(4.0 / 30), 239);
  const calib::Rigid3d first_row = sweep.row_from_middle(0) * pose(4.0 / 30),
                       last_row = sweep.row_from_middle(239) * pose(4.0 / 30);
  EXPECT_LT(calib::log(first_row * calib::inverse(pose(4.0 / 30 - 0.015))).norm(), 1e-5);
  EXPECT_LT(calib::log(last_row * calib::inverse(pose(4.0 / 30 + 0.015))).norm(), 1e-5);
}

TEST(CameraMotion, aPauseOrALossLeavesItUnknown) {
  CameraMotion motion;
  EXPECT_GT(motion.prior(at(0), {}).turn_sigma_rad_s, 0.3);
  motion.add(at(0), {}), motion.add(at(0.033), calib::exp(turning(0.05)));
  EXPECT_GT(motion.prior(at(0.066), {}).velocity({}).norm(), 1);
  EXPECT_EQ(motion.prior(at(2), {}).velocity({}).norm(), 0);
  motion.forget();
  EXPECT_EQ(motion.prior(at(0.066), {}).velocity({}).norm(), 0);
}

TEST(CameraMotion, jerksMakeItLessSure) {
  CameraMotion even, jerky;
  for (int i = 0; i < 12; ++i) {
    even.add(at(i / 30.0), calib::exp(turning(0.05 * i)));
    jerky.add(at(i / 30.0), calib::exp(turning(0.05 * i + (i % 3 == 0 ? 0.02 : 0))));
  }
  EXPECT_GT(jerky.prior(at(12 / 30.0), {}).turn_sigma_rad_s, 5 * even.prior(at(12 / 30.0), {}).turn_sigma_rad_s);
}

TEST(MotionPrior, anUnknownReadoutLeavesTheSweepOpenAlongTheMotion) {
  MotionPrior prior;
  prior.readout = {0, 0.02}, prior.turn_sigma_rad_s = prior.shift_sigma_m_s = 0.01;
  const Matrix6d c = prior.covariance(turning(2));
  EXPECT_NEAR(std::sqrt(c(1, 1)), 0.04, 1e-3);
  EXPECT_LT(std::sqrt(c(0, 0)), 1e-3);
}

TEST(ReadoutLearner, learnsAndStaysHonest) {
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

TEST(ReadoutLearner, oneWrongFrameIsNothing) {
  ReadoutLearner learner({});
  for (int i = 0; i < 40; ++i) learner.add({0.028, 0.001});
  const double before = learner.readout().mean_s;
  learner.add({-0.05, 0.0005});
  EXPECT_NEAR(learner.readout().mean_s, before, 0.2e-3);
}

}  // namespace
}  // namespace huetrack::keyframes
