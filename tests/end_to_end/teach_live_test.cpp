// A colour taught to the live service while it runs, over DDS as a page does it: `huetrackd run` on films, in a process
// of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>

#include "capture/jpeg_decoder.h"
#include "config/service_config.h"
#include "end_to_end/process.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/topics.h"
#include "publish/test_domain.h"
#include "soak/films.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
namespace dds = eprosima::fastdds::dds;
using namespace std::chrono_literals;
using namespace testing;
using Clock = std::chrono::steady_clock;
using eprosima::fastrtps::types::ReturnCode_t;

const int domain = publish::test_domain();

// What the bridge does for a page.
class Page {
 public:
  Page()
      : participant_({.name = "test page", .domain = domain, .interfaces = {"lo"}}),
        request_(participant_.create_writer(idl::teach_request_topic, dds::TypeSupport(new msg::TeachRequestPubSubType),
                                            idl::teach_writer_qos(), "")),
        reply_(participant_.create_reader(idl::teach_reply_topic, dds::TypeSupport(new msg::TeachReplyPubSubType),
                                          idl::teach_reader_qos())),
        scene_(participant_.create_reader(idl::scene_topic, dds::TypeSupport(new msg::ScenePubSubType),
                                          idl::status_reader_qos())),
        position_(participant_.create_reader(idl::object_position_topic,
                                             dds::TypeSupport(new msg::ObjectPositionPubSubType),
                                             idl::object_position_reader_qos())) {}

  // Everything that has come.
  void listen() {
    take<msg::Scene>(scene_, [&](const auto& s) { scene = s; });
    take<msg::ObjectPosition>(position_, [&](const auto& s) { positions.push_back(s); });
    take<msg::TeachReply>(reply_, [&](const auto& s) {
      if (s.client() == "test") replies.push_back(s);
    });
  }

  msg::TeachReply ask(msg::TeachAction action, const std::vector<msg::TeachPoint>& points = {}) {
    last_ = {};
    last_.client("test");
    last_.number(++number_);
    last_.host(scene->host());
    last_.pid(scene->pid());
    last_.action(action);
    last_.target("lime");
    last_.points(points);
    return ask_again();
  }

  msg::TeachReply ask_again() {
    replies.clear();
    bool has_come = false;
    for (int attempt = 0; attempt < 3 && !has_come; ++attempt) {  // as the page: the first may be before they have met
      request_.write(&last_);
      has_come = comes_true(
          [&] {
            listen();
            return !replies.empty() && replies.back().number() == number_;
          },
          7s);
    }
    if (!has_come) throw std::runtime_error("no reply to the request");
    return replies.back();
  }

  std::optional<msg::Scene> scene;
  std::vector<msg::ObjectPosition> positions;
  std::vector<msg::TeachReply> replies;

 private:
  template <typename Sample>
  static void take(dds::DataReader& reader, const std::function<void(const Sample&)>& use) {
    Sample sample;
    dds::SampleInfo info;
    while (reader.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) use(sample);
  }

  idl::DdsParticipant participant_;
  dds::DataWriter& request_;
  dds::DataReader &reply_, &scene_, &position_;
  std::uint32_t number_ = 0;
  msg::TeachRequest last_;
};

msg::TeachPoint point(const std::string& camera, double u, double v) {
  msg::TeachPoint p;
  p.camera(camera);
  p.pixel({u, v});
  return p;
}

// Where a user would click: in the middle of what is greenest, the least blue and red.
msg::TeachPoint lime_in(const msg::TeachCamera& camera) {
  const std::vector<std::uint8_t> jpeg(camera.jpeg().begin(), camera.jpeg().end());
  const auto decoded = capture::JpegDecoder().decode(jpeg);
  if (!decoded.image) throw std::runtime_error(decoded.problem);
  const capture::Plane &blue = decoded.image->planes[1], &red = decoded.image->planes[2];
  const int width = decoded.image->width / 2, height = decoded.image->height / 2;  // of chroma
  const auto at = [&](int u, int v) { return blue.data[v * blue.stride + u] + red.data[v * red.stride + u]; };
  int best_u = 0, best_v = 0;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (at(u, v) < at(best_u, best_v)) best_u = u, best_v = v;
  double sum_u = 0, sum_v = 0, count = 0;
  for (int v = std::max(0, best_v - 10); v < std::min(height, best_v + 10); ++v)
    for (int u = std::max(0, best_u - 10); u < std::min(width, best_u + 10); ++u)
      if (at(u, v) < at(best_u, best_v) + 20) sum_u += u, sum_v += v, ++count;
  return point(camera.camera(), 2 * sum_u / count + 0.5, 2 * sum_v / count + 0.5);
}

class TeachLive : public Test {
 protected:
  void SetUp() override {
    soak::make_films(folder, 2, 320, 240);
    write(true);
    service.emplace(std::vector<std::string>{FILM_SERVICE, config.string(), folder.string(), "--phases", "together"},
                    folder / "out", folder / "err");
    ASSERT_TRUE(comes_true([&] {
      page.listen();
      return page.scene && page.positions.size() > 4;
    })) << service->err();
  }
  ~TeachLive() override {
    service.reset();
    fs::remove_all(folder);
  }
  void write(bool may_teach) const {
    std::ofstream(config) << "# the lab's\nversion: 1\ncontrol: {allow_teach: " << (may_teach ? "true" : "false")
                          << "}  # first of all\nrig: " << (folder / "rig.yaml").string()
                          << "\ntargets:\n  lime:   # the ball\n    color: {hue_deg: [200, 220]}   # wrong\n"
                             "    radius_m: 0.05\n"
                             "cameras: {cam0: {device: 0, fps: 30}, cam1: {device: 1, fps: 30}}\n"
                             "dds: {domain: "
                          << domain << ", interfaces: [lo]}  # last\n";
  }
  const fs::path folder = fs::path(TempDir()) / ("teach_live_" + std::to_string(::getpid()));
  const fs::path config = folder / "c.yaml", taught = folder / "c.taught.yaml";
  std::optional<Process> service;
  Page page;
};

TEST_F(TeachLive, TheRunningServiceTakesTheColourOverWithoutARestart) {
  EXPECT_TRUE(page.scene->may_teach());
  EXPECT_EQ(page.scene->pid(), std::uint32_t(service->pid()));
  EXPECT_EQ(page.positions.back().state(), msg::TRACK_STATE_SEARCHING);  // of a colour that nothing has

  // At some moments of the film one click does not tell the ball in the other view: then nothing is suggested, and
  // whoever teaches takes another picture.
  msg::TeachReply frozen, one;
  std::vector<msg::TeachPoint> points;
  ASSERT_TRUE(comes_true([&] {
    frozen = page.ask(msg::TEACH_ACTION_FREEZE);
    if (!frozen.granted() || frozen.cameras().size() != 2) return false;
    points = {lime_in(frozen.cameras()[0])};
    one = page.ask(msg::TEACH_ACTION_LOOK, points);
    return one.granted() && !std::isnan(one.cameras()[1].region_pixel()[0]);
  })) << frozen.reason()
      << one.reason();
  EXPECT_TRUE(one.cameras()[0].pointed());
  EXPECT_FALSE(one.cameras()[1].pointed());
  const auto& suggested = one.cameras()[1].region_pixel();  // what the page marks with a dashed ring
  const msg::TeachPoint seen = lime_in(frozen.cameras()[1]);
  EXPECT_NEAR(suggested[0], seen.pixel()[0], 4);
  EXPECT_NEAR(suggested[1], seen.pixel()[1], 4);
  points.push_back(point("cam1", suggested[0], suggested[1]));
  const std::string before = contents(config);
  ASSERT_TRUE(page.ask(msg::TEACH_ACTION_LOOK, points).granted());
  EXPECT_FALSE(fs::exists(taught));  // looking writes nothing

  const msg::TeachReply saved = page.ask(msg::TEACH_ACTION_APPLY, points);
  ASSERT_TRUE(saved.granted()) << saved.reason();
  EXPECT_THAT(saved.reason(), AllOf(StartsWith("Saved: lime"), HasSubstr("written into " + taught.string() + ".")));
  EXPECT_EQ(contents(config), before);  // the user's own
  EXPECT_THAT(contents(taught), AllOf(StartsWith("# What huetrackd was taught"), HasSubstr("\n  lime:\n    color:\n"),
                                      Not(HasSubstr("radius_m"))));
  const color::HsiRange learnt = config::load_service_config(config).targets[0].color;
  EXPECT_GT(learnt.hue_min_deg, 40);
  EXPECT_LT(learnt.hue_max_deg, 140);

  page.positions.clear();
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return !page.positions.empty() && page.positions.back().state() == msg::TRACK_STATE_TRACKING;
  })) << "the service does not track with the new colour: "
      << service->err();
  // No set was lost on the way, but on a machine that stands still for a third of a second.
  EXPECT_LT(page.positions.back().set_number() - page.positions.front().set_number(), page.positions.size() + 10);
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return page.scene->targets()[0].colors()[0].hue_deg()[0] == learnt.hue_min_deg;
  })) << "the scene does not say the new colour";
  EXPECT_FALSE(service->has_ended());

  // Without that file, the configuration alone counts again.
  fs::remove(taught);
  service->kill(SIGHUP);
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return page.scene->targets()[0].colors()[0].hue_deg()[0] == 200;
  })) << "the scene does not say the configuration's colour";
}

// Who waits for long asks again; pictures taken a second time would not be those that are shown.
TEST_F(TeachLive, ARequestThatComesAgainTakesNoOtherPictures) {
  const msg::TeachReply frozen = page.ask(msg::TEACH_ACTION_FREEZE);
  ASSERT_TRUE(frozen.granted()) << frozen.reason();
  page.positions.clear();
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return page.positions.size() > 5;
  }));
  EXPECT_EQ(page.ask_again().set_number(), frozen.set_number());
  EXPECT_GT(page.ask(msg::TEACH_ACTION_FREEZE).set_number(), frozen.set_number() + 5);
}

TEST_F(TeachLive, ItIsRefusedWithAReasonOnceTheConfigurationForbidsIt) {
  const auto ball = lime_in(page.ask(msg::TEACH_ACTION_FREEZE).cameras().at(0));
  write(false);
  const std::string before = contents(config);
  service->kill(SIGHUP);
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return !page.scene->may_teach();
  }));
  EXPECT_THAT(page.scene->why_not(), HasSubstr("allow_teach: true"));
  for (const auto action :
       {msg::TEACH_ACTION_FREEZE, msg::TEACH_ACTION_LOOK, msg::TEACH_ACTION_APPLY, msg::TEACH_ACTION_IGNORE}) {
    const msg::TeachReply reply = page.ask(action, {ball});
    EXPECT_FALSE(reply.granted());
    EXPECT_THAT(reply.reason(), HasSubstr("The configuration does not allow it. Set control: {allow_teach: true} in"));
  }
  EXPECT_EQ(contents(config), before);
}

}  // namespace
}  // namespace huetrack::end_to_end
