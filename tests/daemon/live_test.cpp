#include "daemon/live.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "calib/model/rig_yaml.h"
#include "daemon/fake_camera.h"
#include "daemon/replay.h"
#include "pipeline/recorded_changes.h"
#include "tracks/track_csv.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

const fs::path demo = fs::path(HUETRACK_SOURCE_DIR) / "configs/demo";

class Live : public testing::Test {
 protected:
  Live()
      : folder_(fs::path(testing::TempDir()) / ("live_" + std::to_string(::getpid()) + "_" +
                                                testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_);
    rewrite("65, 115");
    config_ = config::load_service_config(folder_ / "c.yaml");
    options_.no_dds = true;
    options_.tracks = folder_ / "live.csv";
  }
  ~Live() override { fs::remove_all(folder_); }

  void rewrite(const std::string& hue, const std::string& more = "") const {
    std::ofstream(folder_ / "c.yaml") << "version: 1\nrig: " << (demo / "recording/rig.yaml").string()
                                      << "\ntargets: {lime: {color: {hue_deg: [" << hue << "]}}}\n"
                                      << "cameras: {cam0: {device: 0, fps: 30}, cam1: {device: 1, fps: 30}}\n"
                                      << more;
  }
  std::vector<LiveCamera> cameras(std::size_t frames, bool go_silent = false) const {
    return fake_cameras(demo / "recording", {"cam0", "cam1"}, frames, go_silent);
  }
  static std::vector<fs::path> folders_in(const fs::path& folder) {
    std::vector<fs::path> folders;
    for (const auto& entry : fs::directory_iterator(folder)) folders.push_back(entry.path());
    return folders;
  }
  // The tracks of a recording by the configuration that lies in it.
  std::string replayed(const fs::path& recording) const {
    ReplayCommand command;
    command.config = recording / "huetrackd.yaml";
    command.recording = {recording};
    command.no_dds = true;
    command.progress = false;
    command.tracks = folder_ / "replayed.csv";
    replay(command, {});
    return contents(command.tracks);
  }
  static std::string contents(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
  }

  fs::path folder_;
  config::ServiceConfig config_;
  LiveCommand options_;
  LiveRequests requests_;
};

TEST_F(Live, TracksInRealTimeAndReportsIt) {
  const auto before = capture::unix_now();
  const LiveSummary summary = run_live(config_, cameras(30), options_, requests_, {});
  EXPECT_EQ(summary.figures.cameras.at(0).frames, 30u);
  EXPECT_EQ(summary.figures.sets_tracked + summary.figures.sets_dropped, summary.figures.frame_sets.sets);
  EXPECT_EQ(summary.status.mode, "run");
  const auto tracks = tracks::read_track_csv(options_.tracks);
  ASSERT_TRUE(tracks.contains("lime"));
  EXPECT_EQ(tracks.at("lime").back().state, object_tracking::TrackState::tracking);
  EXPECT_GT(tracks.at("lime").front().at, before);  // UNIX time, not the recording's
}

TEST_F(Live, AStopEndsItWithinASecondWithoutFrames) {
  std::stop_source stop;
  std::atomic<std::chrono::steady_clock::time_point> asked;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(1500ms);
    asked = std::chrono::steady_clock::now();
    stop.request_stop();
  });
  const LiveSummary summary = run_live(config_, cameras(3, true), options_, requests_, stop.get_token());
  EXPECT_LT(std::chrono::steady_clock::now() - asked.load(), 1s);
  EXPECT_EQ(summary.status.cameras.at(0).frames, 3u);
  EXPECT_EQ(summary.status.cameras.at(0).health, publish::CameraStatus::Health::delivering);
}

TEST_F(Live, EndsAfterTheGivenSeconds) {
  options_.seconds = 0.3;
  const auto start = std::chrono::steady_clock::now();
  run_live(config_, cameras(60, true), options_, requests_, {});
  const auto took = std::chrono::steady_clock::now() - start;
  EXPECT_GE(took, 300ms);
  EXPECT_LT(took, 2s);
}

TEST_F(Live, AReloadChangesTheColourAndLosesNoFrame) {
  const std::string before = config::config_identity(config_);
  std::jthread reloader([&] {
    for (int k = 0; k < 1000 && contents(options_.tracks).find(",tracking,") == std::string::npos; ++k)
      std::this_thread::sleep_for(10ms);
    rewrite("240, 250");  // a colour that nothing has
    requests_.reload = true;
  });
  const LiveSummary summary = run_live(config_, cameras(60), options_, requests_, {});
  const auto track = tracks::read_track_csv(options_.tracks).at("lime");
  EXPECT_EQ(track.size() + summary.figures.sets_dropped, summary.figures.frame_sets.sets);
  EXPECT_LT(summary.figures.sets_dropped, 10u);  // none, but on a machine that stands still for a third of a second
  EXPECT_TRUE(
      std::ranges::any_of(track, [](const auto& row) { return row.state == object_tracking::TrackState::tracking; }));
  EXPECT_EQ(track.back().state, object_tracking::TrackState::searching);
  EXPECT_EQ(summary.figures.cameras[0].frames, 60u);
  EXPECT_NE(summary.status.config_identity, before);
}

TEST_F(Live, AReloadOfABadFileIsRefused) {
  std::string identity;
  std::jthread reloader([&] {
    std::this_thread::sleep_for(500ms);
    rewrite("65, 115", "object_tracking: {particle_cuont: 3}\n");
    requests_.reload = true;
  });
  const LiveSummary summary = run_live(config_, cameras(45), options_, requests_, {});
  EXPECT_FALSE(requests_.reload);  // it was seen
  EXPECT_EQ(tracks::read_track_csv(options_.tracks).at("lime").back().state, object_tracking::TrackState::tracking);
  EXPECT_EQ(summary.figures.cameras[1].frames, 45u);
}

TEST_F(Live, ARecordingReplaysToTheSameTrackByteForByte) {
  rewrite("65, 115", "record: {folder: " + (folder_ / "recordings").string() + ", always: true, queue_frames: 100}\n");
  config_ = config::load_service_config(folder_ / "c.yaml");
  const LiveSummary summary = run_live(config_, cameras(60), options_, requests_, {});
  ASSERT_EQ(summary.recorded.cameras.size(), 2u);
  EXPECT_EQ(summary.recorded.cameras[0].frames, 60u);
  EXPECT_THAT(summary.recorded.dropped, testing::ElementsAre(0, 0));
  EXPECT_EQ(summary.recorded.failure, std::nullopt);

  const auto recordings = folders_in(folder_ / "recordings");
  ASSERT_EQ(recordings.size(), 1u);
  const std::string live = contents(options_.tracks);
  EXPECT_GT(std::ranges::count(live, '\n'), 50);
  EXPECT_THAT(live, HasSubstr("tracking"));
  EXPECT_EQ(replayed(recordings[0]), live);
}

// A camera is knocked 7 s after the beginning of `bumped`: what goes before is left out but for the second in which the
// room is learnt.
TEST_F(Live, ACorrectedRigIsSavedNextToTheRigAndRepeatedByAReplay) {
  const fs::path bumped = fs::path(HUETRACK_SHARED_DATA) / "rendered/bumped";
  if (!fs::exists(bumped)) GTEST_SKIP() << bumped;
  constexpr std::size_t first = 165, count = 165;
  const std::vector<std::string> names{"cam0", "cam1", "cam2"};
  auto pictures = first_frames(bumped, names, first + count);
  const capture::Timestamp start = capture::unix_now() + 50ms;
  std::vector<LiveCamera> cameras;
  for (std::size_t c = 0; c < names.size(); ++c) {
    auto& frames = pictures[c];
    frames.erase(frames.begin(), frames.begin() + first);
    const capture::Duration began = frames.front().captured_at.time_since_epoch();
    for (std::size_t k = 0; k < frames.size(); ++k) {
      frames[k].captured_at -= began;
      frames[k].sequence = static_cast<std::uint32_t>(k);
    }
    cameras.push_back(FakeCamera(int(c), std::move(frames), start, false).live());
  }
  fs::copy_file(bumped / "rig.yaml", folder_ / "rig.yaml");
  std::ofstream(folder_ / "c.yaml") << "version: 1\nrig: rig.yaml\ncalibration: {watch: mend}\n"
                                    << "targets: {ball: {radius_m: 0.04, color: {hue_deg: [313, 350], saturation: "
                                       "[0.26, 1], intensity: [0.28, 0.81]}}}\n"
                                    << "object_tracking: {volume: {min: [-1, -1, 0.1], max: [1, 1, 2.1]}}\n"
                                    << "cameras: {cam0: {device: 0, fps: 30}, cam1: {device: 1, fps: 30}, cam2: "
                                       "{device: 2, fps: 30}}\n"
                                    << "record: {folder: " << (folder_ / "recordings").string()
                                    << ", always: true, queue_frames: 100}\n";
  config_ = config::load_service_config(folder_ / "c.yaml");
  const std::string as_it_was = contents(folder_ / "rig.yaml");
  run_live(config_, std::move(cameras), options_, requests_, {});

  const calib::CameraRig before = calib::read_rig(folder_ / "rig.yaml");
  EXPECT_EQ(contents(folder_ / "rig.yaml"), as_it_was);
  const std::string mended = contents(folder_ / "rig.mended.yaml");
  ASSERT_FALSE(mended.empty());
  const calib::CameraRig after = calib::read_rig(folder_ / "rig.mended.yaml");
  EXPECT_TRUE(after.uncertainty);
  const auto turned_deg = [&](std::size_t c) {
    const calib::Rigid3d change = after.cameras[c].cam_from_world * calib::inverse(before.cameras[c].cam_from_world);
    return calib::log(change).head<3>().norm() * 180 / std::numbers::pi;
  };
  EXPECT_NEAR(turned_deg(2), 0.8, 0.1);
  EXPECT_EQ(turned_deg(0) + turned_deg(1), 0);

  const auto recordings = folders_in(folder_ / "recordings");
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_EQ(contents(recordings[0] / "rig.mended.yaml"), mended);
  EXPECT_EQ(calib::rig_identity(calib::read_rig(recordings[0] / "rig.yaml")), calib::rig_identity(before));
  EXPECT_TRUE(replayed(recordings[0]) == contents(options_.tracks)) << "the replay is not as it was live";
}

TEST_F(Live, AReplayRepeatsTheReloads) {
  rewrite("65, 115", "record: {folder: " + (folder_ / "recordings").string() + ", always: true, queue_frames: 100}\n");
  config_ = config::load_service_config(folder_ / "c.yaml");
  std::jthread reloader([&] {
    for (const char* hue : {"240, 250", "60, 120"}) {
      std::this_thread::sleep_for(600ms);
      rewrite(hue, "object_tracking: {seed: 3}\n");
      requests_.reload = true;
    }
  });
  run_live(config_, cameras(75), options_, requests_, {});
  const auto recording = folders_in(folder_ / "recordings").at(0);
  const pipeline::RecordedChanges changes = pipeline::read_changes(recording);
  EXPECT_EQ(changes.reloads.size(), 2u);
  const std::string live = contents(options_.tracks);
  const auto track = tracks::read_track_csv(options_.tracks).at("lime");
  EXPECT_GT(std::ranges::count(track, object_tracking::TrackState::searching, &object_tracking::ObjectEstimate::state),
            10);
  EXPECT_EQ(track.back().state, object_tracking::TrackState::tracking);
  EXPECT_TRUE(replayed(recording) == live);
}

TEST_F(Live, RecordWithoutTrackingReplays) {
  options_ = LiveCommand{.track = false, .record_to = folder_ / "out", .no_dds = false, .tracks = {}, .seconds = {}};
  const LiveSummary summary = run_live(config_, cameras(30), options_, requests_, {});
  EXPECT_EQ(summary.recorded.cameras.at(1).frames, 30u);
  EXPECT_EQ(summary.published, 0u);
  EXPECT_THAT(replayed(folder_ / "out"), HasSubstr("tracking"));
}

TEST_F(Live, TracksWithoutRecordingOnADiskError) {
  rewrite("65, 115", "record: {folder: /proc/huetrack, always: true}\n");
  config_ = config::load_service_config(folder_ / "c.yaml");
  const LiveSummary summary = run_live(config_, cameras(30), options_, requests_, {});
  EXPECT_GT(summary.figures.sets_tracked, 20u);
  EXPECT_THAT(summary.status.warnings, testing::Contains(HasSubstr("nothing is being recorded: /proc/huetrack")));
}

TEST_F(Live, APreRollThatCannotBeSavedIsAWarningInTheStatus) {
  rewrite("65, 115", "record: {folder: /proc/huetrack, pre_roll_s: 0.5}\n");
  config_ = config::load_service_config(folder_ / "c.yaml");
  requests_.save = true;
  const LiveSummary summary = run_live(config_, cameras(30), options_, requests_, {});
  EXPECT_GT(summary.figures.sets_tracked, 20u);
  EXPECT_THAT(summary.status.warnings, testing::Contains(HasSubstr("the pre-roll was not saved: /proc/huetrack")));
}

TEST_F(Live, AFullDiskEndsTheTracksFileAndIsReported) {
  options_.tracks = "/dev/full";
  EXPECT_THAT([&] { run_live(config_, cameras(90), options_, requests_, {}); },
              testing::ThrowsMessage<std::runtime_error>(HasSubstr("no more tracks are written")));
}

TEST_F(Live, APreRollHoldsTheConfigurationInForce) {
  const std::string record =
      "record: {folder: " + (folder_ / "recordings").string() + ", pre_roll_s: 0.5, after_s: 0.3}\n";
  rewrite("65, 115", record);
  config_ = config::load_service_config(folder_ / "c.yaml");
  std::jthread user([&] {
    std::this_thread::sleep_for(600ms);
    rewrite("64, 116", record);
    requests_.reload = true;
    std::this_thread::sleep_for(600ms);
    requests_.save = true;
  });
  run_live(config_, cameras(75), options_, requests_, {});
  const auto recordings = folders_in(folder_ / "recordings");
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_EQ(config::load_service_config(recordings[0] / "huetrackd.yaml").targets.at(0).color.hue_min_deg, 64);
}

// A recording begins with its first frame, not with a camera that never delivered: it would be 56 years long.
TEST_F(Live, ARecordingWithASilentCameraIsAsLongAsItsFrames) {
  options_ = LiveCommand{.track = false, .record_to = folder_ / "out", .no_dds = false, .tracks = {}, .seconds = {}};
  std::vector<LiveCamera> one = cameras(30);
  one.pop_back();
  run_live(config_, std::move(one), options_, requests_, {});
  ReplayCommand command;
  command.config = folder_ / "out/huetrackd.yaml";
  command.recording = {folder_ / "out"};
  command.no_dds = true;
  command.progress = false;
  const ReplaySummary summary = replay(command, {});
  EXPECT_NEAR(summary.recorded_s, 1, 0.1);
}

TEST_F(Live, AFolderThatIsNotEmptyIsNotRecordedInto) {
  options_.record_to = folder_;
  EXPECT_THAT([&] { run_live(config_, cameras(3), options_, requests_, {}); },
              testing::ThrowsMessage<capture::CaptureError>(HasSubstr("is not an empty folder")));
}

TEST_F(Live, SavesThePreRollOnRequest) {
  rewrite("65, 115", "record: {folder: " + (folder_ / "recordings").string() + ", pre_roll_s: 0.5, after_s: 0.3}\n");
  config_ = config::load_service_config(folder_ / "c.yaml");
  std::jthread user([&] {
    std::this_thread::sleep_for(1400ms);
    requests_.save = true;
  });
  run_live(config_, cameras(75), options_, requests_, {});
  const auto recordings = folders_in(folder_ / "recordings");
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_THAT(recordings[0].filename().string(), testing::EndsWith("Z-signal"));
  recordings::ReplaySource source(recordings::read_recording(recordings[0]), std::vector<std::string>{"cam0", "cam1"});
  std::vector<int> frames(2);
  std::uint32_t first = 0;
  while (const auto frame = source.next({})) {
    if (frame->camera == 0 && frames[0]++ == 0) first = frame->sequence;
    if (frame->camera == 1) ++frames[1];
  }
  EXPECT_GT(first, 3u);      // not from the start on
  EXPECT_LT(first, 50u);     // but from before the request
  EXPECT_GT(frames[0], 15);  // half a second and what came after
  EXPECT_LT(frames[0], 45);
  EXPECT_GT(frames[1], 15);
}

TEST_F(Live, SavesThePreRollWhenATargetIsLost) {
  rewrite("65, 115",
          "object_tracking: {coast_s: 0.1}\n"
          "record: {folder: " +
              (folder_ / "recordings").string() + ", pre_roll_s: 5, after_s: 0.1}\n");
  config_ = config::load_service_config(folder_ / "c.yaml");
  auto pictures = first_frames(demo / "recording", {"cam0", "cam1"}, 60);
  const capture::Timestamp start = capture::unix_now() + 50ms;
  std::vector<LiveCamera> list;
  for (std::size_t c = 0; c < 2; ++c) {
    for (std::size_t i = 25; i < 60; ++i) {  // the lights go out
      const capture::Image& before = pictures[c][i].pixels;
      pictures[c][i].pixels =
          capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, before.width, before.height).image;
    }
    for (std::size_t i = 0; i < 25; ++i) pictures[c][i].encoded.reset();
    list.push_back(FakeCamera(int(c), std::move(pictures[c]), start, false).live());
  }
  run_live(config_, std::move(list), options_, requests_, {});
  const auto recordings = folders_in(folder_ / "recordings");
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_THAT(recordings[0].filename().string(), testing::EndsWith("Z-lost"));
}

TEST_F(Live, WithoutCamerasTheErrorSaysWhatToDo) {
  EXPECT_THAT([&] { run_live(config_, {}, options_, requests_, {}); },
              testing::ThrowsMessage<std::runtime_error>(HasSubstr("cameras: there are none")));
}

TEST_F(Live, CamerasWithoutARigAreOnlyShown) {
  std::ofstream(folder_ / "c.yaml") << "version: 1\nrig: none\ntargets: {lime: {radius_m: 0.04}}\ncameras:\n"
                                       "  cam0: {device: 0, fps: 30, size: [320, 240]}\n"
                                       "  cam1: {device: 1, fps: 30, size: [320, 240]}\n";
  config_ = config::load_service_config(folder_ / "c.yaml");
  options_.tracks.clear();
  const LiveSummary summary = run_live(config_, cameras(20), options_, requests_, {});
  EXPECT_EQ(summary.figures.cameras.at(1).frames, 20u);
  EXPECT_GT(summary.figures.sets_tracked, 10u);
  EXPECT_THAT(summary.status.warnings, testing::Contains(HasSubstr("not calibrated")));
  EXPECT_TRUE(summary.figures.searches.empty());
  // Nothing that holds such a rig is written.
  options_.write_rig = folder_ / "learnt.yaml";
  EXPECT_THROW(run_live(config_, cameras(20), options_, requests_, {}), files::ConfigError);
  EXPECT_FALSE(fs::exists(options_.write_rig));
}

TEST(IsProgressing, NeedsEveryCameraAndTheTrackingThread) {
  const auto now = std::chrono::steady_clock::now();
  std::vector<capture::CameraHealth> cameras(2);
  for (auto& camera : cameras) camera.last_progress = now - 1s;
  pipeline::PipelineFigures figures;
  figures.tracking_round = now - 1s;
  EXPECT_TRUE(is_progressing(cameras, figures, now, 2s));
  cameras[1].last_progress = now - 3s;
  EXPECT_FALSE(is_progressing(cameras, figures, now, 2s));
  cameras[1].last_progress = now;
  figures.tracking_round = now - 3s;
  EXPECT_FALSE(is_progressing(cameras, figures, now, 2s));
}

TEST(StatusLine, SaysRatesAndStates) {
  publish::ServiceStatus status;
  status.cameras = {
      {.name = "left", .health = publish::CameraStatus::Health::delivering, .message = {}, .rate_hz = 29.96},
      {.name = "back", .health = publish::CameraStatus::Health::absent, .message = "unplugged"}};
  status.set_rate_hz = 29.9;
  status.targets = {"ball"};
  metrics::TargetFigures targets[] = {{.state = object_tracking::TrackState::coasting}};
  EXPECT_EQ(status_line(status, targets),
            "1 of 2 cameras deliver: left 30.0 Hz, back absent; 29.9 sets/s; ball coasting");
  EXPECT_EQ(status_line(status, targets, {}, "left", camera_tracking::PoseState::lost),
            "1 of 2 cameras deliver: left 30.0 Hz, back absent; 29.9 sets/s; ball coasting, left's pose lost");
  targets[0].most = 8, targets[0].tracked = 3;
  EXPECT_EQ(status_line(status, targets),
            "1 of 2 cameras deliver: left 30.0 Hz, back absent; 29.9 sets/s; ball: 3 of at most 8 tracking");
  metrics::LatencyHistogram latencies;
  for (int i = 0; i < 98; ++i) latencies.add(1900us);  // 1.5 .. 2 ms
  for (int i = 0; i < 2; ++i) latencies.add(7ms);      // 5 .. 10 ms
  EXPECT_EQ(
      status_line(status, targets, latencies.snapshot()),
      "1 of 2 cameras deliver: left 30.0 Hz, back absent; 29.9 sets/s, written 1.8 ms after their last byte (one in "
      "a hundred: 7.5); ball: 3 of at most 8 tracking");
}

}  // namespace
}  // namespace huetrack::daemon
