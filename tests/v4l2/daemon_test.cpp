// huetrackd and huetrack as a user runs them, on real V4L2 drivers: in the VM that tests/v4l2/run.sh boots.
#include <gmock/gmock.h>

#include <cstring>
#include <random>
#include <set>

#include "calib/model/rig_yaml.h"
#include "capture/clips.h"
#include "capture/timing/capture_clock.h"
#include "config/service_config.h"
#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"
#include "tracks/track_csv.h"
#include "tracks/truth_comparison.h"
#include "v4l2/vm.h"

namespace huetrack::v4l2 {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using capture::TemporaryFolder;
using capture::write_text;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const fs::path rendered = fs::path(HUETRACK_SHARED_DATA) / "rendered";
constexpr int metrics_port = 19464;

// Frames from .. from + count of every camera, into folder/<camera>.yuyv.
void write_films(const fs::path& recording, const std::vector<std::string>& cameras, const fs::path& folder,
                 int from = 0, int count = 1000000) {
  recordings::ReplaySource source(recordings::read_recording(recording), cameras);
  std::vector<std::ofstream> films;
  for (const auto& camera : cameras) films.emplace_back(folder / (camera + ".yuyv"), std::ios::binary);
  std::vector<int> seen(cameras.size());
  while (const auto frame = source.next({})) {
    const auto camera = std::size_t(frame->camera);
    if (const int k = seen[camera]++; k >= from && k < from + count) films[camera] << yuyv_of(frame->pixels);
  }
}

// The JPEG that is frame number `index` of a Motion-JPEG file.
std::string jpeg_of(const fs::path& video, int index) {
  AVFormatContext* file = nullptr;
  if (avformat_open_input(&file, video.c_str(), nullptr, nullptr) < 0) throw std::runtime_error(video.string());
  AVPacket* packet = av_packet_alloc();
  std::string jpeg;
  for (int k = 0; av_read_frame(file, packet) >= 0; ++k) {
    if (k == index) jpeg.assign(reinterpret_cast<const char*>(packet->data), std::size_t(packet->size));
    av_packet_unref(packet);
  }
  av_packet_free(&packet);
  avformat_close_input(&file);
  return jpeg;
}

class Daemon : public testing::Test {
 protected:
  void SetUp() override { SKIP_OUTSIDE_VM(); }
  void TearDown() override {
    if (HasFailure() && service) std::printf("---- the log of huetrackd\n%s----\n", service->err().c_str());
  }

  struct Camera {
    std::string name;
    fs::path device;
    std::string more;  // "format: mjpeg, controls: {gain: 3}"
  };
  // target: "pink: {color: {hue_deg: [310, 355]}}"
  fs::path configure(const fs::path& rig, const std::string& target, const std::vector<Camera>& cameras, double fps,
                     const std::string& more = "") {
    std::string text = "version: 1\nrig: " + rig.string() + "\ntargets: {" + target +
                       "}\nmetrics: {port: " + std::to_string(metrics_port) + "}\ncameras:\n";
    for (const auto& camera : cameras)
      text += "  " + camera.name + ": {device: " + camera.device.string() + ", fps: " + std::to_string(fps) +
              (camera.more.empty() ? "" : ", " + camera.more) + "}\n";
    write_text(folder / "c.yaml", text + more);
    return folder / "c.yaml";
  }
  std::unique_ptr<end_to_end::Process> start(const std::vector<std::string>& command, const std::string& name) {
    return std::make_unique<end_to_end::Process>(command, folder / (name + ".out"), folder / (name + ".err"),
                                                 std::map<std::string, std::string>{{"ROS_DOMAIN_ID", "30"}});
  }
  void run(const fs::path& config) {
    service = start({HUETRACKD, "run", config, "--tracks", folder / "live.csv"}, "service");
  }
  bool says(const std::string& text, std::chrono::milliseconds patience = 30s) {
    return comes_true([&] { return service->err().find(text) != std::string::npos; }, patience);
  }
  static double figure(const std::string& sample) {
    const auto text = end_to_end::http_get(metrics_port, "/metrics");
    if (!text) return -1;
    const auto samples = end_to_end::prometheus_samples(*text);
    const auto found = samples.find(sample);
    return found == samples.end() ? -1 : found->second;
  }
  static bool is_up(const std::string& camera) { return figure("huetrack_camera_up{camera=\"" + camera + "\"}") == 1; }
  static double frames(const std::string& camera) {
    return figure("huetrack_camera_frames_total{camera=\"" + camera + "\"}");
  }
  static bool is(const std::string& target, const std::string& state) {
    return figure("huetrack_target_state{target=\"" + target + "\",state=\"" + state + "\"}") == 1;
  }
  // SIGTERM, which must end it well and soon.
  void stop() {
    const auto asked = std::chrono::steady_clock::now();
    service->kill(SIGTERM);
    EXPECT_EQ(service->wait(), 0);
    const auto took = std::chrono::duration<double>(std::chrono::steady_clock::now() - asked).count();
    EXPECT_LT(took, 30.0);  // emulated, and on a busy machine; else within 1 s, as tests/soak asks
    std::printf("ended %.2f s after SIGTERM\n", took);
  }

  TemporaryFolder folder;
  std::unique_ptr<end_to_end::Process> service;
};

// ---- v4l2loopback: a known film at known times

struct Film {
  const char* name;
  const char* target;
  const char* hue;
  double fps;
  std::vector<std::string> cameras;
};
void PrintTo(const Film& film, std::ostream* out) {
  *out << film.name;
}

class Films : public Daemon, public testing::WithParamInterface<Film> {
 protected:
  int open_videos() const {
    int count = 0;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(service->pid()) + "/fd", error))
      count += fs::read_symlink(entry, error).string().starts_with("/dev/video") ? 1 : 0;
    return count;
  }
  // slowness: the film was played that many times slower than the truth says.
  static tracks::TruthFigures figures(const fs::path& csv, const fs::path& truth_file, const std::string& target,
                                      capture::Duration clock_offset, int slowness) {
    tracks::Truth truth = tracks::Truth::read(truth_file);
    const std::vector<std::string> targets{target};
    truth.match(targets);
    tracks::TruthComparison comparison(truth, target);
    auto tracks = tracks::read_track_csv(csv);
    for (object_tracking::ObjectEstimate& estimate : tracks.at(target)) {
      estimate.at = capture::Timestamp((estimate.at.time_since_epoch() - clock_offset) / slowness);
      comparison.add(estimate);
    }
    return comparison.figures();
  }

  struct Outcome {
    fs::path folder;
    double frames = 0;  // that came, of one camera: the fewest
    double dropped_sets = 0;
  };
  // Plays the film once into the loopback devices while huetrackd tracks and records, and huetrack watches.
  Outcome play(const Film& film, int film_frames, int slowness) {
    const double fps = film.fps / slowness;
    Outcome outcome{.folder = folder / ("slowness_" + std::to_string(slowness))};
    fs::create_directories(outcome.folder);
    std::vector<std::string> player_command{tool("v4l2play"),
                                            "-w",
                                            "320",
                                            "-h",
                                            "240",
                                            "-r",
                                            std::to_string(fps),
                                            "-n",
                                            std::to_string(film_frames),
                                            "-m",
                                            "-g",
                                            outcome.folder / "go"};
    std::vector<Camera> cameras;
    for (std::size_t c = 0; c < film.cameras.size(); ++c) {
      const fs::path node = node_of("v4l2 loopback", int(c));
      player_command.push_back(node.string() + "=" + (folder / (film.cameras[c] + ".yuyv")).string());
      cameras.push_back({film.cameras[c], node, ""});
    }
    const fs::path config = configure(
        rendered / film.name / "rig.yaml", std::string(film.target) + ": {color: {hue_deg: " + film.hue + "}}", cameras,
        fps, "record: {folder: " + (outcome.folder / "recordings").string() + ", always: true, queue_frames: 500}\n");
    const auto watch = start({HUETRACK, "watch", "--format", "csv"}, "watch");
    const auto player = start(player_command, "player");
    EXPECT_TRUE(comes_true([&] { return fs::exists(outcome.folder / "go.ready"); }));
    run(config);
    EXPECT_TRUE(comes_true([&] { return open_videos() == int(film.cameras.size()); }));
    EXPECT_TRUE(says("metrics on http"));  // its trackers are made: it is about to read the cameras
    std::this_thread::sleep_for(1s);       // and the subscriber finds it
    write_text(outcome.folder / "go", "");
    EXPECT_EQ(player->wait(), 0);
    std::this_thread::sleep_for(2s);  // the last sets go out, the metrics are renewed
    outcome.dropped_sets = figure("huetrack_dropped_sets_total");
    outcome.frames = 1e9;
    for (const auto& camera : film.cameras) outcome.frames = std::min(outcome.frames, frames(camera));
    stop();
    watch->kill(SIGTERM);
    watch->wait();
    return outcome;
  }
};

TEST_P(Films, LiveReplayAndRecordingAreByteEqual) {
  const Film& film = GetParam();
  const fs::path original = rendered / film.name;
  if (!fs::exists(original)) GTEST_SKIP() << original << " is not there";
  write_films(original, film.cameras, folder.path());
  const int film_frames = int(fs::file_size(folder / (film.cameras[0] + ".yuyv")) / (320 * 240 * 2));
  Outcome outcome;
  int slowness = 1;  // an emulated processor on a busy machine does not keep up with every film
  for (;; slowness *= 2) {
    outcome = play(film, film_frames, slowness);
    std::printf("%s: at %g frames/s, %g of %d frames came, %g sets were dropped\n", film.name, film.fps / slowness,
                outcome.frames, film_frames, outcome.dropped_sets);
    if (outcome.frames > 0.97 * film_frames && outcome.dropped_sets < 0.03 * film_frames) break;
    ASSERT_LT(slowness, 8) << "frames are missing, however slowly they come";
  }

  // The recording replays to the same track, whatever was dropped.
  const fs::path recording = *fs::directory_iterator(outcome.folder / "recordings");
  const auto replayed = start({HUETRACKD, "replay", recording / "huetrackd.yaml", recording, "--no-dds", "--quiet",
                               "--tracks", folder / "replayed.csv"},
                              "replay");
  EXPECT_EQ(replayed->wait(), 0) << replayed->err();
  const std::string live = end_to_end::contents(folder / "live.csv");
  EXPECT_GT(std::ranges::count(live, '\n'), film_frames * 9 / 10);
  EXPECT_TRUE(end_to_end::contents(folder / "replayed.csv") == live) << "live.csv and replayed.csv differ";

  // What a subscriber got is what was tracked.
  const auto tracks = tracks::read_track_csv(folder / "live.csv"),
             got_tracks = tracks::read_track_csv(folder / "watch.out");
  const auto &track = tracks.at(film.target), &received = got_tracks.at(film.target);
  ASSERT_EQ(received.size(), track.size());
  for (std::size_t i = 0; i < track.size(); ++i) {
    ASSERT_EQ(received[i].at, track[i].at);
    ASSERT_EQ(received[i].state, track[i].state);
    if (track[i].has_position()) {
      ASSERT_NEAR((received[i].position - track[i].position).norm(), 0, 1e-6);
    }
  }

  // And it is as good as a replay of the original.
  const auto of_original = start(
      {HUETRACKD, "replay", folder / "c.yaml", original, "--no-dds", "--quiet", "--tracks", folder / "original.csv"},
      "original");
  EXPECT_EQ(of_original->wait(), 0) << of_original->err();
  recordings::ReplaySource recorded(recordings::read_recording(recording), film.cameras);
  capture::Timestamp last{};  // nothing overwrites the film's last frame: that one came
  while (const auto frame = recorded.next({})) last = std::max(last, frame->captured_at);
  const capture::Duration offset =
      last.time_since_epoch() - capture::duration_of((film_frames - 1) * slowness / film.fps);
  const auto wanted = figures(folder / "original.csv", original / "groundtruth.csv", film.target, 0ns, 1);
  const auto got = figures(folder / "live.csv", original / "groundtruth.csv", film.target, offset, slowness);
  std::printf("%s: replay  %s\n%s: live    %s\n", film.name, tracks::to_text(wanted).c_str(), film.name,
              tracks::to_text(got).c_str());
  ASSERT_TRUE(got.lock_set);
  EXPECT_LE(*got.lock_set, *wanted.lock_set + 5);
  EXPECT_LT(got.rms_m, 1.3 * wanted.rms_m + 0.0005);
  EXPECT_EQ(got.wrong_tracking, 0u);
}

INSTANTIATE_TEST_SUITE_P(Rendered, Films,
                         testing::Values(Film{"two_cams", "lime", "[65, 115]", 30, {"cam0", "cam1"}},
                                         Film{"fast_60fps", "pink", "[310, 355]", 60, {"cam0", "cam1", "cam2"}}),
                         [](const auto& film) { return std::string(film.param.name); });

// ---- uvcvideo: what webcams use

class Webcams : public Daemon {
 protected:
  static constexpr int still = 20;  // the frame that the cameras show
  void SetUp() override {
    Daemon::SetUp();
    if (IsSkipped()) return;
    if (!fs::exists(original)) GTEST_SKIP() << original << " is not there";
    write_films(original, names, folder.path(), still, 1);
    for (const auto& name : names) write_text(folder / (name + ".mjpg"), jpeg_of(original / (name + ".mkv"), still));
    for (int c = 0; c < 3; ++c) plug_in(c);
  }
  void TearDown() override {
    Daemon::TearDown();
    service.reset();
    for (auto& camera : plugged) camera.reset();
    comes_true([] { return webcams().empty(); });
  }
  // One program and port for each, so that they can be unplugged one by one.
  void plug_in(int c) {
    const auto before = webcams();
    const std::string film = folder / (names[std::size_t(c)] + ".yuyv");
    for (int attempt = 0; attempt < 20; ++attempt) {
      plugged[std::size_t(c)] = std::make_unique<Program>(std::vector<std::string>{
          "/usr/bin/env", "UVCCAM_PORT=" + std::to_string(c), tool("uvccam"), "-w", "320", "-h", "240", "-r", "15",
          "-l", log(c), film + "," + (folder / (names[std::size_t(c)] + ".mjpg")).string()});
      if (comes_true([&] { return webcams().size() == before.size() + 1; }, 5s)) {
        for (const auto& node : webcams())
          if (!before.contains(node)) nodes[std::size_t(c)] = node;
        return;
      }
      plugged[std::size_t(c)].reset();
    }
    FAIL() << "the emulated camera cannot be plugged in";
  }
  // From sysfs: opening one takes long.
  static std::set<fs::path> webcams() {
    std::set<fs::path> found;
    for (const auto& entry : fs::directory_iterator("/sys/class/video4linux"))
      if (end_to_end::contents(entry.path() / "name").starts_with("UVC Camera") &&
          end_to_end::contents(entry.path() / "index") == "0\n")
        found.insert("/dev" / entry.path().filename());
    return found;
  }
  void unplug(int c) { plugged[std::size_t(c)].reset(); }
  fs::path log(int c) const { return folder / ("controls_" + names[std::size_t(c)]); }

  const fs::path original = rendered / "fast_60fps";
  const std::vector<std::string> names{"cam0", "cam1", "cam2"};
  std::array<std::unique_ptr<Program>, 3> plugged;
  std::array<fs::path, 3> nodes;
};

TEST_F(Webcams, TrackSurvivesUnplugging) {
  std::vector<Camera> cameras;
  const std::array<const char*, 3> more{
      "format: yuyv, controls: {exposure_time_absolute: 200, white_balance_temperature: 5000, gain: 30}",
      "format: mjpeg, controls: {exposure_time_absolute: 100, auto_exposure: Aperture Priority Mode}",
      "format: mjpeg, restore_controls: true, controls: {brightness: 7}"};
  for (int c = 0; c < 3; ++c) cameras.push_back({names[std::size_t(c)], nodes[std::size_t(c)], more[std::size_t(c)]});
  run(configure(original / "rig.yaml", "pink: {color: {hue_deg: [310, 355]}}", cameras, 15));
  ASSERT_TRUE(says("ready: 3 of 3 cameras deliver"));
  EXPECT_TRUE(comes_true([] { return is("pink", "tracking"); }));

  // Controls: set, the automatic ones off first; a refusal is reported.
  EXPECT_EQ(end_to_end::contents(log(0)),
            "cam 0 auto_exposure 1\ncam 0 white_balance_automatic 0\ncam 0 exposure_time_absolute 200\n"
            "cam 0 white_balance_temperature 5000\ncam 0 gain 30\n");
  EXPECT_THAT(service->err(), AllOf(HasSubstr("camera cam0: auto_exposure"), HasSubstr("warning: camera cam1: "),
                                    HasSubstr("exposure_time_absolute: asked 100, got 157: the camera refuses it")));
  EXPECT_THAT(service->err(), AllOf(HasSubstr("delivers yuyv 320x240"), HasSubstr("delivers mjpeg 320x240")));

  // One goes: the others continue. A second one goes: the distance is unknown.
  unplug(2);
  EXPECT_TRUE(comes_true([] { return !is_up("cam2"); }));
  EXPECT_TRUE(says("warning: camera cam2: unplugged: No such device"));
  std::this_thread::sleep_for(2s);
  EXPECT_TRUE(is("pink", "tracking"));
  unplug(1);
  EXPECT_TRUE(comes_true([] { return is("pink", "coasting") || is("pink", "lost"); }));
  EXPECT_TRUE(is_up("cam0"));
  // They return to their ports, and the track to its place.
  write_text(log(1), "");
  plug_in(1);
  EXPECT_TRUE(comes_true([] { return is("pink", "tracking"); }, 30s));
  plug_in(2);
  EXPECT_TRUE(comes_true([] { return is_up("cam1") && is_up("cam2"); }, 30s));
  EXPECT_TRUE(says("camera cam2: is back after"));
  EXPECT_TRUE(comes_true([] { return is("pink", "tracking"); }));
  EXPECT_THAT(end_to_end::contents(log(2)), HasSubstr("brightness 7\n"));
  write_text(log(2), "");
  stop();
  EXPECT_EQ(end_to_end::contents(log(2)), "cam 0 brightness 0\n") << "restored at the end";

  const tracks::Truth truth = [&] {
    tracks::Truth read = tracks::Truth::read(original / "groundtruth.csv");
    read.match(std::vector<std::string>{"pink"});
    return read;
  }();
  const auto where = truth.position("pink", capture::Timestamp(capture::duration_of(still / 60.0)));
  ASSERT_TRUE(where);
  int tracking = 0, coasting = 0;
  const auto tracks = tracks::read_track_csv(folder / "live.csv");
  for (const auto& estimate : tracks.at("pink")) {
    coasting += estimate.state == object_tracking::TrackState::coasting ? 1 : 0;
    if (estimate.state != object_tracking::TrackState::tracking) continue;
    ++tracking;
    EXPECT_LT((estimate.position - *where).norm(), 0.02);
  }
  EXPECT_GT(tracking, 30);
  EXPECT_GT(coasting, 0);
  std::printf("webcams: %d sets tracking, %d coasting\n", tracking, coasting);
}

TEST_F(Webcams, RecordKeepsTheCamerasJpegs) {
  std::vector<Camera> cameras;
  for (int c = 0; c < 3; ++c)
    cameras.push_back({names[std::size_t(c)], nodes[std::size_t(c)], c == 0 ? "format: yuyv" : "format: mjpeg"});
  const fs::path config = configure(original / "rig.yaml", "pink: {color: {hue_deg: [310, 355]}}", cameras, 15);
  service = start({HUETRACKD, "record", config, folder / "out", "--seconds", "3"}, "service");
  EXPECT_EQ(service->wait(), 0) << service->err();
  EXPECT_THAT(service->out(), AllOf(HasSubstr("cam0"), HasSubstr("0 by the disk")));
  EXPECT_TRUE(jpeg_of(folder / "out/cam1.mkv", 3) == jpeg_of(original / "cam1.mkv", still));
  recordings::ReplaySource recorded(recordings::read_recording(folder / "out"), names);
  int frames = 0;
  while (const auto frame = recorded.next({}))
    if (frame->camera == 0) {
      EXPECT_TRUE(yuyv_of(frame->pixels) == end_to_end::contents(folder / "cam0.yuyv"));
      ++frames;
    }
  EXPECT_GT(frames, 15);
  // into the same folder again: refused
  const auto again = start({HUETRACKD, "record", config, folder / "out"}, "again");
  EXPECT_EQ(again->wait(), 1);
  EXPECT_THAT(again->err(), HasSubstr("is not an empty folder"));
}

TEST_F(Webcams, TeachesAColour) {
  std::vector<Camera> cameras;
  for (int c = 0; c < 3; ++c)
    cameras.push_back({names[std::size_t(c)], nodes[std::size_t(c)], c == 0 ? "format: yuyv" : "format: mjpeg"});
  const fs::path config = configure(original / "rig.yaml", "pink: {color: {hue_deg: [200, 220]}}", cameras, 15);
  tracks::Truth truth = tracks::Truth::read(original / "groundtruth.csv");
  truth.match(std::vector<std::string>{"pink"});
  const auto where = truth.position("pink", capture::Timestamp(capture::duration_of(still / 60.0)));
  ASSERT_TRUE(where);
  const auto pixel = calib::read_rig(original / "rig.yaml").cameras.at(0).project_world(*where);
  ASSERT_TRUE(pixel);
  const std::string at = "cam0,5," + std::to_string(pixel->px.x()) + "," + std::to_string(pixel->px.y());
  const auto taught =
      start({HUETRACKD, "teach", config, "live", "--at", at, "--accept", "--pictures", folder / "taught"}, "taught");
  EXPECT_EQ(taught->wait(), 0) << taught->err();
  std::printf("%s", taught->out().c_str());
  EXPECT_THAT(taught->out(), AllOf(HasSubstr("camera cam0: "), HasSubstr("camera cam1: "), HasSubstr("camera cam2: "),
                                   HasSubstr("of the background matches"), HasSubstr("written into ")));
  for (const auto& name : names) EXPECT_TRUE(fs::exists(folder / "taught" / (name + ".png")));
  run(config);
  ASSERT_TRUE(says("ready: 3 of 3 cameras deliver", 120s));  // a colour table per camera, on an emulated processor
  EXPECT_TRUE(comes_true([] { return is("pink", "tracking"); }));
  // They are the service's now.
  const auto again = start({HUETRACKD, "teach", config, "live", "--at", at, "--dry-run"}, "again");
  EXPECT_EQ(again->wait(), 1);
  EXPECT_THAT(again->err(), HasSubstr("is it in use by a running huetrackd? Then teach on the page"));
  EXPECT_TRUE(comes_true([] { return is("pink", "tracking"); }));
  stop();
}

TEST_F(Webcams, DoctorDescribesThem) {
  fs::create_directories("/dev/v4l/by-path");  // the VM has no udev
  const fs::path link = "/dev/v4l/by-path/platform-vhci_hcd.0-usb-0:1:1.0-video-index0";
  fs::remove(link);
  fs::create_symlink(nodes[0], link);
  const fs::path config = configure(original / "rig.yaml", "pink: {color: {hue_deg: [310, 355]}}",
                                    {{"cam0", link, "format: yuyv, controls: {exposure_time_absolute: 200}"},
                                     {"cam1", nodes[1], "format: mjpeg, controls: {white_balance_temperature: 99}"}},
                                    15);
  service = start({HUETRACKD, "doctor", config, "--seconds", "2"}, "service");
  const int status = service->wait();
  const std::string said = service->out();
  std::printf("%s", said.c_str());
  EXPECT_EQ(status, 0) << "warnings only";
  for (const std::string& line :
       {std::string("camera cam0 ("), "ok    by path (the port): " + link.string(),
        std::string("note  no name in /dev/v4l/by-id"), std::string("ok    yuyv: 320x240@15"),
        std::string("ok    mjpeg: 320x240@15"), std::string("yuyv 320x240: "), std::string("frames/s reached of 15"),
        std::string("time stamps: start of exposure"),
        std::string("accepted controls of the configuration: exposure_time_absolute 200, auto_exposure 1"),
        std::string("WARN  white_balance_temperature: asked 99"), std::string("is not stable"),
        std::string("controls that accept a change (tested by one step, then restored): "), std::string("Mbit/s"),
        std::string("domain 30, from ROS_DOMAIN_ID"), std::string("WARN  white balance is automatic")})
    EXPECT_THAT(said, HasSubstr(line));
  EXPECT_THAT(end_to_end::contents(log(0)), HasSubstr("exposure_time_absolute 157\n")) << "as it was found";
  fs::remove(link);
}

// ---- vivid: a driver that fails on demand

class Faults : public Daemon {
 protected:
  void SetUp() override {
    Daemon::SetUp();
    if (IsSkipped()) return;
    for (int c = 0; c < 2; ++c) {
      nodes.push_back(node_of("vivid", c));
      ASSERT_FALSE(nodes.back().empty());
      set(c, "percentage_of_dropped_buffers", 0);
    }
    calib::CameraRig rig = calib::read_rig(fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording/rig.yaml");
    for (auto& camera : rig.cameras) camera.image_size.height = 180;  // a size that vivid has
    calib::write_rig(rig, folder / "rig.yaml");
  }
  void set(int camera, const std::string& control, std::int64_t value) {
    capture::V4l2Device knobs(nodes[std::size_t(camera)]);
    const std::vector<capture::ControlSetting> settings{{control, value}};
    knobs.set_controls(settings);
  }
  bool delivers(const std::string& camera) {
    const double then = frames(camera);
    return comes_true([&] { return is_up(camera) && frames(camera) > then + 10; });
  }
  std::vector<fs::path> nodes;
};

TEST_F(Faults, DoNotEndTheService) {
  run(configure(folder / "rig.yaml", "lime: {color: {hue_deg: [65, 115]}}",
                {{"cam0", nodes[0], ""}, {"cam1", nodes[1], ""}}, 30, "quorum: 1\n"));
  ASSERT_TRUE(says("ready: "));
  ASSERT_TRUE(delivers("cam0") && delivers("cam1"));

  set(0, "inject_v4l2_buf_flag_error", 1);
  EXPECT_TRUE(comes_true([] { return figure("huetrack_camera_corrupted_frames_total{camera=\"cam0\"}") >= 1; }));
  EXPECT_TRUE(says("camera cam0: a frame is damaged and not used (the driver flags it"));

  set(1, "percentage_of_dropped_buffers", 30);
  EXPECT_TRUE(comes_true([] { return figure("huetrack_camera_dropped_frames_total{camera=\"cam1\"}") >= 5; }));
  set(1, "percentage_of_dropped_buffers", 100);  // it stops delivering
  EXPECT_TRUE(says("camera cam1: no frame for"));
  EXPECT_TRUE(delivers("cam0"));
  set(1, "percentage_of_dropped_buffers", 0);
  EXPECT_TRUE(delivers("cam1"));

  set(0, "inject_fatal_streaming_error", 1);
  EXPECT_TRUE(says("camera cam0: the driver reports Input/output error"));
  EXPECT_TRUE(delivers("cam0"));
  set(0, "inject_vidioc_streamon_error", 1);
  set(0, "inject_fatal_streaming_error", 1);
  EXPECT_TRUE(says("its stream does not restart"));
  EXPECT_TRUE(delivers("cam0"));
  set(1, "disconnect", 1);
  EXPECT_TRUE(says("camera cam1: unplugged: No such device"));
  EXPECT_TRUE(delivers("cam1"));
  EXPECT_TRUE(delivers("cam0"));
  stop();
}

// A second one goes on tracking while the first one locks up, and does not answer from the start.
TEST_F(Faults, WrongCameraAtStartDoesNotStopTheOthers) {
  run(configure(folder / "rig.yaml", "lime: {color: {hue_deg: [65, 115]}}",
                {{"cam0", nodes[0], ""}, {"cam1", "/dev/null", ""}}, 15, "quorum: 1\n"));
  ASSERT_TRUE(says("ready: 1 of 2"));
  EXPECT_TRUE(says("camera cam1: not available: /dev/null: is not a video device"));
  EXPECT_TRUE(delivers("cam0"));
  stop();

  run(configure(folder / "rig.yaml", "lime: {color: {hue_deg: [65, 115]}}",
                {{"cam0", "/dev/null", ""}, {"cam1", "/dev/zero", ""}}, 15));
  EXPECT_EQ(service->wait(), 1);  // no camera at all: the configuration is wrong
  EXPECT_TRUE(says("is not a video device"));
}

TEST_F(Faults, LockedUpCameraBlocksNothing) {
  const fs::path config =
      configure(folder / "rig.yaml", "lime: {color: {hue_deg: [65, 115]}}",
                {{"cam0", nodes[0], "restore_controls: true, controls: {brightness: 100, contrast: 100}"},
                 {"cam1", nodes[1], ""}},
                15, "quorum: 1\ndds: {enabled: false}\n");
  const auto run_preloaded = [&] {
    service = std::make_unique<end_to_end::Process>(
        std::vector<std::string>{HUETRACKD, "run", config}, folder / "service.out", folder / "service.err",
        std::map<std::string, std::string>{{"LD_PRELOAD", tool("locked_up.so")},
                                           {"LOCKED_UP_DEVICE", nodes[0].string()},
                                           {"LOCKED_UP_WHILE", (folder / "locked_up").string()}});
  };
  const auto end = [&](const char* when) {
    const auto asked = std::chrono::steady_clock::now();
    service->kill(SIGTERM);
    EXPECT_EQ(service->wait(), 0);
    const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - asked).count();
    EXPECT_LT(took, 4.5) << "one ioctl takes 5 s";  // emulated, and on a busy machine
    std::printf("locked up %s: ended %.2f s after SIGTERM\n", when, took);
  };
  run_preloaded();
  ASSERT_TRUE(says("ready: "));
  ASSERT_TRUE(delivers("cam0") && delivers("cam1"));
  write_text(folder / "locked_up", "");
  EXPECT_TRUE(says("camera cam0: does not answer, since it was to be "));
  EXPECT_TRUE(delivers("cam1"));
  end("while running");
  EXPECT_THAT(service->err(), HasSubstr("camera cam0: does not answer; ending without waiting for it"));

  const auto begun = std::chrono::steady_clock::now();
  run_preloaded();
  ASSERT_TRUE(says("ready: 1 of 2 cameras deliver", 60s));
  std::printf("locked up from the start: ready after %.1f s\n",
              std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
  EXPECT_TRUE(says("camera cam0: does not answer, since it was to be opened"));
  EXPECT_TRUE(delivers("cam1"));
  end("from the start");
  fs::remove(folder / "locked_up");
  set(0, "brightness", 128);
  set(0, "contrast", 128);
}

// ---- kill -9

using Kills = Faults;

// HUETRACK_KILLS says how often (20). On a machine that is not emulated, subscribers notice within 1.5 s:
// end_to_end/kill_test.cpp
TEST_F(Kills, RestartWorksAndRecordingAndSubscribersSurvive) {
  const char* wanted = std::getenv("HUETRACK_KILLS");
  const int kills = wanted ? std::stoi(wanted) : 20;
  constexpr double fps = 25;
  const fs::path config = configure(
      folder / "rig.yaml", "lime: {color: {hue_deg: [65, 115]}}", {{"cam0", nodes[0], ""}, {"cam1", nodes[1], ""}}, fps,
      "record: {folder: " + (folder / "recordings").string() + ", always: true, queue_frames: 500}\n");
  const std::vector<std::string> cameras{"cam0", "cam1"};
  const auto watch = start({HUETRACK, "watch", "--format", "csv"}, "watch");
  std::mt19937 random(3);
  std::set<fs::path> known;
  double slowest_s = 0, most_lost_s = 0;
  int frames = 0;
  for (int k = 0; k < kills; ++k) {
    const std::string before = watch->out();
    run(config);
    ASSERT_TRUE(comes_true([&] { return watch->out().size() > before.size() + 1000; }, 60s)) << "kill " << k;
    std::this_thread::sleep_for(std::chrono::milliseconds(std::uniform_int_distribution<int>(0, 1500)(random)));
    const std::string said = watch->err();
    service->kill(SIGKILL);
    const auto killed = std::chrono::steady_clock::now();
    EXPECT_EQ(service->wait(), -SIGKILL);
    EXPECT_TRUE(comes_true([&] { return watch->err().size() > said.size(); })) << "not noticed";
    const auto since_kill = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - killed).count();
    };
    slowest_s = std::max(slowest_s, since_kill());

    fs::path recording;
    for (const auto& entry : fs::directory_iterator(folder / "recordings"))
      if (known.insert(entry.path()).second) recording = entry.path();
    ASSERT_FALSE(recording.empty());
    recordings::ReplaySource source(recordings::read_recording(recording), cameras);
    std::optional<capture::Timestamp> last;
    while (const auto frame = source.next({})) {
      ++frames;
      last = frame->captured_at;
    }
    ASSERT_TRUE(last) << "nothing was recorded";
    // Against what was published, in samples: an emulated start takes seconds, in which the cameras wait with full
    // buffers.
    const auto published = tracks::read_track_csv(folder / "watch.out")["lime"];
    const auto later =
        std::ranges::count_if(published, [&](const object_tracking::ObjectEstimate& e) { return e.at > *last; });
    most_lost_s = std::max(most_lost_s, double(later) / fps);
    fs::remove_all(recording);  // the VM's disk is its memory
  }
  std::printf("%d kills: noticed within %.2f s, %d frames in the recordings, at most the last %.2f s of film missing\n",
              kills, slowest_s, frames, most_lost_s);
  EXPECT_LT(slowest_s, 4);
  EXPECT_LT(most_lost_s, 1);
}

}  // namespace
}  // namespace huetrack::v4l2
