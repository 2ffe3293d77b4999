#include "calib/wave/wave_start.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "calib/solver/calibration_error.h"
#include "wave/waving.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using solver::Fault;

// What each camera sees of the ball, without noise; late_s: by which the stamps of a camera are late.
BallTracks tracks_of(const calib::CameraRig& rig, double seconds,
                     const std::function<Vector3d(double)>& path = lissajous, const std::vector<double>& late_s = {}) {
  BallTracks tracks;
  tracks.of_camera.resize(rig.cameras.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    for (int i = 0; i < static_cast<int>(30 * seconds); ++i) {
      const double t = i / 30.0;
      const auto px = rig.cameras[c].project_world(path(t));
      if (!px || !rig.cameras[c].contains(*px)) continue;
      tracks.of_camera[c].push_back({t + (late_s.empty() ? 0 : late_s[c]), px->px});
    }
  }
  return tracks;
}

std::vector<calib::Rigid3d> poses_of(const calib::CameraRig& rig) {
  std::vector<calib::Rigid3d> poses;
  for (const calib::Camera& camera : rig.cameras) poses.push_back(camera.cam_from_world);
  return poses;
}

// nullopt: a start was found. Any other exception fails the test.
std::optional<Fault> fault_of(const calib::CameraRig& rig, const BallTracks& tracks) {
  try {
    start_from_nothing(rig, tracks);
  } catch (const solver::CalibrationError& error) {
    EXPECT_STRNE(error.what(), "");
    return error.fault();
  }
  return std::nullopt;
}

TEST(BallTracks, InterpolateBetweenNeighboursAndBridgeNoLongGap) {
  BallTracks tracks;
  tracks.max_gap_s = 0.15;
  tracks.of_camera = {{{1.0, {10, 20}}, {1.1, {20, 40}}, {1.5, {0, 0}}}, {{1.05, {1, 1}}, {1.3, {2, 2}}}};
  EXPECT_EQ(*tracks.at(0, 1.0), Vector2d(10, 20));
  EXPECT_LT((*tracks.at(0, 1.025) - Vector2d(12.5, 25)).norm(), 1e-9);
  EXPECT_FALSE(tracks.at(0, 0.9));
  EXPECT_FALSE(tracks.at(0, 1.3)) << "0.4 s between its neighbours";
  EXPECT_FALSE(tracks.at(0, 1.6));
  EXPECT_EQ(tracks.shared(1, 0), std::vector<double>{1.05});
  tracks.move_earlier(1, 0.05);
  EXPECT_EQ(*tracks.at(1, 1.0), Vector2d(1, 1));
}

TEST(Triangulated, IsWhereTheRaysMeet) {
  const calib::CameraRig rig = rig_of(3);
  const BallTracks tracks = tracks_of(rig, 1);
  for (const double t : {0.1, 0.5, 0.9}) {
    const auto at = triangulated(rig, poses_of(rig), {true, true, true}, tracks, std::round(30 * t) / 30);
    ASSERT_TRUE(at);
    EXPECT_LT((*at - lissajous(std::round(30 * t) / 30)).norm(), 1e-6);
  }
  EXPECT_FALSE(triangulated(rig, poses_of(rig), {true, false, false}, tracks, 0.5)) << "one ray meets none";
  EXPECT_FALSE(triangulated(rig, poses_of(rig), {true, true, true}, tracks, 50)) << "not seen then";
}

TEST(Triangulated, IsNoneBehindACamera) {
  calib::CameraRig rig = rig_of(2);
  const BallTracks tracks = tracks_of(rig, 1);
  std::vector<calib::Rigid3d> poses = poses_of(rig);
  poses[1].rotation = Eigen::AngleAxisd(M_PI, Vector3d::UnitY()) * poses[1].rotation;  // looks away
  poses[1].translation = Eigen::AngleAxisd(M_PI, Vector3d::UnitY()) * poses[1].translation;
  EXPECT_FALSE(triangulated(rig, poses, {true, true}, tracks, 0.5));
}

TEST(TriangulatedPath, GoesStraightWhereNoRaysCross) {
  const calib::CameraRig rig = rig_of(3);
  BallTracks tracks = tracks_of(rig, 3);
  for (auto& track : tracks.of_camera)
    std::erase_if(track, [](const BallTracks::Point& p) { return p.t_s > 1 && p.t_s < 2; });
  std::size_t crossed = 0;
  const BallPath path = triangulated_path(rig, poses_of(rig), tracks, 0, 2.9, 1 / 30.0, &crossed);
  EXPECT_GT(crossed, 50u);
  EXPECT_LT(crossed, path.control.size() - 25);
  EXPECT_LT((path.at(0.5) - lissajous(0.5)).norm(), 0.01);
  const Vector3d middle = (path.at(1.1) + path.at(1.9)) / 2;
  EXPECT_LT((path.at(1.5) - middle).norm(), 1e-6);
}

// Relative poses up to scale: compared by the rotation between cameras and the direction of their baselines.
TEST(StartFromNothing, FindsRelativePoses) {
  for (const int cameras : {2, 3, 4}) {
    const calib::CameraRig rig = rig_of(cameras);
    const WaveStart start = start_from_nothing(rig, tracks_of(rig, 6));
    ASSERT_EQ(start.cam_from_world.size(), rig.cameras.size());
    std::optional<double> scale;
    for (std::size_t c = 1; c < rig.cameras.size(); ++c) {
      const calib::Rigid3d found = start.cam_from_world[c] * calib::inverse(start.cam_from_world[0]);
      const calib::Rigid3d truth = rig.cameras[c].cam_from_world * calib::inverse(rig.cameras[0].cam_from_world);
      EXPECT_LT(found.rotation.angularDistance(truth.rotation), 0.01) << cameras << " cameras, camera " << c;
      if (!scale) scale = found.translation.norm() / truth.translation.norm();
      EXPECT_LT((found.translation - *scale * truth.translation).norm(), 0.02 * *scale * truth.translation.norm());
      EXPECT_EQ(start.later_s[c], 0);
    }
  }
}

TEST(StartFromNothing, DoesNotDependOnTheWorldOfTheRig) {
  const calib::CameraRig rig = rig_of(3);
  calib::CameraRig moved = rig;
  for (calib::Camera& camera : moved.cameras) camera.cam_from_world = {};  // what it says of poses is not used
  const BallTracks tracks = tracks_of(rig, 6);
  const WaveStart a = start_from_nothing(rig, tracks), b = start_from_nothing(moved, tracks);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_EQ(a.cam_from_world[c].translation, b.cam_from_world[c].translation) << "camera " << c;
}

TEST(StartFromNothing, FindsCamerasWhoseStampsAreLate) {
  const calib::CameraRig rig = rig_of(3);
  const WaveStart start =
      start_from_nothing(rig, tracks_of(rig, 8, [](double t) { return lissajous(2 * t); }, {0.0, 0.04, 0.0}));
  EXPECT_NEAR(start.later_s[1] - start.later_s[0], 0.04, 0.008);
  EXPECT_NEAR(start.later_s[2] - start.later_s[0], 0, 0.008);
}

// A patch at one pixel is consistent with a ball that moves along its line of sight: an error is not certain here, but
// nothing else than a CalibrationError may leave.
TEST(StartFromNothing, StillPatchOfTheColourEndsInAStartOrANamedError) {
  const calib::CameraRig rig = rig_of(3);
  for (const double rests_from_s : {6.0, 2.0, 0.4}) {
    BallTracks tracks = tracks_of(rig, 6, [&](double t) { return lissajous(std::min(t, rests_from_s)); });
    for (BallTracks::Point& p : tracks.of_camera[2]) p.px = {300, 200};
    const auto fault = fault_of(rig, tracks);
    EXPECT_TRUE(!fault || *fault == Fault::unplaced_camera || *fault == Fault::contradicting_motion) << rests_from_s;
  }
}

// A ball that rests for most of the time: samples of points in one place, for which OpenCV's SQPnP throws. The start
// may be wrong (EXPERIMENTS.md), but nothing else than a CalibrationError may leave.
TEST(StartFromNothing, BallThatMostlyRestsEndsInAStartOrANamedError) {
  const calib::CameraRig rig = rig_of(3);
  const auto rests = [](double t) { return lissajous(t < 4 ? t : 4); };
  const auto fault = fault_of(rig, tracks_of(rig, 20, rests));
  EXPECT_TRUE(!fault || *fault == Fault::unplaced_camera || *fault == Fault::contradicting_motion);
}

TEST(StartFromNothing, BallThatHardlyMovesIsANamedError) {
  const calib::CameraRig rig = rig_of(3);
  for (const double moves_s : {0.0, 0.2}) {
    const auto fault = fault_of(rig, tracks_of(rig, 6, [&](double t) { return lissajous(std::min(t, moves_s)); }));
    EXPECT_TRUE(!fault || *fault == Fault::unplaced_camera || *fault == Fault::contradicting_motion) << moves_s;
  }
}

TEST(StartFromNothing, TooFewCommonFramesIsANamedError) {
  const calib::CameraRig rig = rig_of(2);
  EXPECT_EQ(fault_of(rig, tracks_of(rig, 0.3)), Fault::contradicting_motion);
  EXPECT_EQ(fault_of(rig, BallTracks{{{}, {}}, 0.1}), Fault::contradicting_motion);
}

}  // namespace
}  // namespace huetrack::wave
