// What a service manager hears of a running service, and how the service takes trouble with its disk.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>

#include "daemon/fake_camera.h"
#include "daemon/live.h"
#include "tracks/track_csv.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

const fs::path demo_folder = fs::path(HUETRACK_SOURCE_DIR) / "configs/demo";

class Service : public testing::Test {
 protected:
  Service() : folder(fs::path(testing::TempDir()) / ("service_" + std::to_string(::getpid()))) {
    fs::create_directories(folder);
    options.no_dds = true;
    options.tracks = folder / "live.csv";
  }
  ~Service() override {
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
    if (listening.joinable()) {
      listening.request_stop();
      listening.join();
    }
    if (socket >= 0) ::close(socket);
    fs::remove_all(folder);
  }
  void listen() {
    socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    (folder / "notify").string().copy(address.sun_path, sizeof address.sun_path - 1);
    ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ::setenv("NOTIFY_SOCKET", (folder / "notify").c_str(), 1);
    listening = std::jthread([this](const std::stop_token& end) {  // at once: the kernel keeps some ten messages
      char buffer[4096];
      while (!end.stop_requested()) {
        const ssize_t got = ::recv(socket, buffer, sizeof buffer, 0);
        if (got < 0) {
          std::this_thread::sleep_for(5ms);
          continue;
        }
        const std::scoped_lock lock(mutex);
        received.emplace_back(buffer, std::size_t(got));
      }
    });
  }
  // What was heard since the last call.
  std::vector<std::string> heard() {
    std::this_thread::sleep_for(50ms);
    const std::scoped_lock lock(mutex);
    return std::exchange(received, {});
  }
  config::ServiceConfig configure(const std::string& more = "", const std::string& hue = "65, 115") const {
    std::ofstream(folder / "c.yaml") << "version: 1\nrig: " << (demo_folder / "recording/rig.yaml").string()
                                     << "\ntargets: {lime: {color: {hue_deg: [" << hue << "]}}}\n"
                                     << "cameras: {cam0: {device: 0, fps: 30}, cam1: {device: 1, fps: 30}}\n"
                                     << more;
    return config::load_service_config(folder / "c.yaml");
  }
  static std::vector<LiveCamera> cameras(std::size_t frames, bool go_silent = false) {
    return fake_cameras(demo_folder / "recording", {"cam0", "cam1"}, frames, go_silent);
  }

  const fs::path folder;
  LiveCommand options;
  LiveRequests requests;
  int socket = -1;
  std::mutex mutex;
  std::vector<std::string> received;  // guarded by mutex
  std::jthread listening;
};

TEST_F(Service, NotifiesReadyStatusWatchdogReloadingAndStopping) {
  listen();
  ::setenv("WATCHDOG_USEC", "400000", 1);
  const config::ServiceConfig config = configure();
  std::jthread reloader([&] {
    std::this_thread::sleep_for(900ms);
    configure("", "60, 120");
    requests.reload = true;
  });
  run_live(config, cameras(60), options, requests, {});
  const auto messages = heard();
  const auto first = [&](const std::string& text) {
    return std::ranges::find_if(messages, [&](const auto& m) { return m.find(text) != std::string::npos; }) -
           messages.begin();
  };
  const auto count = std::ptrdiff_t(messages.size());
  ASSERT_LT(first("READY=1"), count);
  ASSERT_LT(first("RELOADING=1\nMONOTONIC_USEC="), count);
  EXPECT_LT(first("READY=1"), first("RELOADING=1"));
  EXPECT_EQ(messages.at(std::size_t(first("RELOADING=1")) + 1), "READY=1");
  EXPECT_THAT(messages, Contains(HasSubstr("STATUS=2 of 2 cameras deliver: cam0 ")));
  EXPECT_THAT(messages, Contains(HasSubstr("lime tracking")));
  EXPECT_GE(std::ranges::count(messages, "WATCHDOG=1"), 8);  // about 2 s, every 100 ms
  EXPECT_THAT(messages.back(), HasSubstr("STOPPING=1"));
}

TEST_F(Service, IsNotReadyBelowItsQuorum) {
  listen();
  auto one = cameras(20);
  one.pop_back();
  config::ServiceConfig config = configure("quorum: 2\n");
  run_live(config, std::move(one), options, requests, {});
  EXPECT_THAT(heard(), AllOf(Not(Contains("READY=1")), Contains(HasSubstr("STATUS="))));
}

// A camera whose thread never comes back from the driver.
class Stuck final : public capture::FrameSource {
 public:
  std::optional<capture::Frame> next(std::stop_token stop) override {
    while (!stop.stop_requested()) std::this_thread::sleep_for(10ms);
    return std::nullopt;
  }
};

TEST_F(Service, AStuckCameraStarvesTheWatchdog) {
  listen();
  ::setenv("WATCHDOG_USEC", "400000", 1);  // is_progressing() is patient for 3 s
  std::vector<LiveCamera> list;
  const auto since = std::chrono::steady_clock::now();
  list.push_back({.camera = 0,
                  .source = std::make_unique<Stuck>(),
                  .health =
                      [since] {
                        capture::CameraHealth health;
                        health.last_progress = since;
                        return health;
                      },
                  .take_events = [] { return std::vector<capture::CameraEvent>{}; }});
  std::stop_source stop;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(3300ms);
    heard();
    std::this_thread::sleep_for(600ms);
    EXPECT_THAT(heard(), Not(Contains("WATCHDOG=1")));
    stop.request_stop();
  });
  run_live(configure(), std::move(list), options, requests, stop.get_token());
}

// ---- The disk

TEST_F(Service, AFullDiskEndsOnlyTheRecording) {
  const config::ServiceConfig config =
      configure("record: {folder: " + (folder / "recordings").string() + ", always: true}\n");
  auto list = cameras(60);
  std::signal(SIGXFSZ, SIG_IGN);  // as huetrackd does
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{.rlim_cur = 2'000'000, .rlim_max = before.rlim_max};  // some 13 frames of each
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const LiveSummary summary = run_live(config, std::move(list), options, requests, {});
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  ASSERT_TRUE(summary.recorded.failure);
  EXPECT_THAT(*summary.recorded.failure,
              AllOf(HasSubstr(".mkv: File too large"), HasSubstr("recording stopped after")));
  EXPECT_THAT(summary.status.warnings, Contains(HasSubstr("recording stopped")));
  EXPECT_EQ(tracks::read_track_csv(options.tracks).at("lime").back().state, object_tracking::TrackState::tracking);
  EXPECT_EQ(summary.figures.cameras[0].frames, 60u);
}

TEST(Recorder, FramesThatTheDiskDoesNotTakeAreDroppedAndCounted) {
  const fs::path folder = fs::path(testing::TempDir()) / ("recorder_" + std::to_string(::getpid()));
  pipeline::RecorderOptions options;
  options.recording.cameras = {"left", "right"};
  options.queue_frames = 2;
  options.recording.raw_storage = recordings::RawStorage::huffyuv;  // slower than frames are offered here
  pipeline::Recorder recorder(options);
  recorder.start(folder);
  capture::Frame frame;
  frame.pixels = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 1280, 960).image;
  constexpr int offered = 100;
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < offered; ++i) {
    frame.sequence = std::uint32_t(i);
    frame.captured_at = capture::Timestamp(capture::Duration(i * 1ms));
    recorder.offer(frame);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, 1s) << "it delayed the pipeline";
  recorder.finish();
  const pipeline::RecorderFigures figures = recorder.figures();
  EXPECT_GT(figures.dropped.at(0), 0u);
  EXPECT_EQ(figures.dropped[0] + figures.cameras.at(0).frames, std::uint64_t{offered});
  EXPECT_EQ(figures.dropped.at(1), 0u);
  EXPECT_EQ(figures.failure, std::nullopt);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace huetrack::daemon
