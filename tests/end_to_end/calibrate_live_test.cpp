// The cameras of a running service, calibrated by command from the ball that is waved before them, and used at once:
// `huetrackd run` on films, `huetrack control`, `huetrack-calibrate`: processes of their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "end_to_end/process.h"
#include "publish/test_domain.h"
#include "soak/films.h"
#include "solver/synthetic_rig.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace testing;

class CalibrateLive : public Test {
 protected:
  static constexpr double period_s = 8;  // of the ball's way, so that a film of it can be looped
  static Eigen::Vector3d waved(double t_s) {
    const double a = 2 * std::numbers::pi * t_s / period_s;
    return {0.55 * std::sin(2 * a), 0.55 * std::sin(3 * a + 0.7), 1 + 0.35 * std::sin(5 * a + 0.3)};
  }
  void SetUp() override {
    scene::BallOptions ball;
    ball.path = waved;
    const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball(ball).build();
    constexpr double fps = 20;
    soak::write_films(folder, scene, {.set_count = int(period_s * fps), .fps = fps});
    truth = spoiled = scene.rig;
    for (std::size_t c = 0; c < spoiled.cameras.size(); ++c) {  // as after a knock: turned by a degree, moved by 3 mm
      const Eigen::Vector3d axis =
          Eigen::Vector3d(std::cos(2.1 * double(c)), std::sin(2.1 * double(c)), 0.3).normalized();
      const Eigen::Quaterniond turned(Eigen::AngleAxisd(std::numbers::pi / 180, axis));
      calib::Rigid3d& pose = spoiled.cameras[c].cam_from_world;
      pose = {turned * pose.rotation, turned * pose.translation + 0.003 * Eigen::Vector3d(0.6, -0.8, 0)};
    }
    calib::write_rig(spoiled, folder / "rig.yaml");
    std::string config = soak::film_config(folder, 300,
                                           "record: {folder: recordings, pre_roll_s: 8.5, after_s: 0, on_lost: false}\n"
                                           "control: {allow_record: true, allow_teach: true}\ndds: {domain: " +
                                               std::to_string(publish::test_domain()) + ", interfaces: [lo]}\n");
    for (std::size_t at = 0; (at = config.find("fps: 30", at)) != std::string::npos;) config.replace(at, 7, "fps: 20");
    std::ofstream(folder / "c.yaml") << config;
    service.emplace(
        std::vector<std::string>{FILM_SERVICE, (folder / "c.yaml").string(), folder.string(), "--phases", "together"},
        folder / "service.out", folder / "service.err",
        std::map<std::string, std::string>{
            {"PATH", fs::path(HUETRACK_CALIBRATE).parent_path().string() + ":/usr/bin:/bin"}});
  }
  ~CalibrateLive() override {
    service.reset();
    fs::remove_all(folder);
  }
  struct Result {
    int status;
    std::string out, err;
  };
  Result control(std::vector<std::string> words) const {
    words.insert(words.begin(), {HUETRACK, "control"});
    words.insert(words.end(), {"--domain", std::to_string(publish::test_domain()), "--interface", "lo"});
    Process process(words, folder / "out", folder / "err");
    const int status = process.wait();
    return {status, process.out(), process.err()};
  }
  // How far the second camera is from standing to the first one as it does, as a turn.
  double turned_deg(const calib::CameraRig& rig) const {
    const auto between = [](const calib::CameraRig& of) {
      return of.cameras[1].cam_from_world.rotation * of.cameras[0].cam_from_world.rotation.conjugate();
    };
    return between(truth).angularDistance(between(rig)) * 180 / std::numbers::pi;
  }
  double off_m(const calib::CameraRig& rig) const {
    return solver::volume_rms_m(truth, rig, {-0.5, -0.5, 0.7}, {0.5, 0.5, 1.3});
  }
  const fs::path folder = fs::path(TempDir()) / ("calibrate_live_" + std::to_string(::getpid()));
  calib::CameraRig truth, spoiled;
  std::optional<Process> service;
};

TEST_F(CalibrateLive, FromWhatWasWavedJustNow) {
  ASSERT_TRUE(comes_true([&] { return control({"calibrate", "state"}).status == 0; })) << service->err();
  EXPECT_THAT(control({"calibrate", "wave", "none"}).err, HasSubstr("no target none"));
  std::this_thread::sleep_for(std::chrono::seconds(9));  // that is waved
  const Result begun = control({"calibrate", "wave", "lime"});
  ASSERT_EQ(begun.status, 0) << begun.err;
  EXPECT_THAT(begun.err, HasSubstr("Calibrating from the last 8.5 s"));
  std::string state;
  ASSERT_TRUE(comes_true(
      [&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        state = control({"calibrate", "state"}).out;
        return std::ranges::any_of(std::array{"usable", "doubtful", "failed"},
                                   [&](const std::string& end) { return state.starts_with("state\t" + end + "\n"); });
      },
      std::chrono::seconds(120)))
      << state << service->err();
  // The distances between the cameras are known from the rig alone, which was knocked: that is said.
  EXPECT_THAT(state, AllOf(HasSubstr("state\tdoubtful\n"), HasSubstr("the scale is from the rig's own poses")));
  EXPECT_THAT(state,
              AllOf(HasSubstr("kind\twave\n"), HasSubstr("report\ttrue\n"), HasSubstr("the rms error of the ball is")));
  ASSERT_EQ(control({"calibrate", "report", "--out", (folder / "report.html").string()}).status, 0);
  EXPECT_THAT(contents(folder / "report.html"), AllOf(StartsWith("<!doctype html>"), HasSubstr("waved object")));

  EXPECT_THAT(control({"calibrate", "accept"}).err, HasSubstr("use it with accept doubtful"));
  EXPECT_FALSE(fs::exists(folder / "c.taught.yaml"));
  const Result accepted = control({"calibrate", "accept", "doubtful"});
  ASSERT_EQ(accepted.status, 0) << accepted.err;
  EXPECT_THAT(accepted.err, AllOf(HasSubstr("Accepted: c.rig-"), HasSubstr("restarts")));
  fs::path found;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().filename().string().starts_with("c.rig-")) found = entry.path();
  ASSERT_FALSE(found.empty());
  EXPECT_GT(turned_deg(spoiled), 1);
  EXPECT_LT(turned_deg(calib::read_rig(found)), 0.1);
  EXPECT_LT(off_m(calib::read_rig(found)), 0.006);
  EXPECT_THAT(contents(folder / "c.taught.yaml"), HasSubstr(found.string()));
  EXPECT_EQ(contents(folder / "rig.yaml"), calib::to_yaml(spoiled)) << "the old one is kept";
  ASSERT_TRUE(
      comes_true([&] { return contents(folder / "service.err").find("restarting with") != std::string::npos; }));
  ASSERT_TRUE(comes_true([&] { return control({"calibrate", "state"}).status == 0; })) << service->err();
  EXPECT_THAT(control({"calibrate", "state"}).out, HasSubstr("state\taccepted\n"));

  // What it was made from is deleted.
  std::string name;
  for (const auto& entry : fs::directory_iterator(folder / "recordings")) name = entry.path().filename();
  EXPECT_THAT(name, EndsWith("-wave"));
  EXPECT_EQ(control({"record", "delete", name}).status, 0);
  EXPECT_TRUE(fs::is_empty(folder / "recordings"));
  EXPECT_THAT(control({"record", "delete", name}).err, HasSubstr("There is no recording"));
}

}  // namespace
}  // namespace huetrack::end_to_end
