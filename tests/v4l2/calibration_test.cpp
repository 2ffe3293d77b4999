// huetrack-calibrate as a user runs it, on live cameras of a real V4L2 driver: in the VM that tests/v4l2/run.sh boots.
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <fstream>

#include "calib/model/rig_yaml.h"
#include "capture/clips.h"
#include "end_to_end/process.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"
#include "v4l2/vm.h"

namespace huetrack::v4l2 {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

class LiveCalibration : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_OUTSIDE_VM();
    if (!fs::exists(original())) GTEST_SKIP() << original() << " is not there";
    truth = calib::read_rig(original() / "rig.yaml");
  }
  void TearDown() override {
    if (HasFailure() && calibrate) std::printf("---- huetrack-calibrate\n%s----\n", calibrate->err().c_str());
  }
  virtual fs::path original() const { return fs::path(HUETRACK_SHARED_DATA) / "rendered/chessboard"; }

  // Every frame of the recording `hold` times, for the first two loopback devices; from..: which.
  void play(int hold, double fps, int from, int count, const std::vector<std::string>& more = {}) {
    const std::vector<std::string> cameras{"cam0", "cam1"};
    recordings::ReplaySource source(recordings::read_recording(original()), cameras);
    std::vector<std::ofstream> films;
    for (const auto& camera : cameras) films.emplace_back(folder / (camera + ".yuyv"), std::ios::binary);
    std::vector<int> seen(cameras.size());
    while (const auto frame = source.next({})) {
      const auto camera = static_cast<std::size_t>(frame->camera);
      const int k = seen[camera]++;
      if (k < from || k >= from + count) continue;
      const std::string bytes = yuyv_of(frame->pixels);
      for (int i = 0; i < hold; ++i) films[camera] << bytes;
    }
    films.clear();
    std::vector<std::string> command{tool("v4l2play"), "-w", "320", "-h", "240", "-r", std::to_string(fps), "-m"};
    command.insert(command.end(), more.begin(), more.end());
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      nodes.push_back(node_of("v4l2 loopback", static_cast<int>(c)));
      command.push_back(nodes.back().string() + "=" + (folder / (cameras[c] + ".yuyv")).string());
    }
    player = std::make_unique<end_to_end::Process>(command, folder / "player.out", folder / "player.err");
    ASSERT_TRUE(comes_true([&] { return player->err().find("ready") != std::string::npos; }));
  }
  void run(const std::vector<std::string>& arguments) {
    std::vector<std::string> command{HUETRACK_CALIBRATE};
    command.insert(command.end(), arguments.begin(), arguments.end());
    calibrate = std::make_unique<end_to_end::Process>(command, folder / "calibrate.out", folder / "calibrate.err");
  }
  // Until its page says so; then Ctrl-C. The exit status.
  int stop_at(const fs::path& page, const std::string& status) {
    const auto begun = std::chrono::steady_clock::now();
    EXPECT_TRUE(comes_true(
        [&] { return calibrate->has_ended() || end_to_end::contents(page).find(status) != std::string::npos; }, 300s));
    std::printf("%s after %.0f s\n", status.c_str(),
                std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
    calibrate->kill(SIGINT);
    return calibrate->wait();
  }

  capture::TemporaryFolder folder;
  calib::CameraRig truth;
  std::vector<fs::path> nodes;
  std::unique_ptr<end_to_end::Process> player, calibrate;
};

TEST_F(LiveCalibration, WithABoardAndTwoCameras) {
  play(60, 10, 2, 12, {"-n", "100000"});  // six seconds each: an emulated processor is slow to find a board
  const std::string board = original() / "board.yaml";
  const fs::path page = folder / "view.html";

  // Cameras that are not there, or give nothing, are named.
  run({"extrinsics", "--board", board, "cam0=" + nodes[0].string(), "cam1=/dev/video99", "--rig", folder / "no.yaml"});
  EXPECT_EQ(calibrate->wait(), 1);
  EXPECT_THAT(calibrate->err(), AllOf(HasSubstr("/dev/video99"), HasSubstr("not plugged in")));
  const std::string silent = node_of("v4l2 loopback", 2);
  run({"extrinsics", "--board", board, "cam0=" + nodes[0].string(), "silent=" + silent, "--size", "320x240",
       "--seconds", "3", "--rig", folder / "no.yaml"});
  EXPECT_EQ(calibrate->wait(), 1);
  EXPECT_THAT(calibrate->err(), HasSubstr("camera silent delivered no image"));
  EXPECT_FALSE(fs::exists(folder / "no.yaml"));

  // Both cameras, with their lenses known.
  run({"extrinsics", "--board", board, "cam0=" + nodes[0].string(), "cam1=" + nodes[1].string(), "--intrinsics",
       original() / "rig.yaml", "--refine-lens", "no", "--view", page, "--rig", folder / "rig.yaml"});
  const int status = stop_at(page, "kept view 5");
  ASSERT_TRUE(status == 0 || status == 2) << calibrate->err();  // 2: five views are few, and it says so
  const calib::CameraRig found = calib::read_rig(folder / "rig.yaml");
  const calib::Rigid3d was = truth.cameras[1].cam_from_world * calib::inverse(truth.cameras[0].cam_from_world);
  const calib::Rigid3d is = found.cameras[1].cam_from_world * calib::inverse(found.cameras[0].cam_from_world);
  std::printf("status %d; the cameras stand %.1f mm and %.3f degrees off\n", status,
              1e3 * (is.translation - was.translation).norm(), 57.3 * is.rotation.angularDistance(was.rotation));
  EXPECT_LT((is.translation - was.translation).norm(), 0.02);
  EXPECT_LT(is.rotation.angularDistance(was.rotation), 0.01);
  EXPECT_THAT(end_to_end::contents(page), AllOf(HasSubstr("finished with"), HasSubstr("data:image/jpeg"),
                                                HasSubstr("Missing shared views: cam0 + cam1")));

  // One lens.
  fs::remove(page);
  run({"intrinsics", "--board", board, "--camera", "cam1", nodes[1], "--lens", "radtan4", "--view", page, "--rig",
       folder / "cam1.yaml"});
  const int lens_status = stop_at(page, "kept view 5");
  ASSERT_TRUE(lens_status == 0 || lens_status == 2) << calibrate->err();
  EXPECT_NEAR(calib::read_rig(folder / "cam1.yaml").cameras[0].model.fx() / truth.cameras[1].model.fx(), 1, 0.02);
}

class LiveWave : public LiveCalibration {
 protected:
  fs::path original() const override { return fs::path(HUETRACK_SHARED_DATA) / "rendered/two_cams"; }
};

TEST_F(LiveWave, RestoresAWrongRig) {
  constexpr double fps = 3;  // a tenth of the real speed: an emulated processor drops frames
  play(1, fps, 0, 150, {"-n", "150", "-g", folder / "go"});
  calib::CameraRig spoilt = truth;
  spoilt.cameras[1].cam_from_world.translation += Eigen::Vector3d(0.06, -0.05, 0.06);
  calib::write_rig(spoilt, folder / "spoilt.yaml");
  std::string config = "version: 1\nrig: spoilt.yaml\ntargets: {lime: {color: {hue_deg: [65, 115]}}}\ncameras:\n";
  for (const std::size_t c : {0U, 1U})
    config += "  cam" + std::to_string(c) + ": {device: " + nodes[c].string() + ", fps: " + std::to_string(fps) + "}\n";
  capture::write_text(folder / "c.yaml", config);
  const double distance = (truth.cameras[0].centre() - truth.cameras[1].centre()).norm();
  run({"wave", "--live", "65", "--config", folder / "c.yaml", "--target", "lime", "--camera-distance", "cam0", "cam1",
       std::to_string(distance), "--rig", folder / "rig.yaml"});
  ASSERT_TRUE(comes_true(
      [&] {
        int open = 0;
        std::error_code error;
        for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(calibrate->pid()) + "/fd", error))
          open += fs::read_symlink(entry, error).string().starts_with("/dev/video") ? 1 : 0;
        return open >= 2 || calibrate->has_ended();
      },
      100s));
  ASSERT_FALSE(calibrate->has_ended());
  std::this_thread::sleep_for(2s);
  capture::write_text(folder / "go", "");
  const int status = calibrate->wait();
  EXPECT_TRUE(status == 0 || status == 2) << status;  // 2: too many frames were dropped, and it says so
  std::printf("%s", end_to_end::contents(folder / "calibrate.out").c_str());
  const calib::CameraRig found = calib::read_rig(folder / "rig.yaml");
  const calib::Rigid3d was = truth.cameras[1].cam_from_world * calib::inverse(truth.cameras[0].cam_from_world);
  const calib::Rigid3d is = found.cameras[1].cam_from_world * calib::inverse(found.cameras[0].cam_from_world);
  std::printf("the cameras stand %.1f mm and %.3f degrees off\n", 1e3 * (is.translation - was.translation).norm(),
              57.3 * is.rotation.angularDistance(was.rotation));
  EXPECT_LT((is.translation - was.translation).norm(), 0.03);
  EXPECT_LT(is.rotation.angularDistance(was.rotation), 0.01);
}

}  // namespace
}  // namespace huetrack::v4l2
