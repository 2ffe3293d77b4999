#include "hosts/remote_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <numbers>
#include <sstream>

#include "daemon/capture_command.h"
#include "daemon/fake_camera.h"
#include "daemon/live.h"
#include "daemon/replay.h"
#include "hosts/camera_host.h"
#include "publish/test_domain.h"

namespace huetrack::hosts {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

const fs::path demo = fs::path(HUETRACK_SOURCE_DIR) / "configs/demo";

// A camera host in a thread, with one camera of the demo's recording, from `start` on.
class Host {
 public:
  Host(const std::string& name, int camera, std::vector<capture::Frame> frames, capture::Timestamp start,
       std::function<std::string(const capture::LightFindings&)> describe_light = nullptr)
      : host_({.host = name,
               .cameras = {"there"},
               .program_version = "test",
               .transport = {.name = "host", .domain = publish::test_domain(), .interfaces = {"lo"}},
               .describe_light = std::move(describe_light)},
              cameras(camera, std::move(frames), start)),
        running_([this](const std::stop_token& stop) { host_.run(stop); }),
        telling_([this](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            host_.publish_states();
            std::this_thread::sleep_for(50ms);
          }
        }) {}
  SentFigures sent() const { return host_.sent().front(); }

 private:
  static std::vector<capture::LiveCamera> cameras(int camera, std::vector<capture::Frame> frames,
                                                  capture::Timestamp start) {
    std::vector<capture::LiveCamera> out;
    out.push_back(daemon::FakeCamera(camera, std::move(frames), start, true).live());
    return out;
  }
  CameraHost host_;
  std::jthread running_, telling_;
};

config::ServiceConfig tracker_config(const fs::path& folder, const std::string& of_camera = "",
                                     const std::string& of_target = "", const std::string& more = "") {
  std::ofstream(folder / "c.yaml") << "version: 1\nrig: " << (demo / "recording/rig.yaml").string()
                                   << "\ntargets: {lime: {" << of_target << "color: {hue_deg: [65, 115]}}}\n"
                                   << "cameras: {cam0: {host: left-pi, camera: there" << of_camera
                                   << "}, cam1: {host: right-pi, camera: there" << of_camera << "}}\n"
                                   << more << "dds: {domain: " << publish::test_domain() << ", interfaces: [lo]}\n";
  return config::load_service_config(folder / "c.yaml");
}

std::vector<std::vector<std::string>> rows_of(const fs::path& csv) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream file(csv);
  for (std::string line; std::getline(file, line);) {
    auto& row = rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
  }
  return rows;
}

class RemoteCamera : public testing::Test {
 protected:
  RemoteCamera()
      : folder_(fs::path(testing::TempDir()) / ("hosted_" + std::to_string(::getpid()) + "_" +
                                                testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_);
  }
  ~RemoteCamera() override { fs::remove_all(folder_); }
  // The rows of what was recorded of the cameras, by the configuration as it stands.
  std::vector<std::vector<std::string>> replayed() const {
    const fs::path recording = *fs::directory_iterator(folder_ / "recorded");
    daemon::ReplayCommand again;
    again.config = folder_ / "c.yaml";
    again.recording = {recording.string()};
    again.no_dds = true;
    again.progress = false;
    again.tracks = folder_ / "again.csv";
    daemon::replay(again, {});
    return rows_of(folder_ / "again.csv");
  }
  fs::path folder_;
};

// Films through two camera hosts and DDS, and from this machine, at the same time.
class Both {
 public:
  // A busy machine loses frames, mostly the first ones during discovery: then it is repeated with more time. nullopt:
  // too slow each time. frames: of each film.
  static std::optional<Both> tracked(const config::ServiceConfig& there, const config::ServiceConfig& here,
                                     const fs::path& folder, int frames = 60) {
    for (int attempt = 0; attempt < 5; ++attempt) {
      fs::remove_all(folder / "recorded");
      if (auto both = tracked_once(there, here, folder, frames, 1500ms + attempt * 1000ms)) return both;
    }
    return std::nullopt;
  }
  std::vector<std::vector<std::string>> there, here;
  SentFigures sent;  // of one of the two hosts

 private:
  // nullopt: a frame or a set was lost, and the tracks are not of the same ones.
  static std::optional<Both> tracked_once(const config::ServiceConfig& there, const config::ServiceConfig& here,
                                          const fs::path& folder, int frames, std::chrono::milliseconds first) {
    const auto pictures = daemon::first_frames(demo / "recording", {"cam0", "cam1"}, frames);
    const capture::Timestamp start = capture::unix_now() + first;
    std::stop_source stop;
    Both both;
    const auto run = [&](const config::ServiceConfig& config, std::vector<capture::LiveCamera> cameras,
                         const fs::path& tracks) {
      daemon::LiveCommand options;
      options.no_dds = true;
      options.tracks = tracks;
      daemon::LiveRequests requests;
      const auto summary = daemon::run_live(config, std::move(cameras), options, requests, stop.get_token());
      std::uint64_t lost = summary.figures.sets_dropped + summary.figures.frame_sets.incomplete_sets;
      for (const auto& camera : summary.figures.cameras) lost += camera.dropped;
      return lost;
    };
    std::uint64_t lost_there = 0, lost_here = 0;
    std::vector<capture::LiveCamera> cameras;
    for (int c = 0; c < 2; ++c) cameras.push_back(daemon::FakeCamera(c, pictures[std::size_t(c)], start, true).live());
    {
      const Host left("left-pi", 0, pictures[0], start), right("right-pi", 1, pictures[1], start);
      const std::jthread elsewhere(
          [&] { lost_there = run(there, pipeline::open_cameras(there), folder / "there.csv"); });
      const std::jthread at_the_same_time([&] { lost_here = run(here, std::move(cameras), folder / "here.csv"); });
      const auto until = start + frames * 1000ms / 30 + 800ms;
      while (capture::unix_now() < until) std::this_thread::sleep_for(20ms);
      stop.request_stop();
      both.sent = left.sent();
    }
    if (lost_there + lost_here > 0) {
      std::printf("%llu and %llu sets or frames were lost\n", static_cast<unsigned long long>(lost_there),
                  static_cast<unsigned long long>(lost_here));
      return std::nullopt;
    }
    both.there = rows_of(folder / "there.csv"), both.here = rows_of(folder / "here.csv");
    return both;
  }
};

// The whole demo from two hosts: byte-equal to local cameras, and to the replay of the recording.
TEST_F(RemoteCamera, TracksEqualThoseOfLocalCameras) {
  const config::ServiceConfig here = tracker_config(folder_);
  const config::ServiceConfig there =
      tracker_config(folder_, "", "", "record: {folder: " + folder_.string() + "/recorded, always: true}\n");
  constexpr int all = 150;
  const auto both = Both::tracked(there, here, folder_, all);
  if (!both) GTEST_SKIP() << "this machine is too slow now for two trackers";
  EXPECT_EQ(both->there.size(), std::size_t(all + 1));
  EXPECT_EQ(both->there, both->here);
  EXPECT_EQ(replayed(), both->there);
}

// Tracks from matches alone, and from their recording.
TEST_F(RemoteCamera, TracksOfMatchesEqualThoseOfFrames) {
  const std::string blob = "shape: blob, ";
  const auto here = tracker_config(folder_, "", blob);
  const auto there = tracker_config(folder_, ", send: matches", blob,
                                    "record: {folder: " + folder_.string() + "/recorded, always: true}\n");
  const auto both = Both::tracked(there, here, folder_);
  if (!both) GTEST_SKIP() << "this machine is too slow now for two trackers";
  ASSERT_GT(both->there.size(), 50U);
  EXPECT_EQ(both->there, both->here);
  EXPECT_GE(both->sent.frames, 55U);
  // With three pictures of some 30 kB among them.
  EXPECT_LT(both->sent.bytes / both->sent.frames, 6000U);

  EXPECT_TRUE(fs::exists(fs::directory_iterator(folder_ / "recorded")->path() / "cam0.matches"));
  EXPECT_EQ(replayed(), both->there);
}

// Patches arrive where the tracker predicted the ball, and are recorded with the matches. Works on a slow machine, too:
// lost frames are not in the recording either.
TEST_F(RemoteCamera, OutlinesAreFittedInMatchesAndReplayed) {
  const auto config = [&](const char* shape, const std::string& more = "") {
    return tracker_config(folder_, ", send: matches", shape, more);
  };
  const auto there = config("shape: ball, ", "record: {folder: " + folder_.string() + "/recorded, always: true}\n");
  const auto pictures = daemon::first_frames(demo / "recording", {"cam0", "cam1"}, 60);
  const capture::Timestamp start = capture::unix_now() + 1500ms;
  SentFigures sent;
  {
    std::stop_source stop;
    const Host left("left-pi", 0, pictures[0], start), right("right-pi", 1, pictures[1], start);
    const std::jthread tracking([&] {
      daemon::LiveCommand options;
      options.no_dds = true;
      options.tracks = folder_ / "there.csv";
      daemon::LiveRequests requests;
      daemon::run_live(there, pipeline::open_cameras(there), options, requests, stop.get_token());
    });
    while (capture::unix_now() < start + 2800ms) std::this_thread::sleep_for(20ms);
    stop.request_stop();
    sent = left.sent();
  }
  const auto rows = rows_of(folder_ / "there.csv");
  ASSERT_GT(rows.size(), 30U);
  EXPECT_LT(sent.bytes / sent.frames, 6000U);
  config("shape: ball, ");
  EXPECT_EQ(replayed(), rows);
  config("shape: blob, ");
  EXPECT_NE(replayed(), rows) << "no outline was fitted";
}

// The host watches light in all its frames, for trackers that receive only matches.
TEST_F(RemoteCamera, LightIsWatchedByTheHost) {
  const config::ServiceConfig config = tracker_config(folder_, ", send: matches, picture_every_s: 0");
  constexpr int levels = 90;  // three seconds from bright to dark and back
  std::vector<capture::Image> pictures;
  for (int i = 0; i < levels; ++i) {
    const double level = 110 * (1 + 0.15 * std::sin(2 * std::numbers::pi * i / levels));
    const auto pixels =
        std::make_shared<std::vector<std::uint8_t>>(std::size_t(640 * 480), static_cast<std::uint8_t>(level));
    pictures.push_back({.format = capture::PixelFormat::grey,
                        .range = capture::ColorRange::full,
                        .width = 640,
                        .height = 480,
                        .planes = {{{pixels->data(), 640}}},
                        .owner = pixels});
  }
  std::vector<capture::Frame> frames(30 * 60);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].sequence = static_cast<std::uint32_t>(i);
    frames[i].captured_at = capture::Timestamp(std::int64_t(i) * capture::Duration(33'333'333));
    frames[i].pixels = pictures[i % levels];
  }
  auto cameras = pipeline::open_cameras(config);
  const Host left("left-pi", 0, std::move(frames), capture::unix_now() + 500ms,
                  [](const capture::LightFindings& found) { return found.exposure_change ? "it wanders" : ""; });
  cameras[0].look_for(std::vector{capture::MatchedColor{65, 115, 0.2, 1, 0.1, 1}});
  std::stop_source stop;
  const std::jthread reading([&] {
    while (cameras[0].source->next(stop.get_token())) {
    }
  });
  std::string warning;
  for (int i = 0; i < 500 && warning.empty(); ++i) {  // some five seconds, on a machine that has time
    std::this_thread::sleep_for(100ms);
    warning = cameras[0].health().warning;
  }
  EXPECT_EQ(warning, "left-pi reports: it wanders");
  stop.request_stop();
}

// On any machine: frames arrive unchanged, and most arrive.
TEST_F(RemoteCamera, FramesArriveAsSent) {
  const config::ServiceConfig config = tracker_config(folder_);
  const auto pictures = daemon::first_frames(demo / "recording", {"cam0", "cam1"}, 40);
  auto cameras = pipeline::open_cameras(config);
  const capture::Timestamp start = capture::unix_now() + 1500ms;
  const Host left("left-pi", 0, pictures[0], start);
  std::size_t come = 0;
  std::stop_source stop;
  const std::jthread ending([&] {
    while (capture::unix_now() < start + 4s) std::this_thread::sleep_for(20ms);
    stop.request_stop();
  });
  while (const auto frame = cameras[0].source->next(stop.get_token())) {
    const auto at = frame->stamped_at - start;
    const auto sent = std::ranges::find(pictures[0], capture::Timestamp(at), &capture::Frame::captured_at);
    ASSERT_NE(sent, pictures[0].end()) << "no frame was sent with the stamp " << at.count() << " ns";
    EXPECT_EQ(frame->camera, 0);
    EXPECT_EQ(frame->captured_at, frame->stamped_at) << "the film's period is regular, and one machine has one clock";
    ASSERT_EQ(frame->pixels.format, sent->pixels.format);
    capture::require_all(frame->pixels);
    capture::require_all(sent->pixels);
    for (int row = 0; row < frame->pixels.height; ++row)
      ASSERT_TRUE(std::equal(sent->pixels.planes[0].data + row * sent->pixels.planes[0].stride,
                             sent->pixels.planes[0].data + row * sent->pixels.planes[0].stride +
                                 capture::plane_row_bytes(frame->pixels.format, 0, frame->pixels.width),
                             frame->pixels.planes[0].data + row * frame->pixels.planes[0].stride));
    ++come;
  }
  EXPECT_GE(come, 20U);
}

TEST_F(RemoteCamera, MissingHostIsReportedAndAwaited) {
  const config::ServiceConfig config = tracker_config(folder_);
  auto cameras = pipeline::open_cameras(config);
  ASSERT_EQ(cameras.size(), 2U);
  std::string said;
  std::stop_source stop;
  const std::jthread reading([&] {
    while (cameras[0].source->next(stop.get_token())) {
    }
  });
  const auto wait_for = [&](const std::string& words) {
    for (int i = 0; i < 200 && said.find(words) == std::string::npos; ++i) {
      for (const auto& event : cameras[0].take_events()) said += event.message + "\n";
      std::this_thread::sleep_for(50ms);
    }
    return said.find(words) != std::string::npos;
  };
  EXPECT_TRUE(wait_for("left-pi is not found")) << said;
  EXPECT_EQ(cameras[0].health().state, capture::CaptureState::absent);
  const auto pictures = daemon::first_frames(demo / "recording", {"cam0", "cam1"}, 30);
  for (int times = 0; times < 2; ++times) {
    said.clear();
    {
      const Host left("left-pi", 0, pictures[0], capture::unix_now() + 800ms);
      EXPECT_TRUE(wait_for("delivering, from left-pi")) << said;
      EXPECT_EQ(cameras[0].health().state, capture::CaptureState::delivering);
    }
    said.clear();
    EXPECT_TRUE(wait_for("left-pi is silent")) << said;
  }
  EXPECT_GE(cameras[0].health().reconnects, 1U);
  stop.request_stop();
}

// As with two machines cloned from one disk image: the first one is used, and it is reported.
TEST_F(RemoteCamera, FirstOfTwoHostsWithOneNameIsUsed) {
  auto cameras = pipeline::open_cameras(tracker_config(folder_));
  const auto film = daemon::looped(daemon::first_frames(demo / "recording", {"cam0"}, 30).front(), 60);
  const auto health = [&] { return cameras[0].health(); };
  const auto comes_true = [](const auto& what) {
    for (int i = 0; i < 200 && !what(); ++i) std::this_thread::sleep_for(50ms);
    return what();
  };
  std::stop_source stop;
  const std::jthread reading([&] {
    while (cameras[0].source->next(stop.get_token())) {
    }
  });
  const Host first("left-pi", 0, film, capture::unix_now());
  EXPECT_TRUE(comes_true([&] { return health().frames > 10; }));
  EXPECT_EQ(health().warning, "");
  std::optional<Host> second(std::in_place, "left-pi", 0, film, capture::unix_now());
  EXPECT_TRUE(comes_true([&] { return health().warning.starts_with("two camera hosts are called left-pi"); }));
  const auto before = health();
  std::this_thread::sleep_for(1500ms);
  const auto after = health();
  EXPECT_EQ(after.state, capture::CaptureState::delivering) << after.message;
  EXPECT_EQ(after.reconnects, 0U);
  EXPECT_GT(after.frames, before.frames + 10);
  EXPECT_TRUE(after.clock && after.clock->is_known);
  second.reset();
  EXPECT_TRUE(comes_true([&] { return health().warning.empty(); })) << health().warning;
  stop.request_stop();
}

TEST(CameraHostNames, AreValidInTopicNames) {
  EXPECT_TRUE(is_host_name("pi-3.hall_2"));
  for (const char* bad : {"", "a/b", "a b", "\xc3\xa4", "a\n"}) EXPECT_FALSE(is_host_name(bad)) << bad;
}

TEST_F(RemoteCamera, WrongConfigurationsAreExplained) {
  const auto refusal = [&](const std::string& cameras) -> std::string {
    std::ofstream(folder_ / "bad.yaml") << "version: 1\nrig: " << (demo / "recording/rig.yaml").string()
                                        << "\ntargets: {lime: {color: {hue_deg: [65, 115]}}}\ncameras: " << cameras
                                        << "\n";
    try {
      config::load_service_config(folder_ / "bad.yaml");
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal("{cam0: {host: a}, cam1: {device: 1}}"), "");
  EXPECT_THAT(refusal("{cam0: {host: a, device: 0}}"), HasSubstr("belongs to the camera's host"));
  EXPECT_THAT(refusal("{cam0: {host: a, fps: 30}}"), HasSubstr("has the camera, and its settings"));
  EXPECT_THAT(refusal("{cam0: {device: 0, camera: x}}"), HasSubstr("give host, too"));
  EXPECT_THAT(refusal("{cam0: {host: a, camera: x}, cam1: {host: a, camera: x}}"),
              HasSubstr("is the camera of cam0 already"));
  EXPECT_EQ(refusal("{cam0: {host: a, send: matches, picture_every_s: 0}, cam1: {device: 1}}"), "");
  EXPECT_THAT(refusal("{cam0: {device: 0, send: matches}}"), HasSubstr("give host, too"));
  EXPECT_THAT(refusal("{cam0: {host: a, send: match}}"), HasSubstr("matches"));
  EXPECT_THAT(refusal("{cam0: {host: a, send: matches, picture_every_s: 61}}"), HasSubstr("picture_every_s"));
  const auto refusal_of_host = [&](const std::string& text) -> std::string {
    std::ofstream(folder_ / "host.yaml") << text;
    try {
      config::load_capture_config(folder_ / "host.yaml");
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal_of_host("version: 1\nhost: pi-3\ncameras: {left: {device: 0, size: [640, 480], fps: 30}}\n"), "");
  EXPECT_THAT(refusal_of_host("version: 1\ncameras: {left: {device: 0}}\n"), HasSubstr("size"));
  EXPECT_THAT(
      refusal_of_host("version: 1\ncameras: {left: {device: 0, size: [640, 480]}, right: {device: 0, size: [640, "
                      "480]}}\n"),
      HasSubstr("right.device: is the device of left already"));
  // The printed text agrees.
  const std::string host = "version: 1\nhost: pi-3\ncameras: {left: {device: 0, size: [640, 480], fps: 30}}\n";
  EXPECT_EQ(refusal_of_host(host), "");
  const std::string printed = config::to_yaml(config::load_capture_config(folder_ / "host.yaml"));
  EXPECT_THAT(printed,
              testing::AllOf(HasSubstr("host: \"pi-3\""), HasSubstr("size: [640, 480]"), HasSubstr("fps: 30")));
  EXPECT_EQ(refusal_of_host(printed), "") << printed;
  EXPECT_EQ(config::to_yaml(config::load_capture_config(folder_ / "host.yaml")), printed);
  EXPECT_THAT(refusal_of_host("version: 1\nrig: r.yaml\ncameras: {left: {device: 0}}\n"), HasSubstr("of a tracker"));
  EXPECT_THAT(refusal_of_host("version: 1\n"), HasSubstr("name the cameras of this host"));
}

}  // namespace
}  // namespace huetrack::hosts
