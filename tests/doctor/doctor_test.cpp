#include "doctor/doctor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "capture/clips.h"
#include "capture/mjpeg_server.h"
#include "daemon/fake_camera.h"
#include "doctor/network_exam.h"
#include "hosts/camera_host.h"
#include "pipeline/live_cameras.h"
#include "publish/test_domain.h"

namespace huetrack::doctor {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::EndsWith;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

auto says(Grade verdict, const std::string& what) {
  return Contains(AllOf(Field(&Finding::verdict, verdict), Field(&Finding::what, HasSubstr(what))));
}
auto advises(const std::string& advice) {
  return Contains(Field(&Finding::advice, HasSubstr(advice)));
}

capture::OfferedFormat yuyv() {
  return {.fourcc = 0x56595559,
          .description = "YUYV 4:2:2",
          .format = capture::CaptureFormat::yuyv,
          .sizes = {{640, 480, 640, 480, {30, 15}}, {1280, 720, 1280, 720, {10}}}};
}

capture::Control control(const std::string& name, std::int64_t value) {
  capture::Control control;
  control.name = name;
  control.max = 100;
  control.value = value;
  return control;
}

// A webcam with nothing to complain of.
CameraExam healthy(const std::string& name = "left", int bus = 1) {
  CameraExam exam;
  exam.name = name;
  exam.node.identity.node = "/dev/video0";
  exam.node.identity.driver = "uvcvideo";
  exam.node.identity.usb =
      capture::UsbPlace{.port = "1-2", .bus = bus, .speed_mbps = 480, .id = "046d:0825", .serial = "A1"};
  exam.node.identity.by_path = {"/dev/v4l/by-path/pci-usb-0:2:1.0-video-index0"};
  exam.node.identity.by_id = {"/dev/v4l/by-id/usb-A1-video-index0"};
  exam.node.is_capture = true;
  exam.asked_fps = 30;
  exam.formats = {yuyv()};
  StreamTrial trial;
  trial.agreed = {.format = capture::CaptureFormat::yuyv, .width = 640, .height = 480, .stride = 1280, .fps = 30};
  trial.frames = 91;
  trial.seconds = 3;
  trial.bytes = 91ull * 640 * 480 * 2;
  trial.longest_gap_s = 0.034;
  trial.mean_age_s = 0.012;
  trial.stamp = capture::StampKind::start_of_exposure;
  exam.trial = trial;
  return exam;
}

TEST(JudgeCamera, AHealthyOneIsAllRight) {
  const auto findings = judge_camera(healthy(), true);
  for (const auto& finding : findings)
    EXPECT_TRUE(finding.verdict == Grade::ok || finding.what == "no controls") << finding.what;
  EXPECT_THAT(findings, says(Grade::ok, "by path (the port): /dev/v4l/by-path/pci-usb-0:2:1.0-video-index0"));
  EXPECT_THAT(findings, says(Grade::ok, "by id (the camera): /dev/v4l/by-id/usb-A1-video-index0"));
  EXPECT_THAT(findings, says(Grade::ok, "yuyv: 640x480@30/15, 1280x720@10"));
  EXPECT_THAT(findings, says(Grade::ok, "yuyv 640x480: 30.0 frames/s reached of 30 over 3.0 s, longest gap 34 ms"));
  EXPECT_THAT(findings, says(Grade::ok, "no frame of 91 dropped or damaged"));
  EXPECT_THAT(findings, says(Grade::ok, "time stamps: start of exposure, 12.0 ms"));
}

TEST(JudgeCamera, ARateThatIsNotReachedNamesItsCauses) {
  CameraExam dark = healthy();
  dark.trial->frames = 46;
  const auto findings = judge_camera(dark, true);
  EXPECT_THAT(findings, says(Grade::warning, "15.0 frames/s reached of 30"));
  EXPECT_THAT(findings, advises("exposure_time_absolute below the frame period"));
}

TEST(JudgeCamera, DropsDamageAndStampsAreSaid) {
  CameraExam poor = healthy();
  poor.trial->dropped = 3;
  poor.trial->corrupted = 2;
  poor.trial->stamp = capture::StampKind::dequeued;
  auto findings = judge_camera(poor, true);
  EXPECT_THAT(findings, says(Grade::warning, "3 frames dropped, 2 damaged of 94"));
  EXPECT_THAT(findings, says(Grade::warning, "none by the driver"));
  poor.trial->stamp = capture::StampKind::end_of_frame;
  EXPECT_THAT(judge_camera(poor, true), says(Grade::note, "time stamps: end of frame"));
  poor.trial->mean_age_s = -0.02;
  EXPECT_THAT(judge_camera(poor, true), says(Grade::warning, "they are in the future"));
  poor.trial->agreed.is_interlaced = true;
  EXPECT_THAT(judge_camera(poor, true), says(Grade::warning, "interlaced frames"));
  poor.has_fields = true;
  EXPECT_THAT(judge_camera(poor, true), testing::Not(says(Grade::warning, "interlaced frames")));
  poor.trial->frames = 0;
  poor.trial->failure = "no frame came";
  findings = judge_camera(poor, true);
  EXPECT_THAT(findings, says(Grade::problem, "yuyv 640x480: no frame came"));
}

TEST(JudgeCamera, ControlsThatDidNotStick) {
  CameraExam exam = healthy();
  exam.controls = {control("auto_exposure", 3), control("gain", 0), control("sharpness", 2)};
  exam.configured = {{"gain", "30", 30, "", false},
                     {"exposure_time_absolute", "100", 157, "the camera refuses it", false},
                     {"white_balance_temperature", "4600", 4600, "", false}};
  exam.stayed = {{"gain", "30", 30, "", false},
                 {"white_balance_temperature", "4600", 5000, "it changed while the camera streamed", false}};
  const auto findings = judge_camera(exam, true);
  EXPECT_THAT(findings, says(Grade::ok, "accepted controls of the configuration: gain 30"));
  EXPECT_THAT(findings, says(Grade::warning, "exposure_time_absolute: asked 100, got 157: the camera refuses it"));
  EXPECT_THAT(findings, says(Grade::warning, "white_balance_temperature: asked 4600, got 5000: it changed"));
  EXPECT_THAT(findings, says(Grade::warning, "exposure is automatic"));
  EXPECT_THAT(findings, says(Grade::note, "controls not tried: auto_exposure, sharpness"));
}

TEST(JudgeCamera, PermissionsAndBusyCamerasSayWhatToDo) {
  CameraExam exam = healthy();
  exam.trial.reset();
  exam.node.problem = "/dev/video0: Permission denied: " + capture::advice_for(EACCES);
  EXPECT_THAT(judge_camera(exam, true), says(Grade::problem, "group video"));
  EXPECT_THAT(judge_camera(exam, false), Not(says(Grade::problem, "")));
  exam.node.problem.clear();
  exam.problem = "/dev/video0: Device or resource busy: " + capture::advice_for(EBUSY);
  EXPECT_THAT(judge_camera(exam, true), says(Grade::warning, "another program uses it"));
  EXPECT_THAT(judge_camera(exam, true), advises("systemctl stop huetrackd"));
  exam.problem = "/dev/video0: No space left on device: " + capture::advice_for(ENOSPC);
  EXPECT_THAT(judge_camera(exam, true), says(Grade::problem, "USB bandwidth, not the disk"));
}

TEST(JudgeCamera, WithoutStableNamesItWarns) {
  CameraExam exam = healthy();
  exam.node.identity.by_path.clear();
  exam.node.identity.by_id.clear();
  EXPECT_THAT(judge_camera(exam, true), says(Grade::warning, "no name in /dev/v4l/by-path"));
  EXPECT_THAT(judge_camera(exam, true), says(Grade::note, "no serial number"));
  EXPECT_THAT(judge_camera(exam, true), Not(advises("use its port"))) << "it has no such name";
}

TEST(JudgeCamera, TheSumSaysWhatWasNotExamined) {
  EXPECT_EQ(not_examined(0, 3), "");
  EXPECT_EQ(not_examined(1, 1), "; 1 of 1 camera could not be examined: busy");
  EXPECT_EQ(not_examined(2, 3), "; 2 of 3 cameras could not be examined: busy");
}

class DoctorsConfig : public testing::Test {
 protected:
  // What doctor says of cameras with these devices; only looked at, unless they stream.
  std::string said_of(const std::string& left, const std::string& right, bool streams = false) {
    capture::write_text(folder / "c.yaml",
                        "version: 1\nrig: " HUETRACK_SOURCE_DIR
                        "/configs/demo/recording/rig.yaml\ndds: {enabled: false}\ntargets: {ball: {color: {hue_deg: "
                        "[65, 115]}}}\ncameras: {cam0: {device: " +
                            left + "}, cam1: {device: " + right + "}}\n");
    return said(folder / "c.yaml", streams);
  }
  static std::string said(const std::filesystem::path& config, bool streams = false) {
    DoctorOptions options;
    options.config = config;
    options.streams = streams;
    testing::internal::CaptureStdout();
    doctor(options, {});
    return testing::internal::GetCapturedStdout();
  }
  capture::TemporaryFolder folder;
};

TEST_F(DoctorsConfig, DevicesThatAreNoneOrNotThere) {
  const std::string text = said_of("/dev/null", "/dev/video97");
  EXPECT_THAT(text, HasSubstr("FAIL  /dev/null is not a video device\n        -> use "));
  EXPECT_THAT(text, HasSubstr("WARN  /dev/video97 is not stable"));
  EXPECT_THAT(text, HasSubstr("FAIL  /dev/video97 is not there\n        -> plug it in"));
}

TEST_F(DoctorsConfig, OneCameraUnderTwoNames) {
  const std::string text = said_of("/dev/null", "/dev/shm/../null");
  EXPECT_THAT(text, HasSubstr("FAIL  cameras: cam0 and cam1 are one camera: /dev/null and "));
  EXPECT_THAT(text, HasSubstr("are both /dev/null\n        -> give each its own device"));
  try {
    pipeline::open_cameras(config::load_service_config(folder / "c.yaml"));
    ADD_FAILURE() << "opened";
  } catch (const capture::CaptureError& error) {
    EXPECT_THAT(error.what(), HasSubstr("cam0 and cam1 are one camera"));
  }
}

TEST_F(DoctorsConfig, ACameraOfTheNetworkIsAskedAndNoneNeedsToBePluggedIn) {
  const std::string text = said_of("http://127.0.0.1:1/a", "http://127.0.0.1:1/b", true);
  EXPECT_THAT(text, HasSubstr("FAIL  http://127.0.0.1:1: Connection refused\n        -> check whether"));
  EXPECT_THAT(text, Not(HasSubstr("plugged in")));
  EXPECT_THAT(text, HasSubstr("2 problems"));
  EXPECT_THAT(said_of("http://127.0.0.1:1/a", "http://127.0.0.1:1/b"), HasSubstr("network camera, not tested"));
}

TEST(DoctorWithoutCameras, IsAProblemAndNamesTheDemo) {
  if (!capture::list_v4l2_nodes().empty()) GTEST_SKIP() << "this host has cameras";
  testing::internal::CaptureStdout();
  DoctorOptions options;
  options.streams = false;
  EXPECT_GE(doctor(options, {}), 1);
  const std::string text = testing::internal::GetCapturedStdout();
  EXPECT_THAT(text, AllOf(HasSubstr("FAIL  no camera is plugged in"), EndsWith("huetrackd demo\n")));
}

TEST(TryNetworkCamera, TakesPicturesForAsLongAsIsAsked) {
  using namespace std::chrono_literals;
  const capture::MjpegServer camera({.pictures = 1000});
  const NetworkTrial trial =
      try_network_camera({.name = "left", .address = camera.address(), .width = 64, .height = 48}, 400ms, {});
  EXPECT_EQ(trial.failure, "");
  EXPECT_GT(trial.pictures, 2u);
  EXPECT_LT(trial.seconds, 2);
  const capture::MjpegServer small({.pictures = 1000});
  const NetworkTrial other =
      try_network_camera({.name = "left", .address = small.address(), .width = 640, .height = 480}, 400ms, {});
  EXPECT_EQ(other.pictures, 0u);
  EXPECT_THAT(other.failure, HasSubstr("its pictures are 64x48, and the rig's are 640x480"));
}

TEST(JudgeNetworkCamera, SaysHowManyPicturesCome) {
  EXPECT_EQ(judge_network_camera({.pictures = 31, .seconds = 1, .failure = {}}).what,
            "it delivers: 31 pictures, 30.0 per second");
  EXPECT_EQ(judge_network_camera({.pictures = 1, .seconds = 0, .failure = {}}).verdict, Grade::ok);
}

TEST_F(DoctorsConfig, AVolumeInMillimetresIsAProblemAsOfCheck) {
  capture::write_text(folder / "c.yaml",
                      "version: 1\nrig: " HUETRACK_SOURCE_DIR
                      "/configs/demo/recording/rig.yaml\ndds: {enabled: false}\ntargets: {ball: {}}\n"
                      "object_tracking: {volume: {min: [-1000, -1000, 0], max: [1000, 1000, 2000]}}\n");
  EXPECT_THAT(said(folder / "c.yaml"), HasSubstr("FAIL  object_tracking.volume is 2000 m long"));
}

TEST_F(DoctorsConfig, AMissingFileIsNoLineToCorrect) {
  const std::string text = said(folder / "none.yaml");
  EXPECT_THAT(text, testing::AllOf(HasSubstr("FAIL"), HasSubstr("give the service's configuration"),
                                   Not(HasSubstr("correct it"))));
}

TEST_F(DoctorsConfig, OfACameraHost) {
  capture::write_text(
      folder / "host.yaml",
      "version: 1\nhost: pi-3\ndds: {interfaces: [lo]}\ncameras: {left: {device: /dev/null, size: [640, "
      "480], format: yuyv}, right: {device: /dev/video97, size: [640, 480], format: mjpeg}}\n");
  const std::string text = said(folder / "host.yaml");
  EXPECT_THAT(text, HasSubstr("ok    it is valid; camera host pi-3 with 2 cameras: trackers use host: pi-3"));
  EXPECT_THAT(text, HasSubstr("FAIL  /dev/null is not a video device"));
  EXPECT_THAT(text, HasSubstr("FAIL  /dev/video97 is not there"));
  EXPECT_THAT(text, HasSubstr("sends about"));
  EXPECT_THAT(text, HasSubstr("uncompressed from left"));
  EXPECT_THAT(text, HasSubstr("this host's clock"));
  EXPECT_THAT(text, Not(HasSubstr("targets")));
  capture::write_text(folder / "bad.yaml",
                      "version: 1\ncameras: {left: {device: /dev/null, size: [640, 480], hosst: 1}}\n");
  EXPECT_THAT(said(folder / "bad.yaml"), AllOf(HasSubstr("FAIL"), HasSubstr("hosst")));
}

// One host is there with one of the two cameras that are expected of it, the other one is not.
TEST_F(DoctorsConfig, CamerasOfOtherHostsAreAskedForOnTheBus) {
  const std::string domain = std::to_string(publish::test_domain());
  const std::filesystem::path demo = HUETRACK_SOURCE_DIR "/configs/demo/recording";
  capture::write_text(folder / "tracker.yaml",
                      "version: 1\nrig: " + (demo / "rig.yaml").string() +
                          "\ndds: {interfaces: [lo], domain: " + domain +
                          "}\ntargets: {ball: {color: {hue_deg: [65, 115]}}}\ncameras: {cam0: {host: pi-3, camera: "
                          "there, send: matches}, cam1: {host: pi-4}}\n");
  std::vector<capture::LiveCamera> cameras;
  capture::Frame picture;
  picture.pixels = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 320, 240).image;
  auto film = daemon::looped({picture}, 60);
  cameras.push_back(daemon::FakeCamera(0, std::move(film), capture::unix_now(), true).live());
  hosts::CameraHost host({.host = "pi-3",
                          .cameras = {"there"},
                          .program_version = "test",
                          .transport = {.name = "host", .domain = publish::test_domain(), .interfaces = {"lo"}}},
                         std::move(cameras));
  const std::jthread running([&](const std::stop_token& stop) { host.run(stop); });
  const std::jthread telling([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      host.publish_states();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  });
  const std::string text = said(folder / "tracker.yaml", true);
  EXPECT_THAT(text, HasSubstr("camera cam0 of the host pi-3\n")) << text;
  EXPECT_THAT(text, HasSubstr("grey 320x240: ")) << text;
  EXPECT_THAT(text, HasSubstr(" frames/s received of 30")) << text;
  EXPECT_THAT(text, HasSubstr("ok    the clock of pi-3 is ours")) << text;
  EXPECT_THAT(text, HasSubstr("camera cam1 of the host pi-4\n  FAIL  its host pi-4 is not found")) << text;
  EXPECT_THAT(text, HasSubstr("note  the clock of pi-4 could not be compared")) << text;
  EXPECT_THAT(said(folder / "tracker.yaml"), HasSubstr("note  remote camera of host pi-4, not tested"));
}

TEST(JudgeHosted, WhatIsSlowLostOrAmissThereIsAWarning) {
  HostedExam exam{.name = "left", .host = "pi-3", .health = {}, .fps = 29.9};
  exam.health.state = capture::CaptureState::delivering;
  exam.health.stream = {.format = capture::CaptureFormat::mjpeg, .width = 640, .height = 480, .fps = 30};
  EXPECT_THAT(judge_hosted(exam), testing::ElementsAre(Field(&Finding::verdict, Grade::ok)));
  EXPECT_THAT(judge_hosted(exam), says(Grade::ok, "640x480: 29.9 frames/s received of 30"));
  exam.fps = 20;
  EXPECT_THAT(judge_hosted(exam), says(Grade::warning, "20.0 frames/s received of 30"));
  exam.health.dropped = 7;
  exam.health.warning = "pi-3 says: it wanders";
  EXPECT_THAT(judge_hosted(exam),
              AllOf(says(Grade::warning, "7 frames were lost on the way"), says(Grade::warning, "it wanders")));
  exam.health.state = capture::CaptureState::absent;
  exam.health.message = "its host pi-3 has no camera left; it has right";
  EXPECT_THAT(judge_hosted(exam), testing::ElementsAre(Field(&Finding::verdict, Grade::problem)));
  EXPECT_THAT(judge_hosted(exam), says(Grade::problem, "it has right"));
}

TEST(JudgeClock, OfAHostThatIsNotWellKnownSaysWhatToInstall) {
  capture::HostClock clock;
  clock.host = "pi-3";
  clock.is_known = true;
  clock.offset_s = -0.0401;
  clock.sigma_s = 0.0002;
  EXPECT_EQ(judge_clock(clock).verdict, Grade::ok);
  EXPECT_THAT(judge_clock(clock).what, HasSubstr("the clock of pi-3 is 40.100 ms behind ours, known to 0.200 ms"));
  clock.advice = "install chrony";
  EXPECT_EQ(judge_clock(clock).verdict, Grade::warning);
  EXPECT_EQ(judge_clock(clock).advice, "install chrony");
  clock.is_known = false;
  EXPECT_EQ(judge_clock(clock).verdict, Grade::note);
}

TEST(JudgeSending, WhatComesAtOneMomentWantsRoom) {
  const SentCamera small{.name = "a", .width = 640, .height = 480, .format = capture::CaptureFormat::mjpeg};
  SentCamera large = small;
  large.name = "b", large.format = capture::CaptureFormat::yuyv;
  EXPECT_THAT(judge_sending(std::vector{small}, std::nullopt, false), says(Grade::ok, "sends about 1.7 MB/s"));
  EXPECT_THAT(judge_sending(std::vector(4, small), 212992.0, true), Not(says(Grade::warning, "")));
  EXPECT_THAT(judge_sending(std::vector(5, small), 212992.0, true),
              AllOf(says(Grade::warning, "288 kB of frames may arrive at once"), advises("net.core.rmem_max")));
  EXPECT_THAT(judge_sending(std::vector{small, large}, 212992.0, true),
              AllOf(says(Grade::note, "uncompressed from b"), says(Grade::warning, "may arrive at once")));
  EXPECT_THAT(judge_sending(std::vector{small, large}, 4194304.0, true), Not(says(Grade::warning, "")));
  EXPECT_THAT(judge_sending(std::vector(5, large), 212992.0, false),
              AllOf(says(Grade::warning, "sends about 92"), Not(says(Grade::warning, "may arrive at once"))));
}

TEST(JudgeUsb, AddsUpWhatCamerasOfABusWant) {
  // 640 x 480 x 2 bytes x 8 bits x 30.0 = 147 Mbit/s each
  std::vector<CameraExam> exams{healthy("left"), healthy("right")};
  auto findings = judge_usb(exams, {{1, 480}});
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].verdict, Grade::warning);
  EXPECT_THAT(findings[0].what, HasSubstr("bus 1, 480 Mbit/s: left (video0) in port 1-2 147 Mbit/s, right"));
  EXPECT_THAT(findings[0].what, HasSubstr("together 295 of the available 384 Mbit/s"));
  exams.push_back(healthy("back"));
  EXPECT_EQ(judge_usb(exams, {{1, 480}})[0].verdict, Grade::problem);
  exams[1] = healthy("right", 2);
  exams[2] = healthy("back", 3);
  findings = judge_usb(exams, {{1, 480}, {2, 480}, {3, 5000}});
  ASSERT_EQ(findings.size(), 3u);
  for (const auto& finding : findings) EXPECT_EQ(finding.verdict, Grade::ok);
  exams = {healthy("left"), healthy("right")};
  exams[0].trial->usb = capture::UsbReservation{
      .in_force = {{.interface = 1, .alternate = 7, .is_isochronous = true, .bytes = 3072, .intervals_per_s = 8000}},
      .most_mbps = 196.608};
  exams[1].trial->usb = capture::UsbReservation{};
  findings = judge_usb(exams, {{1, 480}});
  EXPECT_THAT(findings[0].what,
              HasSubstr("left (video0) in port 1-2 147 Mbit/s, 197 Mbit/s reserved (alternate setting 7: "
                        "3072 bytes, 8000 times a second), right"));
  EXPECT_THAT(findings[0].what,
              HasSubstr("147 Mbit/s, bulk: nothing is reserved; together 344 of the available 384 Mbit/s"));
  exams[0].node.identity.usb->speed_mbps = 12;
  EXPECT_THAT(judge_usb(exams, {}), says(Grade::problem, "left (video0) runs at 12 Mbit/s"));
}

TEST(JudgeNetwork, SaysWhoCanSubscribe) {
  EXPECT_THAT(judge_network(7, "ROS_DOMAIN_ID", {"lo 127.0.0.1", "eth0 10.0.0.5"}, false),
              AllOf(says(Grade::ok, "domain 7, from ROS_DOMAIN_ID"), says(Grade::ok, "eth0 10.0.0.5")));
  EXPECT_THAT(judge_network(0, "", {"lo 127.0.0.1"}, false),
              AllOf(says(Grade::note, "subscribers on this host only"), advises("bring a network up")));
  EXPECT_THAT(judge_network(0, "", {"lo 127.0.0.1"}, true),
              AllOf(says(Grade::note, "subscribers on this host only"), advises("dds: {interfaces: [...]}")));
  EXPECT_THAT(judge_network(0, "", {"lo 127.0.0.1", "eth0 10.0.0.5", "wlan0 10.1.0.5"}, false),
              AllOf(says(Grade::note, "several networks"), advises("interfaces: [...]")));
  EXPECT_THAT(judge_network(0, "", {}, false), says(Grade::problem, "no network interface"));
}

TEST(SuitableStream, IsVgaOrTheNearestBelowIt) {
  const std::vector<capture::OfferedFormat> formats{yuyv()};
  const auto stream = suitable_stream(formats);
  ASSERT_TRUE(stream);
  EXPECT_EQ(stream->width, 640);
  EXPECT_EQ(stream->fps, 30);
  capture::OfferedFormat large = yuyv();
  large.sizes.erase(large.sizes.begin());
  EXPECT_EQ(suitable_stream(std::vector{large})->width, 1280);
  capture::OfferedFormat unknown = yuyv();
  unknown.format.reset();
  EXPECT_EQ(suitable_stream(std::vector{unknown}), std::nullopt);
}

TEST(ToText, PutsTheAdviceBelowTheVerdict) {
  EXPECT_EQ(to_text({Grade::ok, "fine", ""}), "  ok    fine\n");
  EXPECT_EQ(to_text({Grade::problem, "bad", "mend it"}), "  FAIL  bad\n        -> mend it\n");
}

TEST(ToText, WhatACameraCallsItselfIsNoCommandToTheTerminal) {
  EXPECT_EQ(to_text({Grade::problem, "camera \x1b[2Jevil\n", "turn\x07"}),
            "  FAIL  camera  [2Jevil \n        -> turn \n");
}

}  // namespace
}  // namespace huetrack::doctor
