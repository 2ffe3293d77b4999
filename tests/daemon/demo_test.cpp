#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "capture/timing/capture_clock.h"
#include "config/service_config.h"
#include "daemon/demo_cameras.h"
#include "daemon/demo_command.h"
#include "daemon/opened_recording.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path source_dir = HUETRACK_SOURCE_DIR;
const fs::path bundled = source_dir / "configs/demo";

std::shared_ptr<const DemoFilm> film_of(std::vector<std::string> cameras) {
  return std::make_shared<const DemoFilm>(recordings::read_recording(bundled / "recording"), std::move(cameras));
}

TEST(DemoFilm, IsPlayedForwardsAndBackwards) {
  const auto film = film_of({"cam0", "cam1"});
  ASSERT_EQ(film->length(), 150u);
  EXPECT_NEAR(capture::seconds(film->period()), 1 / 30.0, 1e-6);
  const auto number = [&](std::uint64_t k) { return film->at(1, k).sequence; };
  EXPECT_EQ(number(0), 0u);
  EXPECT_EQ(number(149), 149u);
  EXPECT_EQ(number(150), 148u);
  EXPECT_EQ(number(297), 1u);
  EXPECT_EQ(number(298), 0u);
  EXPECT_EQ(number(299), 1u);
  EXPECT_TRUE(film->at(0, 7).encoded) << "a recorder would have to encode it again";
}

TEST(DemoCameras, DeliverInRealTimeWithRisingStampsAndMissWhatIsNotTaken) {
  auto cameras = demo_cameras(film_of({"cam0"}), std::vector<std::string>{"other", "cam0"});
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_EQ(cameras[0].camera, 1);
  const auto first = cameras[0].source->next({});
  const auto second = cameras[0].source->next({});
  ASSERT_TRUE(first && second);
  EXPECT_EQ(second->sequence, first->sequence + 1);
  EXPECT_NEAR(capture::seconds(second->captured_at - first->captured_at), 1 / 30.0, 1e-6);
  EXPECT_GE(capture::unix_now(), second->captured_at);
  std::this_thread::sleep_for(std::chrono::milliseconds(150));
  const auto late = cameras[0].source->next({});
  ASSERT_TRUE(late);
  EXPECT_GE(late->sequence, second->sequence + 4);
  const capture::CameraHealth health = cameras[0].health();
  EXPECT_EQ(health.state, capture::CaptureState::delivering);
  EXPECT_EQ(health.dropped, late->sequence - second->sequence - 1);
}

TEST(DemoFilm, NeedsTheSameLengthOfAllCameras) {
  recordings::Recording recording = recordings::read_recording(bundled / "recording");
  recording.cameras[1].first_frame = 10;
  EXPECT_THROW(DemoFilm(recording, {"cam0", "cam1"}), std::runtime_error);
}

TEST(BundledDemo, IsFoundAboveTheProgramInstalledOrInTheSourceTree) {
  EXPECT_EQ(bundled_demo(source_dir / "build/release/service/daemon/huetrackd"), bundled);
  const fs::path root = fs::path(testing::TempDir()) / ("bundled_" + std::to_string(::getpid()));
  const fs::path installed = root / "share/huetrack/demo";
  fs::create_directories(installed);
  std::ofstream(installed / "huetrackd.yaml") << "version: 1\n";
  EXPECT_EQ(bundled_demo(root / "bin/huetrackd"), installed);
  fs::remove_all(root);
  try {
    bundled_demo("/proc/none/huetrackd");
    FAIL() << "there is none";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("configs/install.sh"));
  }
}

TEST(CopiedDemo, ListsItsCamerasAndIsKept) {
  const fs::path folder = fs::path(testing::TempDir()) / ("copied_" + std::to_string(::getpid()));
  const fs::path file = copy_demo(bundled, folder / "a");
  const config::ServiceConfig config = config::load_service_config(file);
  EXPECT_EQ(config.cameras.size(), config.rig.cameras.size());
  EXPECT_TRUE(config.control.allow_teach && config.control.allow_record);
  EXPECT_TRUE(fs::exists(folder / "a/recording/cam1.mkv"));
  std::ofstream(file, std::ios::app) << "log_level: warning\n";
  EXPECT_EQ(copy_demo(bundled, folder / "a"), file);
  EXPECT_EQ(config::load_service_config(file).log_level, config::LogLevel::warning);
  fs::remove_all(folder);
}

TEST(CopiedDemo, SaysWhyItsFolderCannotBeWritten) {
  EXPECT_THAT([] { copy_demo(bundled, "/proc/none/demo"); },
              testing::ThrowsMessage<std::runtime_error>("cannot write /proc/none/demo: No such file or directory"));
}

// So that a jump need not decode all before it.
TEST(RecordingFromATime, LeavesOutFramesWhoseTimesAreKnown) {
  recordings::Recording recording = recordings::read_recording(bundled / "recording");
  const auto first = [&](double s) {
    return without_frames_before(recording, capture::Timestamp(capture::duration_of(s))).cameras[0].first_frame;
  };
  EXPECT_EQ(first(0), 0);
  EXPECT_EQ(first(2), 60);
  EXPECT_EQ(first(2.01), 60);
  recording.cameras[0].every = 7;
  recording.cameras[0].first_frame = 3;
  EXPECT_EQ(first(2), 3 + 8 * 7) << "the same frames as before";
  recording.cameras[0].fps = 0;  // the container's own times
  EXPECT_EQ(first(2), 3);
}

}  // namespace
}  // namespace huetrack::daemon
