// What pages ask is refused, whatever it is, where the configuration does not allow it.
#include "page/teach_desk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "config/taught_file.h"

namespace huetrack::page {
namespace {

using namespace testing;

struct Desk {
  bool resumed = false, reloaded = false;
  TeachDesk desk{{.reload =
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

TEST(TeachDesk, NothingIsDoneForWhoMayNotTeach) {
  for (const auto action : {msg::TEACH_ACTION_RESUME, msg::TEACH_ACTION_LOOK, msg::TEACH_ACTION_APPLY,
                            msg::TEACH_ACTION_IGNORE, msg::TEACH_ACTION_UNDO}) {
    Desk of;
    const msg::TeachReply reply = of.desk.answer(request_of(action), config_that_allows(false));
    EXPECT_FALSE(reply.granted()) << int(action);
    EXPECT_THAT(reply.reason(), HasSubstr("allow_teach")) << int(action);
    EXPECT_FALSE(of.resumed) << int(action);
    EXPECT_FALSE(of.reloaded) << int(action);
  }
}

TEST(TeachDesk, AReplayThatIsHeldGoesOnForWhoMay) {
  Desk of;
  EXPECT_TRUE(of.desk.answer(request_of(msg::TEACH_ACTION_RESUME), config_that_allows(true)).granted());
  EXPECT_TRUE(of.resumed);
}

TEST(TeachDesk, ASaveIsUndone) {
  const std::filesystem::path folder = std::filesystem::path(TempDir()) / ("teach_desk_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  config::ServiceConfig config = config_that_allows(true);
  config.file = folder / "c.yaml";
  std::ofstream(config.file) << "version: 1\nrig: " << config.rig_file.string()
                             << "\ntargets: {ball: {radius_m: 0.04, color: {hue_deg: [10, 30]}}}\n";
  Desk nothing;
  const msg::TeachReply refused = nothing.desk.answer(request_of(msg::TEACH_ACTION_UNDO), config);
  EXPECT_FALSE(refused.granted());
  EXPECT_THAT(refused.reason(), HasSubstr("nothing to undo"));
  EXPECT_FALSE(nothing.reloaded);

  const auto hue = [&] { return config::load_service_config(config.file).targets.at(0).color.hue_min_deg; };
  object_tracking::TargetOptions target = config::load_service_config(config.file).targets.at(0);
  target.color.hue_min_deg = 20;
  config::save_taught(config.file, target, {});
  ASSERT_EQ(hue(), 20);
  Desk of;
  const msg::TeachReply reply = of.desk.answer(request_of(msg::TEACH_ACTION_UNDO), config);
  EXPECT_TRUE(reply.granted()) << reply.reason();
  EXPECT_THAT(reply.reason(), HasSubstr("c.taught.yaml is as it was before the last save"));
  EXPECT_TRUE(of.reloaded);
  EXPECT_EQ(hue(), 10);
  config::redo_taught(config.file);
  EXPECT_EQ(hue(), 20);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace huetrack::page
