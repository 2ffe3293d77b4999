// The verdict on calibrations: good ones are usable, and every known way of being wrong is named.
#include "calib/report/calibration_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "calib/report/rig_check_report.h"
#include "calib/report/sentences.h"
#include "calib/solver/world_frame.h"
#include "solver/synthetic_rig.h"

namespace huetrack::report {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::Not;

const solver::IntrinsicsOptions one_lens{.lens = solver::LensModel::radtan4};

std::vector<solver::CameraToCalibrate> unknown(const calib::CameraRig& rig) {
  std::vector<solver::CameraToCalibrate> cameras;
  for (const calib::Camera& camera : rig.cameras) cameras.push_back({camera.name, camera.image_size, {}});
  return cameras;
}

solver::Extrinsics calibrated(const solver::SyntheticCapture& capture) {
  return solver::calibrate_extrinsics(capture.board, unknown(capture.rig), capture.views, {.intrinsics = one_lens});
}

// Seen from the side, or from behind: no real board is.
bool is_steep(const solver::SyntheticCapture& capture, const solver::BoardView& view) {
  const calib::Rigid3d cam_from_board = capture.rig.cameras[static_cast<std::size_t>(view.camera)].cam_from_world *
                                        capture.world_from_board[static_cast<std::size_t>(view.set)];
  return (cam_from_board.rotation * Eigen::Vector3d::UnitZ()).dot(cam_from_board.translation.normalized()) < 0.3;
}

auto speaks_against(Verdict verdict, const std::string& name) {
  return Contains(AllOf(Field(&Check::verdict, verdict), Field(&Check::name, name)));
}

TEST(CalibrationReport, OfAGoodCaptureIsUsable) {
  solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 3, .sets = 40});
  std::erase_if(capture.views, [&](const solver::BoardView& view) { return is_steep(capture, view); });
  solver::Extrinsics found = calibrated(capture);
  found.adjustment = solver::in_world(found.adjustment, solver::upright_guess(found.adjustment));
  const CalibrationReport report =
      report_on(found, {.cameras = {}, .warnings = {}, .volume = {}, .made_of = {{"tool", "test"}}});
  EXPECT_EQ(report.verdict, Verdict::usable) << to_text(report);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(report.cameras[c].rms_px, 0.1 * std::sqrt(2), 0.02);
    EXPECT_GT(report.cameras[c].coverage, 0.4);
    EXPECT_LT(report.cameras[c].centre_sigma_m, 0.003);
  }
  // The predicted accuracy is that of the rig: of the same size as its true error.
  const double true_rms =
      solver::volume_rms_m(capture.rig, solver::rig_of(found.adjustment), {-0.3, -0.4, 0.6}, {0.3, 0.4, 1.4});
  EXPECT_GT(report.volume->median_by_calibration_m, 0.5 * true_rms);
  EXPECT_LT(report.volume->median_by_calibration_m, 5 * true_rms);
  EXPECT_GT(report.volume->median_total_m, report.volume->median_by_calibration_m);
  for (const PairReport& pair : report.pairs) {
    const double truth =
        (capture.rig.cameras[std::size_t(pair.a)].centre() - capture.rig.cameras[std::size_t(pair.b)].centre()).norm();
    EXPECT_NEAR(pair.distance_m, truth, 4 * pair.distance_sigma_m);
    EXPECT_LT(pair.distance_sigma_m, 0.004);
  }
  EXPECT_THAT(to_text(report),
              AllOf(HasSubstr("USABLE"), HasSubstr("cam0 - cam1"), HasSubstr("mm by the calibration")));
  const std::string html = to_html(report);
  for (const char* part : {"<svg", "Usable", "Expected accuracy", "cam2"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_TRUE(html == to_html(report));
}

TEST(CalibrationReport, NamesWhatSpeaksAgainstALens) {
  // Boards that are all held alike, in the middle of the image.
  solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 1, .sets = 12});
  std::vector<solver::BoardView> views;
  std::mt19937_64 rng(1);
  for (int k = 0; k < 12; ++k) {
    solver::BoardView view = capture.views.front();
    view.set = k;
    view.image = "view " + std::to_string(k);
    for (auto& px : view.px) px += 0.05 * drawn<2>(rng, solver::normal) + Eigen::Vector2d(k % 3, 0);
    views.push_back(std::move(view));
  }
  const solver::Intrinsics found = solver::calibrate_intrinsics(capture.board, "cam", {640, 480}, views, one_lens);
  const CalibrationReport report =
      report_on(found, {.cameras = {}, .warnings = {"cam.mp4 ends early"}, .volume = {}, .made_of = {}});
  EXPECT_NE(report.verdict, Verdict::usable);
  EXPECT_THAT(report.checks, speaks_against(Verdict::doubtful, "coverage of cam"));
  EXPECT_THAT(report.checks, speaks_against(Verdict::doubtful, "tilt of cam"));
  EXPECT_THAT(report.checks, speaks_against(Verdict::failed, "views of cam"));  // repeated ones count as one
  EXPECT_THAT(report.checks, speaks_against(Verdict::doubtful, "input"));
  EXPECT_THAT(to_text(report), HasSubstr("cam.mp4 ends early"));
}

TEST(CalibrationReport, SaysWhatBecameOfAGivenLens) {
  solver::Extrinsics found = calibrated(solver::synthetic_capture({.cameras = 2, .sets = 14}));
  EXPECT_THAT(to_html(report_on(found, {})), Not(HasSubstr("the given lens was refined")));
  found.refinement = solver::LensRefinement::given_refined;
  found.adjustment.cameras[1].lens_prior.emplace().mean.head<4>() << 700, 701, 320, 240;
  EXPECT_THAT(to_html(report_on(found, {})),
              AllOf(HasSubstr("cam1: the given lens was refined"), HasSubstr("(given: 700.0)"),
                    HasSubstr("(given: 320.0, 240.0)"), Not(HasSubstr("cam0: the given lens was refined"))));
}

TEST(CalibrationReport, SaysThatAGivenLensIsBelievedAndWhatSpeaksAgainstIt) {
  solver::Extrinsics found = calibrated(solver::synthetic_capture({.cameras = 2, .sets = 14}));
  found.given_lens_checks = {solver::GivenLensCheck{0.1, 0.2, false}, solver::GivenLensCheck{1.5, 0.2, false}};
  const CalibrationReport report = report_on(found, {});
  EXPECT_THAT(report.checks, speaks_against(Verdict::usable, "given lens of cam0"));
  EXPECT_THAT(report.checks, speaks_against(Verdict::doubtful, "given lens of cam1"));
  EXPECT_THAT(to_text(report), HasSubstr("these views differ from it by 1.50 px"));
  EXPECT_THAT(report.checks, Not(Contains(Field(&Check::name, "rays of cam1"))));
}

TEST(CalibrationReport, NamesAspectOverlapAndBoardsSeenFromBehind) {
  const solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 2, .sets = 14});
  solver::SyntheticCapture squeezed = capture;
  // What a video squeezed by 4 % shows.
  for (solver::BoardView& view : squeezed.views) {
    if (view.camera == 1)
      for (auto& px : view.px) px.x() *= 0.96;
  }
  std::erase_if(squeezed.views, [](const solver::BoardView& view) { return view.camera == 1 && view.set % 2 == 1; });
  const solver::Extrinsics found = calibrated(squeezed);
  const CalibrationReport report = report_on(found, {});
  EXPECT_THAT(report.checks, speaks_against(Verdict::doubtful, "aspect ratio of cam1"));
  EXPECT_THAT(to_text(report), HasSubstr("--intrinsics"));
  ReportInput of_page;
  of_page.reader = Reader::page;
  EXPECT_THAT(to_text(report_on(found, of_page)), AllOf(HasSubstr("pitch: [x, y]"), Not(HasSubstr("--"))));
  EXPECT_THAT(report.checks, speaks_against(Verdict::doubtful, "overlap of cam0 and cam1"));
  // The lens by itself is then not known better than its pixels are square; seven views leave part of the 4 % to the
  // prior of square pixels.
  std::vector<solver::BoardView> own;
  for (solver::BoardView& view : squeezed.views) {
    if (view.camera != 1) continue;
    view.camera = 0;
    own.push_back(std::move(view));
  }
  const solver::Adjustment alone =
      solver::calibrate_intrinsics(capture.board, "cam1", {640, 480}, own, one_lens).adjustment;
  EXPECT_GT(alone.lens_sigma(0).head<2>().norm(), 0.015 * alone.cameras[0].parameters(0));
  // As if the solution had put a camera behind the boards.
  solver::Extrinsics behind = calibrated(capture);
  solver::Adjustment& a = behind.adjustment;
  for (std::size_t s = 0; s < a.world_from_board.size(); ++s) {
    a.world_from_board[s].rotation = a.world_from_board[s].rotation *
                                     Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  }
  EXPECT_THAT(report_on(behind, {}).checks, speaks_against(Verdict::failed, "side of the board of cam0"));
}

TEST(Sentences, SayWhatTheSolversFound) {
  EXPECT_EQ(dropped_text({9.87, 0.123}), "its corners have an error of 9.87 px, those of the other views 0.12 px");
  EXPECT_EQ(dropped_text({98.7, 0.123}), "its corners have an error of 99 px, those of the other views 0.12 px");
  EXPECT_EQ(contradiction_text({.given_px = 1.234, .refined_px = 0.2}, "left"),
            "the given lens of camera left leaves a residual of 1.23 px, one fitted to its views 0.20 px");
  const solver::LensContradiction zoomed{
      .is_by_focal_length = true, .focal_px = 600.12, .focal_sigma_px = 0.5, .given_focal_px = 620};
  EXPECT_EQ(contradiction_text(zoomed, "left"),
            "by its views camera left has a focal length of 600.1 px (+- 0.5), not 620.0 px as given");

  solver::Intrinsics lens;
  lens.trials = {{.lens = solver::LensModel::radtan4, .log_evidence = -1010, .error = {}}};
  EXPECT_EQ(choice_text(lens), "radtan4 was asked for");
  lens.trials.push_back({.lens = solver::LensModel::radtan5, .log_evidence = -1012.5, .error = {}});
  EXPECT_EQ(choice_text(lens), "radtan4 explains the views best (log evidence 2.5 above that of radtan5)");
  lens.trials.push_back({.lens = solver::LensModel::fisheye, .log_evidence = -1007, .error = {}});
  EXPECT_EQ(
      choice_text(lens),
      "radtan4 is simpler or more usual than fisheye, which does not explain the views clearly better (log evidence "
      "3.0 above)");
  lens.trials[2].possible = false;
  lens.trials[1].possible = false;
  EXPECT_EQ(choice_text(lens), "radtan4 is the only lens model that fits");

  solver::Extrinsics cameras;
  EXPECT_EQ(refinement_text(cameras), "the lenses stay as they were given");
  cameras.given_lens_checks = {std::nullopt, solver::GivenLensCheck{.has_covariance = true}};
  EXPECT_EQ(refinement_text(cameras), "the lenses stay as they were given");
  cameras.given_lens_checks[0].emplace();
  EXPECT_EQ(refinement_text(cameras),
            "the lenses stay as they were given; their files have no uncertainty, so that of usual webcams is assumed "
            "(0.2 % of the image's width), unless these views determine them better");
  cameras.alone_px = 0.1;
  cameras.adjustment.noise_px = 0.25;
  cameras.refinement = solver::LensRefinement::not_synchronised;
  EXPECT_EQ(refinement_text(cameras),
            "the lenses were estimated from these views; each is kept as its own camera's views determine it (0.10 "
            "px), because the cameras agree less well with one another (0.25 px): they are not quite synchronised");
  cameras.held_px = 0.4;
  cameras.refinement = solver::LensRefinement::given_refined;
  EXPECT_EQ(refinement_text(cameras),
            "the given lenses were refined: unrefined, the cameras agree less well with one another (0.40 px) than now "
            "(0.25 px)");
  cameras.adjustment.cameras.resize(2);
  cameras.adjustment.cameras[1].name = "right";
  cameras.contradictions = {std::nullopt, zoomed};
  cameras.refinement = solver::LensRefinement::refined;
  EXPECT_EQ(refinement_text(cameras),
            contradiction_text(zoomed, "right") + "; the lenses are refined with all cameras' views");
}

TEST(RigCheck, NamesTheCameraThatMoved) {
  const solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 3, .sets = 16});
  const solver::RigCheck fits = solver::check_rig(capture.board, capture.rig, capture.views);
  EXPECT_EQ(report_on(fits, capture.rig).verdict, Verdict::usable) << to_text(report_on(fits, capture.rig), fits);
  EXPECT_TRUE(fits.moved.empty());
  calib::CameraRig bumped = capture.rig;
  const calib::Rigid3d bump = calib::exp((calib::Tangent6d() << 0, 0.02, 0, 0.03, 0.01, 0).finished());
  bumped.cameras[2].cam_from_world = bump * bumped.cameras[2].cam_from_world;
  const solver::RigCheck moved = solver::check_rig(capture.board, bumped, capture.views);
  EXPECT_EQ(report_on(moved, bumped).verdict, Verdict::failed);
  ASSERT_EQ(moved.moved.size(), 1U);
  EXPECT_EQ(moved.moved[0].camera, 2);
  EXPECT_TRUE(moved.alternatives.empty());
  EXPECT_NEAR(moved.moved[0].turned_rad, 0.02, 0.001);
  EXPECT_NEAR(moved.moved[0].moved_m, (bumped.cameras[2].centre() - capture.rig.cameras[2].centre()).norm(), 0.003);
  // Two cameras cannot tell which.
  calib::CameraRig two = bumped;
  two.cameras.erase(two.cameras.begin());
  std::vector<solver::BoardView> views;
  for (solver::BoardView view : capture.views) {
    if (view.camera == 0) continue;
    --view.camera;
    views.push_back(std::move(view));
  }
  const solver::RigCheck either = solver::check_rig(capture.board, two, views);
  EXPECT_EQ(report_on(either, two).verdict, Verdict::failed);
  EXPECT_EQ(either.alternatives.size(), 1U);
  EXPECT_THAT(to_text(report_on(either, two), either), HasSubstr("these views do not determine which"));
}

TEST(RigCheck, TellsAnotherBoardAndSwappedNamesFromABump) {
  const solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 3, .sets = 8});
  board::Board smaller = capture.board;
  smaller.pitch *= 0.95;
  const solver::RigCheck scale = solver::check_rig(smaller, capture.rig, capture.views);
  EXPECT_EQ(report_on(scale, capture.rig).verdict, Verdict::failed);
  EXPECT_TRUE(scale.moved.empty());
  EXPECT_THAT(to_text(report_on(scale, capture.rig), scale), AllOf(HasSubstr("0.950"), HasSubstr("board file")));
  std::vector<solver::BoardView> swapped = capture.views;
  for (solver::BoardView& view : swapped) view.camera = view.camera == 0 ? 2 : view.camera == 2 ? 0 : view.camera;
  const solver::RigCheck names = solver::check_rig(capture.board, capture.rig, swapped);
  EXPECT_EQ(report_on(names, capture.rig).verdict, Verdict::failed);
  EXPECT_TRUE(names.moved.empty());
  EXPECT_THAT(to_text(report_on(names, capture.rig), names), HasSubstr("cameras cam0 and cam2 look swapped"));
  // As a camera that mirrors its pictures has the board: counted from its other side, by columns or by rows, as the
  // colours of the squares have it.
  for (const bool by_rows : {false, true}) {
    std::vector<solver::BoardView> mirrored = capture.views;
    for (solver::BoardView& view : mirrored) {
      if (view.camera != 1) continue;
      std::map<int, Eigen::Vector2d> corners;
      for (std::size_t k = 0; k < view.ids.size(); ++k) {
        const int columns = capture.board.columns, column = view.ids[k] % columns, row = view.ids[k] / columns;
        const int id =
            by_rows ? (capture.board.rows - 1 - row) * columns + column : row * columns + columns - 1 - column;
        corners[id] = {639 - view.px[k].x(), view.px[k].y()};
      }
      view.ids.clear();
      view.px.clear();
      for (const auto& [id, px] : corners) {
        view.ids.push_back(id);
        view.px.push_back(px);
      }
    }
    const solver::RigCheck flipped = solver::check_rig(capture.board, capture.rig, mirrored);
    EXPECT_EQ(report_on(flipped, capture.rig).verdict, Verdict::failed);
    EXPECT_THAT(to_text(report_on(flipped, capture.rig), flipped), HasSubstr("the images of cam1 are mirrored"));
  }
}

TEST(WorldFrame, IsSetByBoardsPointsAndFloors) {
  const solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 3, .sets = 2});
  const calib::Rigid3d other = calib::exp((calib::Tangent6d() << 0.3, -0.5, 0.8, 1, 2, 3).finished());
  const calib::CameraRig moved = solver::in_world(capture.rig, {other, 1});
  const std::vector<Eigen::Vector3d> floor{{0, 0, 0}, {1, 0.5, 0}, {-0.5, 1, 0}, {-1, -1, 0}};
  std::vector<Eigen::Vector3d> seen;
  for (const auto& p : floor) seen.push_back(other * p);
  const calib::CameraRig back = solver::in_world(moved, {solver::floor_from_points(seen, moved), 1});
  for (const calib::Camera& camera : back.cameras) EXPECT_NEAR(camera.centre().z(), 1.8, 1e-6);
  EXPECT_LT((solver::floor_from_points(seen, moved) * seen[1] - Eigen::Vector3d(std::hypot(1, 0.5), 0, 0)).norm(),
            1e-9);
  std::vector<Eigen::Vector3d> larger;
  for (const auto& p : floor) larger.push_back(1.1 * p);
  const solver::WorldChange change = solver::align_points(seen, larger, true);
  EXPECT_NEAR(change.scale, 1.1, 1e-9);
  const calib::CameraRig scaled = solver::in_world(moved, change);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_LT((scaled.cameras[c].centre() - 1.1 * capture.rig.cameras[c].centre()).norm(), 1e-6);
  // The same pixels after all that.
  const auto before = capture.rig.cameras[0].project_world({0.1, 0.2, 0.9}).value().px;
  EXPECT_LT((scaled.cameras[0].project_world({0.11, 0.22, 0.99}).value().px - before).norm(), 1e-6);
  EXPECT_THROW(solver::align_points({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, false),
               solver::CalibrationError);
  const solver::MeasuredPoint point =
      solver::measure_point(capture.rig, {{0, capture.rig.cameras[0].project_world({0.1, 0.2, 0.9}).value().px},
                                          {2, capture.rig.cameras[2].project_world({0.1, 0.2, 0.9}).value().px}});
  EXPECT_LT((point.p_world - Eigen::Vector3d(0.1, 0.2, 0.9)).norm(), 1e-6);
  EXPECT_THROW(solver::measure_point(capture.rig, {{0, before}}), solver::CalibrationError);
}

}  // namespace
}  // namespace huetrack::report
