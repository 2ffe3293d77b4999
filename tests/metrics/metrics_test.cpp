#include "metrics/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <memory>

#include "end_to_end/http.h"
#include "metrics/pipeline_meter.h"

namespace huetrack::metrics {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;

TEST(LatencyHistogram, KnowsItsQuantiles) {
  LatencyHistogram histogram;
  EXPECT_TRUE(std::isnan(histogram.snapshot().quantile_s(0.5)));
  for (int i = 0; i < 3; ++i) histogram.add(900us);  // 0.8 .. 1 ms
  histogram.add(4ms);                                // 3 .. 5 ms
  const auto snapshot = histogram.snapshot();
  EXPECT_DOUBLE_EQ(snapshot.quantile_s(0), 0);
  EXPECT_DOUBLE_EQ(snapshot.quantile_s(0.375), 0.0009);  // the middle of the bucket
  EXPECT_DOUBLE_EQ(snapshot.quantile_s(0.75), 0.001);
  EXPECT_DOUBLE_EQ(snapshot.quantile_s(1), 0.005);
  for (int i = 0; i < 4; ++i) histogram.add(5s);
  EXPECT_DOUBLE_EQ(histogram.snapshot().quantile_s(0.9), 1.0);
}

TEST(LatencyHistogram, PutsABoundIntoTheBucketThatItEnds) {
  LatencyHistogram histogram;
  histogram.add(10us);
  histogram.add(50us);
  histogram.add(51us);
  histogram.add(5s);
  const auto snapshot = histogram.snapshot();
  EXPECT_EQ(snapshot.counts[0], 2u);
  EXPECT_EQ(snapshot.counts[1], 1u);
  EXPECT_EQ(snapshot.counts.back(), 1u);
  EXPECT_EQ(snapshot.count(), 4u);
  EXPECT_NEAR(snapshot.sum_s, 5.000111, 1e-9);
}

publish::ServiceStatus status() {
  publish::ServiceStatus status;
  status.cameras = {{.name = "le\"ft",
                     .health = publish::CameraStatus::Health::delivering,
                     .message = {},
                     .frames = 12,
                     .dropped = 3,
                     .rate_hz = 29.5,
                     .age_s = 0.02}};
  status.targets = {"ball"};
  status.sets = 11;
  return status;
}

TEST(PipelineMeter, CountsMistakesByKindWhileTheyLast) {
  PipelineMeter meter(1, 1, nullptr);
  capture::FrameSet frames;
  const std::vector<object_tracking::ObjectEstimate> estimates(1);
  const std::vector<std::vector<view_watch::Mistake>> late{{{.kind = view_watch::MistakeKind::late, .cameras = {0}}}},
      none(1);
  const auto text_after = [&](const auto& mistakes) {
    meter.on_set({.frames = frames, .estimates = estimates, .received_at = {}, .trackers = {}, .mistakes = mistakes});
    return to_prometheus(status(), meter.targets(), {}, {}, 0);
  };
  EXPECT_THAT(text_after(late), AllOf(HasSubstr("\nhuetrack_target_mistake{target=\"ball\",kind=\"late\"} 1\n"),
                                      HasSubstr("{target=\"ball\",kind=\"swapped\"} 0\n")));
  EXPECT_THAT(text_after(none), HasSubstr("\nhuetrack_target_mistake{target=\"ball\",kind=\"late\"} 0\n"));
}

TEST(ToPrometheus, HasEveryFigureOnce) {
  LatencyHistogram histogram;
  histogram.add(150us);
  histogram.add(30ms);
  LatencyFigures latencies;
  latencies.capture_to_dequeue = {histogram.snapshot()};
  latencies.dequeue_to_write = histogram.snapshot();
  histogram.add(25us);
  latencies.dequeue_to_publish = histogram.snapshot();
  const TargetFigures targets[] = {
      {.state = object_tracking::TrackState::coasting, .effective_sample_size = 87.5, .particles = 200}};
  const std::string text = to_prometheus(status(), targets, latencies, {.is_recording = true, .dropped = {4}}, 10);
  for (const auto* line : {
           "\nhuetrack_camera_frames_total{camera=\"le\\\"ft\"} 12\n",
           "\nhuetrack_camera_dropped_frames_total{camera=\"le\\\"ft\"} 3\n",
           "\nhuetrack_camera_rate_hertz{camera=\"le\\\"ft\"} 29.5\n",
           "\nhuetrack_camera_up{camera=\"le\\\"ft\"} 1\n",
           "\nhuetrack_sets_total 11\n",
           "\nhuetrack_published_samples_total 10\n",
           "\nhuetrack_recording 1\n",
           "\nhuetrack_recording_dropped_frames_total{camera=\"le\\\"ft\"} 4\n",
           "\nhuetrack_target_state{target=\"ball\",state=\"coasting\"} 1\n",
           "\nhuetrack_target_state{target=\"ball\",state=\"lost\"} 0\n",
           "\nhuetrack_target_effective_sample_size{target=\"ball\"} 87.5\n",
           "\nhuetrack_capture_to_dequeue_seconds_bucket{camera=\"le\\\"ft\",le=\"0.0001\"} 0\n",
           "\nhuetrack_dequeue_to_write_seconds_bucket{le=\"0.00015\"} 1\n",
           "\nhuetrack_dequeue_to_write_seconds_bucket{le=\"0.05\"} 2\n",  // cumulated
           "\nhuetrack_dequeue_to_write_seconds_bucket{le=\"+Inf\"} 2\n",
           "\nhuetrack_dequeue_to_write_seconds_sum 0.03015\n",
           "\nhuetrack_dequeue_to_write_seconds_count 2\n",
           "\nhuetrack_dequeue_to_publish_seconds_bucket{le=\"5e-05\"} 1\n",
           "\nhuetrack_dequeue_to_publish_seconds_count 3\n",
       }) {
    const auto at = text.find(line);
    ASSERT_NE(at, std::string::npos) << line << text;
    EXPECT_EQ(text.find(line, at + 1), std::string::npos) << line;
  }
}

class Server : public testing::Test {
 protected:
  const int port = 20000 + 2 * (::getpid() % 6000);
  MetricsServer server{"127.0.0.1", port};
};

TEST_F(Server, AnswersWithTheLatestText) {
  server.show("a 1\n");
  EXPECT_THAT(
      end_to_end::http_get(port, "/metrics").value(),
      AllOf(HasSubstr("HTTP/1.1 200 OK\r\n"), HasSubstr("\r\nContent-Length: 4\r\n"), EndsWith("\r\n\r\na 1\n")));
  const std::string long_text(3'000'000, 'x');  // more than a socket takes at once
  server.show(long_text);
  EXPECT_THAT(end_to_end::http_get(port, "/metrics").value(), EndsWith("\r\n\r\n" + long_text));
  EXPECT_THAT(end_to_end::http_get(port, "/").value(), HasSubstr("404"));
  const end_to_end::Connection poster(port);
  poster.send("POST /metrics HTTP/1.1\r\n\r\n");
  EXPECT_THAT(poster.receive(), HasSubstr("405"));
  const end_to_end::Connection talker(port);  // in pieces, and never to the point
  for (int i = 0; i < 20; ++i) talker.send(std::string(1000, 'y'));
  EXPECT_THAT(talker.receive(), testing::Not(HasSubstr("200 OK")));
}

TEST_F(Server, ASilentClientHoldsUpNobodyAndNoEnd) {
  server.show("a 1\n");
  std::vector<std::unique_ptr<end_to_end::Connection>> silent;
  for (int i = 0; i < 5; ++i) silent.push_back(std::make_unique<end_to_end::Connection>(port));
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(end_to_end::http_get(port, "/metrics").value(), EndsWith("a 1\n"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, 1s);
  EXPECT_EQ(silent[0]->receive(), "") << "it is sent away";
  EXPECT_LT(std::chrono::steady_clock::now() - start, 4s);

  auto other = std::make_unique<MetricsServer>("127.0.0.1", port + 1);
  const end_to_end::Connection says_nothing(port + 1);
  ASSERT_TRUE(says_nothing.is_open());
  const auto asked = std::chrono::steady_clock::now();
  other.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - asked, 500ms);
  EXPECT_EQ(end_to_end::http_get(port + 1, "/metrics"), std::nullopt);
}

TEST_F(Server, WhoComesWhenThereAreTooManyWaitsItsTurn) {
  server.show("a 1\n");
  std::vector<std::unique_ptr<end_to_end::Connection>> silent;
  for (int i = 0; i < 20; ++i) silent.push_back(std::make_unique<end_to_end::Connection>(port));
  EXPECT_THAT(end_to_end::http_get(port, "/metrics").value(), EndsWith("a 1\n"));
}

// One host that opens connections and says nothing takes the room from itself.
TEST_F(Server, AHostOfSilentClientsStarvesNobody) {
  server.show("a 1\n");
  std::vector<std::unique_ptr<end_to_end::Connection>> silent;
  for (int i = 0; i < 600; ++i) {
    silent.push_back(std::make_unique<end_to_end::Connection>(port));
    if (i % 100 != 99) continue;
    const auto start = std::chrono::steady_clock::now();
    EXPECT_THAT(end_to_end::http_get(port, "/metrics").value(), EndsWith("a 1\n"));
    EXPECT_LT(std::chrono::steady_clock::now() - start, 1s) << i;
  }
}

TEST_F(Server, APortThatCannotBeHadIsNamed) {
  const auto says = [](const std::string& what) { return testing::ThrowsMessage<std::runtime_error>(HasSubstr(what)); };
  EXPECT_THAT([&] { MetricsServer("127.0.0.1", port); }, says("127.0.0.1:" + std::to_string(port)));
  EXPECT_THAT([&] { MetricsServer("192.0.2.77", port); }, says("192.0.2.77:" + std::to_string(port)));
  EXPECT_THAT([&] { MetricsServer("nowhere.invalid", port); }, says("nowhere.invalid"));
}

TEST(ToPrometheus, SaysWhichCameraNoLongerStandsWhereTheRigSays) {
  const CalibrationFigures moved{.is_in_place = false,
                                 .turned_deg = 0.75,
                                 .moved_m = 0.006,
                                 .effect_m = 0.015,
                                 .blur_px = 2.5,
                                 .changed_share = 0.12};
  const std::string text = to_prometheus(status(), {}, {}, {}, 0, std::span(&moved, 1));
  const std::string camera = R"(le\"ft)";
  EXPECT_THAT(text, testing::HasSubstr("huetrack_camera_in_place{camera=\"" + camera + "\"} 0"));
  EXPECT_THAT(text, testing::HasSubstr("huetrack_camera_turned_degrees{camera=\"" + camera + "\"} 0.75"));
  EXPECT_THAT(text, testing::HasSubstr("huetrack_camera_effect_meters{camera=\"" + camera + "\"} 0.015"));
  EXPECT_THAT(text, testing::HasSubstr("huetrack_camera_blur_pixels{camera=\"" + camera + "\"} 2.5"));
  EXPECT_THAT(text, testing::HasSubstr("huetrack_camera_room_changed_share{camera=\"" + camera + "\"} 0.12"));
  EXPECT_THAT(to_prometheus(status(), {}, {}, {}, 0), testing::Not(testing::HasSubstr("huetrack_camera_in_place")));
}

}  // namespace
}  // namespace huetrack::metrics
