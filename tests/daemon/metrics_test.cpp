#include "daemon/metrics.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace huetrack {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

TEST(LatencyHistogram, PutsABoundIntoTheBucketThatItEnds) {
  LatencyHistogram histogram;
  histogram.add(50us);
  histogram.add(100us);
  histogram.add(101us);
  histogram.add(5s);
  const auto snapshot = histogram.snapshot();
  EXPECT_EQ(snapshot.counts[0], 2u);
  EXPECT_EQ(snapshot.counts[1], 1u);
  EXPECT_EQ(snapshot.counts.back(), 1u);
  EXPECT_EQ(snapshot.count(), 4u);
  EXPECT_NEAR(snapshot.sum_s, 5.000251, 1e-9);
}

ServiceStatus status() {
  ServiceStatus status;
  status.cameras = {{.name = "le\"ft",
                     .health = CameraStatus::Health::delivering,
                     .message = {},
                     .frames = 12,
                     .dropped = 3,
                     .rate_hz = 29.5,
                     .age_s = 0.02}};
  status.targets = {"ball"};
  status.sets = 11;
  return status;
}

TEST(ToPrometheus, HasEveryFigureOnce) {
  LatencyHistogram histogram;
  histogram.add(150us);
  histogram.add(30ms);
  LatencyFigures latencies;
  latencies.capture_to_dequeue = {histogram.snapshot()};
  latencies.dequeue_to_publish = histogram.snapshot();
  const TargetFigures targets[] = {{.state = TrackState::coasting, .effective_sample_size = 87.5, .particles = 200}};
  const std::string text = to_prometheus(status(), targets, latencies, 10);
  for (const auto* line : {
           "\nhuetrack_camera_frames_total{camera=\"le\\\"ft\"} 12\n",
           "\nhuetrack_camera_dropped_frames_total{camera=\"le\\\"ft\"} 3\n",
           "\nhuetrack_camera_rate_hertz{camera=\"le\\\"ft\"} 29.5\n",
           "\nhuetrack_camera_up{camera=\"le\\\"ft\"} 1\n",
           "\nhuetrack_sets_total 11\n",
           "\nhuetrack_published_samples_total 10\n",
           "\nhuetrack_target_state{target=\"ball\",state=\"coasting\"} 1\n",
           "\nhuetrack_target_state{target=\"ball\",state=\"lost\"} 0\n",
           "\nhuetrack_target_effective_sample_size{target=\"ball\"} 87.5\n",
           "\nhuetrack_capture_to_dequeue_seconds_bucket{camera=\"le\\\"ft\",le=\"0.0001\"} 0\n",
           "\nhuetrack_dequeue_to_publish_seconds_bucket{le=\"0.0002\"} 1\n",
           "\nhuetrack_dequeue_to_publish_seconds_bucket{le=\"0.05\"} 2\n",  // cumulated
           "\nhuetrack_dequeue_to_publish_seconds_bucket{le=\"+Inf\"} 2\n",
           "\nhuetrack_dequeue_to_publish_seconds_sum 0.03015\n",
           "\nhuetrack_dequeue_to_publish_seconds_count 2\n",
       }) {
    const auto at = text.find(line);
    ASSERT_NE(at, std::string::npos) << line << text;
    EXPECT_EQ(text.find(line, at + 1), std::string::npos) << line;
  }
}

// What a reader gets; empty when nobody listens.
std::string get(int port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  ::inet_pton(AF_INET, "127.0.0.1", &to.sin_addr);
  std::string answer;
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) {
    const std::string request = "GET /metrics HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
    EXPECT_EQ(::send(fd, request.data(), request.size(), 0), ssize_t(request.size()));
    char buffer[4096];
    for (ssize_t n; (n = ::recv(fd, buffer, sizeof buffer, 0)) > 0;) answer.append(buffer, std::size_t(n));
  }
  ::close(fd);
  return answer;
}

TEST(MetricsServer, AnswersWithTheLatestTextAndEndsSoon) {
  const int port = 20000 + ::getpid() % 20000;
  {
    auto server = std::make_unique<MetricsServer>("127.0.0.1", port);
    server->show("a 1\n");
    EXPECT_THAT(get(port), HasSubstr("\r\n\r\na 1\n"));
    server->show("a 2\n");
    EXPECT_THAT(get(port), HasSubstr("a 2\n"));
    const int idle = ::socket(AF_INET, SOCK_STREAM, 0);  // says nothing
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    ::inet_pton(AF_INET, "127.0.0.1", &to.sin_addr);
    ASSERT_EQ(::connect(idle, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
    EXPECT_THAT([&] { MetricsServer("192.0.2.77", port); },
                testing::ThrowsMessage<std::runtime_error>(HasSubstr("192.0.2.77:" + std::to_string(port))));
    const auto start = std::chrono::steady_clock::now();
    server.reset();
    EXPECT_LT(std::chrono::steady_clock::now() - start, 2s);
    ::close(idle);
  }
  EXPECT_EQ(get(port), "");
}

}  // namespace
}  // namespace huetrack
