// Targets of the running service, changed, added and renamed by command: it goes on with them without being started
// again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "end_to_end/process.h"
#include "publish/test_domain.h"
#include "soak/films.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace testing;

class TargetLive : public Test {
 protected:
  void SetUp() override {
    soak::make_films(folder, 2, 320, 240, false);
    std::ofstream(config) << soak::film_config(folder, 300,
                                               "control: {allow_teach: true}\ndds: {domain: " +
                                                   std::to_string(publish::test_domain()) + ", interfaces: [lo]}\n");
    service.emplace(std::vector<std::string>{FILM_SERVICE, config.string(), folder.string(), "--phases", "together"},
                    folder / "service.out", folder / "service.err");
  }
  ~TargetLive() override {
    service.reset();
    fs::remove_all(folder);
  }
  struct Result {
    int status;
    std::string out, err;
  };
  Result huetrack(std::vector<std::string> words) const {
    words.insert(words.begin(), HUETRACK);
    words.insert(words.end(), {"--domain", std::to_string(publish::test_domain()), "--interface", "lo"});
    Process process(words, folder / "out", folder / "err");
    const int status = process.wait();
    return {status, process.out(), process.err()};
  }
  bool is_tracked(const std::string& target) const {
    return comes_true([&] {
      return huetrack({"watch", "--target", target, "--count", "1", "--timeout", "3", "--format", "csv"})
                 .out.find(",tracking,") != std::string::npos;
    });
  }
  const fs::path folder = fs::path(TempDir()) / ("target_live_" + std::to_string(::getpid()));
  const fs::path config = folder / "c.yaml";
  std::optional<Process> service;
};

TEST_F(TargetLive, TheServiceGoesOnWithOtherTargets) {
  ASSERT_TRUE(is_tracked("lime")) << service->err();
  const Result added = huetrack({"control", "target", "add", "second", "radius_m=0.04", "hue_deg=65,115"});
  ASSERT_EQ(added.status, 0) << added.err;
  EXPECT_THAT(added.err, HasSubstr("The service begins anew with it."));
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
