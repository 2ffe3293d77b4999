#include "calib/solver/intrinsics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

#include "board/captures.h"
#include "calib/model/rig_yaml.h"
#include "solver/odd_lens.h"
#include "solver/synthetic_rig.h"

namespace huetrack::solver {
namespace {

Intrinsics of_synthetic(const calib::CameraModel& model, double noise_px, std::optional<LensModel> lens = {},
                        double distance_m = 2.2) {
  const SyntheticCapture capture =
      synthetic_capture({.cameras = 1, .sets = 25, .noise_px = noise_px, .distance_m = distance_m, .models = {model}});
  return calibrate_intrinsics(capture.board, "cam0", {640, 480}, capture.views, {.lens = lens});
}

TEST(Intrinsics, FindsTheSimplestSupportedLens) {
  const Intrinsics barrel =
      of_synthetic(calib::CameraModel(calib::PinholeRadtan{620, 618, 322, 236, {-0.3, 0.1, 0.001, 0}}), 0.1);
  EXPECT_EQ(barrel.adjustment.cameras[0].lens, LensModel::radtan4);
  EXPECT_NEAR(barrel.adjustment.cameras[0].parameters(0), 620, 2);
  const Intrinsics fisheye = of_synthetic(
      calib::CameraModel(calib::FisheyeKannalaBrandt{230, 231, 322, 236, {0.08, -0.02, 0.004, -0.001}}), 0.1, {}, 0.9);
  EXPECT_EQ(fisheye.adjustment.cameras[0].lens, LensModel::fisheye);
  EXPECT_NEAR(fisheye.adjustment.cameras[0].parameters(0), 230, 2);
  for (const Intrinsics& found : {barrel, fisheye}) {
    EXPECT_NEAR(found.adjustment.noise_px, 0.1, 0.01);
    EXPECT_TRUE(covers_image(found.adjustment.cameras[0].model(), {640, 480}));
    EXPECT_EQ(found.trials[found.chosen].lens, found.adjustment.cameras[0].lens);
  }
}

// Boards amid the image only: a fisheye fits them as well. Without clear evidence for another model the lens stays an
// ordinary one.
TEST(Intrinsics, AnOrdinaryLensNeedsNoBoardsAtTheImagesEdge) {
  const calib::CameraModel lens(calib::PinholeRadtan{480, 480, 322, 236, {-0.13, 0.026, 0.0005, 0.0004}});
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const SyntheticCapture capture = synthetic_capture({.cameras = 1, .sets = 20, .seed = seed, .models = {lens}});
    const Intrinsics found = calibrate_intrinsics(capture.board, "cam0", {640, 480}, capture.views);
    EXPECT_LE(found.adjustment.cameras[0].lens, LensModel::radtan5) << seed;
  }
}

// Where no corner was, the prior of lenses bounds what is unknown: k3 is not determined by boards amid the image.
TEST(Intrinsics, WhatTheViewsLeaveOpenIsAsUncertainAsThePrior) {
  const calib::CameraModel lens(calib::PinholeRadtan{480, 480, 322, 236, {-0.13, 0.026, 0.0005, 0.0004}});
  SyntheticCapture capture = synthetic_capture({.cameras = 1, .sets = 20, .models = {lens}});
  for (BoardView& view : capture.views) {
    const BoardView all = view;
    view.ids.clear();
    view.px.clear();
    for (std::size_t k = 0; k < all.ids.size(); ++k) {
      if ((all.px[k] - Eigen::Vector2d(320, 240)).norm() > 120) continue;
      view.ids.push_back(all.ids[k]);
      view.px.push_back(all.px[k]);
    }
  }
  std::erase_if(capture.views, [](const BoardView& view) { return view.ids.size() < 12; });
  const Intrinsics found =
      calibrate_intrinsics(capture.board, "cam0", {640, 480}, capture.views, {.lens = LensModel::radtan5});
  const AdjustedCamera& camera = found.adjustment.cameras[0];
  const double reach = 400 / camera.parameters(0), share = found.adjustment.lens_sigma(0)(8) * std::pow(reach, 6);
  std::printf("k3 %.3f +- %.3f: %.2f of the radius at the image's corner\n", camera.parameters(8),
              found.adjustment.lens_sigma(0)(8), share);
  EXPECT_GT(share, 0.1);
  EXPECT_LT(share, 0.35);
  EXPECT_LT(std::abs(camera.parameters(8)), 2.5 * found.adjustment.lens_sigma(0)(8));
}

// Seen at 1.1 m, circles of 45 mm: their images' centres of area lie up to 0.3 px beside the images of their centres.
TEST(Intrinsics, ModelsTheCentresOfCircles) {
  const calib::CameraModel lens(calib::PinholeRadtan{620, 618, 322, 236, {-0.25, 0.08, 0.0006, -0.0004}});
  SyntheticCapture capture =
      synthetic_capture({.cameras = 1, .sets = 25, .noise_px = 0.005, .distance_m = 1.1, .models = {lens}});
  capture.board.type = board::BoardType::circles;
  capture.board.diameter = 0.045;
  double squares = 0, points = 0, largest = 0;
  for (BoardView& view : capture.views) {
    const calib::Rigid3d cam_from_board =
        capture.rig.cameras[0].cam_from_world * capture.world_from_board[static_cast<std::size_t>(view.set)];
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      const Eigen::Vector3d centre = capture.board.point(view.ids[k]);
      const Eigen::Vector2d px = lens.project(cam_from_board * centre)->px;
      constexpr int count = 720;  // a polygon that is a circle to 1e-5
      double area = 0;
      Eigen::Vector2d moment = Eigen::Vector2d::Zero();
      const auto rim = [&](int i) {
        const double a = 2 * std::numbers::pi * i / count;
        return Eigen::Vector2d(
            lens.project(cam_from_board * (centre + 0.0225 * Eigen::Vector3d(std::cos(a), std::sin(a), 0)))->px - px);
      };
      for (int i = 0; i < count; ++i) {
        const Eigen::Vector2d a = rim(i), b = rim(i + 1);
        const double cross = a.x() * b.y() - a.y() * b.x();
        area += cross / 2;
        moment += cross * (a + b) / 6;
      }
      const Eigen::Vector2d offset = moment / area;
      view.px[k] += offset;
      squares += offset.squaredNorm();
      largest = std::max(largest, offset.norm());
      ++points;
    }
  }
  const Intrinsics modelled =
      calibrate_intrinsics(capture.board, "cam0", {640, 480}, capture.views, {.lens = LensModel::radtan4});
  capture.board.diameter = 0;  // as if they were corners
  const Intrinsics neglected =
      calibrate_intrinsics(capture.board, "cam0", {640, 480}, capture.views, {.lens = LensModel::radtan4});
  const auto error = [&](const Intrinsics& found) { return found.adjustment.cameras[0].parameters(0) - 620; };
  std::printf(
      "offsets %.3f px rms, at most %.3f; modelled: noise %.3f px, f off by %.3f px; neglected: %.3f px, %.3f px\n",
      std::sqrt(squares / points), largest, modelled.adjustment.noise_px, error(modelled),
      neglected.adjustment.noise_px, error(neglected));
  EXPECT_NEAR(modelled.adjustment.noise_px, 0.005, 0.001);
  EXPECT_LT(std::abs(error(modelled)), 0.1);
  EXPECT_GT(std::abs(error(neglected)), 3 * std::abs(error(modelled)));
}

TEST(Intrinsics, UsesTheRequestedLens) {
  const Intrinsics found = of_synthetic(
      calib::CameraModel(calib::PinholeRadtan{620, 618, 322, 236, {-0.3, 0.1, 0.001, 0}}), 0.1, LensModel::radtan5);
  EXPECT_EQ(found.adjustment.cameras[0].lens, LensModel::radtan5);
  EXPECT_EQ(found.trials.size(), 1U);
}

// A lens that no model holds: the corners at the image's edge, which the pinholes do not follow, decide.
TEST(Intrinsics, FitsAnUnusualLensToTheImageEdge) {
  const OddCapture capture = odd_capture({100}, 0.1, 3);
  const Intrinsics found = calibrate_intrinsics(capture.of.board, "cam0", {1280, 720}, capture.of.views);
  for (const LensTrial& trial : found.trials) {
    std::printf("%s: rms %.3f px, log evidence %.1f, %d left out %s\n", std::string(name(trial.lens)).c_str(),
                trial.rms_px, trial.log_evidence, trial.left_out, facts(reasons_of(trial)).c_str());
  }
  EXPECT_EQ(found.adjustment.cameras[0].lens, LensModel::stereographic);
  EXPECT_LT(rays_off_px(capture.lenses[0], found.adjustment.cameras[0].model(), capture.of.views, 0, {1280, 720}),
            0.45);
  EXPECT_LE(found.trials[found.chosen].left_out, 5);  // by the noise
}

// A model that at a glance allows no pose for most of the views, and fits the others closely, is not the closest one.
TEST(Intrinsics, IgnoresAModelThatCoversHardlyAnyBoard) {
  const OddCapture capture = odd_capture({70, 100, 130}, 0.1, 25, 120);
  std::vector<BoardView> views;
  std::ranges::copy_if(capture.of.views, std::back_inserter(views), [](const BoardView& v) { return v.camera == 0; });
  const Intrinsics found = calibrate_intrinsics(capture.of.board, "cam0", {1280, 720}, views);
  EXPECT_EQ(found.adjustment.cameras[0].lens, LensModel::stereographic);
  EXPECT_LT(rays_off_px(capture.lenses[0], found.adjustment.cameras[0].model(), views, 0, {1280, 720}), 0.45);
}

TEST(Intrinsics, EveryLensModelCanBeRequested) {
  const OddCapture capture = odd_capture({100}, 0.1, 3, 30);
  for (const LensModel lens : all_lens_models) {
    const Intrinsics found =
        calibrate_intrinsics(capture.of.board, "cam0", {1280, 720}, capture.of.views, {.lens = lens});
    EXPECT_EQ(found.adjustment.cameras[0].lens, lens);
    EXPECT_TRUE(covers_image(found.adjustment.cameras[0].model(), {1280, 720})) << name(lens);
  }
}

// The one model that was asked for leads nowhere: why, and that another one may.
TEST(Intrinsics, FailedFitHasTwoReasons) {
  SyntheticCapture capture = synthetic_capture({.cameras = 1, .sets = 10});
  for (BoardView& view : capture.views) {
    for (Eigen::Vector2d& px : view.px) px = {320, 240};
  }
  try {
    calibrate_intrinsics(capture.board, "left", {640, 480}, capture.views, {.lens = LensModel::radtan4});
    FAIL();
  } catch (const CalibrationError& error) {
    EXPECT_STREQ(
        error.what(),
        "camera left: radtan4 cannot be fitted to its views (camera left: no lens fits the views of the board)");
    EXPECT_EQ(error.fault(), Fault::no_lens_fits);
    ASSERT_EQ(error.reasons().size(), 2U);
    EXPECT_EQ(error.reasons()[1].fault, Fault::lens_does_not_fit);
  }
}

// Coefficients of a lens that nearly cancel one another: the first five of them alone would be another lens, 100 px
// off.
TEST(Intrinsics, SimplerModelStartsAtTheSameLens) {
  AdjustedCamera fitted;
  fitted.image_size = {640, 480};
  fitted.lens = LensModel::radtan8;
  fitted.parameters << 424.5, 423.8, 317.3, 235.2, 1.536, -0.0318, 0.0012, 0.0011, -0.0764, 1.6352, 0.1359, -0.1373;
  for (const LensModel lens : {LensModel::radtan4, LensModel::radtan5, LensModel::fisheye}) {
    const calib::CameraModel before = fitted.model(), simpler = start_like(fitted, lens).model();
    for (const Eigen::Vector2d& px : {Eigen::Vector2d(320, 240), Eigen::Vector2d(500, 350), Eigen::Vector2d(60, 400)}) {
      const auto there = simpler.project(before.ray({px}).value());
      ASSERT_TRUE(there);
      EXPECT_LT((there->px - px).norm(), 1) << name(lens) << " " << px.transpose();
    }
  }
}

TEST(Intrinsics, TooFewViewsAreAnError) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 1, .sets = 2});
  try {
    calibrate_intrinsics(capture.board, "left", {640, 480}, capture.views);
    FAIL();
  } catch (const CalibrationError& error) {
    EXPECT_STREQ(error.what(), "camera left: only 2 views of the board; at least 4 are needed");
    EXPECT_EQ(error.fault(), Fault::too_few_views);
  }
}

TEST(IntrinsicsCaptures, OpenCvStereo) {
  if (!std::filesystem::exists(board::shared_data("opencv_chessboard_stereo"))) GTEST_SKIP() << "not there";
  for (const int camera : {0, 1}) {
    const Intrinsics found = calibrate_intrinsics(board::stereo_board(), camera == 0 ? "left" : "right", {640, 480},
                                                  board::views_of(board::stereo_views(), camera));
    const Adjustment& a = found.adjustment;
    std::printf("%s: %d views, rms %.3f px, fx %.2f fy %.2f\n", a.cameras[0].name.c_str(), a.views_used(0), a.rms_px,
                a.cameras[0].parameters(0), a.cameras[0].parameters(1));
    EXPECT_EQ(a.views_used(0), 13);
    EXPECT_GT(a.corners_used, 690);
    EXPECT_LE(a.rms_px, camera == 0 ? 0.20 : 0.21);
    for (const int i : {0, 1}) {
      EXPECT_GE(a.cameras[0].parameters(i), 0.995 * 534);
      EXPECT_LE(a.cameras[0].parameters(i), 1.005 * 536);
    }
  }
}

TEST(IntrinsicsCaptures, RenderedBoards) {
  if (!std::filesystem::exists(board::shared_data("rendered/chessboard"))) GTEST_SKIP() << "not there";
  const calib::CameraRig truth = calib::read_rig(board::shared_data("rendered/chessboard/rig.yaml"));
  for (int camera = 0; camera < 3; ++camera) {
    const Intrinsics found = calibrate_intrinsics(board::rendered_board(), "cam", {320, 240},
                                                  board::views_of(board::rendered_views(), camera));
    const double f = found.adjustment.cameras[0].parameters(0),
                 true_f = truth.cameras[static_cast<std::size_t>(camera)].model.fx();
    std::printf("cam%d alone: focal length off by %.2f %% (sigma %.2f %%), rms %.3f px\n", camera,
                100 * (f / true_f - 1), 100 * found.adjustment.lens_sigma(0)(0) / true_f, found.adjustment.rms_px);
    EXPECT_NEAR(f / true_f, 1, 0.006);
  }
}

}  // namespace
}  // namespace huetrack::solver
