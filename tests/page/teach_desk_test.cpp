// What pages ask is refused, whatever it is, where the configuration does not allow it.
#include "page/teach_desk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  for (const auto action :
       {msg::TEACH_ACTION_RESUME, msg::TEACH_ACTION_LOOK, msg::TEACH_ACTION_APPLY, msg::TEACH_ACTION_IGNORE}) {
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

}  // namespace
}  // namespace huetrack::page
