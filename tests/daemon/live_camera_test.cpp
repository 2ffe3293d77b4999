// A tracked camera live, from a fake camera to the bus: the native pose, ROS 2's and /tf, the map; and that a recording
// of it is a bug report. And a map that is saved, and found again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "daemon/fake_camera.h"
#include "daemon/live.h"
#include "daemon/replay.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/ros2_messagesPubSubTypes.h"
#include "idl/topics.h"
#include "publish/test_domain.h"
#include "scene/led_scene.h"
#include "slow_motion.h"

namespace huetrack::daemon {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace fs = std::filesystem;
using eprosima::fastrtps::types::ReturnCode_t;
using namespace std::chrono_literals;
using namespace testing;

const int domain = publish::test_domain();

template <typename Type>
class Reader {
 public:
  Reader(idl::DdsParticipant& participant, const std::string& topic, const dds::DataReaderQos& qos)
      : reader_(participant.create_reader<Type>(topic.c_str(), qos)) {}
  const std::vector<typename Type::type>& samples() {
    typename Type::type sample;
    dds::SampleInfo info;
    while (reader_.take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) samples_.push_back(sample);
    return samples_;
  }

 private:
  dds::DataReader& reader_;
  std::vector<typename Type::type> samples_;
};

class LiveCameraTracking : public Test {
 protected:
  LiveCameraTracking()
      : folder_(fs::path(TempDir()) / ("live_camera_" + std::to_string(::getpid()) + "_" +
                                       UnitTest::GetInstance()->current_test_info()->name())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~LiveCameraTracking() override {
    if (!HasFailure()) fs::remove_all(folder_);
  }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  static std::string contents(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
  }
  ReplaySummary replay_of(const fs::path& config, const fs::path& recording, const fs::path& poses) const {
    ReplayCommand command;
    command.config = config, command.recording = {recording}, command.poses = poses;
    command.no_dds = true, command.progress = false;
    return replay(command, {});
  }

  fs::path folder_;
};

// What the LEDs' test scene shows a live camera; its poses are known.
class LiveLeds : public LiveCameraTracking {
 protected:
  static constexpr int frames = 75;

  config::ServiceConfig config(const std::string& more = "") const {
    std::ostringstream text;
    write(
        "rig.yaml",
        "version: 1\ncameras:\n  hand:\n    image_size: [320, 240]\n    model: pinhole_radtan\n"
        "    intrinsics: {fx: 250, fy: 251, cx: 158.5, cy: 121}\n    distortion: [-0.11, 0.02, 0.0004, -0.0005, 0]\n");
    text << "version: 1\nrig: rig.yaml\ncameras: {hand: {device: 0}}\ndds: {domain: " << domain
         << ", interfaces: [lo]}\ncamera_tracking:\n  camera: hand\n  particle_count: 500\n  start:\n    leds: [";
    for (const auto& led : scene_.leds)
      text << (&led != scene_.leds.data() ? ", " : "") << "[" << led.x() << ", " << led.y() << ", " << led.z() << "]";
    text << "]\n    led_schedule: [[0], [1], [2], [3], [4], [5], [6], [7]]\n"
            "    led_room_min: [-1.5, -1.5, 0]\n    led_room_max: [1.5, 1.5, 2]\n"
         << more;
    return config::load_service_config(write("c.yaml", text.str()));
  }
  std::vector<LiveCamera> cameras(capture::Duration from_now, capture::Duration period) {
    std::vector<capture::Frame> list;
    for (int i = 0; i < frames; ++i) {
      capture::Frame frame;
      frame.sequence = std::uint32_t(i);
      frame.captured_at = capture::Timestamp(i * period);
      frame.pixels = scene::led_image(scene_, scene::led_dots(scene_, scene::led_scene_pose(i / scene_.fps), {i % 8}),
                                      std::uint64_t(i));
      list.push_back(std::move(frame));
    }
    start_ = capture::unix_now() + from_now;
    std::vector<LiveCamera> live;
    live.push_back(FakeCamera(0, std::move(list), start_, false).live());
    return live;
  }

  const scene::LedScene scene_ = scene::led_scene();
  capture::Timestamp start_;
};

TEST_F(LiveLeds, PosesGoToTheBusNativelyAndForRos) {
  idl::DdsParticipant participant({.name = "test", .domain = domain, .interfaces = {"lo"}});
  dds::DataReaderQos all = idl::status_reader_qos();
  all.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  all.history().kind = dds::KEEP_ALL_HISTORY_QOS;
  Reader<msg::CameraPosePubSubType> native(participant, idl::camera_pose_topic, idl::object_position_reader_qos());
  Reader<geometry_msgs::msg::dds_::PoseWithCovarianceStamped_PubSubType> ros(participant,
                                                                             idl::ros2_camera_pose_topic("hand"), all);
  Reader<tf2_msgs::msg::dds_::TFMessage_PubSubType> tf(participant, idl::ros2_tf_topic, all);
  Reader<msg::CameraMapPubSubType> map(participant, idl::camera_map_topic, idl::status_reader_qos());

  const config::ServiceConfig c = config();
  LiveCommand options;
  options.poses = folder_ / "live.tum";
  LiveRequests requests;
  const auto period =
      std::chrono::duration_cast<capture::Duration>(std::chrono::duration<double>(slow_motion / scene_.fps));
  // By then readers and writers have met.
  const LiveSummary summary = run_live(c, cameras(1s, period), options, requests, {});
  EXPECT_EQ(summary.figures.camera_frames_tracked + summary.figures.camera_frames_dropped, std::uint64_t(frames));

  std::size_t with_pose = 0;
  const auto& samples = native.samples();
  EXPECT_EQ(samples.size(), summary.figures.camera_frames_tracked);
  for (const auto& s : samples) {
    EXPECT_EQ(s.camera(), "hand");
    EXPECT_LE(s.captured_at(), s.received_at());
    EXPECT_LE(s.received_at(), s.published_at());
    const bool has_pose = s.state() == msg::CAMERA_STATE_TRACKING || s.state() == msg::CAMERA_STATE_COASTING;
    ASSERT_EQ(has_pose, std::isfinite(s.position()[0]));
    ASSERT_EQ(has_pose, std::isfinite(s.covariance()[35]));
    if (!has_pose) continue;
    const std::int64_t offset = s.captured_at() - start_.time_since_epoch().count();
    const double t = double(offset) * 1e-9 / slow_motion;
    const Eigen::Vector3d at(s.position()[0], s.position()[1], s.position()[2]);
    // From slower pictures it knows less, and says so.
    const double stated = std::sqrt(s.covariance()[0] + s.covariance()[7] + s.covariance()[14]);
    EXPECT_LT((scene::led_scene_pose(t).translation - at).norm(), slow_motion > 1 ? 4 * stated : 0.02) << t;
    ++with_pose;
  }
  ASSERT_GT(with_pose, std::size_t(frames) / 2);
  // For ROS 2: only where there is a pose, and the same.
  ASSERT_EQ(ros.samples().size(), with_pose);
  ASSERT_EQ(tf.samples().size(), with_pose);
  const auto& last = samples.back();
  const auto& pose = ros.samples().back();
  EXPECT_EQ(pose.header().frame_id(), "world");
  EXPECT_EQ(pose.header().stamp().sec() * 1'000'000'000LL + pose.header().stamp().nanosec(), last.captured_at());
  EXPECT_EQ(pose.pose().pose().position().x(), last.position()[0]);
  EXPECT_EQ(pose.pose().pose().orientation().w(), last.orientation()[3]);
  EXPECT_THAT(pose.pose().covariance(), ElementsAreArray(last.covariance()));
  const auto& transform = tf.samples().back().transforms().at(0);
  EXPECT_EQ(transform.child_frame_id(), "hand");
  EXPECT_EQ(transform.transform().translation().z(), last.position()[2]);
  // The map: the LEDs.
  ASSERT_FALSE(map.samples().empty());
  EXPECT_EQ(map.samples().back().points().size(), scene_.leds.size());
  // And the file: a line per pose.
  const std::string file = contents(options.poses);
  EXPECT_EQ(std::size_t(std::ranges::count(file, '\n')), with_pose);
}

TEST_F(LiveLeds, ARecordingReplaysToTheSamePosesEvenWhenFramesWereDropped) {
  // The disk's queue holds all frames, so that only the tracker's own drops some, on however slow a disk.
  const config::ServiceConfig c = config("record: {queue_frames: " + std::to_string(frames) + "}\n");
  LiveCommand options;
  options.no_dds = true;
  options.poses = folder_ / "live.tum";
  options.record_to = folder_ / "recording";
  LiveRequests requests;
  // The first 30 come at once: more than the queue holds, so that some are dropped.
  const LiveSummary summary = run_live(c, cameras(-330ms, 11ms), options, requests, {});
  EXPECT_EQ(summary.figures.camera_frames_tracked + summary.figures.camera_frames_dropped, std::uint64_t(frames));
  EXPECT_GT(summary.figures.camera_frames_dropped, 0u);
  ASSERT_THAT(summary.recorded.dropped, ElementsAre(0u));
  replay_of(folder_ / "recording/huetrackd.yaml", folder_ / "recording", folder_ / "replayed.tum");
  EXPECT_EQ(contents(folder_ / "replayed.tum"), contents(options.poses));
  EXPECT_THAT(contents(options.poses), Not(IsEmpty()));
}

TEST_F(LiveLeds, ARecordingHoldsTheFilesThatItsConfigurationNames) {
  const fs::path board = write("my board.yaml", "inner_corners: [9, 6]\nsquare: 0.025\n");
  write("rig.yaml", "");
  config::ServiceConfig c = config();
  c.camera_tracking.leds.clear();
  c.camera_tracking.led_schedule.clear();
  c.camera_tracking.board = board;
  LiveCommand options;
  options.no_dds = true;
  LiveRequests requests;
  // Told at the start, not when all the work is done.
  c.camera_tracking.save_map = write("letter.txt", "my letter");
  EXPECT_THROW(run_live(c, cameras(0ms, 11ms), options, requests, {}), std::runtime_error);
  EXPECT_EQ(contents(c.camera_tracking.save_map), "my letter");
  const std::string older = "huetrack camera map 1\nan older one";
  c.camera_tracking.save_map = write("mine.map", older);
  options.record_to = folder_ / "recording";
  options.seconds = 0.2;
  run_live(c, cameras(0ms, 11ms), options, requests, {});
  EXPECT_EQ(contents(c.camera_tracking.save_map), older);  // there was no board, and so no pose and no map
  fs::remove(board);
  fs::rename(folder_ / "recording", folder_ / "moved");
  EXPECT_THAT(contents(folder_ / "moved/huetrackd.yaml"), Not(HasSubstr(folder_.string())));
  const config::ServiceConfig read = config::load_service_config(folder_ / "moved/huetrackd.yaml");
  EXPECT_EQ(read.camera_tracking.board, folder_ / "moved/camera_board.yaml");
  EXPECT_TRUE(read.camera_tracking.save_map.empty());
  replay_of(folder_ / "moved/huetrackd.yaml", folder_ / "moved", folder_ / "poses.tum");  // the board is read
}

// A map is saved at the end of one run and found again by another, which has never seen the start.
TEST_F(LiveCameraTracking, AMapIsSavedAndTheCameraFoundInIt) {
  const fs::path data = fs::path(HUETRACK_SHARED_DATA) / "rendered/desk";
  if (!fs::exists(data / "recording.yaml")) GTEST_SKIP() << data << " is not there";
  const std::string desk = fs::absolute(data).string();
  const std::string camera = "version: 1\nrig: " + desk +
                             "/rig.yaml\ncameras: {cam0: {device: 0}}\ndds: {enabled: false}\n" +
                             "camera_tracking:\n  camera: cam0\n";
  const fs::path first =
      write("first.yaml", camera + "  start: {rectangle: " + desk + "/rectangle.csv}\n  save_map: desk.map\n");
  const auto pictures = first_frames(data, {"cam0"}, 120);
  const auto live = [&](const fs::path& file, std::size_t from, std::size_t to, LiveCommand options) {
    std::vector<capture::Frame> some(pictures[0].begin() + std::ptrdiff_t(from),
                                     pictures[0].begin() + std::ptrdiff_t(to));
    for (auto& frame : some) frame.captured_at = capture::Timestamp(slow_motion * frame.captured_at.time_since_epoch());
    const capture::Timestamp begin = capture::unix_now() - some.front().captured_at.time_since_epoch() + 50ms;
    std::vector<LiveCamera> cameras;
    cameras.push_back(FakeCamera(0, std::move(some), begin, false).live());
    LiveRequests requests;
    run_live(config::load_service_config(file), std::move(cameras), options, requests, {});
  };
  live(first, 0, 45, {});
  ASSERT_TRUE(fs::exists(folder_ / "desk.map"));

  const fs::path second = write("second.yaml", camera + "  load_map: desk.map\n");
  LiveCommand options;
  options.poses = folder_ / "second.tum";
  options.record_to = folder_ / "recording";
  live(second, 66, 90, options);
  const std::string poses = contents(options.poses);
  EXPECT_GE(std::ranges::count(poses, '\n'), 18) << poses;  // found within five frames

  // The recording holds the map: it replays anywhere.
  fs::remove(folder_ / "desk.map");
  replay_of(folder_ / "recording/huetrackd.yaml", folder_ / "recording", folder_ / "replayed.tum");
  EXPECT_EQ(contents(folder_ / "replayed.tum"), poses);
}

}  // namespace
}  // namespace huetrack::daemon
