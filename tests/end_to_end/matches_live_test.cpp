// Cameras of another host that send which pixels match, as a user has them: a camera host on films, trackers and a
// page, each a process or a participant of its own. What changes a colour while they run.
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

class MatchesLive : public Test {
 protected:
  void SetUp() override {
    soak::make_films(folder, 2, 320, 240);
    std::ofstream(folder / "host.yaml") << "version: 1\nhost: films\n"
                                        << bus << "cameras:\n"
                                        << camera_of_host(0) << camera_of_host(1);
    host.emplace(std::vector<std::string>{FILM_HOST, folder.string(), (folder / "host.yaml").string()},
                 folder / "host.out", folder / "host.err");
  }
  ~MatchesLive() override {
    trackers.clear();
    host.reset();
    fs::remove_all(folder);
  }
  static std::string camera_of_host(int c) {
    const std::string name = "cam" + std::to_string(c);
    return "  " + name + ": {device: /dev/film/" + name + ", size: [320, 240], format: mjpeg, fps: 30}\n";
  }
  // Returns the configuration's path.
  fs::path track(const std::string& name, const std::string& target) {
    const fs::path config = folder / (name + ".yaml");
    std::ofstream(config) << "version: 1\ncontrol: {allow_teach: true}\nrig: " << (folder / "rig.yaml").string()
                          << "\ntargets:\n  " << name << ": {radius_m: 0.05, " << target << "}\n"
                          << "cameras:\n  cam0: {host: films, camera: cam0, send: matches, picture_every_s: 0.5}\n"
                          << "  cam1: {host: films, camera: cam1, send: matches, picture_every_s: 0.5}\n"
                          << bus;
    trackers.push_back(std::make_unique<Process>(
        std::vector<std::string>{HUETRACKD, "run", config.string(), "--tracks", (folder / (name + ".csv")).string()},
        folder / (name + ".out"), folder / (name + ".err")));
    return config;
  }
  // Positions of this target that were tracked, of those that came since the last call.
  std::size_t tracked(const std::string& target) {
    page.listen();
    const auto count = std::ranges::count_if(
        page.positions, [&](const auto& p) { return p.target() == target && p.state() == msg::TRACK_STATE_TRACKING; });
    std::erase_if(page.positions, [&](const auto& p) { return p.target() == target; });
    return std::size_t(count);
  }
  bool comes_to_track(const std::string& target, std::size_t positions = 30) {
    std::size_t sum = 0;
    return comes_true([&] {
      sum += tracked(target);
      return sum >= positions;
    });
  }

  const fs::path folder = fs::path(TempDir()) / ("matches_live_" + std::to_string(::getpid()));
  const int on_domain = publish::test_domain();
  const std::string bus = "dds: {domain: " + std::to_string(on_domain) + ", interfaces: [lo]}\n";
  std::optional<Process> host;
  std::vector<std::unique_ptr<Process>> trackers;
  TeachingPage page{on_domain};
};

TEST_F(MatchesLive, AColourIsTaughtTakenBackAndReloaded) {
  const fs::path config = track("lime", "color: {hue_deg: [200, 220]}");  // of a colour that nothing has
  ASSERT_TRUE(comes_true([&] {
    page.listen();
    return page.scene && page.positions.size() > 4;
  })) << trackers[0]->err();
  msg::TeachReply frozen, one;
  std::vector<msg::TeachPoint> points;
  ASSERT_TRUE(comes_true([&] {
    frozen = page.ask(msg::TEACH_ACTION_FREEZE);
    if (!frozen.granted() || frozen.cameras().size() != 2) return false;
    // The first pictures come with the first half second.
    if (frozen.cameras()[0].jpeg().empty() || frozen.cameras()[1].jpeg().empty()) return false;
    points = {lime_in(frozen.cameras()[0]), lime_in(frozen.cameras()[1])};
    one = page.ask(msg::TEACH_ACTION_LOOK, points);
    return one.granted();
  })) << frozen.reason()
      << one.reason();
  const msg::TeachReply saved = page.ask(msg::TEACH_ACTION_APPLY, points);
  ASSERT_TRUE(saved.granted()) << saved.reason();
  const color::HsiRange learnt = config::load_service_config(config).targets[0].color;
  EXPECT_GT(learnt.hue_min_deg, 40);
  EXPECT_LT(learnt.hue_max_deg, 140);
  page.positions.clear();
  EXPECT_TRUE(comes_to_track("lime")) << trackers[0]->err();
  fs::remove(folder / "lime.taught.yaml");
  trackers[0]->kill(SIGHUP);
  EXPECT_TRUE(comes_true([&] {
    page.listen();
    return page.scene->targets()[0].colors()[0].hue_deg()[0] == 200 && !page.positions.empty() &&
           page.positions.back().state() != msg::TRACK_STATE_TRACKING;
  })) << "the configuration's colour does not count again";
}

// Each is told what matches its own colours, in the same frames.
TEST_F(MatchesLive, TwoTrackersLookForTheirOwnColours) {
  track("wide", "color: {hue_deg: [60, 120]}");
  track("narrow", "color: {hue_deg: [70, 110], saturation: [0.3, 1]}");
  EXPECT_TRUE(comes_to_track("wide")) << trackers[0]->err();
  EXPECT_TRUE(comes_to_track("narrow")) << trackers[1]->err();
  // One goes: the other tracks on.
  trackers.pop_back();
  tracked("wide");
  EXPECT_TRUE(comes_to_track("wide", 60)) << trackers[0]->err();
}

// The range follows the ball's colour, and the host is told of it again and again.
TEST_F(MatchesLive, AColourThatIsAdaptedIsTrackedThroughout) {
  track("lime", "color: {hue_deg: [60, 135], adapt: true}");
  ASSERT_TRUE(comes_to_track("lime")) << trackers[0]->err();
  page.positions.clear();
  EXPECT_TRUE(comes_true([&] {
    page.listen();
    return page.positions.size() >= 240;
  }));
  const auto not_tracked =
      std::ranges::count_if(page.positions, [](const auto& p) { return p.state() != msg::TRACK_STATE_TRACKING; });
  EXPECT_LT(not_tracked, 12) << trackers[0]->err();
}

}  // namespace
}  // namespace huetrack::end_to_end
