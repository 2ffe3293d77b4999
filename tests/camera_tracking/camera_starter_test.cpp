// Which starts are accepted, and the reasons for rejections.
#include "camera_tracking/camera_starter.h"

#include <gmock/gmock.h>

#include "camera_tracking/drawn_rectangle.h"
#include "particle_filter/random.h"

namespace huetrack::camera_tracking {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

const Eigen::Vector3d near_by(0.05, -0.35, 0.42);

std::vector<Eigen::Vector2d> pixels(const calib::Rigid3d& cam_from_world, const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector2d> px;
  for (const auto& p : points) px.push_back(camera().model.project(cam_from_world * p)->px);
  return px;
}

double error_m(const StartResult& started, const calib::Rigid3d& truth) {
  return (calib::inverse(started.pose.cam_from_world).translation - calib::inverse(truth).translation).norm();
}

TEST(Starter, AcceptsALargeRectangleInOneFrame) {
  const calib::Rigid3d truth = look_at(near_by, {0, 0, 0});
  CameraStarter starter(camera(), RectangleStart{rectangle_corners(), {}});
  const auto started = starter.find({}, view_of_rectangle(camera(), truth));
  ASSERT_TRUE(started);
  EXPECT_THAT(starter.why_not(), IsEmpty());
  EXPECT_LT(error_m(*started, truth), 0.002);
}

TEST(Starter, AcceptsASmallRectangleInThreeConsecutiveFrames) {
  const auto from = [](double x) { return look_at({x, -0.7, 0.8}, {0, 0, 0}); };
  CameraStarter starter(camera(), RectangleStart{rectangle_corners(), {}});
  EXPECT_FALSE(starter.find({}, view_of_rectangle(camera(), from(-0.1))));
  EXPECT_THAT(starter.why_not(), HasSubstr("some frames in a row"));
  EXPECT_FALSE(starter.find({}, view_of_rectangle(camera(), from(0.3))));  // too far for one frame
  EXPECT_FALSE(starter.find({}, view_of_rectangle(camera(), from(0.31))));
  const auto started = starter.find({}, view_of_rectangle(camera(), from(0.32)));
  ASSERT_TRUE(started) << starter.why_not();
  EXPECT_LT(error_m(*started, from(0.32)), 0.05);
}

TEST(Starter, RejectsATinyRectangle) {
  CameraStarter starter(camera(), RectangleStart{rectangle_corners(), {}});
  const GreyImage far_off = view_of_rectangle(camera(), look_at({0.2, -2.5, 2.5}, {0, 0, 0}));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(starter.find({}, far_off));
  EXPECT_THAT(starter.why_not(), HasSubstr("no rectangle of the given proportions"));
}

TEST(Starter, FindsARectangleInALaterFrameThanItsPixels) {
  const calib::Rigid3d truth = look_at(near_by, {0, 0, 0});
  CameraStarter starter(camera(), RectangleStart{rectangle_corners(), pixels(truth, rectangle_corners())});
  EXPECT_FALSE(starter.find({}, view_of_rectangle(camera(), look_at({3, 3, 0.3}, {6, 6, 0}))));
  EXPECT_TRUE(starter.find({}, view_of_rectangle(camera(), truth)));
}

TEST(Starter, ResolvesTheHalfTurnByTheLastPose) {
  const calib::Rigid3d truth =
      look_at({0.05, 0.35, 0.42}, {0, 0, 0});  // from behind: its first corner is at the bottom right
  const CameraStarter starter(camera(), RectangleStart{rectangle_corners(), {}});
  const auto again =
      starter.find_again({}, view_of_rectangle(camera(), truth), look_at({-0.1, 0.4, 0.3}, {0.05, 0, 0}));
  ASSERT_TRUE(again);
  EXPECT_LT((calib::inverse(*again).translation - calib::inverse(truth).translation).norm(), 0.002);
}

TEST(Starter, RejectsPointsThatFitNoPose) {
  const calib::Rigid3d truth = look_at(near_by, {0, 0, 0});
  PointsStart known;
  particle_filter::Rng rng(3);
  for (int i = 0; i < 16; ++i)
    known.points.emplace_back(0.3 * (rng.uniform() - 0.5), 0.2 * (rng.uniform() - 0.5), 0.1 * rng.uniform());
  known.pixels = pixels(truth, known.points);
  known.pixels[3] += Eigen::Vector2d(30, 20);  // an outlier
  const GreyImage any = view_of_rectangle(camera(), truth);
  const auto started = CameraStarter(camera(), known).find({}, any);
  ASSERT_TRUE(started);
  EXPECT_LT(error_m(*started, truth), 0.002);

  for (auto& px : known.pixels) std::swap(px.x(), px.y());
  CameraStarter swapped(camera(), known);
  EXPECT_FALSE(swapped.find({}, any));
  EXPECT_THAT(swapped.why_not(), HasSubstr("the known points in the first frame: "));
  EXPECT_FALSE(swapped.find({}, any));
  EXPECT_THAT(swapped.why_not(), HasSubstr("in the first frame: "));
}

TEST(Starter, RejectsABoardWithTwoThirdsOutliers) {
  const calib::Rigid3d truth = look_at(near_by, {0, 0, 0});
  PointsStart corners;
  for (int i = 0; i < 54; ++i) corners.points.emplace_back(0.02 * (i % 9 - 4), 0.02 * (i / 9 - 2.5), 0);
  corners.pixels = pixels(truth, corners.points);
  const GreyImage any = view_of_rectangle(camera(), truth);
  const auto start_from = [&](const PointsStart& found) {
    return FoundStart{[found](const capture::Image&) { return std::optional(found); }};
  };
  CameraStarter board(camera(), start_from(corners));
  for (int i = 0; i < 2; ++i) board.find({}, any);
  EXPECT_TRUE(board.find({}, any)) << board.why_not();
  particle_filter::Rng rng(4);
  for (std::size_t i = 18; i < corners.pixels.size(); ++i)
    corners.pixels[i] += Eigen::Vector2d(300 * (rng.uniform() - 0.5), 300 * (rng.uniform() - 0.5));
  CameraStarter carpet(camera(), start_from(corners));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(carpet.find({}, any));
  EXPECT_THAT(carpet.why_not(), HasSubstr("what looks like the board: "));
}

}  // namespace
}  // namespace huetrack::camera_tracking
