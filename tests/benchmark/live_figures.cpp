// The figures of the live service: latency from a set's last frame to the DDS write, processor time and memory; by the
// service's own histograms and by a subscriber's clock. The service runs in a process of its own
// (tests/soak/film_service: `huetrackd run` on films), the subscriber in this one.
//   live_figures [--seconds S] [--runs N]
// The machine must be idle for them to mean anything: of several runs the best one is printed last.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <sstream>

#include "benchmark/live_process.h"
#include "clients/huetrack/position_subscription.h"
#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "metrics/metrics.h"
#include "soak/films.h"

namespace {

using namespace huetrack;
using figures::cpu_s;
using figures::quantile;
namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr int domain = 71, metrics_port = 19466;

struct Case {
  const char* name;
  int cameras, width, height, particles;
};

struct Figures {
  double p50_ms = 0, p99_ms = 0;                        // dequeue to DDS write, by the service's histogram
  double write_p50_ms = 0, write_p99_ms = 0;            // the same, exact, from the samples
  double sent_p50_ms = 0, sent_p99_ms = 0;              // dequeue until the write is over, by the service's histogram
  double subscriber_p50_ms = 0, subscriber_p99_ms = 0;  // dequeue to the subscriber's hands, by its clock
  double cpu_percent = 0;                               // of one core, all threads
  double rss_mb = 0, anonymous_mb = 0;
  std::size_t samples = 0, tracking = 0;
};

// Linear inside its bucket.
double quantile(const std::map<std::string, double>& metrics, const std::string& family, double q) {
  const double all = metrics.at(family + "_count");
  double below = 0, lower_s = 0;
  for (const double bound_s : metrics::LatencyHistogram::bounds_s) {
    std::ostringstream label;
    label << family << "_bucket{le=\"" << bound_s << "\"}";
    const double count = metrics.at(label.str());
    if (count >= q * all)
      return lower_s + (bound_s - lower_s) * (count > below ? (q * all - below) / (count - below) : 1);
    below = count;
    lower_s = bound_s;
  }
  return std::numeric_limits<double>::infinity();
}

double status_mb(pid_t pid, const std::string& key) {
  const std::string status = end_to_end::contents("/proc/" + std::to_string(pid) + "/status");
  const auto at = status.find(key + ":");
  return at == std::string::npos ? 0 : std::stod(status.substr(at + key.size() + 1)) * 1024 / 1e6;
}

Figures measure(const Case& c, const fs::path& folder, const std::string& phases, double seconds) {
  std::ofstream(folder / "c.yaml") << soak::film_config(
      folder, c.particles,
      "dds: {domain: " + std::to_string(domain) + "}\nmetrics: {port: " + std::to_string(metrics_port) + "}\n");
  idl::ParticipantOptions participant;
  participant.name = "live_figures";
  participant.domain = domain;
  client::PositionSubscription subscription(participant);
  end_to_end::Process service({FILM_SERVICE, folder / "c.yaml", folder, "--phases", phases}, folder / "out",
                              folder / "err");
  Figures figures;
  std::vector<double> ages_ms, writes_ms;
  const auto now_ns = [] {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
  };
  const auto take = [&](std::chrono::duration<double> length, bool counts) {
    const auto end = std::chrono::steady_clock::now() + length;
    while (std::chrono::steady_clock::now() < end) {
      const auto heard = subscription.next(100ms);
      if (!heard || !counts) continue;
      const msg::ObjectPosition* const sample = &heard->sample;
      ages_ms.push_back(1e-6 * double(now_ns() - sample->received_at()));
      writes_ms.push_back(1e-6 * double(sample->published_at() - sample->received_at()));
      figures.tracking += sample->state() == msg::TRACK_STATE_TRACKING ? 1 : 0;
    }
  };
  take(2s, false);  // discovery, the first sets
  const double cpu_before = cpu_s(service.pid());
  const auto start = std::chrono::steady_clock::now();
  take(std::chrono::duration<double>(seconds), true);
  figures.cpu_percent = 100 * (cpu_s(service.pid()) - cpu_before) /
                        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  figures.rss_mb = status_mb(service.pid(), "VmRSS");
  figures.anonymous_mb = status_mb(service.pid(), "RssAnon");
  const auto text = end_to_end::http_get(metrics_port, "/metrics");
  service.kill(SIGTERM);
  service.wait();
  if (!text || ages_ms.empty()) throw std::runtime_error("the service did not run: " + service.err());
  const auto metrics = end_to_end::prometheus_samples(*text);
  figures.p50_ms = 1e3 * quantile(metrics, "huetrack_dequeue_to_write_seconds", 0.5);
  figures.p99_ms = 1e3 * quantile(metrics, "huetrack_dequeue_to_write_seconds", 0.99);
  figures.sent_p50_ms = 1e3 * quantile(metrics, "huetrack_dequeue_to_publish_seconds", 0.5);
  figures.sent_p99_ms = 1e3 * quantile(metrics, "huetrack_dequeue_to_publish_seconds", 0.99);
  figures.subscriber_p50_ms = quantile(ages_ms, 0.5);
  figures.subscriber_p99_ms = quantile(ages_ms, 0.99);
  figures.write_p50_ms = quantile(writes_ms, 0.5);
  figures.write_p99_ms = quantile(writes_ms, 0.99);
  figures.samples = ages_ms.size();
  return figures;
}

void print(const std::string& what, const Figures& f) {
  std::printf(
      "%-34s dequeue to DDS write p50 %.2f p99 %.2f ms (histogram), %.2f %.2f ms (samples); until it is over %.2f %.2f "
      "ms "
      "(histogram); to the subscriber's hands %.2f %.2f ms; CPU %.1f %%, RSS %.1f MB (anonymous %.1f); %zu samples, "
      "%zu tracking\n",
      what.c_str(), f.p50_ms, f.p99_ms, f.write_p50_ms, f.write_p99_ms, f.sent_p50_ms, f.sent_p99_ms,
      f.subscriber_p50_ms, f.subscriber_p99_ms, f.cpu_percent, f.rss_mb, f.anonymous_mb, f.samples, f.tracking);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("figures of the live service");
  double seconds = 20;
  int runs = 3;
  app.add_option("--seconds", seconds, "of each run")->check(CLI::PositiveNumber);
  app.add_option("--runs", runs, "of each case")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  std::string folder_name = (fs::temp_directory_path() / "live_figures_XXXXXX").string();
  if (!::mkdtemp(folder_name.data())) return 1;
  const fs::path folder = folder_name;
  int status = 0;
  try {
    for (const Case& c : {Case{"four 640x480", 4, 640, 480, 500}, Case{"two 320x240", 2, 320, 240, 200}}) {
      for (const std::string phases : {"spread", "together"}) {
        const fs::path films = folder / (phases + std::to_string(c.width));
        soak::make_films(films, c.cameras, c.width, c.height, phases == "spread");
        const std::string what = std::string(c.name) + " YUYV, 30 fps, " + phases;
        std::optional<Figures> best;
        for (int run = 0; run < runs; ++run) {
          const Figures figures = measure(c, films, phases, seconds);
          print(what, figures);
          if (!best || figures.write_p99_ms < best->write_p99_ms) best = figures;
        }
        print("BEST " + what, *best);
      }
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "live_figures: %s\n", error.what());
    status = 1;
  }
  fs::remove_all(folder);
  return status;
}
