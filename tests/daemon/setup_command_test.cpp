// From cameras alone to a configuration that runs, and nothing where there are none.
#include "daemon/setup_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "capture/clips.h"
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

TEST_F(SetUp, ThePageMayChangeTheFirstConfiguration) {
  const std::vector<SetUpCamera> cameras{
      {"/dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0", 640, 480, "HD Webcam: C525 #1", 29.97, 18e6},
      {"/dev/video2", 640, 360, "evil\nrig: other.yaml"},
      {"/dev/video4", 320, 240, ""}};
  const fs::path file = folder / "my.yaml";
  std::ofstream(file) << first_configuration(cameras, 16e9);
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
  EXPECT_EQ(config.record.pre_roll_mb, 1080);  // a minute of the one that says what it takes
  EXPECT_EQ(config.cameras[0].fps, 29.97);
  EXPECT_EQ(config.cameras[1].fps, std::nullopt);
}

TEST_F(SetUp, AFilmOfOneCameraGetsAConfiguration) {
  capture::write_clip(folder / "ball.mkv", {.frames = 3});
  const SetUpCommand command{.config = folder / "film.yaml", .film = folder / "ball.mkv"};
  testing::internal::CaptureStdout();
  set_up_film(command, {});
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              AllOf(HasSubstr("a film of 64x48"), HasSubstr("--at cam0,FRAME,U,V"),
                    HasSubstr("40 mm until you set it; teaching works without it")));
  const config::ServiceConfig config = config::load_service_config(command.config);
  ASSERT_EQ(config.rig.cameras.size(), 1u);
  EXPECT_EQ(config.rig.cameras[0].image_size, (calib::ImageSize{64, 48}));
  EXPECT_TRUE(config.is_calibrated());
  EXPECT_EQ(config.targets.at(0).name, "ball");
  EXPECT_THROW(set_up_film(command, {}), std::runtime_error);  // nothing is replaced
  testing::internal::CaptureStdout();
  set_up_film({.config = folder / "other.yaml", .film = folder / "ball.mkv"}, {});
  testing::internal::GetCapturedStdout();
  EXPECT_EQ(config::load_service_config(folder / "other.yaml").rig_file.filename(), "other.rig.yaml");
}

TEST_F(SetUp, OneCameraIsUsedWithoutACalibration) {
  const std::vector<SetUpCamera> cameras{{"/dev/video0", 640, 480, ""}};
  std::ofstream(folder / "one.rig.yaml") << rig_of_one_camera(cameras.front(), 60);
  std::ofstream(folder / "one.yaml") << first_configuration(cameras, 16e9, "one.rig.yaml");
  const config::ServiceConfig config = config::load_service_config(folder / "one.yaml");
  ASSERT_TRUE(config.is_calibrated());
  ASSERT_EQ(config.rig.cameras.size(), 1u);
  const calib::Camera& camera = config.rig.cameras.front();
  // Half of 60 degrees to the left, and as far forwards as that takes: the left edge of the picture.
  const auto left = camera.project_world({std::sqrt(3.0), 1, 0});
  ASSERT_TRUE(left);
  EXPECT_NEAR(left->px.x(), -0.5, 1e-3);
  EXPECT_NEAR(left->px.y(), 239.5, 1e-6);
  EXPECT_LT(camera.project_world({2, 0, 0.5})->px.y(), 200) << "up is up";
  const object_tracking::Volume& volume = config.object_tracking.volume;
  EXPECT_GT(volume.min.x(), 0);
  EXPECT_LT(volume.min.z(), -1) << "it sees below the horizon";
  EXPECT_GT(volume.max.z(), 1);
}

TEST_F(SetUp, AnUnknownLensIsInTheCovarianceOfPositions) {
  const SetUpCamera camera{"/dev/video0", 640, 480, ""};
  // By a measured direction and a measured size, which are exact: 1 sigma along the ray, as a share of the distance.
  const auto share_along = [&](std::optional<double> fov_deg) {
    std::ofstream(folder / "rig.yaml") << rig_of_one_camera(camera, fov_deg);
    const calib::CameraRig rig = calib::read_rig(folder / "rig.yaml");
    const calib::PlaceView view{0, 1e4 * Eigen::Matrix2d::Identity(), 1e8};
    const Eigen::Matrix3d covariance = calib::rig_covariance_at(rig, {3, 0, 0}, std::span(&view, 1));
    return std::sqrt(covariance(0, 0)) / 3;
  };
  EXPECT_NEAR(share_along(std::nullopt), 0.25, 0.01);
  EXPECT_NEAR(share_along(70), 0.05, 0.002);
}

TEST_F(SetUp, TheLastMinuteTakesAQuarterOfTheMemoryAtMost) {
  const auto kept_mb = [this](double bytes_per_s, double memory_bytes) {
    const std::vector<SetUpCamera> cameras{{"/dev/video0", 640, 480, "", 30, bytes_per_s},
                                           {"/dev/video2", 640, 480, "", 30, bytes_per_s}};
    const fs::path file = folder / "kept.yaml";
    std::ofstream(file) << first_configuration(cameras, memory_bytes);
    return config::load_service_config(file).record.pre_roll_mb;
  };
  EXPECT_EQ(kept_mb(18e6, 16e9), 2160);
  EXPECT_EQ(kept_mb(18e6, 4e9), 1000);
  EXPECT_EQ(kept_mb(1e6, 16e9), config::RecordConfig().pre_roll_mb);  // never less than usual
}

// Who asks for no rate gets what the driver happens to be set to: seen with vivid, 5 frames/s of its 25.
TEST(SetUpRate, IsTheOneNearestTo30OfAnyFormat) {
  using capture::CaptureFormat;
  const std::vector<capture::OfferedFormat> formats{
      {.fourcc = 0,
       .description = "",
       .format = CaptureFormat::yuyv,
       .sizes = {{640, 480, 640, 480, {30, 15, 5}}, {1280, 720, 1280, 720, {10, 5}}}},
      {.fourcc = 0,
       .description = "",
       .format = CaptureFormat::mjpeg,
       .sizes = {{640, 480, 640, 480, {60, 30}}, {1280, 720, 1280, 720, {60, 30}}, {320, 240, 320, 240, {}}}},
      {.fourcc = 0, .description = "", .format = std::nullopt, .sizes = {{320, 240, 320, 240, {30}}}}};
  const auto chosen = [&](int width, int height) {
    SetUpCamera camera{.device = "/dev/video0", .width = width, .height = height, .model = ""};
    choose_rate(formats, camera);
    return camera;
  };
  EXPECT_EQ(chosen(640, 480).fps, 30);
  EXPECT_EQ(chosen(640, 480).bytes_per_s, 30 * 640 * 480 * 2);  // raw, which is preferred
  EXPECT_EQ(chosen(1280, 720).fps, 30);
  EXPECT_LT(chosen(1280, 720).bytes_per_s, 30 * 1280 * 720);  // JPEGs
  EXPECT_EQ(chosen(320, 240).fps, 0);                         // it does not say
}

TEST_F(SetUp, AnExistingFileIsKept) {
  const fs::path file = folder / "my.yaml";
  std::ofstream(file) << "mine";
  LiveRequests requests;
  set_up({.config = file, .with_page = false}, requests, {});
  EXPECT_EQ(text_of(file), "mine");
}

TEST_F(SetUp, AFolderIsRefused) {
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
    EXPECT_THAT(error.what(), AllOf(HasSubstr("my.yaml was not written"), HasSubstr("no camera can be used"),
                                    HasSubstr("huetrackd demo")));
  }
  EXPECT_FALSE(fs::exists(file));
}

}  // namespace
}  // namespace huetrack::daemon
