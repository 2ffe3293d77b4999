// A camera of the network, served by the test itself: motion JPEG over HTTP, as thousands of cameras send it.
#include "capture/network_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "capture/mjpeg_server.h"
#include "capture/timing/capture_clock.h"

namespace huetrack::capture {
namespace {

using namespace testing;
using namespace std::chrono_literals;

NetworkSourceOptions network_options(const MjpegServer& camera) {
  return {.camera = 1,
          .name = "left",
          .address = camera.address(),
          .width = 64,
          .height = 48,
          .retry = 20ms,
          .patience = 2s};
}

TEST(NetworkAddress, IsDistinguishedFromADevice) {
  EXPECT_TRUE(is_network_address("rtsp://camera/stream"));
  EXPECT_FALSE(is_network_address("/dev/video0"));
  EXPECT_FALSE(is_network_address(""));
  EXPECT_THAT(NetworkSourceOptions({.address = "rtsp://camera", .width = 4, .height = 4}).problems(), IsEmpty());
  EXPECT_THAT(NetworkSourceOptions({.address = "file:///etc/passwd", .width = 4, .height = 4}).problems(),
              ElementsAre(HasSubstr("must begin with rtsp://")));
  EXPECT_THROW(NetworkSource({.address = "/dev/video0", .width = 4, .height = 4}), std::invalid_argument);
}

TEST(NetworkSource, StampsPicturesOnArrival) {
  MjpegServer camera({.pictures = 1000});
  NetworkSourceOptions options = network_options(camera);
  options.timing.latency = 100ms;
  NetworkSource source(options);
  std::vector<Frame> frames;
  std::vector<Timestamp> taken;
  while (frames.size() < 30) {
    auto frame = source.next({});
    ASSERT_TRUE(frame);
    taken.push_back(unix_now());
    frames.push_back(std::move(*frame));
  }
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_EQ(frames[k].camera, 1);
    EXPECT_EQ(frames[k].sequence, k);
    EXPECT_EQ(frames[k].status, FrameStatus::ok);
    EXPECT_EQ(frames[k].pixels.width, 64);
    EXPECT_LE(frames[k].stamped_at, taken[k]);
    EXPECT_EQ(frames[k].arrived_at, frames[k].stamped_at);
    EXPECT_EQ(frames[k].latency, 100ms);
    ASSERT_TRUE(frames[k].encoded);
    EXPECT_EQ(frames[k].encoded->front(), 0xFF);  // a JPEG's first byte: the camera's own bytes
    if (k > 0) {
      EXPECT_GT(frames[k].captured_at, frames[k - 1].captured_at);
    }
  }
  // Smoothed, and a tenth of a second before it came.
  EXPECT_NEAR(seconds(frames.back().stamped_at - frames.back().captured_at), 0.1, 0.05);
  EXPECT_GE(seconds(frames.back().captured_at - frames[10].captured_at), 0.3);
  const CameraHealth health = source.health();
  EXPECT_EQ(health.state, CaptureState::delivering);
  EXPECT_EQ(health.frames, 30u);
  EXPECT_THAT(health.message, HasSubstr("arrival times"));
  EXPECT_EQ(health.warning, "");  // its latency is known
}

// Boundaries are free text, and some cameras send none before the first picture, or none at all.
TEST(NetworkSource, TakesAnyBoundary) {
  const std::string multipart = "multipart/x-mixed-replace; boundary=";
  const std::vector<MjpegServer::Film> films{
      {.type = multipart + "frame", .first_boundary = ""},
      {.type = multipart + "frame", .first_boundary = "", .boundary = "", .has_headers = false},
      {.type = multipart + "--frame", .first_boundary = "--frame\r\n"},
      {.type = multipart + "\"a b\"", .first_boundary = "a b\r\n", .boundary = "a b\r\n"},
      {.type = multipart, .first_boundary = "\r\n\r\n", .boundary = "\r\n"},
      {.type = "image/jpeg", .first_boundary = "", .boundary = "", .has_headers = false},
      {.type = "video/x-motion-jpeg", .first_boundary = "", .boundary = "", .has_headers = false}};
  for (const MjpegServer::Film& film : films) {
    SCOPED_TRACE(film.type + " | " + film.first_boundary + " | " + film.boundary);
    MjpegServer camera(film);
    NetworkSource source(network_options(camera));
    for (int k = 0; k < 8; ++k) {
      const auto frame = source.next({});
      ASSERT_TRUE(frame);
      ASSERT_EQ(frame->status, FrameStatus::ok);
      EXPECT_NEAR(yuv_at(frame->pixels, 30, 20).y, 40 + 10 * k, 2);
    }
    EXPECT_THAT(source.health().message, HasSubstr("delivers mjpeg"));
  }
}

// As `ffmpeg -f mpjpeg -listen 1` serves it: of no particular type, and to one client, once.
TEST(NetworkSource, ConnectsOnce) {
  MjpegServer camera({.pictures = 200, .type = "application/octet-stream", .is_for_one = true});
  NetworkSource source(network_options(camera));
  for (int k = 0; k < 8; ++k) {
    const auto frame = source.next({});
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->status, FrameStatus::ok);
    EXPECT_TRUE(frame->pixels.on_demand);
  }
  EXPECT_EQ(source.take_events().size(), 1U);  // delivers
}

TEST(NetworkSource, WarnsWhileLatencyIsUnknown) {
  MjpegServer camera({});
  NetworkSource source(network_options(camera));
  ASSERT_TRUE(source.next({}));
  EXPECT_THAT(source.health().warning, HasSubstr("latency_offset_s"));
}

TEST(NetworkSource, ReconnectsWhenTheStreamEnds) {
  MjpegServer camera({.pictures = 5});
  NetworkSource source(network_options(camera));
  for (std::uint32_t k = 0; k < 12; ++k) {
    const auto frame = source.next({});
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->sequence, k);
  }
  const auto events = source.take_events();
  EXPECT_THAT(events,
              Contains(AllOf(Field(&CameraEvent::state, CaptureState::absent), Field(&CameraEvent::is_problem, true))));
  for (const auto& event : events) EXPECT_THAT(event.message, Not(HasSubstr("secret")));  // a password
}

TEST(NetworkSource, RefusesAnotherSizeThanTheRigs) {
  MjpegServer camera({.width = 32, .height = 48});
  NetworkSource source(network_options(camera));
  std::stop_source stop;
  std::jthread reading([&] { EXPECT_FALSE(source.next(stop.get_token())); });
  for (int k = 0; k < 400 && source.health().state != CaptureState::absent; ++k) std::this_thread::sleep_for(10ms);
  EXPECT_THAT(source.health().message, HasSubstr("its pictures are 32x48, and the rig's are 64x48"));
  stop.request_stop();
}

// A camera that holds the connection and sends nothing, and one that is not there.
TEST(NetworkSource, StopsWhileWaiting) {
  MjpegServer camera({.pictures = 3, .is_silent_then = true});
  NetworkSourceOptions options = network_options(camera);
  options.patience = 60s;
  NetworkSourceOptions unreachable = options;
  unreachable.address = "http://127.0.0.1:1/";
  for (const auto& o : {options, unreachable}) {
    NetworkSource source(o);
    std::stop_source stop;
    std::jthread reading([&] {
      while (source.next(stop.get_token())) {
      }
    });
    std::this_thread::sleep_for(500ms);
    EXPECT_LT(std::chrono::steady_clock::now() - source.health().last_progress, 500ms) << "for the watchdog";
    const auto asked = std::chrono::steady_clock::now();
    stop.request_stop();
    reading.join();
    EXPECT_LT(std::chrono::steady_clock::now() - asked, 1s);
  }
}

TEST(NetworkSource, SilenceLosesTheCamera) {
  MjpegServer camera({.pictures = 3, .is_silent_then = true});
  NetworkSourceOptions options = network_options(camera);
  options.patience = 300ms;
  NetworkSource source(options);
  std::stop_source stop;
  std::jthread reading([&] {
    while (source.next(stop.get_token())) {
    }
  });
  for (int k = 0; k < 400 && source.health().state != CaptureState::absent; ++k) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(source.health().state, CaptureState::absent);
  EXPECT_THAT(source.health().message, HasSubstr("trying again"));
  stop.request_stop();
}

// Takes what comes until the source has lost its camera, or 20 s long.
void take_until_lost(NetworkSource& source) {
  std::stop_source stop;
  const std::jthread looking([&] {
    for (int i = 0; i < 2000 && source.health().state != CaptureState::absent; ++i) std::this_thread::sleep_for(10ms);
    stop.request_stop();
  });
  while (source.next(stop.get_token())) {
  }
}

// A header may say two gigabytes, or nothing: neither is taken into memory.
TEST(NetworkSource, EndlessPictureLosesTheCamera) {
  for (const std::string length : {"Content-Length: 2147483000\r\n", ""}) {
    MjpegServer camera(
        {.pictures = 3, .endless_then = "--frame\r\nContent-Type: image/jpeg\r\n" + length + "\r\n\xff\xd8"});
    NetworkSourceOptions options = network_options(camera);
    options.patience = 60s;  // it is not the time that ends it
    options.retry = 60s;
    NetworkSource source(options);
    for (int k = 0; k < 2; ++k) ASSERT_TRUE(source.next({})) << k;  // FFmpeg hands one over when the next begins
    take_until_lost(source);
    EXPECT_EQ(source.health().state, CaptureState::absent);
    EXPECT_THAT(source.health().message, HasSubstr("32 MiB without a picture"));
    EXPECT_LT(camera.sent(), 100U << 20U);  // with what lies in the kernel's buffers
  }
}

TEST(NetworkSource, RefusesAnAnswerOfGigabytes) {
  MjpegServer camera({.endless_then = "RTSP/1.0 200 OK\r\nCSeq: 2\r\nContent-Type: application/sdp\r\n"
                                      "Content-Length: 2147483000\r\n\r\n",
                      .is_rtsp = true});
  NetworkSourceOptions options = network_options(camera);
  options.patience = 60s;
  options.retry = 60s;
  NetworkSource source(options);
  take_until_lost(source);
  EXPECT_EQ(source.health().state, CaptureState::absent);
  EXPECT_LT(camera.sent(), 100U << 20U);  // with what lies in the kernel's buffers
}

}  // namespace
}  // namespace huetrack::capture
