// A calibration is recorded, solved by a child process (here a shell script), reported and accepted, and ends well
// whatever the child does.
#include "page/calibration_session.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <sstream>
#include <thread>

#include "calib/model/rig_yaml.h"
#include "capture/frames/pixel_format.h"
#include "config/taught_file.h"
#include "page/control_handler.h"

namespace huetrack::page {
namespace {

using namespace testing;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

bool comes(const std::function<bool()>& condition) {
  for (int i = 0; i < 1000; ++i, std::this_thread::sleep_for(5ms))
    if (condition()) return true;
  return false;
}

class Scratch : public Test {
 protected:
  Scratch() { fs::create_directories(folder); }
  ~Scratch() override { fs::remove_all(folder); }
  fs::path script(const std::string& text) const {
    const fs::path file = folder / "fake-calibrate";
    std::ofstream(file) << "#!/bin/sh\n" << text;
    fs::permissions(file, fs::perms::owner_all);
    return file;
  }
  const fs::path folder = fs::path(TempDir()) / ("calibration_" + std::to_string(::getpid()));
};

// ---- The other program

struct Said {
  std::vector<std::string> lines;
  ChildProcess::Ended ended;
};
Said said_by(ChildProcess& child) {
  Said said;
  EXPECT_TRUE(comes([&] {
    const auto ended = child.ended();
    for (auto& line : child.take_lines()) said.lines.push_back(std::move(line));
    if (ended) said.ended = *ended;
    return ended.has_value();
  }));
  return said;
}

using Child = Scratch;

TEST_F(Child, ReportsItsLinesAndItsEnd) {
  ChildProcess child(script("echo one; echo two >&2; echo \"$2\"; printf last; exit 3"), {"a", "b c"});
  const Said said = said_by(child);
  EXPECT_THAT(said.lines, ElementsAre("one", "two", "b c", "last"));
  EXPECT_EQ(said.ended.status, 3);
  EXPECT_EQ(said.ended.signal, 0);
}

TEST_F(Child, HasALowerPriorityNoOpenFilesAndItsSignals) {
  std::vector<capture::FileDescriptor> open;  // that exec() does not close
  for (int i = 0; i < 20; ++i) open.emplace_back(::open("/dev/null", O_RDONLY));
  sigset_t block, before;
  sigemptyset(&block);
  sigaddset(&block, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &block, &before);
  ChildProcess child(script("set -- /proc/$$/fd/*; echo $#; cut -d' ' -f19 /proc/$$/stat; exec sleep 100"), {});
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  std::vector<std::string> lines;
  ASSERT_TRUE(comes([&] {
    for (auto& line : child.take_lines()) lines.push_back(std::move(line));
    return lines.size() == 2;
  }));
  EXPECT_LE(std::stoi(lines[0]), 6);  // the three, the script itself, and what the shell opens to look
  EXPECT_GE(std::stoi(lines[1]), ::getpriority(PRIO_PROCESS, 0));
  child.ask_to_end();
  EXPECT_EQ(said_by(child).ended.signal, SIGTERM);
}

TEST_F(Child, IsKilledWithItsOwner) {
  std::string pid;
  {
    ChildProcess child(script("trap '' TERM; echo $$; while :; do sleep 0.05; done"), {});
    ASSERT_TRUE(comes([&] {
      for (auto& line : child.take_lines()) pid = line;
      return !pid.empty();
    }));
  }
  EXPECT_FALSE(fs::exists("/proc/" + pid));
}

TEST_F(Child, AMissingProgramIsAnError) {
  EXPECT_THROW(ChildProcess(folder / "none", {}), std::runtime_error);
  EXPECT_EQ(find_program("no-such-program-of-ours"), std::nullopt);
  EXPECT_NE(find_program("sh"), std::nullopt);
}

TEST_F(Child, EndlessOutputDoesNotBlock) {
  ChildProcess child(script("exec yes aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"), {});
  const auto began = std::chrono::steady_clock::now();
  for (int i = 0; i < 20; ++i) EXPECT_LT(child.take_lines().size(), 10'000u);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 2s);
}

// ---- The session

const char* const unknown_calibration =
    "This service does not know that request: after calibrate it knows board [KEY=VALUE ...], wave TARGET [SECONDS] "
    "[camera_distance=CAMERA,CAMERA,METRES], again camera_distance=CAMERA,CAMERA,METRES, state, stop, cancel, accept "
    "[doubtful].";

class Calibrating : public Scratch {
 protected:
  Calibrating() {
    const fs::path demo = fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording/rig.yaml";
    fs::copy_file(demo, folder / "rig.yaml");
    write("rig: rig.yaml");
  }
  void write(const std::string& rig, const std::string& radius = "radius_m: 0.04, ") {
    std::ofstream(folder / "c.yaml")
        << "version: 1\n"
        << rig << "\n"
        << "cameras: {cam0: {device: 0, size: [320, 240]}, cam1: {device: 1, size: [320, 240]}}\n"
           "targets: {ball: {"
        << radius
        << "color: {hue_deg: [65, 115]}}, new: {}}\n"
           "record: {folder: recordings, pre_roll_s: 3, after_s: 0, on_lost: false}\n"
           "control: {allow_teach: true, allow_record: true}\n";
    config = config::load_service_config(folder / "c.yaml");
    keeper.emplace(config, pipeline::RecordingKeeperOptions{.record_to = {}, .cameras_in_use = 2});
  }
  void begin(const std::string& text) {
    session.emplace(
        CalibrationSession::Options{.program = script("echo \"$*\" >> " + (folder / "asked").string() + "\n" + text),
                                    .log = [this](bool, const std::string& what) { log += what + "\n"; }});
  }
  msg::ControlReply ask(std::vector<std::string> words) {
    words.insert(words.begin(), "calibrate");
    msg::ControlRequest request;
    request.words(std::move(words));
    ControlHandler::Actions actions{.recording = &*keeper, .calibration = &*session};
    actions.restart = [this] {
      ++begun_anew;
      return std::string();
    };
    return ControlHandler(actions).answer(request, config);
  }
  std::map<std::string, std::vector<std::string>> state() {
    std::map<std::string, std::vector<std::string>> rows;
    const msg::ControlReply told = ask({"state"});
    for (const auto& row : told.rows()) rows[row.columns()[0]] = {row.columns().begin() + 1, row.columns().end()};
    return rows;
  }
  std::string stage() { return state()["state"].at(0); }
  bool becomes(const std::string& wanted) {
    return comes([&] {
      frame();
      session->poll(&*keeper);
      keeper->supervise();
      return stage() == wanted;
    });
  }
  void frame() {
    for (int c = 0; c < 2; ++c) {
      capture::Frame frame;
      frame.camera = c;
      frame.sequence = std::uint32_t(number);
      frame.captured_at = capture::Timestamp(100s + number * 50ms);
      frame.pixels = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 32, 24).image;
      keeper->on_frame(frame, frame.captured_at);
    }
    ++number;
  }
  std::string text_of(const fs::path& file) const {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  fs::path recording() const {
    for (const auto& entry : fs::directory_iterator(folder / "recordings")) return entry.path();
    return {};
  }
  config::ServiceConfig config;
  std::optional<pipeline::RecordingKeeper> keeper;
  std::optional<CalibrationSession> session;
  std::string log;
  int number = 0, begun_anew = 0;
};

// What the fake does: writes the board, tells of it until it is asked to end, and finds the rig that lies in the
// folder.
const std::string honest = R"(
rig= report=
for word; do case $word in --rig=*) rig=${word#--rig=} ;; --report=*) report=${word#--report=} ;; esac; done
case $2 in
  board) for word; do case $word in --board=*) echo x > ${word#--board=} ;; esac; done ;;
  coverage)
    trap 'exit 0' TERM
    while :; do
      printf '@coverage\tcam0\t3\t15\t40\t60\t1,0,2\t1,0,1,0,0\tno board\n@need\tcam0: show it in the top left\n'
      printf '@progress\thold it still\t3\t\t\n'
      sleep 0.05
    done ;;
  extrinsics | wave)
    printf '@progress\tlooking for the board\t5\t10\tcam0 3\n'
    cp FOLDER/found.yaml $rig
    echo '<html>fine</html>' > $report
    printf 'some words\n@verdict\tVERDICT\tcorners fit to 0.20 px rms\n'
    exit STATUS ;;
esac
)";
std::string with(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}
std::string fake(const fs::path& folder, const std::string& verdict = "usable", int status = 0) {
  return with(with(with(honest, "FOLDER", folder.string()), "VERDICT", verdict), "STATUS", std::to_string(status));
}

// It would be recorded for minutes, and refused then.
TEST_F(Calibrating, NeedsPictures) {
  begin(fake(folder));
  config.cameras[1].host = "bench";
  EXPECT_TRUE(ask({"board"}).granted());  // with those of another host as well
  EXPECT_TRUE(ask({"cancel"}).granted());
  config.cameras[1].send = config::Sent::matches;
  for (const std::vector<std::string>& words : {std::vector<std::string>{"board"}, {"wave", "ball"}}) {
    const msg::ControlReply reply = ask(words);
    EXPECT_FALSE(reply.granted());
    EXPECT_THAT(reply.reason(), AllOf(HasSubstr("Camera cam1 sends matches only"), HasSubstr("set send: frames in "),
                                      HasSubstr("c.yaml")));
  }
  EXPECT_EQ(stage(), "cancelled");
}

TEST_F(Calibrating, ABoardIsRecordedCoveredSolvedAndAccepted) {
  calib::CameraRig found = config.rig;
  found.cameras[0].cam_from_world.translation.x() += 0.01;
  calib::write_rig(found, folder / "found.yaml");
  begin(fake(folder));
  EXPECT_EQ(stage(), "idle");
  EXPECT_THAT(ask({"accept"}).reason(), HasSubstr("no calibration to accept"));
  const msg::ControlReply begun = ask({"board", "type=chessboard", "columns=7", "square_mm=80"});
  ASSERT_TRUE(begun.granted()) << begun.reason();
  EXPECT_EQ(stage(), "recording");
  EXPECT_THAT(ask({"board"}).reason(), HasSubstr("is in progress"));
  EXPECT_THAT(ask({"wave", "ball"}).reason(), HasSubstr("is in progress"));
  EXPECT_THAT(ask({"accept"}).reason(), HasSubstr("not finished yet"));
  ASSERT_TRUE(comes([&] {
    frame();
    session->poll(&*keeper);
    return state().contains("need");
  }));
  EXPECT_THAT(state()["coverage"], ElementsAre("cam0", "3", "15", "40", "60", "1,0,2", "1,0,1,0,0", "no board"));
  EXPECT_THAT(state()["need"], ElementsAre("cam0: show it in the top left"));
  EXPECT_THAT(state()["progress"], ElementsAre("hold it still", "3", "", ""));
  // It is not deleted under its feet.
  EXPECT_THAT(session->busy_with(), EndsWith("-board"));
  ASSERT_TRUE(ask({"stop"}).granted());
  EXPECT_FALSE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("usable")) << stage() << log;
  EXPECT_EQ(state()["says"].at(0), "corners fit to 0.20 px rms");
  EXPECT_THAT(text_of(folder / "asked"), AllOf(HasSubstr("--type=chessboard --columns=7 --square=80"),
                                               HasSubstr("--tell-program extrinsics " + recording().string()),
                                               HasSubstr("--intrinsics=" + (folder / "rig.yaml").string()),
                                               HasSubstr("--world-of=" + (folder / "rig.yaml").string())));
  EXPECT_EQ(text_of(recording() / "calibrated.log"), "some words\n");
  const msg::ControlReply report = ask({"report", "6"});
  EXPECT_EQ(std::string(report.bytes().begin(), report.bytes().end()), "fine</html>\n");
  EXPECT_EQ(report.rows().at(0).columns().at(0), "18");
  EXPECT_TRUE(ask({"report", "18"}).bytes().empty());
  EXPECT_EQ(ask({"report", "-1"}).reason(), "Write a whole number, not -1.");
  // Of one that is larger than any memory a piece is read, and no more.
  constexpr std::uint64_t huge = 1ULL << 40;
  fs::resize_file(recording() / "calibrated.report.html", huge);
  const msg::ControlReply first = ask({"report", "0"});
  ASSERT_TRUE(first.granted()) << first.reason();
  EXPECT_EQ(first.bytes().size(), 256u * 1024);
  EXPECT_EQ(first.rows().at(0).columns().at(0), std::to_string(huge));
  EXPECT_EQ(ask({"report", std::to_string(huge - 3)}).bytes().size(), 3u);

  const msg::ControlReply accepted = ask({"accept"});
  ASSERT_TRUE(accepted.granted()) << accepted.reason();
  EXPECT_THAT(accepted.reason(), AllOf(StartsWith("Accepted: c.rig-"), HasSubstr("restarts")));
  EXPECT_EQ(begun_anew, 1);
  EXPECT_EQ(stage(), "accepted");
  EXPECT_FALSE(ask({"accept"}).granted());
  const config::ServiceConfig now = config::load_service_config(folder / "c.yaml");
  EXPECT_EQ(calib::rig_identity(now.rig), calib::rig_identity(found));
  EXPECT_EQ(calib::rig_identity(calib::read_rig(folder / "rig.yaml")), calib::rig_identity(config.rig)) << "it is kept";
  config::undo_taught(folder / "c.yaml");
  EXPECT_EQ(calib::rig_identity(config::load_service_config(folder / "c.yaml").rig), calib::rig_identity(config.rig));
}

TEST_F(Calibrating, TheFirstRigIsFromABoard) {
  calib::write_rig(config.rig, folder / "found.yaml");
  write("rig: none");
  begin(fake(folder));
  ASSERT_TRUE(ask({"board"}).granted());
  ASSERT_TRUE(comes([&] {
    frame();
    session->poll(&*keeper);
    return state().contains("need");
  }));
  EXPECT_FALSE(fs::exists(recording() / "rig.yaml"));
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("usable")) << log;
  EXPECT_THAT(text_of(folder / "asked"), AllOf(HasSubstr("--type=charuco"), Not(HasSubstr("--intrinsics"))));
  ASSERT_TRUE(ask({"accept"}).granted());
  EXPECT_TRUE(config::load_service_config(folder / "c.yaml").is_calibrated());
}

// No lens is known. The world is at the first camera, so that targets are looked for where the ball was; and what the
// throws show of its radius replaces the default.
TEST_F(Calibrating, OrFromTheBallAlone) {
  calib::CameraRig found = config.rig;
  const Eigen::Vector3d middle(0, 0, 1), origin = found.cameras[0].centre();
  for (calib::Camera& camera : found.cameras)
    camera.cam_from_world.translation += camera.cam_from_world.rotation * origin;
  calib::write_rig(found, folder / "found.yaml");
  const Eigen::Vector3d there = middle - origin;
  const std::string ball =
      fmt::format("printf '@ball\\t{:.3f}\\t{:.3f}\\t{:.3f}\\t0.0332\\n'; cp ", there.x(), there.y(), there.z());
  write("rig: none", "");
  begin(with(fake(folder), "cp ", ball));
  const msg::ControlReply begun = ask({"wave", "ball", "5"});
  ASSERT_TRUE(begun.granted()) << begun.reason();
  EXPECT_THAT(state()["says"].at(0), HasSubstr("then throw it five times and let it bounce"));
  ASSERT_TRUE(comes([&] {
    frame();
    session->poll(&*keeper);
    return state().contains("need");
  }));
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("usable")) << log;
  ASSERT_TRUE(ask({"accept"}).granted());
  const config::ServiceConfig now = config::load_service_config(folder / "c.yaml");
  EXPECT_TRUE(now.is_calibrated());
  EXPECT_NEAR(now.targets.at(0).radius_m, 0.0332, 1e-9);
  const object_tracking::Volume& volume = now.object_tracking.volume;
  EXPECT_TRUE((volume.min.array() < there.array() - 0.3).all() && (there.array() + 0.3 < volume.max.array()).all())
      << volume.min.transpose() << " to " << volume.max.transpose() << " around " << there.transpose();
}

TEST_F(Calibrating, ADoubtfulResultNeedsConfirmation) {
  calib::write_rig(config.rig, folder / "found.yaml");
  begin(fake(folder, "doubtful", 2));
  for (int i = 0; i < 30; ++i, std::this_thread::sleep_for(2ms)) frame();
  const msg::ControlReply begun = ask({"wave", "ball"});  // what just happened
  ASSERT_TRUE(begun.granted()) << begun.reason();
  EXPECT_THAT(begun.reason(), StartsWith("Calibrating from the last 3 s"));
  ASSERT_TRUE(becomes("doubtful")) << stage() << log;
  EXPECT_THAT(text_of(folder / "asked"), AllOf(HasSubstr("--tell-program wave " + recording().string()),
                                               HasSubstr("--target=ball"), HasSubstr("--config=")));
  EXPECT_THAT(ask({"accept"}).reason(), HasSubstr("use it with accept doubtful"));
  EXPECT_FALSE(ask({"accept", "it"}).granted());
  EXPECT_FALSE(fs::exists(folder / "c.taught.yaml"));
  EXPECT_TRUE(ask({"accept", "doubtful"}).granted());
}

TEST_F(Calibrating, AWaveIsCoveredAndCalibratedAgainWithADistance) {
  calib::write_rig(config.rig, folder / "found.yaml");
  begin(fake(folder, "doubtful", 2));
  EXPECT_THAT(ask({"again", "camera_distance=cam0,cam1,3"}).reason(), HasSubstr("no wave"));
  for (const char* distance :
       {"camera_distance=cam0,cam1", "camera_distance=cam0,cam1,3,4", "camera_distance=cam0,none,3",
        "camera_distance=cam0,cam0,3", "camera_distance=cam0,cam1,-3", "camera_distance=cam0,cam1,nan",
        "camera_distance=cam0,cam1,3m", "camera_distance="})
    EXPECT_FALSE(ask({"wave", "ball", "5", distance}).granted()) << distance;
  EXPECT_EQ(stage(), "idle");
  ASSERT_TRUE(ask({"wave", "ball", "5"}).granted());
  // What it lacks is told while it is made.
  ASSERT_TRUE(comes([&] {
    frame();
    session->poll(&*keeper);
    return state().contains("need");
  }));
  EXPECT_THAT(state()["coverage"], Contains("cam0"));
  EXPECT_THAT(
      text_of(folder / "asked"),
      AllOf(HasSubstr("--tell-program coverage " + recording().string() + " --config="), HasSubstr("--target=ball")));
  EXPECT_FALSE(ask({"again", "camera_distance=cam0,cam1,3"}).granted());
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("doubtful")) << stage() << log;
  EXPECT_THAT(text_of(folder / "asked"), Not(HasSubstr("--camera-distance")));
  EXPECT_FALSE(state().contains("camera_distance"));

  // The same recording, with what was measured.
  const fs::path waved = recording();
  EXPECT_EQ(ask({"again", "now"}).reason(), unknown_calibration);
  const msg::ControlReply again = ask({"again", "camera_distance=cam1,cam0,3.42"});
  ASSERT_TRUE(again.granted()) << again.reason();
  ASSERT_TRUE(becomes("doubtful")) << stage() << log;
  EXPECT_EQ(recording(), waved);
  EXPECT_THAT(text_of(folder / "asked"), HasSubstr("--camera-distance cam1 cam0 3.42 --rig=" + waved.string()));
  EXPECT_THAT(state()["camera_distance"], ElementsAre("cam1,cam0,3.42"));
  ASSERT_TRUE(ask({"accept", "doubtful"}).granted());
  EXPECT_THAT(ask({"again", "camera_distance=cam0,cam1,3"}).reason(), HasSubstr("no wave"));

  // Or at once, of what just happened. The next one knows nothing of it.
  ASSERT_TRUE(ask({"wave", "ball", "camera_distance=cam0,cam1,2.5"}).granted());
  ASSERT_TRUE(becomes("doubtful")) << stage() << log;
  EXPECT_THAT(text_of(folder / "asked"), HasSubstr("--camera-distance cam0 cam1 2.5"));
  ASSERT_TRUE(ask({"wave", "ball"}).granted());
  EXPECT_FALSE(state().contains("camera_distance"));
}

TEST_F(Calibrating, ABoardIsPrinted) {
  const std::string whole(300'000, 'p');
  std::ofstream(folder / "whole.pdf") << "%PDF" << whole;
  begin("for word; do case $word in --out=*) cp " + (folder / "whole.pdf").string() + " ${word#--out=} ;; esac; done");
  std::string got;
  while (true) {
    const msg::ControlReply piece = ask({"print", "type=charuco", "columns=9", "paper=A3", std::to_string(got.size())});
    ASSERT_TRUE(piece.granted()) << piece.reason();
    ASSERT_FALSE(piece.bytes().empty());
    EXPECT_EQ(piece.rows().at(0).columns().at(0), std::to_string(whole.size() + 4));
    got.append(piece.bytes().begin(), piece.bytes().end());
    if (got.size() >= whole.size() + 4) break;
  }
  EXPECT_EQ(got, "%PDF" + whole);
  const std::string asked = text_of(folder / "asked");
  EXPECT_THAT(asked, AllOf(StartsWith("board --out="), HasSubstr("--type=charuco --columns=9 --paper=A3")));
  EXPECT_EQ(std::ranges::count(asked, '\n'), 1) << "made once for all its pieces";
  const std::string out = asked.substr(12, asked.find("board.pdf") - 12);
  EXPECT_FALSE(fs::exists(out)) << "nothing is left of " << out;

  for (const std::vector<std::string>& words : {std::vector<std::string>{"print"},
                                                {"print", "x"},
                                                {"print", "type=charuco", "x"},
                                                {"print", "out=/etc/x", "0"}})
    EXPECT_FALSE(ask(words).granted()) << words.back();
  EXPECT_THAT(ask({"board", "paper=A4"}).reason(), HasSubstr("nknown key paper=A4"));
  begin("echo 'huetrack-calibrate: it does not fit on A4' >&2; exit 1");
  EXPECT_EQ(ask({"print", "square_mm=90", "0"}).reason(), "It does not fit on A4.");
  begin("exec sleep 100");
  EXPECT_THAT(ask({"print", "0"}).reason(), HasSubstr("cannot be printed"));

  // Nor does anything stay behind of a program that cannot be started, however often it is asked for.
  const fs::path scratch = folder / "scratch";
  fs::create_directory(scratch);
  ::setenv("TMPDIR", scratch.c_str(), 1);
  session.emplace(CalibrationSession::Options{.program = folder / "no_such_program"});
  EXPECT_THAT(ask({"print", "0"}).reason(), StartsWith("Cannot start"));
  ::unsetenv("TMPDIR");
  EXPECT_TRUE(fs::is_empty(scratch));
}

TEST_F(Calibrating, ARigThatLacksACameraChangesNothing) {
  calib::CameraRig found = config.rig;
  found.cameras.pop_back();
  found.uncertainty.reset();
  calib::write_rig(found, folder / "found.yaml");
  begin(fake(folder));
  ASSERT_TRUE(ask({"wave", "ball", "5"}).granted());
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("usable")) << log;
  EXPECT_THAT(ask({"accept"}).reason(), HasSubstr("cam1"));
  EXPECT_FALSE(fs::exists(folder / "c.taught.yaml"));
  for (const auto& entry : fs::directory_iterator(folder))
    EXPECT_THAT(entry.path().filename().string(), Not(StartsWith("c.rig-")));
}

TEST_F(Calibrating, AFailureIsReportedWithTheLastLine) {
  begin("case $2 in board) echo 'huetrack-calibrate: --type: hexagons not in {...}' >&2; exit 1 ;; esac");
  ASSERT_TRUE(ask({"board", "type=hexagons"}).granted());
  ASSERT_TRUE(becomes("failed"));
  EXPECT_EQ(state()["says"].at(0), "--type: hexagons not in {...}");
  EXPECT_FALSE(keeper->is_recording());
  EXPECT_THAT(log, HasSubstr("hexagons"));

  begin("echo working; kill -9 $$");
  ASSERT_TRUE(ask({"wave", "ball", "5"}).granted());
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("failed"));
  EXPECT_EQ(state()["says"].at(0), "huetrack-calibrate was ended by signal 9; its last line: working");
  EXPECT_FALSE(ask({"accept"}).granted());

  begin("echo 'huetrack-calibrate: no two cameras saw the ball together'; exit 1");
  ASSERT_TRUE(ask({"wave", "ball", "5"}).granted());
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("failed"));
  EXPECT_EQ(state()["says"].at(0), "no two cameras saw the ball together");
}

TEST_F(Calibrating, IsCancelledWhileItRecordsAndWhileItSolves) {
  begin("case $2 in wave) exec sleep 100 ;; esac");
  ASSERT_TRUE(ask({"wave", "ball", "5"}).granted());
  ASSERT_TRUE(ask({"cancel"}).granted());
  EXPECT_EQ(stage(), "cancelled");
  EXPECT_FALSE(keeper->is_recording());
  EXPECT_FALSE(ask({"cancel"}).granted());
  ASSERT_TRUE(ask({"wave", "ball", "5"}).granted());
  ASSERT_TRUE(ask({"stop"}).granted());
  ASSERT_TRUE(becomes("solving"));
  ASSERT_TRUE(ask({"cancel"}).granted());
  EXPECT_EQ(stage(), "cancelled");
  EXPECT_TRUE(fs::exists(recording() / "recording.yaml")) << "what was recorded stays";
}

TEST_F(Calibrating, SurvivesARestartOfThePipeline) {
  calib::write_rig(config.rig, folder / "found.yaml");
  begin(fake(folder));
  ASSERT_TRUE(ask({"wave", "ball", "60"}).granted());
  frame();
  keeper->finish(1s);
  keeper.emplace(config, pipeline::RecordingKeeperOptions{.record_to = {}, .cameras_in_use = 2});
  EXPECT_TRUE(becomes("usable")) << stage() << log;
}

TEST_F(Calibrating, RefusesInvalidRequests) {
  begin("exit 0");
  for (const std::vector<std::string>& words : {std::vector<std::string>{},
                                                {"dance"},
                                                {"wave"},
                                                {"wave", "ball", "5", "6"},
                                                {"stop", "now"},
                                                {"report"},
                                                {"state", "x"}})
    EXPECT_EQ(ask(words).reason(), unknown_calibration);
  EXPECT_THAT(ask({"wave", "none"}).reason(), HasSubstr("no target none"));
  EXPECT_THAT(ask({"wave", "new"}).reason(), HasSubstr("ew has no colour yet"));
  for (const char* seconds : {"", "4", "601", "nan", "5s", "-5"})
    EXPECT_THAT(ask({"wave", "ball", seconds}).reason(), HasSubstr("seconds, not")) << seconds;
  EXPECT_THAT(ask({"board", "colour=red"}).reason(), HasSubstr("nknown key colour=red"));
  EXPECT_THAT(ask({"report", "0"}).reason(), HasSubstr("no report"));
  EXPECT_THAT(ask({"stop"}).reason(), HasSubstr("No calibration is in progress"));
  config.control.allow_record = false;
  EXPECT_THAT(ask({"state"}).reason(), HasSubstr("allow_record"));
  config.control = {.allow_teach = false, .allow_record = true};
  EXPECT_THAT(ask({"state"}).reason(), HasSubstr("allow_teach"));
  config.control.allow_teach = true;
  session.emplace(CalibrationSession::Options{.program = folder / "gone"});
  EXPECT_THAT(ask({"wave", "ball", "5"}).reason(), AnyOf(HasSubstr("Recording"), HasSubstr("cannot start")));
  ASSERT_TRUE(ask({"stop"}).granted());
  EXPECT_TRUE(becomes("failed"));
  EXPECT_THAT(state()["says"].at(0), HasSubstr("cannot start"));
}

}  // namespace
}  // namespace huetrack::page
