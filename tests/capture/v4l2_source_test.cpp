// What can be tested without a device; tests/v4l2 has the rest.
#include "capture/v4l2_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <thread>

#include "capture/clips.h"

namespace huetrack::capture {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

V4l2SourceOptions options() {
  V4l2SourceOptions options;
  options.name = "left";
  options.device = "/dev/v4l/by-path/pci-0000:00:14.0-usb-0:9:1.0-video-index0";
  options.width = 640;
  options.height = 480;
  options.fps = 30;
  options.retry = 50ms;
  return options;
}

TEST(V4l2Names, FormatNamesRoundTrip) {
  for (const auto format : {CaptureFormat::yuyv, CaptureFormat::nv12, CaptureFormat::mjpeg, CaptureFormat::grey})
    EXPECT_EQ(capture_format_of(name(format)), format);
  EXPECT_EQ(capture_format_of("YUYV"), std::nullopt);
  EXPECT_EQ(fourcc_text(0x56595559), "YUYV");
  EXPECT_EQ(fourcc_text(0x20203859), "Y8");
}

TEST(V4l2Names, ErrorsHaveAdvice) {
  EXPECT_THAT(advice_for(ENOSPC), HasSubstr("USB bandwidth, not the disk"));
  EXPECT_THAT(advice_for(EACCES), HasSubstr("group video"));
  EXPECT_THAT(advice_for(EBUSY), HasSubstr("another program"));
  EXPECT_EQ(advice_for(EDOM), "");
}

TEST(V4l2Identity, SerialNumberDistinguishesOneModel) {
  V4l2Identity a{.node = "/dev/video0",
                 .driver = "uvcvideo",
                 .card = "C270",
                 .bus_info = "usb-1",
                 .usb = UsbPlace{.port = "1-1", .id = "046d:0825", .serial = "AB"},
                 .by_path = {},
                 .by_id = {}};
  V4l2Identity b = a;
  b.node = "/dev/video4";
  b.bus_info = "usb-2";
  b.usb->port = "1-2";
  EXPECT_TRUE(a.is_same_camera(b)) << "wherever it is plugged in";
  b.usb->serial = "CD";
  EXPECT_FALSE(a.is_same_camera(b));
  b = a;
  b.card = "C525";
  EXPECT_FALSE(a.is_same_camera(b));
}

TEST(V4l2Device, RefusesWhatIsNoCamera) {
  const auto error_of = [](const std::filesystem::path& path) -> std::string {
    try {
      const V4l2Device device(path);
      return "taken";
    } catch (const CaptureError& e) {
      return e.what();
    }
  };
  EXPECT_THAT(error_of("/dev/video99"), HasSubstr("/dev/video99: No such file or directory: it is not plugged in"));
  EXPECT_THAT(error_of("/dev/null"), HasSubstr("/dev/null: is not a video device"));
}

TEST(V4l2SourceOptions, Problems) {
  EXPECT_THAT(options().problems(), IsEmpty());
  auto bad = options();
  bad.camera = -1;
  bad.device.clear();
  bad.width = 0;
  bad.fps = -1;
  bad.buffers = 3;
  bad.retry = 0ms;
  bad.controls = {{"", 1}};
  EXPECT_EQ(bad.problems().size(), 7U);
  EXPECT_THROW(V4l2Source{bad}, std::invalid_argument);
}

TEST(V4l2SourceOptions, WarnsOfAnUnstableIndex) {
  EXPECT_THAT(options().warnings(), IsEmpty());
  auto index = options();
  index.device = "/dev/video2";
  EXPECT_THAT(index.warnings(), ElementsAre(HasSubstr("/dev/video2 is not stable")));
}

TEST(V4l2Source, AbsentCameraIsAwaitedAndReportedOnce) {
  V4l2Source source(options());
  EXPECT_EQ(source.health().state, CaptureState::absent);
  std::stop_source stop;
  const std::jthread stopper([&] {
    std::this_thread::sleep_for(400ms);
    stop.request_stop();
  });
  EXPECT_FALSE(source.next(stop.get_token()));
  const auto events = source.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_TRUE(events[0].is_problem);
  EXPECT_THAT(events[0].message, HasSubstr("it is not plugged in"));
  EXPECT_THAT(source.take_events(), IsEmpty());
  EXPECT_LT(std::chrono::steady_clock::now() - source.health().last_progress, 300ms)
      << "waiting on purpose is progress";
}

TEST(V4l2Source, StopEndsTheWaitAtOnce) {
  auto patient = options();
  patient.retry = 1h;
  V4l2Source source(patient);
  std::stop_source stop;
  std::chrono::steady_clock::time_point asked;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(100ms);
    asked = std::chrono::steady_clock::now();
    stop.request_stop();
  });
  EXPECT_FALSE(source.next(stop.get_token()));
  stopper.join();
  EXPECT_LT(std::chrono::steady_clock::now() - asked, 1min);  // not after the hour
}

TEST(ControlResult, IsReadableText) {
  EXPECT_EQ(to_string(ControlResult{.name = "gain", .asked = "7", .got = 7, .problem = {}}), "gain: asked 7, got 7");
  EXPECT_EQ(
      to_string(ControlResult{.name = "auto_exposure", .asked = "1", .got = 1, .problem = {}, .is_implied = true}),
      "auto_exposure: set to 1, got 1");
  EXPECT_EQ(to_string(ControlResult{.name = "zoom", .asked = "1", .got = {}, .problem = "no such control"}),
            "zoom: asked 1: no such control");
}

}  // namespace
}  // namespace huetrack::capture
