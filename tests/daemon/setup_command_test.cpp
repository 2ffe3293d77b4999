// From cameras alone to a configuration that runs, and nothing where there are none.
#include "daemon/setup_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "config/service_config.h"

namespace huetrack::daemon {
namespace {

using namespace testing;
namespace fs = std::filesystem;

class SetUp : public Test {
 protected:
  SetUp() { fs::create_directories(folder); }
  ~SetUp() override { fs::remove_all(folder); }
  static std::string text_of(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  const fs::path folder = fs::path(TempDir()) / ("setup_" + std::to_string(::getpid()));
};

TEST_F(SetUp, TheFirstConfigurationIsOneThatThePageMayChange) {
  const std::vector<SetUpCamera> cameras{
      {"/dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0", 640, 480, "HD Webcam: C525 #1"},
      {"/dev/video2", 640, 360, "evil\nrig: other.yaml"},
      {"/dev/video4", 320, 240, ""}};
  const fs::path file = folder / "my.yaml";
  std::ofstream(file) << first_configuration(cameras);
  const config::ServiceConfig config = config::load_service_config(file);
  EXPECT_FALSE(config.is_calibrated());
  ASSERT_EQ(config.cameras.size(), 3u);
  EXPECT_EQ(config.cameras[0].name, "cam0");
  EXPECT_EQ(config.cameras[0].device, cameras[0].device);
  EXPECT_EQ(config.cameras[1].size->height, 360);
  EXPECT_EQ(config.cameras[2].device, "/dev/video4");
  EXPECT_THAT(config.targets, IsEmpty());
  EXPECT_TRUE(config.control.allow_teach);
  EXPECT_TRUE(config.control.allow_record);
  EXPECT_EQ(config.record.folder, folder / "recordings");
  EXPECT_EQ(config.record.pre_roll_s, 60);
}

TEST_F(SetUp, WhatIsThereIsLeftAsItIs) {
  const fs::path file = folder / "my.yaml";
  std::ofstream(file) << "mine";
  LiveRequests requests;
  set_up({.config = file, .with_page = false}, requests, {});
  EXPECT_EQ(text_of(file), "mine");
}

TEST_F(SetUp, WhatIsThereAndNoFileIsRefused) {
  LiveRequests requests;
  EXPECT_THROW(set_up({.config = folder, .with_page = false}, requests, {}), std::runtime_error);
  const fs::path pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(set_up({.config = pipe, .with_page = false}, requests, {}), std::runtime_error);
}

TEST_F(SetUp, WithoutTwoCamerasNothingIsWritten) {
  std::vector<std::string> left_out;
  if (cameras_of_this_host(left_out, {}).size() >= 2) GTEST_SKIP() << "this host has cameras";
  const fs::path file = folder / "my.yaml";
  LiveRequests requests;
  try {
    set_up({.config = file, .with_page = true}, requests, {});
    FAIL() << "it was set up";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("my.yaml is not written"), HasSubstr("two cameras or more")));
  }
  EXPECT_FALSE(fs::exists(file));
}

}  // namespace
}  // namespace huetrack::daemon
