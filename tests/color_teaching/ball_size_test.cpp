// A ball's radius, and when it cannot be measured.
#include "color_teaching/ball_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "color_teaching/color_teacher.h"
#include "object_tracking/ball_outline.h"
#include "scene/scene.h"

namespace huetrack::color_teaching {
namespace {

using namespace testing;

const object_tracking::Volume the_room{Eigen::Vector3d(-1, -1, 0), Eigen::Vector3d(1, 1, 2)};

calib::CameraRig ring(int count = 3) {
  return scene::SceneBuilder{}.cameras_on_ring({.count = count}).build().rig;
}

// As a camera sees a ball there.
ColoredRegion seen(const calib::CameraRig& rig, std::size_t camera, const Eigen::Vector3d& at, double radius_m) {
  const auto ball = object_tracking::outline_of(rig.cameras[camera], at, radius_m);
  const double r = std::sqrt(std::abs(ball->ellipse.axes.determinant()));
  const Eigen::Vector2d c = ball->centre_px;
  ColoredRegion out{.camera = camera, .region = {}};
  out.region.area = int(std::lround(3.14159265 * r * r));
  out.region.centre = c;
  out.region.box = {int(c.x() - r), int(c.y() - r), int(c.x() + r), int(c.y() + r)};
  return out;
}

TEST(BallSize, RegionsGiveARadiusWhereTheirRaysMeet) {
  const calib::CameraRig rig = ring();
  const Eigen::Vector3d at(0.2, -0.1, 1.1);
  std::vector<ColoredRegion> views;
  for (std::size_t c = 0; c < 3; ++c) views.push_back(seen(rig, c, at, 0.05));
  EXPECT_NEAR(*radius_of_regions(rig, views), 0.05, 0.002);
  EXPECT_LT((*meeting_point(rig, views) - at).norm(), 0.002);
  views[1] = seen(rig, 1, {-0.5, 0.4, 0.7}, 0.05);
  EXPECT_FALSE(meeting_point(rig, views));
}

TEST(BallSize, DistinguishesRoundFromSquareAndLong) {
  const auto region = [](int width, int height, double filled) {
    return MaskRegion{.area = int(filled * width * height), .centre = {50, 50}, .box = {0, 0, width - 1, height - 1}};
  };
  EXPECT_TRUE(has_disc_shape(region(20, 20, 0.785)));
  EXPECT_TRUE(has_disc_shape(region(24, 20, 0.785)));  // stretched by motion
  EXPECT_FALSE(has_disc_shape(region(20, 20, 1)));
  EXPECT_FALSE(has_disc_shape(region(40, 20, 0.785)));
  EXPECT_FALSE(has_disc_shape(region(20, 20, 0.5)));
}

// Pictures in which nothing is seen of an edge: the radius comes from regions.
struct Grey {
  capture::Image image = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 320, 240).image;
  BallMoment moment(std::vector<ColoredRegion> views) const {
    return {.pictures = std::vector<const capture::Image*>(3, &image), .views = std::move(views)};
  }
};

TEST(BallSize, RegionsAloneMeasureRoughly) {
  const calib::CameraRig rig = ring();
  const Grey grey;
  const Eigen::Vector3d at(0.2, -0.1, 1.1);
  const RadiusProposal proposal =
      voted_radius(rig, std::vector{grey.moment({seen(rig, 0, at, 0.05), seen(rig, 1, at, 0.05)})});
  ASSERT_TRUE(proposal.radius_m) << proposal.why_not;
  EXPECT_NEAR(*proposal.radius_m, 0.05, 0.003);
  EXPECT_GT(proposal.sigma_m, 0.15 * 0.05);  // nothing shows whether a part of it was hidden in both
  EXPECT_TRUE(proposal.is_rough);
  EXPECT_EQ(proposal.cameras, 2u);
  const Eigen::Vector3d later(0.1, 0.2, 1);
  const RadiusProposal twice =
      voted_radius(rig, std::vector{grey.moment({seen(rig, 0, at, 0.05), seen(rig, 1, at, 0.05)}),
                                    grey.moment({seen(rig, 0, later, 0.05), seen(rig, 1, later, 0.05)})});
  EXPECT_FALSE(twice.is_rough);
  EXPECT_LT(twice.sigma_m, proposal.sigma_m);
}

TEST(BallSize, InconsistentViewsMeasureNothing) {
  const calib::CameraRig rig = ring();
  const Grey grey;
  const Eigen::Vector3d at(0.2, -0.1, 1.1);
  const auto why_not = [&](std::vector<ColoredRegion> views) {
    const RadiusProposal proposal = voted_radius(rig, std::vector{grey.moment(std::move(views))});
    EXPECT_FALSE(proposal.radius_m);
    return proposal.why_not;
  };
  EXPECT_THAT(why_not({seen(rig, 0, at, 0.05)}), HasSubstr("only one camera"));
  EXPECT_THAT(why_not({seen(rig, 0, at, 0.05), seen(rig, 1, at, 0.065)}),
              AllOf(HasSubstr("a part of it is in shade"), HasSubstr("cameras that are not synchronised"),
                    HasSubstr("or the calibration is not right"), HasSubstr("more moments")));
  EXPECT_THAT(why_not({seen(rig, 0, at, 0.05), seen(rig, 1, {-0.5, 0.5, 0.5}, 0.05)}),
              AllOf(HasSubstr("do not meet"), HasSubstr("not synchronised"), HasSubstr("let it rest")));
  ColoredRegion square = seen(rig, 1, at, 0.12);
  const auto& box = square.region.box;
  square.region.area = (box.u_max - box.u_min + 1) * (box.v_max - box.v_min + 1);
  EXPECT_THAT(why_not({seen(rig, 0, at, 0.12), square}), HasSubstr("is not round"));
  EXPECT_THAT(voted_radius(rig, {}).why_not, HasSubstr("only one camera"));
}

// From two clicks in a rendered room, over moments in which the ball goes about.
TEST(BallSize, ManyMomentsMeasureWell) {
  for (const double radius_m : {0.025, 0.04, 0.07}) {
    const scene::Scene scene = scene::SceneBuilder{}
                                   .cameras_on_ring({.count = 3, .image_size = {640, 480}, .focal_px = 480})
                                   .ball({.radius_m = radius_m})
                                   .build();
    const auto sets = scene::render(scene, {.set_count = 40});
    ColorTeacher teacher(scene.rig, sets[0]);
    for (std::size_t i = 2; i < sets.size(); i += 2) teacher.add_moment(sets[i]);
    const Eigen::Vector3d at = scene.ball_at(0, sets[0].at);
    const TeachRequestOptions request{
        .points = {{0, scene.rig.cameras[0].project_world(at)->px}, {1, scene.rig.cameras[1].project_world(at)->px}}};
    const Taught taught = teacher.held_elsewhere(teacher.teach(request, the_room), request, the_room, false);
    const RadiusProposal proposal = teacher.radius(taught);
    ASSERT_TRUE(proposal.radius_m) << proposal.why_not;
    std::printf("%.0f mm: %.2f mm, sigma %.2f, by %zu moments of %zu cameras\n", 1e3 * radius_m,
                1e3 * *proposal.radius_m, 1e3 * proposal.sigma_m, proposal.moments, proposal.cameras);
    EXPECT_NEAR(*proposal.radius_m, radius_m, 0.04 * radius_m);
    EXPECT_NEAR(*proposal.radius_m, radius_m, 2.5 * proposal.sigma_m);
    EXPECT_LT(proposal.sigma_m, 0.05 * radius_m);
    EXPECT_GE(proposal.moments, 10u);
  }
}

// A driver's buffers go back.
TEST(BallSize, MomentsAreCopiesAndBounded) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).ball({}).build();
  auto sets = scene::render(scene, {.set_count = 3});
  const std::weak_ptr<const void> buffer = sets[1].frames[0]->pixels.owner;
  ColorTeacher teacher(scene.rig, sets[0]);
  EXPECT_TRUE(teacher.add_moment(sets[1]));
  sets[1] = {};
  EXPECT_TRUE(buffer.expired());
  int taken = 0;
  while (teacher.add_moment(sets[2])) ASSERT_LT(++taken, 100);
  EXPECT_GE(taken, 16);
  EXPECT_FALSE(teacher.add_moment(sets[2]));
}

}  // namespace
}  // namespace huetrack::color_teaching
