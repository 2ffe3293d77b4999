// Error texts: the solver's fact and the advice.
#include "calib/report/advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "calib/solver/rig_check.h"
#include "calib/solver/world_frame.h"
#include "solver/synthetic_rig.h"

namespace huetrack::report {
namespace {

using solver::Fault;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

std::string advised(const std::function<void()>& calibrate) {
  try {
    calibrate();
  } catch (const solver::CalibrationError& error) {
    return with_advice(error);
  }
  return "no error";
}

TEST(Advice, EveryFaultHasItsOwn) {
  std::set<std::string> all;
  for (int fault = 0; fault < static_cast<int>(Fault::none); ++fault) {
    const std::string to_do = advice({"it is so", static_cast<Fault>(fault), {"left", "right"}});
    EXPECT_GT(to_do.size(), 20U) << fault;
    EXPECT_THAT(to_do, Not(testing::AnyOf(EndsWith("."), EndsWith(" "), HasSubstr("\n")))) << fault;
    EXPECT_TRUE(all.insert(to_do).second) << to_do;
  }
  EXPECT_EQ(advice({"it is so", Fault::none}), "");
}

TEST(Advice, FollowsItsFact) {
  EXPECT_EQ(with_advice(solver::CalibrationError("cam0 gave no frame")), "cam0 gave no frame");
  EXPECT_EQ(with_advice(solver::CalibrationError("it is so", Fault::other_rig)),
            "it is so: is it the rig of these cameras?");
  EXPECT_EQ(with_advice(solver::CalibrationError("it is so", Fault::too_little_motion)),
            "it is so. Wave it through the whole volume");
  const solver::CalibrationError several({{"one", Fault::wrong_radius},
                                          {"; and another", Fault::mirrored_images},
                                          {". As it was given, nothing was found: a third", Fault::none}});
  EXPECT_EQ(
      with_advice(several),
      "one: measure it, and correct it; and another: switch mirroring off in the camera or its driver; or, if it sees "
      "the back of the board, add back: to the board file. As it was given, nothing was found: a third");
  EXPECT_STREQ(several.what(), "one; and another. As it was given, nothing was found: a third");
  EXPECT_EQ(several.fault(), Fault::wrong_radius);
  EXPECT_EQ(solver::facts(solver::after("so: ", several.reasons())), std::string("so: ") + several.what());
  EXPECT_EQ(solver::facts(solver::after("so: ", {})), "so: ");
}

TEST(Advice, OfABoardBeforeOneCamera) {
  solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 1, .sets = 10});
  const auto calibrate = [&](std::size_t views, std::optional<solver::LensModel> lens) {
    const std::vector<solver::BoardView> some(capture.views.begin(),
                                              capture.views.begin() + static_cast<std::ptrdiff_t>(views));
    return advised([&] { calibrate_intrinsics(capture.board, "left", {640, 480}, some, {.lens = lens}); });
  };
  EXPECT_EQ(calibrate(2, {}),
            "camera left: only 2 views of the board; at least 4 are needed. Some 15 with the board tilted and in all "
            "parts of the image are good");
  for (solver::BoardView& view : capture.views) {
    for (Eigen::Vector2d& px : view.px) px = {320, 240};
  }
  EXPECT_EQ(calibrate(10, solver::LensModel::radtan4),
            "camera left: radtan4 cannot be fitted to its views (camera left: no lens fits the views of the board: are "
            "all images of this camera, and not cropped or zoomed?): without --lens the model that "
            "predicts the views best is chosen");
}

// cam0 and cam1 saw it in other sets than cam2.
TEST(Advice, OfCamerasThatShareNoView) {
  solver::SyntheticCapture capture = solver::synthetic_capture({.cameras = 3, .sets = 30});
  std::erase_if(capture.views, [](const auto& view) { return (view.camera == 2) != (view.set >= 15); });
  std::vector<solver::CameraToCalibrate> cameras;
  for (const calib::Camera& camera : capture.rig.cameras)
    cameras.push_back({camera.name, camera.image_size, camera.model});
  EXPECT_EQ(advised([&] { calibrate_extrinsics(capture.board, cameras, capture.views); }),
            "camera cam2 never saw the board at the same time as cam0 and cam1: show it to cam2 and cam0 (or to others "
            "of the two groups) together, 10 times or more");
  // A camera that is left out has the same text.
  const solver::Extrinsics found = calibrate_extrinsics(capture.board, cameras, capture.views, {.leave_out = true});
  ASSERT_EQ(found.left_out.size(), 1U);
  EXPECT_THAT(with_advice(found.left_out[0].why),
              EndsWith("as cam0 and cam1: show it to cam2 and cam0 (or to others of the two "
                       "groups) together, 10 times or more"));
}

TEST(Advice, OfMeasuredPoints) {
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, floor{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(
      advised([&] { solver::align_points(line, line, false); }),
      "the points are collinear: the rotation about their line is not determined. Measure one away from the line");
  calib::CameraRig rig = solver::synthetic_capture({.cameras = 2, .sets = 1}).rig;
  rig.cameras[0].cam_from_world = {Eigen::Quaterniond::Identity(), {0, 0, 1}};
  rig.cameras[1].cam_from_world = {Eigen::Quaterniond::Identity(), {0, 0, -1}};
  EXPECT_EQ(advised([&] { solver::floor_from_points(floor, rig); }),
            "as many cameras stand on one side of the floor as on the other: are the points on the floor?");
}

// The remaining sentences, word for word.
TEST(Advice, HasTheseSentences) {
  const auto advised_as = [](const char* fact, Fault fault) {
    return with_advice(solver::CalibrationError(fact, fault));
  };
  EXPECT_EQ(advised_as("the views do not determine what is asked of them (the adjustment does not converge)",
                       Fault::undetermined),
            "the views do not determine what is asked of them (the adjustment does not converge): show the board at "
            "more places, tilted, and out to the image's edges; or ask for a simpler lens model");
  EXPECT_EQ(advised_as("camera cam1 sees the board 1.43 times as large as camera cam0 does", Fault::different_sizes),
            "camera cam1 sees the board 1.43 times as large as camera cam0 does: did they see different boards, or is "
            "one camera's focal length wrong?");
  EXPECT_EQ(
      advised_as("contradict each other on their relative pose", Fault::contradicting_views),
      "contradict each other on their relative pose: were the images taken at the same time, are they in the right "
      "order, and was a camera moved?");
  EXPECT_EQ(
      advised_as("the images of one of them are mirrored (left and right swapped)", Fault::mirrored_images),
      "the images of one of them are mirrored (left and right swapped): switch mirroring off in the camera or its "
      "driver; or, if it sees the back of the board, add back: to the board file");
  EXPECT_EQ(
      advised_as("cam1 never saw the target: none of its 240 frames has a region of the colour", Fault::target_unseen),
      "cam1 never saw the target: none of its 240 frames has a region of the colour. Check the target's colour "
      "(hue, saturation, intensity) in this camera, or wave it in front of it");
  EXPECT_EQ(advised_as("cam0 and cam2 share 0 frames, 20 are needed", Fault::unconnected_cameras),
            "cam0 and cam2 share 0 frames, 20 are needed. Wave it where both see it");
  EXPECT_EQ(
      advised_as("no two cameras agree on how the ball moved, so their poses cannot be found",
                 Fault::contradicting_motion),
      "no two cameras agree on how the ball moved, so their poses cannot be found: is its colour seen on "
      "anything else that moves? Wave for longer, through the whole volume, or begin with a rig of approximate poses");
  EXPECT_EQ(advised_as("cam2: cannot be placed", Fault::unplaced_camera),
            "cam2: cannot be placed. Wave the ball where it and two other cameras see it at once");
  EXPECT_EQ(advised_as("they are not right, or the cameras' names are swapped", Fault::wrong_poses),
            "they are not right, or the cameras' names are swapped. Find poses and times together, with wave");
  EXPECT_EQ(
      advised_as("so the distance between them cannot set the scale", Fault::no_rests),
      "so the distance between them cannot set the scale: hold it still for two seconds at each of the two marks, "
      "in sight of two cameras");
  EXPECT_EQ(advised_as("the camera poses are not determined by how the ball was moved", Fault::undetermined_poses),
            "the camera poses are not determined by how the ball was moved: carry it through the whole volume, up and "
            "down and towards the cameras");
}

}  // namespace
}  // namespace huetrack::report
