// view_cost [ROUNDS]: what it costs the tracking thread that people watch. The same frame sets go through the pipeline
// at 10 times real time, in turn without a view server, with one that nobody subscribes to, and with the bridge and
// three open pages in this process. Prints the tracking thread's CPU time per frame set (trackers, publishing and the
// hand-over to the previews), as medians over the rounds, and what was made meanwhile.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "benchmark/sequence.h"
#include "clients/live_view/bus_reader.h"
#include "clients/live_view/page_server.h"
#include "daemon/service_config.h"
#include "daemon/view_server.h"
#include "publish/estimate_publisher.h"

namespace huetrack {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// The sequence's frames, over and over, with times that go on.
class Loop final : public FrameSource {
 public:
  Loop(const Sequence& sequence, std::size_t sets) : sequence_(sequence), left_(sets) {}
  std::optional<Frame> next(std::stop_token stop) override {
    if (stop.stop_requested()) return std::nullopt;
    while (queue_.empty()) {
      if (left_-- == 0) return std::nullopt;
      const FrameSet& set = sequence_.sets[next_];
      for (const auto& frame : set.frames) {
        if (!frame) continue;
        queue_.push_back(*frame);
        queue_.back().captured_at += shift_;
        queue_.back().sequence = number_;
      }
      std::ranges::reverse(queue_);
      ++number_;
      if (++next_ == sequence_.sets.size()) {
        next_ = 0;
        shift_ += sequence_.sets.back().at - sequence_.sets.front().at + duration_of(1 / 30.0);
      }
    }
    Frame frame = std::move(queue_.back());
    queue_.pop_back();
    if (queue_.empty()) std::this_thread::sleep_until(due_ += std::chrono::microseconds(3333));  // ten times real time
    return frame;
  }

 private:
  const Sequence& sequence_;
  std::size_t left_, next_ = 0;
  std::uint32_t number_ = 0;
  Duration shift_{0};
  Clock::time_point due_ = Clock::now();
  std::vector<Frame> queue_;
};

struct Cost {
  double cpu_us = 0;  // per set, of the tracking thread
  std::uint64_t previews = 0;
};

Cost run(const Sequence& sequence, const ServiceConfig& config, EstimatePublisher& publisher, bool has_server) {
  constexpr std::size_t sets = 1200;
  std::optional<ViewServer> view;
  if (has_server) view.emplace(config, ViewServerOptions{});
  PipelineOutputs outputs;
  outputs.estimates = [&](const FrameSet&, std::span<const ObjectEstimate> estimates, Timestamp received_at) {
    for (std::size_t t = 0; t < estimates.size(); ++t) publisher.publish(t, estimates[t], received_at, received_at);
  };
  if (view) {
    outputs.view_wanted = [&] { return view->wants(); };
    outputs.view = [&](PictureJob job) { view->offer(std::move(job)); };
    std::this_thread::sleep_for(1s);  // subscribers find it
  }
  std::vector<ObjectTracker> trackers;
  for (const auto& target : config.targets) trackers.emplace_back(config.rig, target, config.object_tracking);
  PipelineOptions options;
  options.frame_sets = {.camera_count = int(config.rig.cameras.size()), .tolerance = duration_of(0.02)};
  options.frame_sets.ascending_input = true;
  std::vector<std::unique_ptr<FrameSource>> sources;
  sources.push_back(std::make_unique<Loop>(sequence, sets));
  Pipeline pipeline(config.rig, std::move(sources), std::move(trackers), options, std::move(outputs));
  pipeline.run({});
  const PipelineFigures figures = pipeline.figures();
  const Duration cpu = figures.track.cpu - figures.track_first.cpu + figures.publish.cpu;
  return {1e6 * seconds(cpu) / double(figures.sets_tracked), view ? view->counters().previews : 0};
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

}  // namespace
}  // namespace huetrack

int main(int argc, char** argv) {
  using namespace huetrack;
  const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 9;
  if (!have("rendered/occlusion")) {
    std::fprintf(stderr, "no recording in %s\n", (shared_data() / "rendered/occlusion").c_str());
    return 1;
  }
  const Sequence sequence = load_sequence(shared_data() / "rendered/occlusion");
  ServiceConfig config;
  config.rig = sequence.rig;
  config.targets = {pink_ball(), lime_ball()};
  config.object_tracking = rendered_options(Observation::huetrack, 1);
  config.dds.publisher.domain = 75;
  config.dds.publisher.interfaces = {"lo"};
  for (const auto& target : config.targets) config.dds.publisher.targets.push_back(target.name);
  for (const auto& camera : config.rig.cameras) config.dds.publisher.cameras.push_back(camera.name);
  EstimatePublisher publisher(config.dds.publisher);

  std::array<std::vector<double>, 3> cpu;
  std::uint64_t previews_idle = 0, previews_watched = 0;
  for (int round = 0; round < rounds; ++round) {
    cpu[0].push_back(run(sequence, config, publisher, false).cpu_us);
    const Cost idle = run(sequence, config, publisher, true);
    cpu[1].push_back(idle.cpu_us);
    previews_idle += idle.previews;
    {
      live_view::EventHub hub;
      live_view::BusReader bus({.domain = 75, .interfaces = {"lo"}}, hub);
      live_view::PageServerOptions options;
      options.port = 0;
      live_view::PageServer server(options, hub, [](const std::string&) { return std::string(); });
      std::atomic<std::size_t> received = 0;
      std::vector<std::jthread> threads;
      threads.emplace_back([&](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          bus.poll(server.pages());
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
      });
      for (int page = 0; page < 3; ++page) {
        threads.emplace_back([&](const std::stop_token& stop) {
          const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
          sockaddr_in to{};
          to.sin_family = AF_INET;
          to.sin_port = htons(static_cast<std::uint16_t>(server.port()));
          to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
          const timeval patience{.tv_sec = 0, .tv_usec = 100'000};
          ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
          if (::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) std::abort();
          const std::string request = "GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n";
          if (::send(fd, request.data(), request.size(), 0) < 0) std::abort();
          std::vector<char> buffer(65536);
          while (!stop.stop_requested()) {
            const auto n = ::recv(fd, buffer.data(), buffer.size(), 0);
            if (n > 0) received += static_cast<std::size_t>(n);
          }
          ::close(fd);
        });
      }
      const Cost watched = run(sequence, config, publisher, true);
      cpu[2].push_back(watched.cpu_us);
      previews_watched += watched.previews;
      for (auto& thread : threads) thread.request_stop();
      threads.clear();
      if (round == 0) std::printf("three pages received %.1f MB in the first round\n", double(received) / 1e6);
    }
  }
  const double none = median(cpu[0]), idle = median(cpu[1]), watched = median(cpu[2]);
  std::printf("tracking thread, CPU per frame set (3 cameras, 2 targets), medians of %d rounds of 1200 sets:\n",
              rounds);
  std::printf("  without a view server            %7.2f us\n", none);
  std::printf("  with one, nobody watches         %7.2f us  %+.2f %%   %llu pictures made\n", idle,
              100 * (idle / none - 1), static_cast<unsigned long long>(previews_idle));
  std::printf("  with three pages open            %7.2f us  %+.2f %%   %llu pictures made\n", watched,
              100 * (watched / none - 1), static_cast<unsigned long long>(previews_watched));
  return 0;
}
