#include "calib/solver/bundle_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "board/captures.h"
#include "calib/model/rig_yaml.h"
#include "drawn.h"
#include "solver/near_truth.h"

namespace huetrack::solver {
namespace {

using testing::HasSubstr;

// Up to what the prior of lenses weighs against corners of 0.01 px, the least noise that is assumed.
TEST(BundleAdjustment, FindsTheTruthFromExactCorners) {
  const SyntheticCapture capture = synthetic_capture({.noise_px = 0});
  const Adjustment found = adjust(near_truth(capture));
  EXPECT_LT(found.rms_px, 1e-5);
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const calib::Camera& truth = capture.rig.cameras[c];
    EXPECT_LT((found.cameras[c].parameters - parameters_of(truth.model)).norm(), 1e-3);
    EXPECT_LT(calib::log(found.cameras[c].cam_from_world * calib::inverse(truth.cam_from_world)).norm(), 1e-6);
  }
}

TEST(BundleAdjustment, IsBitEqualForAnyOrderOfViews) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 12});
  const Adjustment start = near_truth(capture);
  Adjustment shuffled = start;
  std::mt19937_64 rng(3);
  std::ranges::shuffle(shuffled.views, rng);
  const Adjustment a = adjust(start), b = adjust(shuffled);
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    EXPECT_EQ(a.cameras[c].parameters, b.cameras[c].parameters);
    EXPECT_EQ(a.cameras[c].cam_from_world.translation, b.cameras[c].cam_from_world.translation);
    EXPECT_EQ(a.cameras[c].cam_from_world.rotation.coeffs(), b.cameras[c].cam_from_world.rotation.coeffs());
  }
  EXPECT_TRUE(a.covariance == b.covariance);
}

TEST(BundleAdjustment, RejectsOutliersAndNamesViews) {
  SyntheticCapture capture = synthetic_capture({.sets = 20});
  const calib::CameraRig& rig = capture.rig;
  std::mt19937_64 rng(11);
  int spoilt = 0;
  for (std::size_t v = 0; v < capture.views.size(); ++v) {
    BoardView& view = capture.views[v];
    if (v == 7) {  // the whole board moved in between
      for (auto& px : view.px) px += Eigen::Vector2d(9, -4);
    } else if (v % 3 == 0) {
      view.px[view.px.size() / 2] += Eigen::Vector2d(5, 5);
      ++spoilt;
    }
  }
  const std::string moved = capture.views[7].image;
  const Adjustment found = adjust(near_truth(capture));
  int left_out = 0;
  for (std::size_t v = 0; v < found.views.size(); ++v) {
    if (found.views[v].image == moved) {
      ASSERT_TRUE(found.fits[v].dropped);
      EXPECT_GT(found.fits[v].dropped->own_px, 5 * found.fits[v].dropped->others_px);
      EXPECT_EQ(std::ranges::count(found.fits[v].used, true), 0);
    } else {
      EXPECT_FALSE(found.fits[v].dropped) << found.views[v].image;
      left_out += static_cast<int>(std::ranges::count(found.fits[v].used, false));
    }
  }
  EXPECT_GE(left_out, spoilt);
  EXPECT_LE(left_out, spoilt + 10);
  EXPECT_NEAR(found.noise_px, 0.1, 0.01);
  EXPECT_LT(volume_rms_m(rig,
                         [&] {
                           calib::CameraRig r = rig;
                           for (std::size_t c = 0; c < r.cameras.size(); ++c) {
                             r.cameras[c].model = found.cameras[c].model();
                             r.cameras[c].cam_from_world = found.cameras[c].cam_from_world;
                           }
                           return r;
                         }(),
                         {-0.5, -0.5, 0.5}, {0.5, 0.5, 1.5}),
            0.001);
}

TEST(BundleAdjustment, EstimatesABentBoard) {
  SyntheticCapture capture = synthetic_capture({.noise_px = 0.05});
  Adjustment bent = near_truth(capture);
  const BoardWarp warp(0.003, -0.001, 0.004);
  bent.warp = warp;
  std::mt19937_64 rng(2);
  for (BoardView& view : bent.views) {
    const calib::Camera& camera = capture.rig.cameras[static_cast<std::size_t>(view.camera)];
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      const auto px = camera.project_world(capture.world_from_board[static_cast<std::size_t>(view.set)] *
                                           bent.board_point(view.ids[k]));
      view.px[k] = px.value().px + 0.05 * drawn<2>(rng, normal);
    }
  }
  bent.warp.setZero();
  const Adjustment flat = adjust(bent);
  bent.warp_is_free = true;
  const Adjustment found = adjust(bent);
  EXPECT_LT((found.warp - warp).norm(), 2e-4);
  EXPECT_LT((found.warp - warp).cwiseAbs().cwiseQuotient(found.warp_sigma).maxCoeff(), 4);
  EXPECT_LT(found.rms_px, 0.8 * flat.rms_px);
}

TEST(BundleAdjustment, NoViewsAreAnError) {
  Adjustment empty = near_truth(synthetic_capture({.sets = 2}));
  empty.views.clear();
  EXPECT_THROW(adjust(empty), CalibrationError);
}

struct Coverage {
  int inside = 0, all = 0;
  double share() const { return 100.0 * inside / all; }
  void add(double error, double sigma) {
    inside += std::abs(error) < 1.96 * sigma ? 1 : 0;
    ++all;
  }
};

// How often the truth lies in the 95 % bounds that are reported, over lenses and poses.
void count(Coverage& coverage, const Adjustment& found, const calib::CameraRig& truth) {
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const int camera = static_cast<int>(c);
    const LensParameters off = found.cameras[c].parameters - parameters_of(truth.cameras[c].model);
    for (int i = 0; i < parameter_count(found.cameras[c].lens); ++i) coverage.add(off(i), found.lens_sigma(camera)(i));
    if (!found.cameras[c].pose_is_free) continue;
    const calib::Tangent6d error =
        calib::log(found.cameras[c].cam_from_world * calib::inverse(truth.cameras[c].cam_from_world));
    for (int i = 0; i < 3; ++i) coverage.add(error(i), found.rotation_sigma(camera)(i));
    for (int i = 0; i < 3; ++i) coverage.add(error(3 + i), found.centre_sigma(camera)(i));
  }
}

TEST(BundleAdjustmentBounds, CoverTheTruthOfSyntheticRigs) {
  Coverage coverage;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 15, .noise_px = 0.3, .seed = seed});
    count(coverage, adjust(near_truth(capture)), capture.rig);
  }
  std::printf("95 %% bounds cover %.1f %% of %d true parameters\n", coverage.share(), coverage.all);
  EXPECT_GE(coverage.share(), 90);
  EXPECT_LE(coverage.share(), 99);
}

TEST(BundleAdjustmentBounds, CoverTheTruthOfResampledRenderedBoards) {
  if (!std::filesystem::exists(board::shared_data("rendered/chessboard")))
    GTEST_SKIP() << "rendered/chessboard is not there";
  const calib::CameraRig truth = calib::read_rig(board::shared_data("rendered/chessboard/rig.yaml"));
  const auto run = [&](const std::vector<BoardView>& all, double noise_px) {
    Coverage coverage;
    for (std::uint64_t seed = 1; seed <= 25; ++seed) {
      std::mt19937_64 rng(seed);
      std::vector<int> sets(25);
      for (int s = 0; s < 25; ++s) sets[static_cast<std::size_t>(s)] = s;
      std::ranges::shuffle(sets, rng);
      sets.resize(18);
      std::vector<BoardView> views;
      for (BoardView view : all) {
        if (std::ranges::find(sets, view.set) == sets.end()) continue;
        for (auto& px : view.px) px += noise_px * drawn<2>(rng, normal);
        views.push_back(std::move(view));
      }
      std::vector<calib::Rigid3d> boards(25);
      Adjustment start = near_truth(truth, board::rendered_board(), {}, views);
      start.world_from_board.resize(25);
      for (const BoardView& view : views) {
        const AdjustedCamera& camera = start.cameras[static_cast<std::size_t>(view.camera)];
        const calib::Camera& known = truth.cameras[static_cast<std::size_t>(view.camera)];
        const auto poses = board_poses(board::rendered_board(), view, camera.lens, parameters_of(known.model));
        start.world_from_board[static_cast<std::size_t>(view.set)] =
            calib::inverse(known.cam_from_world) * poses.at(0).cam_from_board;
      }
      count(coverage, adjust(start), truth);
    }
    return coverage;
  };
  const Coverage known_noise = run(board::rendered_truth(), 0.15);
  std::printf("exact corners with 0.15 px of noise: 95 %% bounds cover %.1f %% of %d\n", known_noise.share(),
              known_noise.all);
  EXPECT_GE(known_noise.share(), 90);
  EXPECT_LE(known_noise.share(), 99);
  const Coverage detected = run(board::rendered_views(), 0);
  std::printf("detected corners: 95 %% bounds cover %.1f %% of %d\n", detected.share(), detected.all);
  EXPECT_GE(detected.share(), 90);
}

TEST(BoardPoses, IsCorrectForASlantedView) {
  const SyntheticCapture capture = synthetic_capture({.noise_px = 0.05});
  for (const BoardView& view : capture.views) {
    const calib::Camera& camera = capture.rig.cameras[static_cast<std::size_t>(view.camera)];
    const auto poses = board_poses(capture.board, view, LensModel::radtan4, parameters_of(camera.model));
    ASSERT_FALSE(poses.empty()) << view.image;
    const calib::Rigid3d truth = camera.cam_from_world * capture.world_from_board[static_cast<std::size_t>(view.set)];
    EXPECT_LT(calib::log(poses.front().cam_from_board * calib::inverse(truth)).norm(), 0.06) << view.image;
    EXPECT_LT(poses.front().rms_px, 0.15) << view.image;
  }
}

}  // namespace
}  // namespace huetrack::solver
