// Properties that adjust() must have whatever the data: what its covariance means, and what it must not depend on.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/solver/adjustment_steps.h"
#include "solver/near_truth.h"

namespace huetrack::solver {
namespace {

const AdjustmentOptions every_corner{.find_outliers = false};

SyntheticCapture small_capture(std::uint64_t seed = 1, double noise_px = 0.2) {
  return synthetic_capture({.cameras = 3, .sets = 12, .noise_px = noise_px, .seed = seed});
}

// Largest difference of a camera's lens from other parameters, in its standard deviations.
double in_sigmas(const Adjustment& a, const LensParameters& other, int camera) {
  const AdjustedCamera& of = a.cameras[static_cast<std::size_t>(camera)];
  const Eigen::VectorXd off = (of.parameters - other).head(parameter_count(of.lens));
  return off.cwiseQuotient(a.lens_sigma(camera).head(parameter_count(of.lens))).cwiseAbs().maxCoeff();
}

TEST(AdjustmentProperties, NoiseIsEstimated) {
  for (const double noise_px : {0.05, 0.2, 0.8}) {
    const Adjustment found = adjust(near_truth(small_capture(4, noise_px)), every_corner);
    EXPECT_NEAR(found.noise_px, noise_px, 0.06 * noise_px);
  }
}

// The board's pitch is a unit of length like any other.
TEST(AdjustmentProperties, DoesNotDependOnTheUnitOfLength) {
  constexpr double scale = 1000;  // millimetres
  const Adjustment start = near_truth(small_capture());
  Adjustment scaled = start;
  scaled.board.pitch *= scale;
  for (AdjustedCamera& camera : scaled.cameras) camera.cam_from_world.translation *= scale;
  for (calib::Rigid3d& pose : scaled.world_from_board) pose.translation *= scale;
  const Adjustment a = adjust(start, every_corner), b = adjust(scaled, every_corner);
  EXPECT_NEAR(a.rms_px, b.rms_px, 1e-6);
  for (std::size_t c = 0; c < 3; ++c) {
    const int camera = static_cast<int>(c);
    EXPECT_LT(in_sigmas(a, b.cameras[c].parameters, camera), 0.02) << c;
    EXPECT_LT((scale * a.cameras[c].cam_from_world.translation - b.cameras[c].cam_from_world.translation).norm(),
              0.02 * b.centre_sigma(camera).norm() + 1e-9);
    EXPECT_LT((scale * a.centre_sigma(camera) - b.centre_sigma(camera)).norm(),
              0.01 * b.centre_sigma(camera).norm() + 1e-9);
    EXPECT_LT((a.rotation_sigma(camera) - b.rotation_sigma(camera)).norm(),
              0.01 * a.rotation_sigma(camera).norm() + 1e-12);
  }
}

// The covariance is by the cameras' own axes, which do not move with the world.
TEST(AdjustmentProperties, DoesNotDependOnTheWorldFrame) {
  const calib::Rigid3d moved_from_world{
      Eigen::Quaterniond(Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, 2, -1).normalized())), {3, -5, 0.7}};
  const Adjustment start = near_truth(small_capture());
  Adjustment moved = start;
  for (AdjustedCamera& camera : moved.cameras)
    camera.cam_from_world = camera.cam_from_world * calib::inverse(moved_from_world);
  for (calib::Rigid3d& pose : moved.world_from_board) pose = moved_from_world * pose;
  const Adjustment a = adjust(start, every_corner), b = adjust(moved, every_corner);
  EXPECT_NEAR(a.rms_px, b.rms_px, 1e-7);
  for (std::size_t c = 0; c < 3; ++c) {
    const int camera = static_cast<int>(c);
    const calib::Rigid3d there = a.cameras[c].cam_from_world * calib::inverse(moved_from_world);
    EXPECT_LT(calib::log(there * calib::inverse(b.cameras[c].cam_from_world)).norm(), 1e-5) << c;
    EXPECT_LT(in_sigmas(a, b.cameras[c].parameters, camera), 0.02) << c;
  }
  EXPECT_LT((a.covariance - b.covariance).norm(), 1e-3 * a.covariance.norm());
}

TEST(AdjustmentProperties, DoesNotDependOnTheOrderOfCameras) {
  const Adjustment start = near_truth(small_capture());
  Adjustment reversed = start;
  std::ranges::reverse(reversed.cameras);
  for (BoardView& view : reversed.views) view.camera = 2 - view.camera;
  const Adjustment a = adjust(start, every_corner), b = adjust(reversed, every_corner);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_LT(in_sigmas(a, b.cameras[2 - c].parameters, static_cast<int>(c)), 0.02) << c;
    EXPECT_LT((a.lens_sigma(static_cast<int>(c)) - b.lens_sigma(2 - static_cast<int>(c))).norm(),
              1e-3 * a.lens_sigma(static_cast<int>(c)).norm());
  }
}

TEST(AdjustmentProperties, MoreViewsMakeTheCovarianceSmaller) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 32, .noise_px = 0.2});
  SyntheticCapture half = capture;
  std::erase_if(half.views, [](const BoardView& view) { return view.set >= 16; });
  half.world_from_board.resize(16);
  const Adjustment many = adjust(near_truth(capture), every_corner), few = adjust(near_truth(half), every_corner);
  for (int c = 1; c < 3; ++c) EXPECT_LT(many.centre_sigma(c).norm(), few.centre_sigma(c).norm());
}

// What is known of a lens that stays is part of the poses' uncertainty.
TEST(AdjustmentProperties, HeldLensesPassTheirUncertaintyOn) {
  Adjustment exact = near_truth(small_capture());
  for (AdjustedCamera& camera : exact.cameras) camera.lens_is_free = false;
  const SyntheticCapture capture = small_capture();
  for (std::size_t c = 0; c < 3; ++c) exact.cameras[c].parameters = parameters_of(capture.rig.cameras[c].model);
  Adjustment unsure = exact;
  for (AdjustedCamera& camera : unsure.cameras) {
    Eigen::VectorXd variance = Eigen::VectorXd::Zero(8);
    variance.head<4>().setConstant(4);  // 2 px of focal length and principal point
    camera.lens_covariance = variance.asDiagonal();
  }
  const Adjustment a = adjust(exact, every_corner), b = adjust(unsure, every_corner);
  for (int c = 1; c < 3; ++c) {
    EXPECT_EQ(a.lens_offset[static_cast<std::size_t>(c)], -1);
    EXPECT_GT(b.lens_offset[static_cast<std::size_t>(c)], -1);
    EXPECT_GT(b.centre_sigma(c).norm(), 2 * a.centre_sigma(c).norm());
  }
}

TEST(AdjustmentProperties, PriorOfAFreeLensIsKeptWhereTheViewsSayLittle) {
  Adjustment start = near_truth(small_capture());
  LensParameters mean = start.cameras[1].parameters;
  mean(4) = -0.2;  // the truth is -0.12
  start.cameras[1].lens_prior = LensPrior{mean, 1e12 * Eigen::MatrixXd::Identity(8, 8)};
  const Adjustment found = adjust(start, every_corner);
  EXPECT_LT((found.cameras[1].parameters - mean).norm(), 1e-2);
  EXPECT_GT(found.rms_of_camera(1), 2 * adjust(near_truth(small_capture()), every_corner).rms_of_camera(1));
}

TEST(AdjustmentProperties, EvaluateMovesNothingAndUsesAll) {
  const Adjustment start = near_truth(small_capture());
  const auto fits = evaluate(start);
  ASSERT_EQ(fits.size(), start.views.size());
  for (std::size_t v = 0; v < fits.size(); ++v) {
    EXPECT_EQ(fits[v].residuals.size(), start.views[v].ids.size());
    EXPECT_EQ(std::ranges::count(fits[v].used, true), static_cast<std::ptrdiff_t>(start.views[v].ids.size()));
  }
}

TEST(AdjustmentProperties, CamerasWithoutAViewAreRefusedOrStay) {
  Adjustment start = near_truth(small_capture());
  std::erase_if(start.views, [](const BoardView& view) { return view.camera == 2; });
  const calib::Rigid3d before = start.cameras[2].cam_from_world;
  try {
    const Adjustment found = adjust(start, every_corner);
    EXPECT_LT(calib::log(found.cameras[2].cam_from_world * calib::inverse(before)).norm(), 1e-9);
  } catch (const CalibrationError& error) {
    EXPECT_STRNE(error.what(), "");
  }
}

}  // namespace
}  // namespace huetrack::solver
