#include "calib/model/camera_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace huetrack::calib {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

Camera camera(const std::string& name, double x_m) {
  Camera c;
  c.name = name;
  c.image_size = {640, 480};
  c.model = CameraModel(PinholeRadtan{500, 501, 320, 240, {-0.1}});
  c.cam_from_world.translation = {-x_m, 0, 0};
  return c;
}

CameraRig rig() {
  return {{camera("left", 0), camera("right", 1)}, {{"tool", "test"}}};
}

TEST(CameraRig, FindsCamerasByName) {
  EXPECT_EQ(rig().index_of("left"), 0);
  EXPECT_EQ(rig().index_of("right"), 1);
  EXPECT_EQ(rig().index_of("Right"), std::nullopt);
}

TEST(CameraRig, AValidRigHasNoProblems) {
  EXPECT_THAT(rig().problems(), IsEmpty());
}

TEST(CameraRig, EveryViolatedConstraintIsOneSentence) {
  const auto problems = [](const std::function<void(CameraRig&)>& spoil) {
    CameraRig spoilt = rig();
    spoil(spoilt);
    return spoilt.problems();
  };
  const auto lens = [](double fx, double fy, double cx, double cy, double k1 = 0) {
    return [=](CameraRig& r) { r.cameras[1].model = CameraModel(PinholeRadtan{fx, fy, cx, cy, {k1}}); };
  };
  const std::string focal = "camera right: fx and fy do not fit the image size: are they in pixels of this image?";
  const std::string centre =
      "camera right: the principal point (cx, cy) is far outside the image: is it in pixels of this image?";
  const std::string finite = "camera right: the intrinsics and the distortion must be finite numbers";
  const std::string size = "camera right: image_size must be from 1 to 32768 pixels in both directions";
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras.clear(); }), ElementsAre("a rig has at least one camera"));
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras[1].name = "left"; }),
              ElementsAre("two cameras have the name left"));
  for (const std::string name : {"", "a b", "a/b", "../a", ".", "-x", "a\n", "caf\xC3\xA9"}) {
    EXPECT_THAT(problems([&](CameraRig& r) { r.cameras[0].name = name; }),
                ElementsAre("camera " + name +
                            ": a camera's name has 1 to 64 letters, digits, '_', '-' or '.', and starts with a letter, "
                            "a digit or '_'"));
  }
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras[1].image_size = {0, 480}; }), ElementsAre(size));
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras[1].image_size = {640, 40000}; }), ElementsAre(size));
  EXPECT_THAT(problems(lens(0, 500, 320, 240)), ElementsAre("camera right: fx and fy must be > 0"));
  EXPECT_THAT(problems(lens(500, -500, 320, 240)), ElementsAre("camera right: fx and fy must be > 0"));
  EXPECT_THAT(problems(lens(0.78, 500, 320, 240)), ElementsAre(focal));  // in units of the image width
  EXPECT_THAT(problems(lens(500, 1e6, 320, 240)), ElementsAre(focal));
  EXPECT_THAT(problems(lens(500, 500, 1300, 240)), ElementsAre(centre));
  EXPECT_THAT(problems(lens(500, 500, 320, -481)), ElementsAre(centre));
  EXPECT_THAT(problems(lens(500, 500, 320, std::nan(""))), ElementsAre(finite));
  EXPECT_THAT(problems(lens(500, 500, 320, 240, HUGE_VAL)), ElementsAre(finite));
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras[1].cam_from_world.rotation.coeffs() *= 1.001; }),
              ElementsAre("camera right: the rotation of cam_from_world is not a unit quaternion"));
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras[1].cam_from_world.translation.x() = std::nan(""); }),
              ElementsAre("camera right: the translation of cam_from_world must be finite numbers"));
  EXPECT_THAT(problems([](CameraRig& r) { r.cameras[1].cam_from_world = r.cameras[0].cam_from_world; }),
              ElementsAre("cameras left and right are at the same place in the world: one pose is copied, or not "
                          "calibrated"));
  EXPECT_THAT(problems([](CameraRig& r) { r.made_by.emplace_back("date", ""); }),
              ElementsAre("made_by has an empty key or an empty value"));
  EXPECT_EQ(problems([](CameraRig& r) { r.made_by.emplace_back("tool", "2"); }).front(),
            "made_by has the key tool more than once");
}

TEST(Camera, HasACentreAndContainsItsPixels) {
  Camera c = camera("c", 3);
  EXPECT_LT((c.centre() - Eigen::Vector3d(3, 0, 0)).norm(), 1e-15);
  EXPECT_LT((c.project_world({3, 0, 2})->px - Eigen::Vector2d(320, 240)).norm(), 1e-12);
  EXPECT_FALSE(c.project_world({3, 0, -2}));
  EXPECT_TRUE(c.contains({{-0.5, -0.5}}));  // the corner of the first pixel
  EXPECT_TRUE(c.contains({{639.49, 479.49}}));
  EXPECT_FALSE(c.contains({{639.5, 0}}));
  EXPECT_FALSE(c.contains({{0, -0.51}}));
}

}  // namespace
}  // namespace huetrack::calib
