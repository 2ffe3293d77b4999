// Previews are made only while there are subscribers, and never delay tracking.
#include "page/page_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <atomic>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "calib/model/rig_yaml.h"
#include "capture/frames/jpeg_decoder.h"
#include "idl/arrivals.h"
#include "idl/dds_participant.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"
#include "pictures/preview_maker.h"
#include "publish/test_domain.h"

namespace huetrack::page {
namespace {

using namespace testing;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using eprosima::fastrtps::types::ReturnCode_t;

config::ServiceConfig config() {
  config::ServiceConfig c =
      config::load_service_config(std::filesystem::path(HUETRACK_SOURCE_DIR) / "configs/demo/huetrackd.yaml");
  c.dds.publisher.domain = publish::test_domain();
  c.dds.publisher.interfaces = {"lo"};
  return c;
}

pictures::PictureJob job_of(const config::ServiceConfig& c, std::uint64_t number) {
  pictures::PictureJob job;
  job.set.number = number;
  job.set.at = capture::Timestamp(1s);
  for (std::size_t i = 0; i < c.rig.cameras.size(); ++i) {
    const calib::ImageSize size = c.rig.cameras[i].image_size;
    capture::Frame frame;
    frame.camera = int(i);
    frame.captured_at = capture::Timestamp(1s);
    frame.pixels =
        capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, size.width, size.height).image;
    job.set.frames.emplace_back(std::move(frame));
  }
  object_tracking::ObjectEstimate estimate;
  estimate.state = object_tracking::TrackState::tracking;
  estimate.position = {0, 0, 1};
  estimate.covariance = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
  job.estimates = {estimate};
  job.particles = {std::vector<Eigen::Vector3f>(1000, Eigen::Vector3f(0, 0, 1))};
  return job;
}

bool until(const std::function<bool()>& condition, std::chrono::milliseconds at_most = 10s) {
  for (const auto end = Clock::now() + at_most; Clock::now() < end; std::this_thread::sleep_for(5ms))
    if (condition()) return true;
  return false;
}

TEST(PreviewMaker, ContainsOverlaysAsData) {
  config::ServiceConfig c = config();
  c.preview.width = 100;
  c.preview.particles = 50;
  const auto previews = pictures::make_previews(c, job_of(c, 7), 2s);
  ASSERT_EQ(previews.size(), c.rig.cameras.size());
  const msg::Preview& p = previews[0];
  const calib::Camera& camera = c.rig.cameras[0];
  EXPECT_EQ(p.camera(), camera.name);
  EXPECT_EQ(p.set_number(), 7u);
  EXPECT_EQ(p.captured_at(), 3'000'000'000);
  EXPECT_EQ(p.image_width(), unsigned(camera.image_size.width));
  EXPECT_EQ(p.width(), 100u);
  const auto jpeg = capture::JpegDecoder().decode(p.jpeg());
  ASSERT_TRUE(jpeg.image) << jpeg.problem;
  EXPECT_EQ(jpeg.image->width, 100);
  ASSERT_EQ(p.targets().size(), 1u);
  const msg::PreviewTarget& target = p.targets()[0];
  const auto pixel = camera.project_world({0, 0, 1})->px;
  EXPECT_NEAR(target.pixel()[0], pixel.x(), 1e-3);
  EXPECT_NEAR(target.pixel()[1], pixel.y(), 1e-3);
  EXPECT_THAT(target.particles().size(), AllOf(Ge(90u), Le(110u)));
  EXPECT_NEAR(target.particles()[0], pixel.x(), 0.1);
  EXPECT_GE(target.ellipse()[0], target.ellipse()[1]);
  // The ellipse holds what linear propagation says: along a world axis, by differences.
  const Eigen::Vector2d step = (camera.project_world({0, 0, 1.001})->px - pixel) * 1000;
  const Eigen::Vector2d axis(std::cos(double(target.ellipse()[2])), std::sin(double(target.ellipse()[2])));
  EXPECT_GE(double(target.ellipse()[0]), std::abs(step.dot(axis)) * 0.03 * 2.4 * 0.99);
}

TEST(PreviewMaker, WithoutAPositionThereIsNoPixel) {
  const config::ServiceConfig c = config();
  pictures::PictureJob job = job_of(c, 0);
  job.estimates[0] = {};
  job.set.frames[0].reset();
  const auto previews = pictures::make_previews(c, job, 0s);
  ASSERT_EQ(previews.size(), c.rig.cameras.size() - 1);
  EXPECT_TRUE(std::isnan(previews[0].targets()[0].pixel()[0]));
  EXPECT_TRUE(std::isnan(previews[0].targets()[0].ellipse()[0]));
}

TEST(PreviewMaker, TheSceneNeedsNoLensModel) {
  const config::ServiceConfig c = config();
  const msg::Scene scene = pictures::make_scene(c, true, "");
  ASSERT_EQ(scene.cameras().size(), c.rig.cameras.size());
  const msg::SceneCamera& first = scene.cameras()[0];
  const calib::Camera& camera = c.rig.cameras[0];
  ASSERT_EQ(first.border().size(), 96u);
  // A metre along the first ray is the top-left corner of the image.
  const Eigen::Vector3d ray(first.border()[0], first.border()[1], first.border()[2]);
  const auto corner = camera.project_world(camera.centre() + ray);
  ASSERT_TRUE(corner);
  EXPECT_LT((corner->px - Eigen::Vector2d(-0.5, -0.5)).norm(), 1e-3);
  EXPECT_EQ(scene.targets().at(0).colors().size(), c.rig.cameras.size());
  EXPECT_EQ(scene.targets()[0].colors()[0].hue_deg()[0], c.targets[0].color.hue_min_deg);
}

TEST(PageService, DoesNothingWithoutSubscribers) {
  const config::ServiceConfig c = config();
  PageService server(c, {});
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(server.wants());
    std::this_thread::sleep_for(5ms);
  }
  EXPECT_EQ(server.previews(), 0u);

  {
    idl::DdsParticipant participant({.name = "test", .domain = publish::test_domain(), .interfaces = {"lo"}});
    auto& reader = participant.create_reader<msg::PreviewPubSubType>(idl::preview_topic, idl::preview_reader_qos());
    ASSERT_TRUE(until([&] { return server.wants(); }));
    server.offer(job_of(c, 42));
    EXPECT_FALSE(server.wants());  // one at a time, and no sooner than the rate allows
    msg::Preview sample;
    eprosima::fastdds::dds::SampleInfo info;
    ASSERT_TRUE(until([&] {  // best effort: the first ones may come before the reader knows the writer
      if (server.wants()) server.offer(job_of(c, 42));
      return reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK && info.valid_data;
    }));
    EXPECT_EQ(sample.set_number(), 42u);
    EXPECT_TRUE(until([&] { return server.wants(); }));
  }
  // The subscriber has gone: at most the set that was already asked for is taken.
  ASSERT_TRUE(until([&] {
    if (server.wants()) server.offer(job_of(c, 43));
    std::this_thread::sleep_for(200ms);
    return !server.wants();
  }));
  const auto made = server.previews();
  std::this_thread::sleep_for(300ms);
  EXPECT_FALSE(server.wants());
  EXPECT_EQ(server.previews(), made);
}

TEST(PageService, LateJoinersGetTheSceneAndItFollowsTheConfiguration) {
  config::ServiceConfig c = config();
  PageService server(c, {});
  idl::DdsParticipant participant({.name = "test", .domain = publish::test_domain(), .interfaces = {"lo"}});
  auto& reader = participant.create_reader<msg::ScenePubSubType>(idl::scene_topic, idl::status_reader_qos());
  msg::Scene scene;
  eprosima::fastdds::dds::SampleInfo info;
  ASSERT_TRUE(
      until([&] { return reader.take_next_sample(&scene, &info) == ReturnCode_t::RETCODE_OK && info.valid_data; }));
  EXPECT_EQ(scene.pid(), unsigned(::getpid()));
  c.targets[0].radius_m = 0.123;
  server.take_over(c);
  ASSERT_TRUE(until([&] {
    reader.take_next_sample(&scene, &info);
    return scene.targets()[0].radius_m() == 0.123;
  }));
}

TEST(PageService, LateJoinersGetTheMapOfATrackedCamera) {
  config::ServiceConfig c = config();
  c.dds.publisher.tracked_camera = "hand";
  pipeline::PublishedTime time;
  time.begin(2s);
  PageService server(c, {.time = &time});
  ASSERT_TRUE(server.wants_map());
  camera_tracking::CameraMap map{capture::Timestamp(1s), std::vector<camera_tracking::CameraMapPoint>(2500)};
  for (std::size_t i = 0; i < map.points.size(); ++i) map.points[i].id = std::uint32_t(2 * i);
  map.points[0].position = {1, 2, 3};
  map.points[0].covariance << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  map.points[0].state = camera_tracking::CameraMapPoint::State::found;
  map.points[0].given = true;
  server.offer(map);
  EXPECT_FALSE(server.wants_map());  // not before a second is over
  EXPECT_TRUE(until([&] { return server.wants_map(); }));

  idl::DdsParticipant participant({.name = "test", .domain = publish::test_domain(), .interfaces = {"lo"}});
  auto& reader = participant.create_reader<msg::CameraMapPubSubType>(idl::camera_map_topic, idl::status_reader_qos());
  msg::CameraMap sample;
  eprosima::fastdds::dds::SampleInfo info;
  ASSERT_TRUE(
      until([&] { return reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK && info.valid_data; }));
  EXPECT_EQ(sample.camera(), "hand");
  EXPECT_EQ(sample.pid(), unsigned(::getpid()));
  EXPECT_EQ(sample.captured_at(), 3'000'000'000);
  EXPECT_EQ(sample.map_points(), 2500u);
  ASSERT_EQ(sample.points().size(), 1000u);  // bounded, and from the whole map
  EXPECT_EQ(sample.points()[999].id(), 2u * 2497u);
  const msg::CameraMapPoint& first = sample.points()[0];
  EXPECT_THAT(first.position(), ElementsAre(1, 2, 3));
  EXPECT_THAT(first.covariance(), ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_EQ(first.state(), msg::CAMERA_MAP_POINT_FOUND);
  EXPECT_TRUE(first.given());
  EXPECT_EQ(sample.points()[1].state(), msg::CAMERA_MAP_POINT_NOT_SOUGHT);
}

class CountingPlayback final : public Playback {
 public:
  PlaybackState state() const override { return {.is_paused = true}; }
  void pause() override {}
  void go_on() override {}
  void step(int sets) override { steps += sets; }
  void set_speed(double) override {}
  void seek(double) override {}
  std::atomic<int> steps = 0;
};

// A busy machine misses a frame now and then: what is taught needs all cameras' pictures.
TEST(PageService, FreezesASetWithAllPicturesIfOneComesSoon) {
  config::ServiceConfig c = config();
  c.control.allow_teach = true;
  PageService server(c, {.actions = {.reload = [] { return std::string(); }, .resume = {}}});
  idl::DdsParticipant participant({.name = "test", .domain = publish::test_domain(), .interfaces = {"lo"}});
  auto& writer =
      participant.create_writer<msg::TeachRequestPubSubType>(idl::teach_request_topic, idl::teach_writer_qos(), "");
  auto& reader = participant.create_reader<msg::TeachReplyPubSubType>(idl::teach_reply_topic, idl::teach_reader_qos());
  const auto us = idl::PublisherIdentity::of_this_process({});
  msg::TeachRequest request;
  request.client("page");
  request.host(us.host);
  request.pid(us.pid);
  request.action(msg::TEACH_ACTION_FREEZE);
  const auto ask = [&](std::uint32_t number) {
    request.number(number);
    for (int i = 0; i == 0 || (i < 20 && !server.wants()); ++i) {  // until both sides know each other
      writer.write(&request);
      until([&] { return server.wants(); }, 500ms);
    }
  };
  std::uint64_t set = 0;
  const auto offer = [&](bool is_whole) {
    if (!until([&] { return server.wants(); }, 500ms)) return;
    pictures::PictureJob job = job_of(c, ++set);
    if (!is_whole) job.set.frames[1].reset();
    server.offer(std::move(job));
  };
  msg::TeachReply reply;
  ask(1);
  offer(false);
  offer(true);
  ASSERT_TRUE(until([&] { return idl::take_next(reader, reply) && reply.number() == 1; }));
  EXPECT_EQ(reply.set_number(), 2u);
  EXPECT_FALSE(reply.cameras()[1].jpeg().empty());

  // A camera that delivers nothing: what there is.
  ask(2);
  ASSERT_TRUE(until([&] {
    offer(false);
    return idl::take_next(reader, reply) && reply.number() == 2;
  }));
  EXPECT_TRUE(reply.granted()) << reply.reason();
  EXPECT_FALSE(reply.cameras()[0].jpeg().empty());
  EXPECT_TRUE(reply.cameras()[1].jpeg().empty());
}

TEST(PageService, ARepeatedRequestIsExecutedOnceWhateverWasRequestedInBetween) {
  config::ServiceConfig c = config();
  c.control.allow_teach = true;
  CountingPlayback playback;
  PageService server(c, {.control = {.playback = &playback}});
  idl::DdsParticipant participant({.name = "test", .domain = publish::test_domain(), .interfaces = {"lo"}});
  auto& writer =
      participant.create_writer<msg::ControlRequestPubSubType>(idl::control_request_topic, idl::teach_writer_qos(), "");
  auto& reader =
      participant.create_reader<msg::ControlReplyPubSubType>(idl::control_reply_topic, idl::teach_reader_qos());
  const auto us = idl::PublisherIdentity::of_this_process({});
  const auto reply_to = [&](std::uint32_t number, std::vector<std::string> words) {
    msg::ControlRequest request;
    request.client("page");
    request.host(us.host);
    request.pid(us.pid);
    request.number(number);
    request.words(std::move(words));
    std::optional<msg::ControlReply> reply;
    for (int i = 0; i < 20 && !reply; ++i) {  // until both sides know each other
      writer.write(&request);
      msg::ControlReply sample;
      until([&] { return idl::take_next(reader, sample) && sample.number() == number && (reply = sample); }, 500ms);
    }
    return reply;
  };
  const auto first = reply_to(1, {"replay", "step", "1"});
  ASSERT_TRUE(first && first->granted()) << first->reason();
  for (std::uint32_t i = 2; i < 5; ++i) ASSERT_TRUE(reply_to(i, {"replay", "state"}));
  const auto again = reply_to(1, {"replay", "step", "1"});
  ASSERT_TRUE(again);
  EXPECT_EQ(again->reason(), first->reason());
  EXPECT_EQ(playback.steps, 1);
}

}  // namespace
}  // namespace huetrack::page
