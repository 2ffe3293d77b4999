#include "pipeline/calibration_watch.h"

#include <gmock/gmock.h>

#include <cmath>

#include "reports/calibration_words.h"
#include "room_watch/filmed_room.h"

namespace huetrack::pipeline {
namespace {

using config::CalibrationMode;
using reports::calibration_warning;
using room_watch::degree;
using room_watch::Film;
using room_watch::FilmedRoom;
using testing::HasSubstr;

const Eigen::Vector3d axis = Eigen::Vector3d(-0.5, 0.75, -0.4).normalized();
const object_tracking::Volume volume{.min = {-1, -1, 0.1}, .max = {1, 1, 2.1}};

// The filming camera, and others in other corners of the room that deliver nothing.
calib::CameraRig watched_rig(int cameras) {
  calib::CameraRig rig;
  for (int c = 0; c < cameras; ++c) {
    calib::Camera camera = room_watch::camera_in_room();
    camera.name = "cam" + std::to_string(c);
    const Eigen::Quaterniond round(Eigen::AngleAxisd(-1.5 * c, Eigen::Vector3d::UnitZ()));
    camera.cam_from_world = camera.cam_from_world * calib::Rigid3d{round, Eigen::Vector3d::Zero()};
    rig.cameras.push_back(camera);
  }
  return rig;
}

// After the first camera turned at 3 s.
CalibrationWatch after_turn(double deg, CalibrationMode mode, int cameras = 3, int* news = nullptr,
                            double until_s = 6) {
  Film film;
  film.pose = [deg](double t) {
    return room_watch::moved(room_watch::camera_in_room().cam_from_world, (t < 3 ? 0 : deg * degree) * axis);
  };
  FilmedRoom room(film);
  CalibrationWatch watch(watched_rig(cameras), volume, {.watch = mode, .room_file = {}, .room = {}},
                         std::vector<bool>(std::size_t(cameras), true));
  for (int k = 0; k < 15 * until_s; ++k) {
    capture::FrameSet set;
    set.frames.resize(std::size_t(cameras));
    set.frames[0] = room.frame(k / 15.0);
    set.at = set.frames[0]->captured_at;
    const bool is_news = watch.look(set);
    if (news != nullptr && is_news) ++*news;
    watch.learn({});
  }
  return watch;
}

TEST(CalibrationWatch, ReportsNothingOfStillCameras) {
  for (const auto mode : {CalibrationMode::tell, CalibrationMode::leave_out, CalibrationMode::mend}) {
    int news = 0;
    const CalibrationWatch watch = after_turn(0, mode, 3, &news);
    EXPECT_EQ(news, 0);
    EXPECT_FALSE(watch.cameras()[0].moved);
    EXPECT_EQ(watch.cameras()[0].room.state, room_watch::RoomState::still);
    EXPECT_EQ(calibration_warning("cam0", watch.cameras()[0], mode), "");
  }
}

TEST(CalibrationWatch, ReportsTheEffectAndInflatesTheCovariance) {
  const CalibrationWatch watch = after_turn(0.8, CalibrationMode::tell);
  const CameraCalibration& camera = watch.cameras()[0];
  ASSERT_TRUE(camera.moved);
  EXPECT_NEAR(camera.moved->rotation.norm(), 0.8 * degree, 0.15 * degree);
  // 0.8 degrees at some 2.3 m are 32 mm across the view, of which the others take a part.
  EXPECT_GT(camera.effect_m, 0.008);
  EXPECT_LT(camera.effect_m, 0.032);
  const object_tracking::CameraTrust& trust = watch.trust()[0];
  EXPECT_TRUE(trust.is_used);
  EXPECT_FALSE(trust.cam_from_world);
  EXPECT_GT(std::sqrt((trust.pose_covariance.topLeftCorner<3, 3>().trace())), 0.75 * degree);
  EXPECT_THAT(calibration_warning("cam0", camera, CalibrationMode::tell),
              testing::AllOf(HasSubstr("cam0 was turned by 0.8"), HasSubstr("until it is corrected")));
  EXPECT_EQ(watch.trust()[1].pose_covariance.norm(), 0);
}

TEST(CalibrationWatch, ReportsTheEffectOfTheOnlyCamera) {
  const CameraCalibration camera = after_turn(0.8, CalibrationMode::tell, 1).cameras()[0];
  ASSERT_TRUE(camera.moved);
  EXPECT_NEAR(camera.effect_m, 0.032, 0.015);  // nothing takes a part of 0.8 degrees at some 2.3 m
}

// Below the threshold for reporting, but significant.
TEST(CalibrationWatch, InflatesTheCovarianceByAnUnreportedTurn) {
  const CalibrationWatch watch = after_turn(0.045, CalibrationMode::tell, 3, nullptr, 12);
  EXPECT_FALSE(watch.cameras()[0].moved);
  EXPECT_EQ(calibration_warning("cam0", watch.cameras()[0], CalibrationMode::tell), "");
  const object_tracking::CameraTrust& trust = watch.trust()[0];
  EXPECT_FALSE(trust.has_moved);
  EXPECT_NEAR(std::sqrt((trust.pose_covariance.topLeftCorner<3, 3>().trace())), 0.045 * degree, 0.02 * degree);
  EXPECT_EQ(watch.trust()[1].pose_covariance.norm(), 0);
}

// A replay that begins again, before the knock: the room is the learnt one, so the camera stands as at the start at
// once.
TEST(CalibrationWatch, ComparesWithTheLearntRoomAfterAJump) {
  CalibrationWatch watch = after_turn(0.8, CalibrationMode::leave_out);
  ASSERT_FALSE(watch.trust()[0].is_used);
  watch.begin_anew();
  FilmedRoom room(Film{});
  for (int k = 0; k < 15; ++k) {
    capture::FrameSet set;
    set.frames.resize(3);
    set.frames[0] = room.frame(6 + k / 15.0);
    set.at = set.frames[0]->captured_at;
    watch.look(set);
    watch.learn({});
  }
  EXPECT_EQ(watch.cameras()[0].room.state, room_watch::RoomState::still);
  EXPECT_FALSE(watch.cameras()[0].moved);
  EXPECT_TRUE(watch.trust()[0].is_used);
}

TEST(CalibrationWatch, LeavesOutOnlyThatCamera) {
  const CalibrationWatch watch = after_turn(0.8, CalibrationMode::leave_out);
  EXPECT_FALSE(watch.trust()[0].is_used);
  EXPECT_FALSE(watch.cameras()[0].is_used);
  EXPECT_TRUE(watch.trust()[1].is_used);
  EXPECT_TRUE(watch.trust()[2].is_used);
}

TEST(CalibrationWatch, KeepsTheLastButOneCameraIfItsEffectIsSmall) {
  const CalibrationWatch little = after_turn(0.1, CalibrationMode::leave_out, 2);
  ASSERT_TRUE(little.cameras()[0].moved);
  EXPECT_TRUE(little.trust()[0].is_used);
  // At its current pose, not the rig's.
  ASSERT_TRUE(little.trust()[0].cam_from_world);
  const calib::Rigid3d truth = room_watch::moved(watched_rig(1).cameras[0].cam_from_world, 0.1 * degree * axis);
  const calib::Tangent6d off = calib::log(truth * calib::inverse(*little.trust()[0].cam_from_world));
  EXPECT_LT(off.head<3>().norm(), 0.05 * degree);
  EXPECT_THAT(calibration_warning("cam0", little.cameras()[0], CalibrationMode::leave_out),
              HasSubstr("too few cameras would remain without it"));
  const CalibrationWatch much = after_turn(2, CalibrationMode::leave_out, 2);
  EXPECT_FALSE(much.trust()[0].is_used);
}

TEST(CalibrationWatch, CorrectsThePoseWithItsCovariance) {
  const CalibrationWatch watch = after_turn(0.8, CalibrationMode::mend);
  const object_tracking::CameraTrust& trust = watch.trust()[0];
  ASSERT_TRUE(trust.cam_from_world);
  EXPECT_TRUE(trust.is_used);
  const calib::Rigid3d truth = room_watch::moved(watched_rig(1).cameras[0].cam_from_world, 0.8 * degree * axis);
  const calib::Tangent6d off = calib::log(truth * calib::inverse(*trust.cam_from_world));
  EXPECT_LT(off.head<3>().norm(), 0.05 * degree);
  // Without an object the shift is open, by a few millimetres, and the rotation with it.
  EXPECT_GT(std::sqrt(trust.pose_covariance(3, 3)), 0.002);
  EXPECT_LT(std::sqrt(trust.pose_covariance(3, 3)), 0.02);
}

}  // namespace
}  // namespace huetrack::pipeline
