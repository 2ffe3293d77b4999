// Requests of pages are refused if the configuration does not allow them.
#include "page/teaching_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <thread>

#include "config/taught_file.h"
#include "scene/scene.h"

namespace huetrack::page {
namespace {

using namespace testing;

struct Desk {
  bool resumed = false, reloaded = false;
  TeachingSession session{{.reload =
                               [this] {
                                 reloaded = true;
                                 return std::string();
                               },
                           .resume = [this] { resumed = true; }}};
};

msg::TeachRequest request_of(msg::TeachAction action) {
  msg::TeachRequest request;
  request.client("a page");
  request.action(action);
  return request;
}

config::ServiceConfig config_that_allows(bool teaching) {
  config::ServiceConfig c =
      config::load_service_config(std::filesystem::path(HUETRACK_SOURCE_DIR) / "configs/demo/huetrackd.yaml");
  c.control.allow_teach = teaching;
  return c;
}

TEST(TeachingSession, RefusesWithoutPermission) {
  for (const auto action : {msg::TEACH_ACTION_RESUME, msg::TEACH_ACTION_LOOK, msg::TEACH_ACTION_APPLY,
                            msg::TEACH_ACTION_IGNORE, msg::TEACH_ACTION_UNDO}) {
    Desk of;
    const msg::TeachReply reply = of.session.answer(request_of(action), config_that_allows(false));
    EXPECT_FALSE(reply.granted()) << int(action);
    EXPECT_THAT(reply.reason(), HasSubstr("allow_teach")) << int(action);
    EXPECT_FALSE(of.resumed) << int(action);
    EXPECT_FALSE(of.reloaded) << int(action);
  }
}

TEST(TeachingSession, AHeldReplayContinuesWithPermission) {
  Desk of;
  EXPECT_TRUE(of.session.answer(request_of(msg::TEACH_ACTION_RESUME), config_that_allows(true)).granted());
  EXPECT_TRUE(of.resumed);
}

TEST(TeachingSession, ASaveIsUndone) {
  const std::filesystem::path folder =
      std::filesystem::path(TempDir()) / ("teaching_session_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  config::ServiceConfig config = config_that_allows(true);
  config.file = folder / "c.yaml";
  std::ofstream(config.file) << "version: 1\nrig: " << config.rig_file.string()
                             << "\ntargets: {ball: {radius_m: 0.04, color: {hue_deg: [10, 30]}}}\n";
  Desk nothing;
  const msg::TeachReply refused = nothing.session.answer(request_of(msg::TEACH_ACTION_UNDO), config);
  EXPECT_FALSE(refused.granted());
  EXPECT_THAT(refused.reason(), HasSubstr("nothing to undo"));
  EXPECT_FALSE(nothing.reloaded);

  const auto hue = [&] { return config::load_service_config(config.file).targets.at(0).color.hue_min_deg; };
  object_tracking::TargetOptions target = config::load_service_config(config.file).targets.at(0);
  target.color.hue_min_deg = 20;
  config::save_taught(config.file, target, {});
  ASSERT_EQ(hue(), 20);
  Desk of;
  const msg::TeachReply reply = of.session.answer(request_of(msg::TEACH_ACTION_UNDO), config);
  EXPECT_TRUE(reply.granted()) << reply.reason();
  EXPECT_THAT(reply.reason(), HasSubstr("c.taught.yaml is as it was before the last save"));
  EXPECT_TRUE(of.reloaded);
  EXPECT_EQ(hue(), 10);
  config::redo_taught(config.file);
  EXPECT_EQ(hue(), 20);
  std::filesystem::remove_all(folder);
}

// A replay that is held shows one moment. What rests and has the colour is told from the ball by others of the
// recording.
TEST(TeachingSession, AHeldReplayKnowsWhatMoves) {
  const auto circling = [](double t) { return Eigen::Vector3d(0.5 * std::cos(3 * t), 0.5 * std::sin(3 * t), 1.2); };
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3}).ball({.path = circling});
  for (const Eigen::Vector3d& at :
       {Eigen::Vector3d(-0.6, 0.3, 1.2), {0.2, -0.7, 1.2}, {0.1, 0.1, 1.2}, {0.7, 0.6, 1.25}})
    builder.ball({.name = "other", .path = [at](double) { return at; }});
  const scene::Scene world = builder.build();
  const auto sets = scene::render(world, {.set_count = 60});
  config::ServiceConfig config = config_that_allows(true);
  config.rig = world.rig;
  config.object_tracking.volume = {.min = {-1, -1, 0}, .max = {1, 1, 2}};

  const auto suggested = [&](std::size_t of, bool is_recorded) {
    TeachingSession::Actions actions{.reload = [] { return std::string(); }, .resume = {}};
    if (is_recorded) {
      actions.moments = [&](const std::stop_token&) {
        std::vector<capture::FrameSet> moments;
        for (std::size_t i = 0; i < sets.size(); i += 4) moments.push_back(sets[i]);
        return moments;
      };
    }
    TeachingSession session{actions};
    EXPECT_TRUE(session.freeze(request_of(msg::TEACH_ACTION_FREEZE), config, sets[of]).granted());
    msg::TeachRequest look = request_of(msg::TEACH_ACTION_LOOK);
    look.target(config.targets[0].name);
    msg::TeachPoint& point = look.points().emplace_back();
    const Eigen::Vector3d ball = world.ball_at(0, sets[of].at);
    const Eigen::Vector2d px = world.rig.cameras[0].project_world(ball)->px;
    point.camera(world.rig.cameras[0].name);
    point.pixel({px.x(), px.y()});
    const auto right_now = [&] {
      const msg::TeachReply reply = session.answer(look, config);
      int right = 0;
      for (std::size_t c = 1; c < 3; ++c) {
        const auto& at = reply.cameras()[c].region_pixel();
        const Eigen::Vector2d truth = world.rig.cameras[c].project_world(ball)->px;
        right += (Eigen::Vector2d(at[0], at[1]) - truth).norm() < 4 ? 1 : 0;
      }
      return right;
    };
    int right = right_now();
    for (int i = 0; is_recorded && right < 2 && i < 20; ++i) {  // they are read beside this
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      right = right_now();
    }
    return right;
  };
  int by_one_moment = 0, by_all = 0, asked = 0;
  for (std::size_t of = 0; of < sets.size(); of += 12, asked += 2) {
    by_one_moment += suggested(of, false);
    by_all += suggested(of, true);
  }
  EXPECT_GT(by_all, by_one_moment);
  EXPECT_GE(by_all, asked * 8 / 10);
}

// Without poses nothing is suggested, and the size of the object is unknown.
TEST(TeachingSession, EachPictureTeachesBeforeTheCalibration) {
  const scene::Scene world = scene::SceneBuilder().cameras_on_ring({.count = 2}).ball({}).build();
  const auto sets = scene::render(world, {.set_count = 1});
  config::ServiceConfig config = config_that_allows(true);
  config.rig = world.rig;
  config.rig_file.clear();
  config.targets[0].is_radius_assumed = true;
  TeachingSession session{{.reload = [] { return std::string(); }, .resume = {}}};
  ASSERT_TRUE(session.freeze(request_of(msg::TEACH_ACTION_FREEZE), config, sets[0]).granted());
  msg::TeachRequest look = request_of(msg::TEACH_ACTION_LOOK);
  look.target(config.targets[0].name);
  for (std::size_t c = 0; c < 2; ++c) {
    msg::TeachPoint& point = look.points().emplace_back();
    const Eigen::Vector2d px = world.rig.cameras[c].project_world(world.ball_at(0, sets[0].at))->px;
    point.camera(world.rig.cameras[c].name);
    point.pixel({px.x(), px.y()});
    const msg::TeachReply reply = session.answer(look, config);
    EXPECT_TRUE(reply.granted()) << reply.reason();
    EXPECT_THAT(reply.reason(), AllOf(StartsWith(c == 0 ? "Learnt from 1 of 2" : "Learnt from 2 of 2"),
                                      HasSubstr("cannot be measured: the cameras are not calibrated yet")));
    EXPECT_TRUE(std::isnan(reply.radius_m()));
    if (c > 0) continue;
    EXPECT_TRUE(std::isnan(reply.cameras()[1].region_pixel()[0])) << "nothing is suggested";
    EXPECT_THAT(reply.cameras()[1].verdict(), HasSubstr("point at the object, if it is in this picture"));
  }
}

// The views differ in the ball's size by a third: the lens of one is wrong. That is said once the user has confirmed
// it.
TEST(TeachingSession, ARadiusIsOnlyMissedOnceAllIsConfirmed) {
  const Eigen::Vector3d at(0, 0, 1);
  const scene::Scene world =
      scene::SceneBuilder().cameras_on_ring({.count = 2}).ball({.path = [at](double) { return at; }}).build();
  config::ServiceConfig config = config_that_allows(true);
  config.rig = world.rig;
  auto lens = std::get<calib::PinholeRadtan>(world.rig.cameras[1].model.lens());
  lens.fx *= 1.35, lens.fy *= 1.35;
  config.rig.cameras[1].model = calib::CameraModel(lens);
  TeachingSession session{{.reload = [] { return std::string(); }, .resume = {}}};
  ASSERT_TRUE(session.freeze(request_of(msg::TEACH_ACTION_FREEZE), config, scene::render(world, {.set_count = 1})[0])
                  .granted());
  msg::TeachRequest look = request_of(msg::TEACH_ACTION_LOOK);
  look.target(config.targets[0].name);
  for (std::size_t c = 0; c < 2; ++c) {
    const Eigen::Vector2d px = world.rig.cameras[c].project_world(at)->px;
    msg::TeachPoint& point = look.points().emplace_back();
    point.camera(world.rig.cameras[c].name);
    point.pixel({px.x(), px.y()});
    const msg::TeachReply reply = session.answer(look, config);
    const std::string reason = reply.reason();
    EXPECT_TRUE(std::isnan(reply.radius_m()));
    EXPECT_THAT(reason, HasSubstr(c == 0 ? "Confirm it where the dashed ring is: " : "Learnt from 2 of 2"));
    EXPECT_EQ(reason.find("cannot be measured") != std::string::npos, c == 1) << reason;
  }
}

// `huetrackd teach` tracks a recording by the colour before it saves it.
TEST(TeachingSession, ASaveSaysThatTheRecordingWasNotTriedWithIt) {
  const std::filesystem::path folder =
      std::filesystem::path(TempDir()) / ("teaching_untried_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const scene::Scene world = scene::SceneBuilder().cameras_on_ring({.count = 2}).ball({}).build();
  const auto sets = scene::render(world, {.set_count = 1});
  config::ServiceConfig config = config_that_allows(true);
  config.file = folder / "c.yaml";
  std::ofstream(config.file) << "version: 1\nrig: " << config.rig_file.string() << "\ntargets: {"
                             << config.targets[0].name << ": {radius_m: 0.04}}\n";
  config.rig = world.rig;
  for (const bool is_recording : {false, true}) {
    TeachingSession::Actions actions{.reload = [] { return std::string(); }, .resume = {}};
    if (is_recording) actions.moments = [&](const std::stop_token&) { return sets; };
    TeachingSession session{actions};
    ASSERT_TRUE(session.freeze(request_of(msg::TEACH_ACTION_FREEZE), config, sets[0]).granted());
    msg::TeachRequest apply = request_of(msg::TEACH_ACTION_APPLY);
    apply.target(config.targets[0].name);
    const Eigen::Vector2d px = world.rig.cameras[0].project_world(world.ball_at(0, sets[0].at))->px;
    msg::TeachPoint& point = apply.points().emplace_back();
    point.camera(world.rig.cameras[0].name);
    point.pixel({px.x(), px.y()});
    const std::string reason = session.answer(apply, config).reason();
    EXPECT_THAT(reason, StartsWith("Saved: "));
    EXPECT_EQ(reason.find("The recording was not tried with it") != std::string::npos, is_recording) << reason;
  }
  std::filesystem::remove_all(folder);
}

TEST(TeachingSession, AnUnreadableRecordingIsReported) {
  const scene::Scene world = scene::SceneBuilder().cameras_on_ring({.count = 2}).ball({}).build();
  const auto sets = scene::render(world, {.set_count = 1});
  config::ServiceConfig config = config_that_allows(true);
  config.rig = world.rig;
  TeachingSession::Actions actions{.reload = [] { return std::string(); }, .resume = {}};
  actions.moments = [](const std::stop_token&) -> std::vector<capture::FrameSet> {
    throw std::runtime_error("a.mkv is gone");
  };
  TeachingSession session{actions};
  ASSERT_TRUE(session.freeze(request_of(msg::TEACH_ACTION_FREEZE), config, sets[0]).granted());
  msg::TeachRequest look = request_of(msg::TEACH_ACTION_LOOK);
  look.target(config.targets[0].name);
  const Eigen::Vector2d px = world.rig.cameras[0].project_world(world.ball_at(0, sets[0].at))->px;
  msg::TeachPoint& point = look.points().emplace_back();
  point.camera(world.rig.cameras[0].name);
  point.pixel({px.x(), px.y()});
  std::string reason = session.answer(look, config).reason();
  for (int i = 0; reason.find("a.mkv is gone") == std::string::npos && i < 100; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    reason = session.answer(look, config).reason();
  }
  EXPECT_THAT(reason, HasSubstr("Motion is unknown: a.mkv is gone."));
}

}  // namespace
}  // namespace huetrack::page
