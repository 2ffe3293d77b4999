#include "calib/solver/extrinsics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <opencv2/calib3d.hpp>

#include "board/captures.h"
#include "calib/model/rig_yaml.h"
#include "calib/solver/ray_uncertainty.h"
#include "calib/solver/volume_accuracy.h"
#include "calib/solver/world_frame.h"
#include "drawn.h"
#include "solver/odd_lens.h"

namespace huetrack::solver {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::Eq;
using testing::HasSubstr;

std::vector<CameraToCalibrate> unknown(const calib::CameraRig& rig) {
  std::vector<CameraToCalibrate> cameras;
  for (const calib::Camera& camera : rig.cameras) cameras.push_back({camera.name, camera.image_size, {}});
  return cameras;
}

std::vector<CameraToCalibrate> known(const calib::CameraRig& rig) {
  std::vector<CameraToCalibrate> cameras;
  for (const calib::Camera& camera : rig.cameras) cameras.push_back({camera.name, camera.image_size, camera.model});
  return cameras;
}

double synthetic_volume_rms_m(const SyntheticCapture& capture, const Extrinsics& found) {
  return volume_rms_m(capture.rig, rig_of(found.adjustment), {-0.5, -0.5, 0.5}, {0.5, 0.5, 1.5});
}

CalibrationError problem(const SyntheticCapture& capture, const std::vector<BoardView>& views) {
  try {
    calibrate_extrinsics(capture.board, known(capture.rig), views);
  } catch (const CalibrationError& error) {
    return error;
  }
  return CalibrationError("no error");
}

auto finds(Fault fault, const testing::Matcher<std::string>& fact) {
  return AllOf(testing::Property(&CalibrationError::fault, fault),
               testing::ResultOf([](const CalibrationError& error) { return std::string(error.what()); }, fact));
}

TEST(Extrinsics, FindTheRig) {
  const SyntheticCapture capture = synthetic_capture();
  const Extrinsics found = calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views);
  EXPECT_LT(synthetic_volume_rms_m(capture, found), 0.001);
  EXPECT_EQ(found.refinement, LensRefinement::refined);
  EXPECT_NEAR(found.adjustment.noise_px, 0.1, 0.01);
  EXPECT_EQ(found.pairs.size(), 6U);
  for (const CameraPair& pair : found.pairs) EXPECT_LT(pair.rms_px, 0.17);
}

TEST(Extrinsics, ResolvesSymmetricBoards) {
  for (const auto& [columns, rows] : {std::pair(8, 6), std::pair(6, 6)}) {
    SyntheticCapture capture = synthetic_capture({.cameras = 3, .columns = columns, .rows = rows});
    const auto symmetries = capture.board.symmetries();
    ASSERT_GT(symmetries.size(), 1U);
    std::mt19937_64 rng(4);
    for (BoardView& view : capture.views) {
      const auto& turned = symmetries[rng() % symmetries.size()];
      for (int& id : view.ids) id = turned[static_cast<std::size_t>(id)];
      board::sort_corners(view.ids, view.px);
    }
    const Extrinsics found = calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views);
    EXPECT_LT(synthetic_volume_rms_m(capture, found), 0.0015) << columns << "x" << rows;
    for (std::size_t v = 0; v < found.adjustment.fits.size(); ++v) EXPECT_FALSE(found.adjustment.fits[v].dropped);
  }
}

// Two cameras on one side of the volume, two on the other: no picture shows both sides, and of a chessboard none shows
// which side it is of.
TEST(Extrinsics, CamerasOnBothSidesOfATwoSidedBoard) {
  const board::BoardBack back{.thickness = 0.02};
  for (const bool is_told : {true, false}) {
    SyntheticCapture capture = synthetic_capture({.back = back});
    const auto renumbering = capture.board.symmetries().at(1);
    const auto side = capture.board.side_point_count();
    int backs = 0;
    for (BoardView& view : capture.views) {
      if (view.ids.front() < side) continue;
      ++backs;
      if (is_told) continue;
      for (int& id : view.ids) {
        id = renumbering[static_cast<std::size_t>(id)];
        ASSERT_LT(id, side);
      }
      board::sort_corners(view.ids, view.px);
    }
    ASSERT_GT(backs, 20);
    const Extrinsics found = calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views);
    EXPECT_LT(synthetic_volume_rms_m(capture, found), 0.001) << is_told;
    EXPECT_FALSE(found.board_is_warped);
    for (std::size_t v = 0; v < found.adjustment.fits.size(); ++v) EXPECT_FALSE(found.adjustment.fits[v].dropped);
  }
}

TEST(Extrinsics, IsBitEqualForAnyOrderOfImages) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 12});
  std::vector<BoardView> shuffled = capture.views;
  std::mt19937_64 rng(9);
  std::ranges::shuffle(shuffled, rng);
  const Extrinsics a = calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views);
  const Extrinsics b = calibrate_extrinsics(capture.board, unknown(capture.rig), shuffled);
  EXPECT_EQ(calib::to_yaml(rig_of(a.adjustment)), calib::to_yaml(rig_of(b.adjustment)));
}

// Its given lens becomes one of another focal length.
calib::PinholeRadtan zoom(CameraToCalibrate& camera, double factor) {
  auto lens = std::get<calib::PinholeRadtan>(camera.model->lens());
  lens.fx *= factor;
  lens.fy *= factor;
  camera.model = calib::CameraModel(lens);
  return lens;
}

TEST(Extrinsics, KeepsGivenLensesUnlessContradicted) {
  const SyntheticCapture capture = synthetic_capture();
  const Extrinsics stays = calibrate_extrinsics(capture.board, known(capture.rig), capture.views);
  EXPECT_EQ(stays.refinement, LensRefinement::kept_as_given);
  EXPECT_EQ(stays.adjustment.cameras[1].parameters, parameters_of(capture.rig.cameras[1].model));
  auto wrong = known(capture.rig);
  const calib::PinholeRadtan zoomed = zoom(wrong[1], 1.04);
  const Extrinsics refined = calibrate_extrinsics(capture.board, wrong, capture.views);
  EXPECT_EQ(refined.refinement, LensRefinement::refined);
  EXPECT_FALSE(refined.contradictions[0]);
  ASSERT_TRUE(refined.contradictions[1]);
  EXPECT_TRUE(refined.contradictions[1]->is_by_focal_length);
  EXPECT_EQ(refined.contradictions[1]->given_focal_px, zoomed.fx);
  const double true_px = capture.rig.cameras[1].model.fx();
  EXPECT_NEAR(refined.contradictions[1]->focal_px, true_px, 0.01 * true_px);
  EXPECT_LT(synthetic_volume_rms_m(capture, refined), 0.001);
}

// Where the second camera stands before the first one, off, and as it is stated.
std::pair<double, double> off_and_stated_m(const SyntheticCapture& capture, const Adjustment& a) {
  const auto place = [](const calib::Rigid3d& first, const calib::Rigid3d& second) {
    return Eigen::Vector3d((first * calib::inverse(second)).translation);
  };
  const auto& truth = capture.rig.cameras;
  return {(place(a.cameras[0].cam_from_world, a.cameras[1].cam_from_world) -
           place(truth[0].cam_from_world, truth[1].cam_from_world))
              .norm(),
          a.centre_sigma(1).norm()};
}

// Without a word on how well it is known a lens is not exact: one that is 1 % wrong moves its camera by a centimetre.
TEST(Extrinsics, RefinesOrReportsAWrongGivenLens) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 40});
  auto given = known(capture.rig);
  zoom(given[1], 1.01);
  const Extrinsics refined = calibrate_extrinsics(capture.board, given, capture.views);
  EXPECT_NE(refined.refinement, LensRefinement::kept_as_given);
  const double true_px = capture.rig.cameras[1].model.fx();
  EXPECT_NEAR(refined.adjustment.cameras[1].parameters(0), true_px, 0.002 * true_px);
  EXPECT_LT(off_and_stated_m(capture, refined.adjustment).first, 0.004);

  const Extrinsics held = calibrate_extrinsics(capture.board, given, capture.views, {.refine_lens = RefineLens::no});
  EXPECT_EQ(held.adjustment.cameras[1].parameters, parameters_of(*given[1].model));
  const auto [off_m, stated_m] = off_and_stated_m(capture, held.adjustment);
  EXPECT_GT(off_m, 0.01);
  EXPECT_LT(off_m, 2 * stated_m);
  EXPECT_GT(held.adjustment.lens_sigma(1)(0), 0.005 * true_px);
  ASSERT_TRUE(held.given_lens_checks[1]);
  EXPECT_GT(held.given_lens_checks[1]->off_px, 2 * held.given_lens_checks[1]->sigma_px);

  const Extrinsics right = calibrate_extrinsics(capture.board, known(capture.rig), capture.views);
  EXPECT_EQ(right.adjustment.cameras[1].parameters, parameters_of(capture.rig.cameras[1].model));
  EXPECT_LT(off_and_stated_m(capture, right.adjustment).second, 0.005);
  EXPECT_LT(right.given_lens_checks[1]->off_px, 2 * right.given_lens_checks[1]->sigma_px);
}

// From a fifth of the image a lens is known worse, all over it, than a given one can be wrong: it does not take its
// place, and is refined no further than such a lens may be wrong.
TEST(Extrinsics, KeepsAGivenLensWhereViewsCoverTooLittle) {
  SyntheticCapture capture = synthetic_capture({.cameras = 2, .sets = 40, .distance_m = 1.4});
  auto given = known(capture.rig);
  zoom(given[1], 1.015);
  const Extrinsics everywhere = calibrate_extrinsics(capture.board, given, capture.views);
  ASSERT_TRUE(everywhere.contradictions[1]);
  EXPECT_GT(everywhere.contradictions[1]->covered, 0.5);
  std::vector<BoardView> middle;
  for (BoardView view : capture.views) {
    BoardView inner = view;
    inner.ids.clear();
    inner.px.clear();
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      if (std::abs(view.px[k].x() - 320) > 130 || std::abs(view.px[k].y() - 240) > 90) continue;
      inner.ids.push_back(view.ids[k]);
      inner.px.push_back(view.px[k]);
    }
    if (inner.ids.size() >= 12) middle.push_back(std::move(inner));
  }
  const Extrinsics little = calibrate_extrinsics(capture.board, given, middle);
  EXPECT_FALSE(little.contradictions[1]);
  ASSERT_TRUE(little.kept_against[1]);
  EXPECT_LT(little.kept_against[1]->covered, 0.4);
  AdjustedCamera truth = little.adjustment.cameras[1], was = truth;
  truth.parameters = parameters_of(capture.rig.cameras[1].model);
  was.parameters = parameters_of(*given[1].model);
  const auto covered = covered_stations(little.adjustment, 1);
  const LensDifference before = difference(was, truth, covered),
                       now = difference(little.adjustment.cameras[1], truth, covered);
  EXPECT_LT(now.covered_px, 0.2 * before.covered_px);
  EXPECT_LT(now.image_px, before.image_px);
}

// Lenses that no model holds: of each camera the model with the most evidence follows it closely.
TEST(Extrinsics, FollowsLensesThatNoModelHolds) {
  const OddCapture capture = odd_capture({70, 100, 130}, 0.1, 4, 120);
  const Extrinsics found = calibrate_extrinsics(capture.of.board, unknown(capture.of.rig), capture.of.views);
  EXPECT_EQ(found.adjustment.cameras[1].lens, LensModel::stereographic);
  for (int c = 0; c < 3; ++c) {
    const auto& model = found.adjustment.cameras[static_cast<std::size_t>(c)].model();
    EXPECT_LT(rays_off_px(capture.lenses[static_cast<std::size_t>(c)], model, capture.of.views, c, {1280, 720}), 0.3)
        << c;
  }
}

// Boards amid the images: k1, k2, p1, p2 explain them, and k3 is not known. What is stated of the volume includes it.
TEST(Extrinsics, StatesTheUncertaintyOfAnUndeterminedK3) {
  const calib::CameraModel lens(calib::PinholeRadtan{480, 480, 322, 236, {-0.13, 0.026, 0.0005, 0.0004}});
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 20, .models = {lens}});
  const Extrinsics found = calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views);
  const Extrinsics without = calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views,
                                                  {.intrinsics = {.lens = LensModel::radtan4}});
  for (std::size_t c = 0; c < 3; ++c) {
    const Intrinsics& chosen = *found.lenses[c];
    ASSERT_EQ(chosen.trials[chosen.chosen].lens, LensModel::radtan4);
    EXPECT_GT(probability_of_k3(chosen), 0);
    EXPECT_LT(probability_of_k3(chosen), 1);
    EXPECT_LT((found.adjustment.cameras[c].parameters - without.adjustment.cameras[c].parameters).norm(), 1e-3);
    EXPECT_GT(found.adjustment.lens_sigma(static_cast<int>(c))(8), 0);
  }
  const WorldBox box{.low = {-1, -1, 0.1}, .high = {1, 1, 2.1}};
  const Adjustment stated = in_world(found.adjustment, calib::inverse(capture.rig.cameras[0].cam_from_world)),
                   too_sure = in_world(without.adjustment, calib::inverse(capture.rig.cameras[0].cam_from_world));
  EXPECT_GT(predict_accuracy(stated, box, {3, 3, 3}).median_by_calibration_m,
            predict_accuracy(too_sure, box, {3, 3, 3}).median_by_calibration_m);
}

TEST(Extrinsics, ReportsACameraThatMovedDuringTheRecording) {
  SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 40});
  const calib::Rigid3d moved = calib::exp((calib::Tangent6d() << 0, 0.004, 0, 0.004, 0, 0).finished());
  EXPECT_FALSE(calibrate_extrinsics(capture.board, known(capture.rig), capture.views).moved_within);
  for (BoardView& view : capture.views) {
    if (view.camera != 2 || view.set < 24) continue;
    const calib::Camera& camera = capture.rig.cameras[2];
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      const Eigen::Vector3d p = camera.cam_from_world * (capture.world_from_board[static_cast<std::size_t>(view.set)] *
                                                         capture.board.point(view.ids[k]));
      view.px[k] += camera.model.project(moved * p).value().px - camera.model.project(p).value().px;
    }
  }
  const Extrinsics found = calibrate_extrinsics(capture.board, known(capture.rig), capture.views);
  ASSERT_TRUE(found.moved_within);
  EXPECT_EQ(found.moved_within->camera, 2);
  EXPECT_NEAR(found.moved_within->set, 24, 1);
  EXPECT_NEAR(found.moved_within->turned_rad, 0.004, 0.001);
}

TEST(Extrinsics, NoisyCameraHasLessWeight) {
  SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 40});
  std::mt19937_64 rng(7);
  for (BoardView& view : capture.views) {
    if (view.camera != 1) continue;
    for (auto& px : view.px) px += drawn<2>(rng, normal);
  }
  const Extrinsics found = calibrate_extrinsics(capture.board, known(capture.rig), capture.views);
  EXPECT_NEAR(found.adjustment.cameras[1].relative_noise, 10, 2);
  EXPECT_EQ(found.adjustment.cameras[0].relative_noise, 1);
  EXPECT_NEAR(found.adjustment.noise_px, 0.1, 0.02);
  EXPECT_LT(synthetic_volume_rms_m(capture, found), 0.002);
}

TEST(Extrinsics, LeavesOutACameraThatCannotBeCalibrated) {
  const SyntheticCapture capture = synthetic_capture();
  std::vector<BoardView> views = capture.views;
  std::erase_if(views, [](const BoardView& view) { return view.camera == 1; });
  const Extrinsics found = calibrate_extrinsics(capture.board, known(capture.rig), views, {.leave_out = true});
  EXPECT_EQ(found.kept, (std::vector<int>{0, 2, 3}));
  ASSERT_EQ(found.left_out.size(), 1U);
  EXPECT_EQ(found.left_out[0].camera, 1);
  EXPECT_EQ(facts(found.left_out[0].why), "camera cam1 never saw the board");
  EXPECT_EQ(found.adjustment.cameras[1].name, "cam2");
}

// --- inputs that are wrong, each with its own message ---

TEST(ExtrinsicsErrors, NamesCameraWithoutOverlap) {
  const SyntheticCapture capture = synthetic_capture({.sets = 40});
  std::vector<BoardView> views;
  for (const BoardView& view : capture.views) {
    if ((view.camera == 2) == (view.set >= 20))
      views.push_back(view);  // cam2 sees the board only when no other camera does
  }
  const CalibrationError found = problem(capture, views);
  EXPECT_THAT(found,
              finds(Fault::no_overlap, Eq("camera cam2 never saw the board at the same time as cam0, cam1 and cam3")));
  EXPECT_EQ(found.reasons().front().cameras, (std::vector<std::string>{"cam2", "cam0"}));
}

TEST(ExtrinsicsErrors, NamesCameraWithoutViews) {
  const SyntheticCapture capture = synthetic_capture();
  std::vector<BoardView> views;
  for (const BoardView& view : capture.views) {
    if (view.camera != 3) views.push_back(view);
  }
  EXPECT_THAT(problem(capture, views), finds(Fault::none, Eq("camera cam3 never saw the board")));
}

TEST(ExtrinsicsErrors, ReportsMirroredImages) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 2});
  std::vector<BoardView> views;
  for (BoardView view : capture.views) {
    if (view.camera == 1) {
      // In a mirrored image the detector numbers each row from its other end.
      for (int& id : view.ids) id += 8 - 2 * (id % 9);
      for (Eigen::Vector2d& px : view.px) px.x() = 639 - px.x();
      board::sort_corners(view.ids, view.px);
    }
    views.push_back(std::move(view));
  }
  EXPECT_THAT(problem(capture, views),
              finds(Fault::mirrored_images, AllOf(HasSubstr("cameras cam0 and cam1"), HasSubstr("mirrored"))));
}

TEST(ExtrinsicsErrors, ReportsBoardsOfTwoSizes) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 2});
  SyntheticCapture small = synthetic_capture({.cameras = 2});
  small.board.pitch *= 0.7;  // what camera 1 is shown, at the same places
  std::vector<BoardView> views;
  for (BoardView view : capture.views) {
    if (view.camera == 1) {
      const calib::Camera& camera = capture.rig.cameras[1];
      for (std::size_t k = 0; k < view.ids.size(); ++k) {
        const Eigen::Vector3d middle(0.24, 0.15, 0);
        const Eigen::Vector3d p = middle + 0.7 * (capture.board.point(view.ids[k]) - middle);
        view.px[k] = camera.project_world(capture.world_from_board[static_cast<std::size_t>(view.set)] * p).value().px;
      }
    }
    views.push_back(std::move(view));
  }
  EXPECT_THAT(problem(capture, views), finds(Fault::different_sizes, HasSubstr("sees the board 1.4")));
}

TEST(ExtrinsicsErrors, ReportsImagesOfDifferentMoments) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 2});
  std::vector<BoardView> views;
  for (BoardView view : capture.views) {
    if (view.camera == 1) view.set = (view.set + 5) % 30;
    views.push_back(std::move(view));
  }
  EXPECT_THAT(problem(capture, views),
              finds(Fault::contradicting_views, EndsWith("but contradict each other on their relative pose")));
}

TEST(ExtrinsicsErrors, ReportsSwappedCameras) {
  const SyntheticCapture capture = synthetic_capture();
  std::vector<BoardView> views = capture.views;
  for (BoardView& view : views) view.camera = view.camera == 0 ? 2 : view.camera == 2 ? 0 : view.camera;
  EXPECT_THAT(problem(capture, views), finds(Fault::none, HasSubstr("cameras cam0 and cam2 look swapped")));
}

// --- figures ---

// In how many seconds: tests/benchmark/calibration_figures.
TEST(ExtrinsicsFigures, ThreeHundredViewsOfFourCameras) {
  const SyntheticCapture capture = synthetic_capture({.sets = 300, .noise_px = 0.2, .columns = 8});
  ExtrinsicsOptions refining;
  refining.refine_lens = RefineLens::yes;
  const auto before = std::chrono::steady_clock::now();
  const Extrinsics found = calibrate_extrinsics(capture.board, known(capture.rig), capture.views, refining);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - before;
  std::printf("%zu views, %d corners: %.2f s\n", capture.views.size(), found.adjustment.corners_used, taken.count());
  EXPECT_GT(found.adjustment.corners_used, 40000);
  EXPECT_LT(synthetic_volume_rms_m(capture, found), 0.0005);
}

TEST(ExtrinsicsFigures, RenderedChessboard) {
  if (!std::filesystem::exists(board::shared_data("rendered/chessboard"))) GTEST_SKIP() << "not there";
  const calib::CameraRig truth = calib::read_rig(board::shared_data("rendered/chessboard/rig.yaml"));
  const Extrinsics found = calibrate_extrinsics(board::rendered_board(), unknown(truth), board::rendered_views());
  for (std::size_t c = 0; c < 3; ++c) {
    const LensParameters l = found.adjustment.cameras[c].parameters, t = parameters_of(truth.cameras[c].model);
    std::printf("cam%zu: focal lengths off by %.3f and %.3f %%, principal point by %.2f and %.2f px\n", c,
                100 * (l(0) / t(0) - 1), 100 * (l(1) / t(1) - 1), l(2) - t(2), l(3) - t(3));
    EXPECT_NEAR(l(0) / t(0), 1, 0.004);
    EXPECT_NEAR(l(1) / t(1), 1, 0.004);
    EXPECT_NEAR(l(2), t(2), 2);
    EXPECT_NEAR(l(3), t(3), 2);
  }
  const double rms_m = volume_rms_m(truth, rig_of(found.adjustment), {-1, -1, 0.1}, {1, 1, 2.1});
  std::printf("volume: %.2f mm rms\n", 1000 * rms_m);
  EXPECT_LT(rms_m, 0.002);
}

TEST(ExtrinsicsFigures, OpenCvStereoAgreesWithStereoCalibrate) {
  if (!std::filesystem::exists(board::shared_data("opencv_chessboard_stereo"))) GTEST_SKIP() << "not there";
  const std::vector<CameraToCalibrate> cameras{{"left", {640, 480}, {}}, {"right", {640, 480}, {}}};
  const Extrinsics found = calibrate_extrinsics(board::stereo_board(), cameras, board::stereo_views());
  std::vector<std::vector<cv::Point3f>> points(13);
  std::array<std::vector<std::vector<cv::Point2f>>, 2> px;
  std::map<int, std::size_t> number;
  for (const BoardView& view : board::stereo_views()) number.emplace(view.set, number.size());
  px[0].resize(13);
  px[1].resize(13);
  for (const BoardView& view : board::stereo_views()) {
    ASSERT_EQ(view.ids.size(), 54U);
    const std::size_t n = number.at(view.set);
    points[n].clear();
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      const Eigen::Vector3d p = board::stereo_board().point(view.ids[k]);
      points[n].emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F);
      px[static_cast<std::size_t>(view.camera)][n].emplace_back(static_cast<float>(view.px[k].x()),
                                                                static_cast<float>(view.px[k].y()));
    }
  }
  cv::Mat k1, d1, k2, d2, r, t, e, f, rv, tv;
  const cv::Size size(640, 480);
  cv::calibrateCamera(points, px[0], size, k1, d1, rv, tv);
  cv::calibrateCamera(points, px[1], size, k2, d2, rv, tv);
  cv::stereoCalibrate(points, px[0], px[1], k1, d1, k2, d2, size, r, t, e, f, cv::CALIB_USE_INTRINSIC_GUESS);
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rotation(i, j) = r.at<double>(i, j);
  }
  const calib::Rigid3d& right_from_left = found.adjustment.cameras[1].cam_from_world;
  const double off_deg =
      180 / std::numbers::pi * right_from_left.rotation.angularDistance(Eigen::Quaterniond(rotation));
  const double baseline = right_from_left.translation.norm(), opencv = cv::norm(t);
  std::printf("rotation differs by %.3f deg, baseline by %.2f %%; rms %.3f and %.3f px\n", off_deg,
              100 * (baseline / opencv - 1), found.adjustment.rms_of_camera(0), found.adjustment.rms_of_camera(1));
  EXPECT_LT(off_deg, 0.1);
  EXPECT_NEAR(baseline / opencv, 1, 0.005);
}

}  // namespace
}  // namespace huetrack::solver
