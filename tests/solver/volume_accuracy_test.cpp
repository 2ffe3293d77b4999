#include "calib/solver/volume_accuracy.h"

#include <gtest/gtest.h>

#include "calib/solver/ray_uncertainty.h"
#include "calib/solver/world_frame.h"
#include "solver/near_truth.h"

namespace huetrack::solver {
namespace {

using Eigen::Vector3d;

constexpr std::array<int, 3> coarse_steps{5, 5, 4};
const WorldBox box{{-0.5, -0.5, 0.6}, {0.5, 0.5, 1.4}};

Adjustment calibrated(std::uint64_t seed = 1, double noise_px = 0.2) {
  return adjust(near_truth(synthetic_capture({.cameras = 3, .sets = 14, .noise_px = noise_px, .seed = seed})),
                {.find_outliers = false});
}

calib::CameraRig rig_from(const Adjustment& a) {
  calib::CameraRig rig;
  for (const AdjustedCamera& camera : a.cameras)
    rig.cameras.push_back({camera.name, camera.image_size, camera.model(), camera.cam_from_world, {}});
  return rig;
}

// Over repeated calibrations: the error of the volume's shape is as large as was predicted.
TEST(VolumeAccuracy, CoversTheErrorOfRepeatedCalibrations) {
  constexpr int trials = 12;
  double seen = 0, predicted = 0;
  for (std::uint64_t seed = 1; seed <= trials; ++seed) {
    const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 14, .noise_px = 0.2, .seed = seed});
    const Adjustment found = adjust(near_truth(capture), {.find_outliers = false});
    seen += std::pow(volume_rms_m(capture.rig, rig_from(found), box.low, box.high), 2) / trials;
    const VolumeAccuracy map = predict_accuracy(found, box, coarse_steps);
    double squares = 0;
    int points = 0;
    for (const PointAccuracy& point : map.points) {
      if (point.views < 2) continue;
      squares += point.by_calibration_m * point.by_calibration_m;
      ++points;
    }
    predicted += squares / points / trials;
  }
  // The seen error is after rigid alignment; the predicted one includes the uncertainty of the world frame. So only an
  // upper bound of their ratio is exact; the lower one holds that the prediction has the right order.
  EXPECT_GT(std::sqrt(seen / predicted), 0.25);
  EXPECT_LT(std::sqrt(seen / predicted), 1.4);
}

TEST(VolumeAccuracy, DoesNotDependOnTheWorldFrame) {
  const Adjustment here = calibrated();
  // A world that is turned by a right angle about z: the box is one along its axes, too.
  const calib::Rigid3d turn{Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ())), {2, -1, 0.3}};
  const Adjustment there = in_world(here, turn);
  const Vector3d a = turn * box.low, b = turn * box.high;
  const WorldBox moved{a.cwiseMin(b), a.cwiseMax(b)};
  const VolumeAccuracy x = predict_accuracy(here, box, coarse_steps), y = predict_accuracy(there, moved, coarse_steps);
  EXPECT_NEAR(x.covered, y.covered, 1e-12);
  EXPECT_NEAR(x.median_by_calibration_m, y.median_by_calibration_m, 1e-6 * x.median_by_calibration_m);
  EXPECT_NEAR(x.p95_total_m, y.p95_total_m, 1e-6 * x.p95_total_m);
}

TEST(VolumeAccuracy, ObjectNoiseAddsInSquares) {
  const Adjustment a = calibrated();
  const VolumeAccuracy none = predict_accuracy(a, box, coarse_steps, 0),
                       one = predict_accuracy(a, box, coarse_steps, 1), two = predict_accuracy(a, box, coarse_steps, 2);
  for (std::size_t i = 0; i < none.points.size(); ++i) {
    if (none.points[i].views < 2) continue;
    const double by_calibration2 = std::pow(none.points[i].total_m, 2);
    EXPECT_NEAR(none.points[i].total_m, none.points[i].by_calibration_m, 1e-12);
    EXPECT_NEAR(std::pow(two.points[i].total_m, 2) - by_calibration2,
                4 * (std::pow(one.points[i].total_m, 2) - by_calibration2), 1e-12);
  }
}

// A motion of all cameras together is no error of shape.
TEST(ShapeErrorOfAnAdjustment, IsZeroForAMotionOfTheWorld) {
  const calib::Tangent6d motion = 1e-3 * (calib::Tangent6d() << 1, -2, 0.5, 3, 1, -1).finished();
  Adjustment laid_out = calibrated();
  // A layout in which every camera has its pose.
  laid_out.covariance = Eigen::MatrixXd::Identity(18, 18);
  laid_out.lens_offset = {-1, -1, -1};
  laid_out.pose_offset = {0, 6, 12};
  Eigen::VectorXd error(18);
  for (std::size_t c = 0; c < 3; ++c) {
    const calib::Rigid3d& pose = laid_out.cameras[c].cam_from_world;
    error.segment<6>(6 * static_cast<Eigen::Index>(c)) = calib::log(pose * calib::exp(motion) * calib::inverse(pose));
  }
  const ShapeError rigid = shape_error(laid_out, box, error, laid_out.covariance);
  EXPECT_LT(rigid.seen_m, 1e-5) << "to the second order of a motion of 3 mm and 2 mrad";
  Eigen::VectorXd one_camera = error;
  one_camera.tail<12>().setZero();
  EXPECT_GT(shape_error(laid_out, box, one_camera, laid_out.covariance).seen_m, 1e-4)
      << "ten times what is allowed to a motion of all of them";
  EXPECT_NEAR(shape_error(laid_out, box, 2 * one_camera, laid_out.covariance).seen_m,
              2 * shape_error(laid_out, box, one_camera, laid_out.covariance).seen_m, 1e-12);
}

TEST(VolumeAccuracy, OfARigFileIsThatOfItsAdjustment) {
  const Adjustment a = calibrated();
  const VolumeAccuracy map = predict_accuracy(a, box, coarse_steps);
  calib::CameraRig rig = rig_from(a);
  rig.uncertainty = uncertainty_of(a, map);
  ASSERT_TRUE(rig.uncertainty);
  const VolumeAccuracy of_file = predict_accuracy(rig, box, coarse_steps);
  EXPECT_NEAR(of_file.median_by_calibration_m, map.median_by_calibration_m, 0.2 * map.median_by_calibration_m);
  EXPECT_NEAR(of_file.p95_total_m, map.p95_total_m, 0.2 * map.p95_total_m);
}

TEST(VolumeAccuracy, PlacesThatOneCameraSeesHaveNoFigure) {
  const Adjustment a = calibrated();
  const VolumeAccuracy map = predict_accuracy(a, {{-0.5, -0.5, 40}, {0.5, 0.5, 41}}, coarse_steps);  // above all
  EXPECT_EQ(map.covered, 0);
  EXPECT_EQ(map.p95_total_m, 0);
  for (const PointAccuracy& point : map.points) EXPECT_EQ(point.total_m, 0);
}

TEST(NextCameraPlaces, MakeTheVolumeBetterAndAreApart) {
  const calib::CameraRig rig = rig_from(calibrated());
  const VolumeAccuracy map = predict_accuracy(rig, box, coarse_steps);
  const auto places = next_camera_places(rig, map, 3);
  ASSERT_GE(places.size(), 2u);
  for (const CameraPlace& place : places) {
    EXPECT_GE(place.covered, map.covered - 0.1) << "on another grid";
    EXPECT_LE(place.median_total_m, 1.1 * map.median_total_m);
  }
  EXPECT_GT(
      (calib::inverse(places[0].cam_from_world).translation - calib::inverse(places[1].cam_from_world).translation)
          .norm(),
      0.5);
}

TEST(BoardVolume, HoldsTheBoards) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 14});
  const WorldBox volume = board_volume(adjust(near_truth(capture)));
  for (const calib::Rigid3d& pose : capture.world_from_board) {
    const Vector3d middle = pose * Vector3d(0.24, 0.15, 0);
    EXPECT_TRUE(((middle - volume.low).array() > -0.05).all() && ((volume.high - middle).array() > -0.05).all());
  }
  EXPECT_LT((volume.high - volume.low).maxCoeff(), 3);
}

TEST(RayUncertainty, IsZeroForAKnownLensAndSmallWhereBoardsWere) {
  Adjustment a = near_truth(synthetic_capture({.cameras = 2, .sets = 14}));
  const RayUncertainty free = ray_uncertainty(adjust(a), 0);
  EXPECT_GT(free.covered_px, 0);
  EXPECT_LE(free.covered_px, 3 * free.image_px);
  EXPECT_TRUE(std::ranges::any_of(free.covered, [](bool covered) { return covered; }));
  const calib::CameraRig truth = synthetic_capture({.cameras = 2, .sets = 14}).rig;
  for (std::size_t c = 0; c < 2; ++c) {
    a.cameras[c].lens_is_free = false;
    a.cameras[c].parameters = parameters_of(truth.cameras[c].model);
  }
  const RayUncertainty held = ray_uncertainty(adjust(a), 0);
  EXPECT_EQ(held.image_px, 0);
  EXPECT_EQ(held.covered_px, 0);
}

// Errors of rays over repeated calibrations are as large as was predicted.
TEST(RayUncertainty, PredictsTheErrorOfRepeatedCalibrations) {
  constexpr int trials = 12;
  double seen = 0, predicted = 0;
  for (std::uint64_t seed = 1; seed <= trials; ++seed) {
    const SyntheticCapture capture = synthetic_capture({.cameras = 2, .sets = 14, .noise_px = 0.2, .seed = seed});
    const Adjustment found = adjust(near_truth(capture), {.find_outliers = false});
    AdjustedCamera truth = found.cameras[1];
    truth.parameters = parameters_of(capture.rig.cameras[1].model);
    const RayUncertainty rays = ray_uncertainty(found, 1);
    seen += std::pow(difference(found.cameras[1], truth, rays.covered).image_px, 2) / trials;
    predicted += rays.image_px * rays.image_px / trials;
  }
  EXPECT_GT(std::sqrt(seen / predicted), 0.5);
  EXPECT_LT(std::sqrt(seen / predicted), 1.6);
}

TEST(LensDifference, OfALensAndItselfIsZeroAndATurnIsNone) {
  const AdjustedCamera camera = calibrated().cameras[0];
  std::array<bool, ImageStations::count> all{};
  all.fill(true);
  EXPECT_NEAR(difference(camera, camera, all).image_px, 0, 1e-6);
  AdjustedCamera turned = camera;
  turned.parameters(2) += 3;  // a principal point that is off by little is nearly a turn of the camera
  EXPECT_LT(difference(camera, turned, all).image_px, 1.5);
  AdjustedCamera longer = camera;
  longer.parameters.head<2>() *= 1.01;
  EXPECT_GT(difference(camera, longer, all).image_px, 1.5) << "which a longer focal length is not";
}

TEST(ImageStations, CellsAreRowByRow) {
  const calib::ImageSize size{640, 480};
  EXPECT_EQ(ImageStations::cell_of({0, 0}, size), 0);
  EXPECT_EQ(ImageStations::cell_of({639, 0}, size), 7);
  EXPECT_EQ(ImageStations::cell_of({0, 479}, size), 40);
  EXPECT_EQ(ImageStations::cell_of({-5, 600}, size), 40) << "outside: the nearest";
}

}  // namespace
}  // namespace huetrack::solver
