// What RViz shows; and the topics of the view as a second DDS vendor sees them.
#include "publish/ros_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <thread>

#include "idl/huetrack.h"
#include "idl/topics.h"
#include "publish/child_process.h"
#include "publish/page_publisher.h"
#include "publish/test_domain.h"

namespace huetrack::publish {
namespace {

using namespace ::testing;

using namespace std::chrono_literals;

msg::Scene scene() {
  msg::Scene s;
  s.at(5'000'000'000);
  s.volume_min({-1, -1, 0});
  s.volume_max({1, 1, 2});
  msg::SceneCamera camera;
  camera.name("cam.0");
  camera.width(640);
  camera.height(480);
  camera.model("pinhole_radtan");
  camera.intrinsics({500, 501, 319.5, 239.5});
  camera.distortion({-0.1, 0.02, 0, 0, 0.003, 0, 0, 0});
  camera.position({1, 2, 3});
  camera.orientation_xyzw({0, 0, 0, 1});
  for (int i = 0; i < 32; ++i)
    for (const double value : {0.1 * std::cos(i), 0.1 * std::sin(i), 1.0}) camera.border().push_back(value);
  s.cameras({camera, camera});
  s.cameras()[1].name("left");
  msg::SceneTarget target;
  target.name("ball");
  target.radius_m(0.04);
  target.rgb({1, 0, 0});
  target.colors().resize(2);
  target.colors()[1].hue_deg({300, 20});
  s.targets({target});
  s.why_not("because");
  return s;
}

object_tracking::ObjectEstimate estimate(object_tracking::TrackState state) {
  object_tracking::ObjectEstimate e;
  e.state = state;
  e.position = {0.1, 0.2, 0.7};
  e.covariance = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
  return e;
}

msg::Preview preview() {
  msg::Preview p;
  p.camera("cam.0");
  p.captured_at(1'700'000'000'000'000'001);
  p.set_number(42);
  p.image_width(640);
  p.image_height(480);
  p.width(320);
  p.height(240);
  p.jpeg(std::vector<std::uint8_t>(30'000, 7));
  p.targets().resize(1);
  p.targets()[0].target("ball");
  p.targets()[0].state(msg::TRACK_STATE_TRACKING);
  p.targets()[0].ellipse({4, 2.5F, 0});
  p.targets()[0].particles({1, 2, 3, 4});
  return p;
}

TEST(RosView, ATargetIsABallAnEllipsoidAndItsName) {
  const object_tracking::ObjectEstimate e = estimate(object_tracking::TrackState::tracking);
  const auto markers = to_markers(scene(), std::span(&e, 1), capture::Timestamp(3s), "world").markers();
  ASSERT_EQ(markers.size(), 3u + 2 * 2 + 1);
  EXPECT_EQ(markers[0].ns(), "ball");
  EXPECT_EQ(markers[0].type(), 2);
  EXPECT_EQ(markers[0].scale().x(), 0.08);
  EXPECT_EQ(markers[0].pose().position().z(), 0.7);
  EXPECT_EQ(markers[0].header().stamp().sec(), 3);
  EXPECT_EQ(markers[0].header().frame_id(), "world");
  // Semi-axes of the 95 % ellipsoid, smallest first; its long one is z.
  EXPECT_NEAR(markers[1].scale().x(), 2 * 2.7955 * 0.01, 1e-5);
  EXPECT_NEAR(markers[1].scale().z(), 2 * 2.7955 * 0.03, 1e-5);
  const auto& q = markers[1].pose().orientation();
  EXPECT_NEAR(q.x() * q.x() + q.y() * q.y() + q.z() * q.z() + q.w() * q.w(), 1, 1e-9);
  // The ellipsoid is seen through the ball; both are forgotten when nothing comes any more, what stands still is not.
  EXPECT_LT(markers[0].color().a(), 0.5F);
  EXPECT_GT(markers[1].color().a(), markers[0].color().a());
  EXPECT_EQ(markers[0].lifetime().sec(), 2);
  EXPECT_EQ(markers[3].lifetime().sec(), 0);
  EXPECT_EQ(markers[2].text(), "ball");
  EXPECT_EQ(markers[3].ns(), "cameras");
  EXPECT_EQ(markers[3].points().size(), 2u * (32 + 4));
  EXPECT_EQ(markers.back().ns(), "volume");
  EXPECT_EQ(markers.back().points().size(), 24u);  // twelve edges
}

TEST(RosView, ACameraThatIsTrackedMovesWithItsFrame) {
  msg::Scene s = scene();
  s.cameras()[1].orientation_xyzw({std::sqrt(0.5), 0, 0, std::sqrt(0.5)});  // a quarter turn about x
  const auto tf = to_static_tf(s, "map", "left");
  ASSERT_EQ(tf.transforms().size(), 1u);  // /tf says where the other one is
  EXPECT_EQ(tf.transforms()[0].child_frame_id(), "cam.0");
  const auto array = to_markers(s, std::vector{estimate(object_tracking::TrackState::tracking)}, capture::Timestamp(5s),
                                "map", "left");
  int still = 0, moving = 0;
  for (const auto& marker : array.markers()) {
    if (marker.ns() != "cameras" || marker.points().empty()) continue;
    const auto& rim = marker.points()[0];
    if (marker.header().frame_id() == "left") {
      ++moving;
      EXPECT_TRUE(marker.frame_locked());
      // The first ray is (0.1, 0, 1) in the world: in the camera's axes (0.1, 1, 0), from its own origin.
      EXPECT_NEAR(rim.y() / rim.x(), 10, 1e-6);
      EXPECT_NEAR(rim.z(), 0, 1e-9);
    } else {
      ++still;
      EXPECT_EQ(marker.header().frame_id(), "map");
      EXPECT_GT(rim.z(), 3);  // above its place in the rig
    }
  }
  EXPECT_EQ(still, 1);
  EXPECT_EQ(moving, 1);
}

TEST(RosView, WithoutAPositionItsMarkersAreDeleted) {
  const object_tracking::ObjectEstimate e = estimate(object_tracking::TrackState::lost);
  const auto markers = to_markers(scene(), std::span(&e, 1), capture::Timestamp(3s), "world").markers();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(markers[i].action(), 2);
  EXPECT_EQ(markers[3].action(), 0);
}

TEST(RosView, CameraInfoIsOfThePicturesSize) {
  const auto info = to_camera_info(preview(), scene().cameras()[0]);
  EXPECT_EQ(info.width(), 320u);
  EXPECT_EQ(info.distortion_model(), "plumb_bob");
  EXPECT_THAT(info.d(), ElementsAre(-0.1, 0.02, 0, 0, 0.003));
  EXPECT_EQ(info.k()[0], 250);
  EXPECT_EQ(info.k()[2], 159.5);  // (319.5 + 0.5) / 2 - 0.5
  EXPECT_EQ(info.k()[5], 119.5);
  EXPECT_EQ(info.p()[2], 159.5);
  EXPECT_EQ(info.p()[5], 250.5);
  msg::SceneCamera other = scene().cameras()[0];
  other.distortion()[7] = 0.1;
  EXPECT_EQ(to_camera_info(preview(), other).distortion_model(), "rational_polynomial");
  other.model("fisheye_kb");
  other.distortion({1, 2, 3, 4});
  EXPECT_EQ(to_camera_info(preview(), other).distortion_model(), "equidistant");
  other.model("stereographic");
  EXPECT_EQ(to_camera_info(preview(), other).distortion_model(), "stereographic");
  EXPECT_THAT(to_camera_info(preview(), other).d(), ElementsAre(1, 2, 3, 4));
  other.model("");
  EXPECT_EQ(to_camera_info(preview(), other).width(), 320u);
  EXPECT_EQ(to_camera_info(preview(), other).k()[0], 0);
  EXPECT_EQ(to_camera_info(preview(), other).header().frame_id(), "cam.0");
}

TEST(RosView, NamesAreOnesThatRosTakes) {
  EXPECT_EQ(ros_name("left"), "left");
  EXPECT_EQ(ros_name("cam.0-b"), "cam_0_b");
  EXPECT_EQ(ros_name("0"), "camera_0");
}

TEST(ViewSecondVendor, CycloneSeesTheViewAndAsksForIt) {
#ifndef HUETRACK_CYCLONE_PAGE
  GTEST_SKIP() << "Cyclone DDS is not installed (Debian: cyclonedds-dev cyclonedds-tools)";
#else
  EstimatePublisherOptions options;
  options.domain = test_domain();
  options.targets = {"ball"};
  options.cameras = {"cam.0", "left"};
  options.tracked_camera = "left";
  PagePublisher publisher(options);
  EXPECT_TRUE(publisher.publish(scene()));
  camera_tracking::CameraMap map{capture::Timestamp(3s), {{.id = 5}, {.id = 9, .position = {1, 2, 3}, .given = true}}};
  map.points[1].covariance(2, 2) = 0.25;
  map.points[1].state = camera_tracking::CameraMapPoint::State::found;
  EXPECT_TRUE(publisher.publish(map, map.at + 1s));
  ChildProcess page({HUETRACK_CYCLONE_PAGE, std::to_string(test_domain()),
                     idl::PublisherIdentity::of_this_process({}).host, std::to_string(::getpid())});
  const object_tracking::ObjectEstimate e = estimate(object_tracking::TrackState::tracking);
  std::optional<msg::TeachRequest> asked;
  std::vector<std::string> words;
  std::optional<int> status;
  for (int i = 0; i < 1500 && !status; ++i) {
    if (publisher.picture_subscribers() > 0) {
      publisher.publish(preview());
      publisher.publish(std::span(&e, 1), capture::Timestamp(3s));
    }
    while (auto request = publisher.next_request()) {
      asked = std::move(request);
      msg::TeachReply reply;
      reply.client(asked->client());
      reply.number(asked->number());
      reply.granted(true);
      reply.reason("done");
      reply.cameras().resize(1);
      reply.cameras()[0].mask(std::vector<std::uint8_t>(9600, 1));
      publisher.publish(reply);
    }
    while (auto request = publisher.next_control_request()) {
      words = request->words();
      msg::ControlReply reply;
      reply.client(request->client());
      reply.number(request->number());
      reply.granted(true);
      reply.reason("listed");
      reply.rows().resize(2);
      reply.rows()[1].columns({"a", "b"});
      reply.bytes({1, 2, 3});
      publisher.publish(reply);
    }
    status = page.exit_status(50ms);
  }
  ASSERT_EQ(status, 0) << page.err();
  ASSERT_TRUE(asked);
  EXPECT_THAT(words, ElementsAre("record", "list"));
  EXPECT_EQ(asked->action(), msg::TEACH_ACTION_LOOK);
  EXPECT_EQ(asked->points().at(0).camera(), "cam.0");
  EXPECT_EQ(asked->points()[0].pixel()[1], 20.5);
  EXPECT_EQ(asked->wider(), -3);
  std::map<std::string, std::string> got;
  std::istringstream lines(page.out());
  for (std::string line; std::getline(lines, line);)
    got[line.substr(0, line.find(' '))] = line.substr(line.find(' ') + 1);
  EXPECT_EQ(got["scene/pid"], std::to_string(::getpid()));
  EXPECT_EQ(got["scene/frame_id"], "world");
  EXPECT_EQ(got["scene/camera"], "cam.0 640 500 1 8");
  EXPECT_EQ(got["scene/color"], "20");
  EXPECT_EQ(got["scene/why_not"], "because");
  EXPECT_EQ(got["map/camera"], "left " + std::to_string(::getpid()) + " 4000000000 2 2");
  EXPECT_EQ(got["map/point"], "9 2 0.25 2 1");
  EXPECT_EQ(got["preview/camera"], "cam.0");
  EXPECT_EQ(got["preview/set"], "42");
  EXPECT_EQ(got["preview/jpeg"], "30000 7");
  EXPECT_EQ(got["preview/target"], "ball 1 2.5 4");
  EXPECT_EQ(got["reply/number"], "7");
  EXPECT_EQ(got["reply/reason"], "done");
  EXPECT_EQ(got["reply/mask"], "9600");
  EXPECT_EQ(got["control/number"], "8");
  EXPECT_EQ(got["control/reason"], "listed");
  EXPECT_EQ(got["control/column"], "a");
  EXPECT_EQ(got["control/bytes"], "3 3");
  EXPECT_EQ(got["markers/count"], "8");
  EXPECT_THAT(got["markers/first"], StartsWith("ball 2 0 0.69999999999999996 0.08"));
  EXPECT_EQ(got["image/format"], "jpeg");
  EXPECT_EQ(got["image/frame_id"], "cam.0");
  EXPECT_EQ(got["image/bytes"], "30000");
  EXPECT_EQ(got["info/model"], "plumb_bob 320 5");
  EXPECT_EQ(got["info/k"], "250 159.5");
  EXPECT_EQ(got["tf/child"], "cam.0 1");  // not "left", which is tracked
#endif
}

}  // namespace
}  // namespace huetrack::publish
