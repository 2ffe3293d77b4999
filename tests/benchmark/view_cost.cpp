// What it costs the tracking that people watch. The service runs as its own process at real time
// (tests/soak/film_service: `huetrackd run` on films of four cameras, 640x480, 30 fps, 500 particles), `huetrack view`
// as another, the pages read in this one. In turn, in an order that changes from round to round: no bridge; a bridge
// without a page; a bridge with open pages. Of each window the figures of the road are taken:
//   CPU      per frame set: of the tracking thread (trackers, DDS write, hand-over), the kernel's account, a mean
//            without the slowest 5 %
//   latency  from the last frame of a set to its DDS write: from the samples
// Printed: medians with quartiles, and the differences within a round with a 95 % interval of their median.
//   view_cost [--rounds N] [--seconds S] [--pages N] [--together]
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <numeric>
#include <random>
#include <set>
#include <sstream>
#include <thread>
#include <tuple>

#include "clients/huetrack/position_subscription.h"
#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "soak/films.h"

namespace {

using namespace huetrack;
namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int domain = 72;
enum Watchers { no_bridge, no_page, pages_open };
constexpr const char* names[] = {"no bridge", "bridge, no page", "pages open"};

double quantile(std::vector<double> values, double q) {
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, std::size_t(q * double(values.size())))];
}

// Without the slowest 5 %, which are the machine's other business; the sets that are handed over are more than that.
double mean_of_most(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t n = std::max<std::size_t>(1, values.size() * 95 / 100);
  return std::accumulate(values.begin(), values.begin() + std::ptrdiff_t(n), 0.0) / double(n);
}

// Order statistics: whatever the values' distribution, their median is within these with 95 %.
std::array<double, 2> median_interval(std::vector<double> values) {
  std::ranges::sort(values);
  const double n = double(values.size());
  const double below = std::max(0.0, std::floor(n / 2 - 0.98 * std::sqrt(n)));
  return {values[std::size_t(below)], values[values.size() - 1 - std::size_t(below)]};
}

// Of the thread of that name: nanoseconds on a processor. throws when there is none.
class ThreadTime {
 public:
  ThreadTime(pid_t pid, const std::string& name) {
    for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(pid) + "/task"))
      if (end_to_end::contents(task.path() / "comm") == name + "\n") schedstat_ = task.path() / "schedstat";
    if (schedstat_.empty()) throw std::runtime_error("the service has no thread \"" + name + "\"");
  }
  double us() const { return std::stod(end_to_end::contents(schedstat_)) * 1e-3; }

 private:
  fs::path schedstat_;
};

struct Window {
  double cpu_us = 0;  // of the tracking thread, per set
  double median_latency_us = 0, p90_latency_us = 0;
  std::size_t sets = 0;
};

// Pages: connections that read the stream as fast as it comes. They note the numbers of the sets that previews are of.
class Pages {
 public:
  Pages(int port, int count) {
    for (int i = 0; i < count; ++i)
      threads_.emplace_back([this, port](const std::stop_token& stop) {
        end_to_end::Connection connection(port);
        connection.send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
        std::string text;
        while (!stop.stop_requested()) {
          const std::string some = connection.receive_some();
          received_ += some.size();
          text += some;
          for (auto end = text.find("\n\n"); end != std::string::npos; end = text.find("\n\n")) {
            note(text.substr(0, end));
            text.erase(0, end + 2);
          }
        }
      });
  }
  std::size_t received() const { return received_; }
  std::set<std::uint64_t> handed_over() const {
    const std::scoped_lock lock(mutex_);
    return handed_over_;
  }

 private:
  void note(const std::string& event) {
    if (event.find("event: preview\n") == std::string::npos) return;
    const auto at = event.find(",\"set\":");
    if (at == std::string::npos) return;
    const std::scoped_lock lock(mutex_);
    handed_over_.insert(std::stoull(event.substr(at + 7)));
  }
  std::atomic<std::size_t> received_ = 0;
  mutable std::mutex mutex_;
  std::set<std::uint64_t> handed_over_;  // guarded by mutex_
  std::vector<std::jthread> threads_;
};

// What one preview costs: against the set before it, on which none was being made, the set that is handed over, and the
// next one, which comes after (or while) pictures are encoded, sent, bridged and read. No drift of the machine is in
// it.
struct PreviewCost {
  std::vector<double> handed_over_us, next_us;
  void add(const std::map<std::uint64_t, double>& cpu_us, const std::set<std::uint64_t>& handed_over) {
    for (const std::uint64_t set : handed_over) {
      const auto before = cpu_us.find(set - 1), now = cpu_us.find(set), next = cpu_us.find(set + 1);
      if (before == cpu_us.end() || now == cpu_us.end() || next == cpu_us.end() || handed_over.contains(set - 2))
        continue;
      handed_over_us.push_back(now->second - before->second);
      next_us.push_back(next->second - before->second);
    }
  }
};

class Service {
 public:
  Service(const fs::path& films, const fs::path& folder, bool together)
      : folder_(folder), subscription_([] {
          idl::ParticipantOptions options;
          options.name = "view_cost";
          options.domain = domain;
          options.interfaces = {"lo"};
          return options;
        }()) {
    std::ofstream(folder / "c.yaml") << soak::film_config(
        films, 500, "dds: {domain: " + std::to_string(domain) + ", interfaces: [lo]}\nlog_level: warning\n");
    service_.emplace(
        std::vector<std::string>{FILM_SERVICE, folder / "c.yaml", films, "--phases", together ? "together" : "spread"},
        folder / "out", folder / "err");
    if (!subscription_.next(20s)) throw std::runtime_error("the service does not track: " + service_->err());
    tracking_.emplace(service_->pid(), "tracking");
    discard(1s);  // tables, the lock
  }

  void discard(std::chrono::duration<double> length) {
    for (const auto end = Clock::now() + length; Clock::now() < end;) subscription_.next(50ms);
  }

  // by_set: gets the CPU time of each set.
  Window measure(std::chrono::duration<double> length, std::map<std::uint64_t, double>& by_set) {
    std::vector<double> latency_us, cpu_us;
    auto [set, cpu] = after_a_set(latency_us);
    latency_us.clear();
    for (const auto end = Clock::now() + length; Clock::now() < end;) {
      const auto [set_then, cpu_then] = std::pair(set, cpu);
      std::tie(set, cpu) = after_a_set(latency_us);
      if (set != set_then + 1) continue;  // we came too late, and two are in it
      cpu_us.push_back(cpu - cpu_then);
      by_set[set] = cpu_us.back();
    }
    return {mean_of_most(cpu_us), quantile(latency_us, 0.5), quantile(latency_us, 0.9), cpu_us.size()};
  }

 private:
  // The next set, and the thread's time when it sleeps again: so that whole sets are counted, hand-over included.
  std::pair<std::uint64_t, double> after_a_set(std::vector<double>& latency_us) {
    auto heard = subscription_.next(1s);
    if (!heard) throw std::runtime_error("the service has stopped: " + service_->err());
    std::this_thread::sleep_for(4ms);
    for (auto newer = heard; newer; newer = subscription_.next(0ms)) {
      heard = newer;
      latency_us.push_back(1e-3 * double(heard->sample.published_at() - heard->sample.received_at()));
    }
    return {heard->sample.set_number(), tracking_->us()};
  }

  const fs::path folder_;
  client::PositionSubscription subscription_;
  std::optional<end_to_end::Process> service_;
  std::optional<ThreadTime> tracking_;
};

int port_of(const end_to_end::Process& view) {
  for (const auto end = Clock::now() + 10s; Clock::now() < end; std::this_thread::sleep_for(20ms)) {
    const std::string out = view.out();
    if (const auto at = out.find("127.0.0.1:"); at != std::string::npos && out.ends_with("/\n"))
      return std::stoi(out.substr(at + 10));
  }
  throw std::runtime_error("huetrack view does not start: " + view.err());
}

void print(const char* what, const std::vector<double>& base, const std::vector<double>& with) {
  std::vector<double> percent;
  for (std::size_t i = 0; i < base.size(); ++i) percent.push_back(100 * (with[i] / base[i] - 1));
  const auto [low, high] = median_interval(percent);
  std::printf("  %-18s %+6.2f %%   (95 %% interval of the median %+.2f to %+.2f %%; quartiles %+.2f, %+.2f)\n", what,
              quantile(percent, 0.5), low, high, quantile(percent, 0.25), quantile(percent, 0.75));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("what open pages cost the tracking");
  int rounds = 20, pages = 3;
  double seconds = 5;
  bool together = false;
  app.add_option("--rounds", rounds)->check(CLI::PositiveNumber);
  app.add_option("--seconds", seconds, "of each window")->check(CLI::PositiveNumber);
  app.add_option("--pages", pages)->check(CLI::PositiveNumber);
  app.add_flag("--together", together, "all cameras capture at once; otherwise spread over the period");
  CLI11_PARSE(app, argc, argv);
  std::string folder_name = (fs::temp_directory_path() / "view_cost_XXXXXX").string();
  if (!::mkdtemp(folder_name.data())) return 1;
  const fs::path folder = folder_name;
  int status = 0;
  try {
    soak::make_films(folder / "films", 4, 640, 480);
    Service service(folder / "films", folder, together);
    std::array<std::vector<double>, 3> cpu, latency, p90;
    std::array<Watchers, 3> order{no_bridge, no_page, pages_open};
    std::mt19937 rng(1);
    std::size_t received = 0, sets = 0, open_sets = 0, handed_sets = 0;
    PreviewCost previews;
    for (int round = 0; round < rounds; ++round) {
      std::ranges::shuffle(order, rng);
      for (const Watchers watchers : order) {
        std::optional<end_to_end::Process> view;
        std::optional<Pages> readers;
        if (watchers != no_bridge) {
          view.emplace(std::vector<std::string>{HUETRACK, "view", "--port", "0", "--domain", std::to_string(domain),
                                                "--interface", "lo"},
                       folder / "view_out", folder / "view_err");
          const int port = port_of(*view);
          if (watchers == pages_open) readers.emplace(port, pages);
        }
        service.discard(1500ms);  // discovery
        const std::size_t before = readers ? readers->received() : 0;
        std::map<std::uint64_t, double> by_set;
        const Window window = service.measure(std::chrono::duration<double>(seconds), by_set);
        if (readers) {
          received += readers->received() - before;
          const auto handed_over = readers->handed_over();
          previews.add(by_set, handed_over);
          handed_sets +=
              std::size_t(std::ranges::count_if(by_set, [&](const auto& s) { return handed_over.contains(s.first); }));
          open_sets += by_set.size();
        }
        sets += window.sets;
        cpu[watchers].push_back(window.cpu_us);
        latency[watchers].push_back(window.median_latency_us);
        p90[watchers].push_back(window.p90_latency_us);
      }
    }
    std::printf(
        "%d rounds of three windows of %.0f s, %zu frame sets (4 cameras 640x480, 30 fps, %s); %d pages read %.1f MB\n",
        rounds, seconds, sets, together ? "together" : "spread", pages, double(received) / 1e6);
    for (const int w : {no_bridge, no_page, pages_open})
      std::printf(
          "  %-18s CPU %.1f us per set (quartiles %.1f, %.1f); last frame to DDS write median %.1f us (%.1f, %.1f), "
          "p90 %.1f us\n",
          names[w], quantile(cpu[std::size_t(w)], 0.5), quantile(cpu[std::size_t(w)], 0.25),
          quantile(cpu[std::size_t(w)], 0.75), quantile(latency[std::size_t(w)], 0.5),
          quantile(latency[std::size_t(w)], 0.25), quantile(latency[std::size_t(w)], 0.75),
          quantile(p90[std::size_t(w)], 0.5));
    std::printf("the tracking thread's CPU time per set, against no bridge:\n");
    print("bridge, no page", cpu[no_bridge], cpu[no_page]);
    print("pages open", cpu[no_bridge], cpu[pages_open]);
    std::printf("median latency from the last frame to the DDS write, against no bridge:\n");
    print("bridge, no page", latency[no_bridge], latency[no_page]);
    print("pages open", latency[no_bridge], latency[pages_open]);
    const auto [h_low, h_high] = median_interval(previews.handed_over_us);
    const auto [n_low, n_high] = median_interval(previews.next_us);
    const double h = quantile(previews.handed_over_us, 0.5), n = quantile(previews.next_us, 0.5);
    const double share = double(handed_sets) / double(open_sets), of = quantile(cpu[no_bridge], 0.5);
    std::printf(
        "the same from set to set, with pages open: %.0f %% of the sets are handed over, which costs %+.1f us (%+.1f "
        "to %+.1f)\n"
        "each, and the next one %+.1f us (%+.1f to %+.1f), n = %zu: together %+.2f %% (%+.2f to %+.2f %%) of the "
        "tracking thread's time\n",
        100 * share, h, h_low, h_high, n, n_low, n_high, previews.next_us.size(), 100 * share * (h + n) / of,
        100 * share * (h_low + n_low) / of, 100 * share * (h_high + n_high) / of);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "view_cost: %s\n", error.what());
    status = 1;
  }
  fs::remove_all(folder);
  return status;
}
