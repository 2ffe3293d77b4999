#include "calib/wave/shape_errors.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "calib/model/cross_matrix.h"
#include "drawn.h"
#include "wave/waving.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector3d;

const solver::WorldBox room{{-0.6, -0.6, 0.5}, {0.6, 0.6, 1.5}};

WaveState poses_of_rig(const calib::CameraRig& rig) {
  WaveState state;
  for (const calib::Camera& camera : rig.cameras) state.cam_from_world.push_back(camera.cam_from_world);
  return state;
}

// What a motion of the whole world (turn about the origin, shift) does to centres and rotations; these are of
// cam_from_world, which turns against it.
Eigen::VectorXd motion_of_the_world(const calib::CameraRig& rig, const Vector3d& turn, const Vector3d& shift) {
  Eigen::VectorXd error = Eigen::VectorXd::Zero((6 + lens_freedom) * static_cast<Eigen::Index>(rig.cameras.size()));
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    error.segment<6>(6 * static_cast<Eigen::Index>(c)) << turn.cross(rig.cameras[c].centre()) + shift, -turn;
  return error;
}

Eigen::MatrixXd covariance_of(int cameras, double centre_m, double turned_rad) {
  Eigen::VectorXd variance = Eigen::VectorXd::Zero((6 + lens_freedom) * cameras);
  for (int c = 0; c < cameras; ++c)
    variance.segment<6>(6 * c) << Vector3d::Constant(centre_m * centre_m), Vector3d::Constant(turned_rad * turned_rad);
  return variance.asDiagonal();
}

TEST(ShapeErrors, MotionOfTheWholeWorldIsNoError) {
  const calib::CameraRig rig = rig_of(4);
  const ShapeErrors shape = shape_errors(rig, poses_of_rig(rig), places_in(room));
  ASSERT_GT(shape.places, 100);
  const Eigen::VectorXd moved = motion_of_the_world(rig, {0.01, -0.02, 0.03}, {0.5, -1, 2});
  EXPECT_LT((shape.by_errors * moved).norm(), 1e-6 * moved.norm());
  // And it is found as what is taken away: translation, then rotation.
  EXPECT_LT(
      (shape.alignment * moved - (Eigen::Matrix<double, 6, 1>() << 0.5, -1, 2, 0.01, -0.02, 0.03).finished()).norm(),
      1e-6);
}

TEST(ShapeErrors, MotionOfTheWholeWorldMovesNoCamera) {
  const calib::CameraRig rig = rig_of(3);
  const ShapeErrors shape = shape_errors(rig, poses_of_rig(rig), places_in(room));
  const Eigen::VectorXd moved = motion_of_the_world(rig, {0.01, -0.02, 0.03}, {0.5, -1, 2});
  for (int c = 0; c < 3; ++c)
    EXPECT_LT((shape.of_camera(c, rig.cameras[std::size_t(c)].centre()) * moved).norm(), 1e-6 * moved.norm()) << c;
}

// What a tracker makes of the rig's uncertainty is what the report says.
TEST(ShapeErrors, UncertaintyOfTheRigIsThatOfPositions) {
  const calib::CameraRig rig = rig_of(3);
  const WaveState state = poses_of_rig(rig);
  const std::vector<Vector3d> places = places_in(room);
  const ShapeErrors shape = shape_errors(rig, state, places);
  Eigen::MatrixXd root = Eigen::MatrixXd::Random(3 * (6 + lens_freedom), 3 * (6 + lens_freedom));
  for (int c = 0; c < 3; ++c) {
    root.middleRows<6>(6 * c) *= 1e-3;
    root.middleRows<lens_freedom>(18 + lens_freedom * c) *= 1e-3;
    root.middleRows<2>(18 + lens_freedom * c + 1) *= 1e3;
  }
  const Eigen::MatrixXd covariance = root * root.transpose();
  calib::CameraRig uncertain = rig;
  uncertain.uncertainty = shape.uncertainty(rig, state, covariance, 0);
  double sum = 0;
  for (const Vector3d& p : places) {
    std::vector<calib::PlaceView> views;
    for (int c = 0; c < 3; ++c) {
      const auto px = rig.cameras[std::size_t(c)].project_world(p);
      if (px && rig.cameras[std::size_t(c)].contains(*px)) views.push_back({c, Eigen::Matrix2d::Identity()});
    }
    if (views.size() >= 2) sum += calib::rig_covariance_at(uncertain, p, views).trace() / shape.places;
  }
  EXPECT_NEAR(std::sqrt(sum), shape.rms(covariance), 1e-3 * shape.rms(covariance));
}

// Poses moved at random, places triangulated with them, aligned: as far off as was predicted.
TEST(ShapeErrors, RmsIsThatOfTriangulatedPlaces) {
  const calib::CameraRig truth = rig_of(3);
  constexpr double centre_m = 0.002, turned_rad = 0.001;
  const std::vector<Vector3d> places = places_in(room);
  const ShapeErrors shape = shape_errors(truth, poses_of_rig(truth), places);
  std::mt19937_64 rng(8);
  std::normal_distribution<double> normal;
  const auto random = [&](double size) { return Vector3d(size * drawn<3>(rng, normal)); };
  constexpr int trials = 60;
  double sum = 0;
  for (int trial = 0; trial < trials; ++trial) {
    calib::CameraRig found = truth;
    for (calib::Camera& camera : found.cameras) {
      const Vector3d centre = camera.centre() + random(centre_m), turn = random(turned_rad);
      camera.cam_from_world.rotation =
          camera.cam_from_world.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
      camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
    }
    std::vector<Vector3d> from, to;
    for (const Vector3d& p : places) {
      // Least squares of pixels, linearised at the true place.
      Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
      Vector3d right = Vector3d::Zero();
      int views = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto seen = truth.cameras[c].project_world(p);
        calib::CameraModel::Jacobian by_cam;
        const auto at = found.cameras[c].model.project(found.cameras[c].cam_from_world * p, by_cam);
        if (!seen || !truth.cameras[c].contains(*seen) || !at) continue;
        const Eigen::Matrix<double, 2, 3> j = by_cam * found.cameras[c].cam_from_world.rotation.toRotationMatrix();
        information += j.transpose() * j;
        right += j.transpose() * (seen->px - at->px);
        ++views;
      }
      if (views < 2) continue;
      from.push_back(p + information.ldlt().solve(right));
      to.push_back(p);
    }
    Eigen::Matrix3Xd a(3, from.size()), b(3, to.size());
    for (std::size_t i = 0; i < from.size(); ++i)
      a.col(static_cast<Eigen::Index>(i)) = from[i], b.col(static_cast<Eigen::Index>(i)) = to[i];
    const Eigen::Matrix4d t = solver::umeyama(a, b, false);
    sum += (((t.topLeftCorner<3, 3>() * a).colwise() + t.topRightCorner<3, 1>()) - b).squaredNorm() /
           static_cast<double>(from.size());
  }
  const double predicted = shape.rms(covariance_of(3, centre_m, turned_rad));
  EXPECT_NEAR(std::sqrt(sum / trials), predicted, 0.15 * predicted);
}

TEST(ShapeErrors, DoNotDependOnWorldFrameAndUnit) {
  const calib::CameraRig rig = rig_of(3);
  constexpr double scale = 1000;  // millimetres
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.8, Vector3d(1, 1, -2).normalized()).matrix();
  calib::CameraRig moved = rig;
  for (calib::Camera& camera : moved.cameras) {
    const Vector3d centre = scale * (turn * camera.centre()) + Vector3d(100, 200, -3000);
    camera.cam_from_world.rotation = camera.cam_from_world.rotation * Eigen::Quaterniond(turn).conjugate();
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
  }
  std::vector<Vector3d> places = places_in(room), there;
  for (const Vector3d& p : places) there.push_back(scale * (turn * p) + Vector3d(100, 200, -3000));
  const double here_m = shape_errors(rig, poses_of_rig(rig), places).rms(covariance_of(3, 0.002, 0.001));
  const double there_m = shape_errors(moved, poses_of_rig(moved), there).rms(covariance_of(3, scale * 0.002, 0.001));
  EXPECT_NEAR(there_m, scale * here_m, 1e-6 * there_m);
}

TEST(ShapeErrors, DoNotDependOnTheOrderOfCameras) {
  calib::CameraRig rig = rig_of(4);
  const double once = shape_errors(rig, poses_of_rig(rig), places_in(room)).rms(covariance_of(4, 0.002, 0.001));
  std::ranges::rotate(rig.cameras, rig.cameras.begin() + 1);
  EXPECT_NEAR(shape_errors(rig, poses_of_rig(rig), places_in(room)).rms(covariance_of(4, 0.002, 0.001)), once,
              1e-9 * once);
}

TEST(ShapeErrors, PlacesThatOneCameraSeesDoNotCount) {
  const calib::CameraRig rig = rig_of(1);
  const ShapeErrors shape = shape_errors(rig, poses_of_rig(rig), places_in(room));
  EXPECT_EQ(shape.places, 0);
  EXPECT_EQ(shape.rms(covariance_of(1, 1, 1)), 0);
}

TEST(ShapeErrors, ScaleMovesCamerasAwayFromTheMiddle) {
  const calib::CameraRig rig = rig_of(3);
  const WaveState state = poses_of_rig(rig);
  const ShapeErrors shape = shape_errors(rig, state, places_in(room));
  const auto exact = shape.uncertainty(rig, state, Eigen::MatrixXd::Zero(39, 39), 0.01);
  for (int c = 0; c < 3; ++c) {
    const double expected = 0.01 * (rig.cameras[static_cast<std::size_t>(c)].centre() - shape.middle).norm();
    EXPECT_NEAR(exact.covariance().block(14 * c + 11, 14 * c + 11, 3, 3).trace(), expected * expected, 1e-8);
    EXPECT_NEAR(exact.covariance().block(14 * c + 8, 14 * c + 8, 3, 3).norm(), 0, 1e-12) << "it turns none";
  }
}

TEST(Places, AreSpreadOverBoxAndPath) {
  const std::vector<Vector3d> box = places_in(room);
  EXPECT_EQ(box.size(), 343u);
  EXPECT_EQ(box.front(), room.low);
  EXPECT_LT((box.back() - room.high).norm(), 1e-12);
  BallPath path = BallPath::over(0, 1, 0.1);
  for (std::size_t k = 0; k < path.control.size(); ++k) path.control[k].x() = 0.1 * (double(k) - 1);
  const std::vector<Vector3d> along = places_along(path, 0.2, 0.8);
  EXPECT_NEAR(along.front().x(), 0.2, 1e-9);
  EXPECT_NEAR(along.back().x(), 0.8, 1e-9);
}

}  // namespace
}  // namespace huetrack::wave
