// Targets of the running service, changed, added and renamed by command: it goes on with them without being started
// again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "end_to_end/film_service.h"

namespace huetrack::end_to_end {
namespace {

using namespace testing;

class TargetLive : public FilmService {
 protected:
  TargetLive() : FilmService("target_live") {
    soak::make_films(folder, 2, 320, 240, false);
    configure("control: {allow_teach: true}\n");
    start();
  }
  bool is_tracked(const std::string& target) const {
    return comes_true([&] {
      return huetrack({"watch", "--target", target, "--count", "1", "--timeout", "3", "--format", "csv"})
                 .out.find(",tracking,") != std::string::npos;
    });
  }
};

TEST_F(TargetLive, TheServiceGoesOnWithOtherTargets) {
  ASSERT_TRUE(is_tracked("lime")) << service->err();
  const Result added = huetrack({"control", "target", "add", "second", "radius_m=0.04", "hue_deg=65,115"});
  ASSERT_EQ(added.status, 0) << added.err;
  EXPECT_THAT(added.err, HasSubstr("The service restarts with it."));
  EXPECT_TRUE(is_tracked("second")) << service->err();
  EXPECT_TRUE(is_tracked("lime")) << service->err();
  // What nothing has is not found; and undone it is.
  ASSERT_EQ(huetrack({"control", "target", "set", "second", "hue_deg=200,220"}).status, 0);
  EXPECT_TRUE(comes_true([&] {
    return huetrack({"watch", "--target", "second", "--count", "1", "--timeout", "3", "--format", "csv"})
               .out.find(",searching,") != std::string::npos;
  })) << service->err();
  ASSERT_EQ(huetrack({"control", "undo"}).status, 0);
  EXPECT_TRUE(is_tracked("second")) << service->err();
  const Result renamed = huetrack({"control", "target", "rename", "second", "wand"});
  ASSERT_EQ(renamed.status, 0) << renamed.err;
  EXPECT_TRUE(is_tracked("wand")) << service->err();
  EXPECT_FALSE(service->has_ended());
  Process check({HUETRACKD, "check", config.string()}, folder / "out", folder / "err");
  ASSERT_EQ(check.wait(), 0);
  EXPECT_THAT(check.out(), ContainsRegex("  wand:\n    radius_m: 0.04 +# from c.taught.yaml"));
  service->kill(SIGTERM);
  EXPECT_EQ(service->wait(), 0) << service->err();
}

}  // namespace
}  // namespace huetrack::end_to_end
