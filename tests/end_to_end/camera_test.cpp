// A moving camera through huetrackd and huetrack, as a user runs them: a recording of LEDs that the test writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "end_to_end/process.h"
#include "publish/test_domain.h"
#include "scene/led_scene.h"

namespace huetrack::end_to_end {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

class CameraEndToEnd : public testing::Test {
 protected:
  static constexpr int frames = 60;

  CameraEndToEnd()
      : folder_(fs::path(testing::TempDir()) /
                ("camera_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "cam0");
    const scene::LedScene scene = scene::led_scene();
    for (int i = 0; i < frames; ++i) {
      const capture::Image image = scene::led_image(
          scene, scene::led_dots(scene, scene::led_scene_pose(i / scene.fps), {i % 8}), static_cast<std::uint64_t>(i));
      char name[32];
      std::snprintf(name, sizeof name, "cam0/%06d.pgm", i);
      std::ofstream file(folder_ / name, std::ios::binary);
      file << "P5\n320 240\n255\n";
      for (int v = 0; v < image.height; ++v)
        file.write(reinterpret_cast<const char*>(image.planes[0].data + v * image.planes[0].stride), image.width);
    }
    write("recording.yaml", "version: 1\ncameras:\n  cam0: {frames: cam0/%06d.pgm, fps: 90}\n");
    write(
        "rig.yaml",
        "version: 1\ncameras:\n  cam0:\n    image_size: [320, 240]\n    model: pinhole_radtan\n"
        "    intrinsics: {fx: 250, fy: 251, cx: 158.5, cy: 121}\n    distortion: [-0.11, 0.02, 0.0004, -0.0005, 0]\n");
    std::ostringstream leds;
    for (const auto& led : scene.leds)
      leds << (leds.tellp() > 0 ? ", " : "") << "[" << led.x() << ", " << led.y() << ", " << led.z() << "]";
    write("config.yaml",
          "version: 1\nrig: rig.yaml\ncamera_tracking:\n  camera: cam0\n  particle_count: 1000\n  start:\n    leds: [" +
              leds.str() +
              "]\n    led_schedule: [[0], [1], [2], [3], [4], [5], [6], [7]]\n"
              "    led_room_min: [-1.5, -1.5, 0]\n    led_room_max: [1.5, 1.5, 2]\n");
  }
  ~CameraEndToEnd() override {
    if (!HasFailure()) fs::remove_all(folder_);
  }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  std::unique_ptr<Process> start(std::vector<std::string> command) {
    const std::string name = "process_" + std::to_string(started_++);
    return std::make_unique<Process>(command, folder_ / (name + ".out"), folder_ / (name + ".err"), environment_);
  }
  std::vector<std::string> replay(std::vector<std::string> more) const {
    std::vector<std::string> command{HUETRACKD, "replay", folder_ / "config.yaml", folder_};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }

  fs::path folder_;
  std::map<std::string, std::string> environment_{{"ROS_DOMAIN_ID", std::to_string(publish::test_domain())}};
  int started_ = 0;
};

TEST_F(CameraEndToEnd, PosesAreNearTheTruthAndTheSameBytesWhateverTheThreads) {
  std::string first;
  for (const std::string threads : {"1", "2", "4"}) {
    const std::string file = folder_ / ("poses_" + threads + ".tum");
    const auto process = start(replay({"--no-dds", "--poses", file, "--threads", threads}));
    ASSERT_EQ(process->wait(), 0) << process->err();
    if (first.empty()) {
      first = contents(file);
      EXPECT_THAT(process->out(), HasSubstr("pose from frame "));
    }
    EXPECT_EQ(contents(file), first);
  }
  std::istringstream lines(first);
  int poses = 0;
  for (std::string line; std::getline(lines, line); ++poses) {
    double t = 0, x = 0, y = 0, z = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%lf %lf %lf %lf", &t, &x, &y, &z), 4) << line;
    EXPECT_LT((scene::led_scene_pose(t).translation - Eigen::Vector3d(x, y, z)).norm(), 0.02) << line;
  }
  EXPECT_GT(poses, 40);
}

TEST_F(CameraEndToEnd, PicturesAreDrawn) {
  const auto process = start(replay({"--no-dds", "--pictures", folder_ / "out", "--pictures-every", "20"}));
  ASSERT_EQ(process->wait(), 0) << process->err();
  for (const char* name : {"camera_000000.png", "camera_000020.png", "camera_000040.png", "camera_3d.png"})
    EXPECT_TRUE(fs::exists(folder_ / "out" / name)) << name;
  EXPECT_FALSE(fs::exists(folder_ / "out/set_000000.png"));  // there are no targets
}

TEST_F(CameraEndToEnd, ASubscriberHasTheFileOfTheReplay) {
  const std::string file = folder_ / "poses.tum";
  const auto watch = start({HUETRACK, "watch", "--camera", "cam0", "--format", "tum", "--timeout", "20"});
  const auto process =
      start(replay({"--poses", file, "--wait-for-subscriber", "20", "--speed", "real", "--stamps", "recording"}));
  ASSERT_EQ(process->wait(), 0) << process->err();
  const std::string expected = contents(file);
  for (int i = 0; i < 100 && watch->out().size() < expected.size(); ++i) std::this_thread::sleep_for(50ms);
  watch->kill(SIGTERM);
  watch->wait();
  EXPECT_EQ(watch->out(), expected) << watch->err();
  EXPECT_THAT(watch->err(), HasSubstr("camera cam0"));
}

TEST_F(CameraEndToEnd, WithoutTargetsWatchAndStatusPointToTheCamera) {
  write("recording.yaml", "version: 1\ncameras:\n  cam0: {frames: cam0/%06d.pgm, fps: 6}\n");
  const auto watch = start({HUETRACK, "watch"});
  const auto process = start(replay({"--wait-for-subscriber", "20", "--speed", "real"}));
  for (int i = 0; i < 100 && watch->err().find("--camera NAME") == std::string::npos; ++i)
    std::this_thread::sleep_for(50ms);
  EXPECT_THAT(watch->err(), HasSubstr("no target is tracked on domain " + environment_["ROS_DOMAIN_ID"] +
                                      ", but these cameras: cam0. Watch them with huetrack watch --camera NAME"));
  const auto status = start({HUETRACK, "status"});
  EXPECT_EQ(status->wait(), 0) << status->err();
  EXPECT_THAT(status->out(), HasSubstr("  pose      cam0  "));
  EXPECT_THAT(status->out(), HasSubstr("  targets   none\n"));
  for (const auto* one : {&process, &watch}) {
    (*one)->kill(SIGTERM);
    EXPECT_EQ((*one)->wait(), 0) << (*one)->err();
  }
}

TEST_F(CameraEndToEnd, WithoutAPoseTheSummarySaysSoAndTheMapIsKept) {
  write("config.yaml",
        "version: 1\nrig: rig.yaml\ncamera_tracking:\n  camera: cam0\n  save_map: kept.map\n  start:\n"
        "    rectangle: [[-0.1, 0.1, 0], [0.1, 0.1, 0], [0.1, -0.1, 0], [-0.1, -0.1, 0]]\n");
  const std::string older = "huetrack camera map 1\nan older one";
  write("kept.map", older);
  write("recording.yaml", "version: 1\ncameras:\n  cam0: {frames: cam0/%06d.pgm, fps: 15}\n");
  const auto process = start(replay({"--no-dds"}));
  EXPECT_EQ(process->wait(), 0) << process->err();
  EXPECT_THAT(process->out(), testing::ContainsRegex("cam0 +never a pose"));
  EXPECT_THAT(process->err(), HasSubstr("kept.map: map not saved, because the camera never had a pose"));
  EXPECT_THAT(process->err(), HasSubstr("camera cam0: no pose for 3 s (searching)"));
  EXPECT_EQ(contents(folder_ / "kept.map"), older);
}

TEST_F(CameraEndToEnd, PosesWithoutACameraAreRefused) {
  write("none.yaml", "version: 1\nrig: rig.yaml\ntargets: {ball: {color: {hue_deg: [65, 115]}}}\n");
  const auto process =
      start({HUETRACKD, "replay", folder_ / "none.yaml", folder_, "--no-dds", "--poses", folder_ / "p.tum"});
  EXPECT_EQ(process->wait(), 1);
  EXPECT_THAT(process->err(), HasSubstr("--poses needs a tracked camera: set camera_tracking in"));
}

}  // namespace
}  // namespace huetrack::end_to_end
