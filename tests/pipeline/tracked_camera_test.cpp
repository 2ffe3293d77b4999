#include "pipeline/tracked_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "pipeline/pipeline_to.h"
#include "pipeline/without_numbers.h"
#include "tracks/pose_file.h"

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
namespace fs = std::filesystem;

camera_tracking::CameraEstimate estimate(camera_tracking::PoseState state, capture::Duration at) {
  camera_tracking::CameraEstimate e;
  e.at = capture::Timestamp(at);
  e.state = state;
  if (e.has_pose()) e.world_from_camera = {Eigen::Quaterniond::Identity(), {1, 2, 3}};
  return e;
}

std::string contents(const fs::path& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

TEST(NoPoseWarning, AppearsAfterThreeSecondsWithTheLastReason) {
  TrackedCameraFigures figures;
  figures.add(estimate(camera_tracking::PoseState::searching, 10s), "too dark");
  figures.add(estimate(camera_tracking::PoseState::searching, 12900ms), "");
  EXPECT_EQ(no_pose_warning("cam0", figures), "");
  figures.add(estimate(camera_tracking::PoseState::searching, 14s), "");
  EXPECT_EQ(no_pose_warning("cam0", figures), "camera cam0: no pose for 4 s (searching): too dark");
  EXPECT_FALSE(figures.had_pose);
  figures.add(estimate(camera_tracking::PoseState::coasting, 15s), "");
  EXPECT_EQ(no_pose_warning("cam0", figures), "");
  EXPECT_TRUE(figures.had_pose);
  figures.add(estimate(camera_tracking::PoseState::lost, 16s), "");
  figures.add(estimate(camera_tracking::PoseState::lost, 21s), "");
  EXPECT_EQ(no_pose_warning("cam0", figures), "camera cam0: no pose for 5 s (lost)");  // without the old reason
}

TEST(ReadoutText, AppearsOnceTheReadoutIsKnown) {
  TrackedCameraFigures figures;
  EXPECT_EQ(readout_text(figures), "");  // a method without readout
  auto known = estimate(camera_tracking::PoseState::tracking, 1s);
  known.readout_s = 0.0188, known.readout_sigma_s = 0.0126;
  figures.add(known, "");
  EXPECT_EQ(readout_text(figures), "");
  known.readout_s = 0.02952, known.readout_sigma_s = 0.00047;
  figures.add(known, "");
  EXPECT_EQ(readout_text(figures), "readout 29.5 ms +- 0.5");
}

TEST(NoPoseLog, LogsEachWarningOnceUntilThereIsAPose) {
  std::ostringstream log;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_st>(log)));
  spdlog::set_pattern("%v");
  NoPoseLog no_pose_log;
  TrackedCameraFigures figures;
  const auto frame = [&](camera_tracking::PoseState state, int s, const std::string& why) {
    figures.add(estimate(state, std::chrono::seconds(s)), why);
    no_pose_log.log("cam0", figures);
  };
  for (int s = 0; s < 20; ++s)
    frame(camera_tracking::PoseState::searching, s, s % 2 == 0 ? "too dark" : "wrong by 3." + std::to_string(s));
  frame(camera_tracking::PoseState::tracking, 20, "");
  for (int s = 21; s < 30; ++s) frame(camera_tracking::PoseState::lost, s, "too dark");
  spdlog::set_default_logger(before);
  EXPECT_EQ(
      log.str(),
      "camera cam0: no pose for 3 s (searching): wrong by 3.3\ncamera cam0: no pose for 4 s (searching): too dark\n"
      "camera cam0: no pose for 3 s (lost): too dark\n");
}

TEST(WithoutNumbers, IgnoresTheFiguresOfASentence) {
  EXPECT_EQ(without_numbers("37.5 px rms for 12 s"), without_numbers("-4 px rms for 3 s"));
  EXPECT_NE(without_numbers("37 px"), without_numbers("37 mm"));
}

TEST(PoseFile, HoldsTrackingPosesOnly) {
  const fs::path file = fs::path(testing::TempDir()) / ("poses_" + std::to_string(getpid()) + ".tum");
  {
    tracks::PoseFileWriter writer(file);
    writer.write(estimate(camera_tracking::PoseState::searching, 1s));
    writer.write(estimate(camera_tracking::PoseState::tracking, 2s));
    writer.write(estimate(camera_tracking::PoseState::coasting, 3s));
    writer.write(estimate(camera_tracking::PoseState::lost, 4s));
    writer.flush();
  }
  EXPECT_EQ(contents(file), "2.000000000 1 2 3 0 0 0 1\n");
  fs::remove(file);
}

TEST(PoseFile, ReplacesOnlyPoseFiles) {
  const fs::path file = fs::path(testing::TempDir()) / ("poses_kind_" + std::to_string(getpid()));
  for (const char* other : {"# made by a calibration\nversion: 1\ncameras: {}\n", "# my notes\n", "# no end"}) {
    std::ofstream(file) << other;
    EXPECT_THROW(tracks::PoseFileWriter{file}, std::runtime_error) << other;
    EXPECT_EQ(contents(file), other);
  }
  for (const char* poses : {"2.0 1 2 3 0 0 0 1\n", "# t x y z qx qy qz qw\n2.0 1 2 3 0 0 0 1\n"}) {
    std::ofstream(file) << poses;
    EXPECT_NO_THROW(tracks::PoseFileWriter{file}) << poses;
  }
  fs::remove(file);
}

// In its frames from `first` to `last` it has a pose.
class FakeTracker final : public camera_tracking::CameraTracker {
 public:
  FakeTracker(std::uint64_t first, std::uint64_t last) : first_(first), last_(last) {}
  camera_tracking::CameraEstimate update(const capture::Frame& frame) override {
    camera_tracking::CameraEstimate e = estimate(frames_ < first_   ? camera_tracking::PoseState::searching
                                                 : frames_ <= last_ ? camera_tracking::PoseState::tracking
                                                                    : camera_tracking::PoseState::lost,
                                                 frame.captured_at.time_since_epoch());
    e.frame_number = frames_++;
    return e;
  }
  void begin_anew() override { begun_anew_at_.push_back(frames_); }
  std::string why_no_pose() const override { return "frame " + std::to_string(frames_ - 1) + " is grey"; }
  camera_tracking::CameraTrackerInside inside() const override { return {}; }
  std::vector<camera_tracking::CameraMapPoint> map() const override {
    return std::vector<camera_tracking::CameraMapPoint>(3);
  }
  void save_map(const fs::path& file) const override { std::ofstream(file) << "new"; }
  const std::vector<std::uint64_t>& begun_anew_at() const { return begun_anew_at_; }

 private:
  std::vector<std::uint64_t> begun_anew_at_;  // numbers of the next frames
  std::uint64_t first_, last_, frames_ = 0;
};

// Ten frames, a second apart; the seventh shows another moment.
class OneGreyCamera final : public capture::FrameSource {
 public:
  std::optional<capture::Frame> next(std::stop_token) override {
    if (made_ == 10) return std::nullopt;
    capture::Frame frame;
    frame.sequence = std::uint32_t(made_);
    frame.captured_at = capture::Timestamp(made_++ * 1s);
    frame.pixels = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 32, 24).image;
    return frame;
  }

  std::uint64_t jumps() const override { return made_ > 6 ? 1 : 0; }

 private:
  int made_ = 0;
};

class TrackedCamera : public testing::Test {
 protected:
  TrackedCamera() {
    calib::Camera camera;
    camera.name = "cam0";
    camera.image_size = {32, 24};
    camera.model = calib::CameraModel(calib::PinholeRadtan{.fx = 30, .fy = 30, .cx = 15.5, .cy = 11.5});
    rig_.cameras.push_back(camera);
    std::ofstream(map_) << "old";
  }
  ~TrackedCamera() override { fs::remove(map_); }
  Pipeline& run(std::uint64_t first, std::uint64_t last, Calls calls) {
    std::vector<std::unique_ptr<capture::FrameSource>> sources;
    sources.push_back(std::make_unique<OneGreyCamera>());
    pipeline_.emplace(rig_, std::move(sources), std::vector<object_trackers::ObjectTracker>{},
                      PipelineOptions{.pictures_every = 1}, std::move(calls));
    pipeline_->track_camera(0, std::make_unique<FakeTracker>(first, last));
    pipeline_->run({});
    return *pipeline_;
  }
  calib::CameraRig rig_;
  const fs::path map_ = fs::path(testing::TempDir()) / ("tracked_" + std::to_string(getpid()) + ".map");
  std::optional<PipelineTo> pipeline_;
};

TEST_F(TrackedCamera, TheReasonComesWithItsFrame) {
  std::vector<std::string> reasons;
  run(2, 4, {.camera_poses = [&](const TrackedFrame& frame) { reasons.push_back(frame.camera.why); }});
  EXPECT_THAT(reasons,
              testing::ElementsAre("frame 0 is grey", "frame 1 is grey", "", "", "", "frame 5 is grey",
                                   "frame 6 is grey", "frame 7 is grey", "frame 8 is grey", "frame 9 is grey"));
  const TrackedCameraFigures figures = pipeline_->figures().tracked_camera;
  EXPECT_EQ(figures.state, camera_tracking::PoseState::lost);
  EXPECT_EQ(figures.without_since, capture::Timestamp(5s));
  EXPECT_EQ(no_pose_warning("cam0", figures), "camera cam0: no pose for 4 s (lost): frame 9 is grey");
}

TEST_F(TrackedCamera, TheTrackerBeginsAnewAfterAJump) {
  const Pipeline& pipeline = run(0, 9, {});
  EXPECT_THAT(dynamic_cast<const FakeTracker&>(*pipeline.camera_tracker()).begun_anew_at(), testing::ElementsAre(6u));
}

TEST_F(TrackedCamera, AnEarlierMapIsKeptIfThereNeverWasAPose) {
  Pipeline& never = run(20, 20, {});
  save_map(*never.camera_tracker(), never.tracked_camera(), map_);
  EXPECT_EQ(contents(map_), "old");
  Pipeline& once = run(3, 3, {});
  save_map(*once.camera_tracker(), once.tracked_camera(), map_);
  EXPECT_EQ(contents(map_), "new");
}

TEST_F(TrackedCamera, ThePictureOfTheStartHasItsPoints) {
  std::vector<std::size_t> points;
  run(8, 9,
      {.camera_pictures = [&](const pictures::CameraPictureJob& job) { points.push_back(job.start_map.size()); }});
  EXPECT_THAT(points, testing::ElementsAre(0, 0, 0, 0, 0, 0, 0, 0, 3, 3));
}

}  // namespace
}  // namespace huetrack::pipeline
