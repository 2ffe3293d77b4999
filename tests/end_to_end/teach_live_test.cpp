// A colour taught to the live service while it runs, over DDS as a page does it: `huetrackd run` on films, in a process
// of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/service_config.h"
#include "end_to_end/process.h"
#include "end_to_end/teaching_page.h"
#include "publish/test_domain.h"
#include "soak/films.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using namespace testing;

const int domain = publish::test_domain();

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
  TeachingPage page{domain};
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

// The cameras of a recording seldom begin at one moment: it is held when each has shown something.
TEST(TeachHeld, AllCamerasOfAReplayThatIsHeldMayBePointedInto) {
  const fs::path folder = fs::path(TempDir()) / ("teach_held_" + std::to_string(::getpid()));
  const fs::path demo = fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording", config = folder / "c.yaml";
  fs::create_directories(folder);
  const std::string frames = "{frames: " + demo.string();
  std::ofstream(folder / "recording.yaml") << "version: 1\ncameras:\n  cam0: " << frames << "/cam0.mkv, fps: 30}\n"
                                           << "  cam1: " << frames << "/cam1.mkv, fps: 30, offset_s: 0.12}\n";
  std::ofstream(config) << "version: 1\ncontrol: {allow_teach: true}\nrig: " << (demo / "rig.yaml").string()
                        << "\ntargets: {lime: {}}\ndds: {domain: " << domain << ", interfaces: [lo]}\n";
  Process replay({HUETRACKD, "replay", config, folder, "--hold", "--quiet"}, folder / "out", folder / "err");
  TeachingPage page(domain);
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return page.scene.has_value();
  })) << replay.err();
  msg::TeachReply frozen;
  EXPECT_TRUE(comes_true([&] {
    frozen = page.ask(msg::TEACH_ACTION_FREEZE);
    return frozen.granted() && frozen.cameras().size() == 2 &&
           std::ranges::none_of(frozen.cameras(), [](const auto& camera) { return camera.jpeg().empty(); });
  })) << frozen.reason();
  EXPECT_FALSE(replay.has_ended());
  ASSERT_TRUE(page.ask(msg::TEACH_ACTION_RESUME).granted());
  EXPECT_EQ(replay.wait(), 0) << replay.err();
  fs::remove_all(folder);
}

}  // namespace
}  // namespace huetrack::end_to_end
