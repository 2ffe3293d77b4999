// Runs the service on failing films for a long time and bothers it: reloads, good and bad; saved pre-rolls; subscribers
// that come and go; readers of the metrics, silent ones too; kill -9. Prints its memory as it goes. See run.sh.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <random>

#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "soak/films.h"

namespace {

using namespace huetrack;
namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int domain = 34, metrics_port = 19468;

double status_mb(pid_t pid, const std::string& key) {
  const std::string status = end_to_end::contents("/proc/" + std::to_string(pid) + "/status");
  const auto at = status.find(key + ":");
  return at == std::string::npos ? 0 : std::stod(status.substr(at + key.size() + 1)) * 1024 / 1e6;
}

// What systemd would hear.
class NotifySocket {
 public:
  explicit NotifySocket(const fs::path& path) : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    if (::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) throw std::runtime_error("bind");
  }
  ~NotifySocket() { ::close(fd_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;
  std::optional<std::string> next() const {
    char buffer[4096];
    const ssize_t got = ::recv(fd_, buffer, sizeof buffer, 0);
    return got < 0 ? std::nullopt : std::optional(std::string(buffer, std::size_t(got)));
  }

 private:
  int fd_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("soak: the service on failing films");
  double minutes = 30, slowness = 1;
  std::uint64_t seed = 1;
  fs::path program = FILM_SERVICE;
  app.add_option("--minutes", minutes)->check(CLI::PositiveNumber);
  app.add_option("--seed", seed);
  app.add_option("--service", program, "film_service of another build")->check(CLI::ExistingFile);
  app.add_option("--slowness", slowness, "of a sanitized build: patience is multiplied by it")
      ->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  std::string name = (fs::temp_directory_path() / "soak_XXXXXX").string();
  if (!::mkdtemp(name.data())) return 1;
  const fs::path folder = name;
  const auto watchdog = std::chrono::duration_cast<std::chrono::microseconds>(4s * slowness);
  const auto write_config = [&](const std::string& hue, const std::string& more) {
    const std::string text = soak::film_config(folder, 200,
                                               "quorum: 1\ndds: {domain: " + std::to_string(domain) +
                                                   "}\nmetrics: {port: " + std::to_string(metrics_port) +
                                                   "}\nrecord: {folder: " + (folder / "recordings").string() +
                                                   ", pre_roll_s: 2, pre_roll_mb: 64, after_s: 1}\n" + more);
    std::ofstream(folder / "c.yaml") << std::string(text).replace(text.find("[65, 115]"), 9, hue);
  };
  std::vector<std::string> complaints;
  const auto complain = [&](const std::string& what) {
    std::printf("COMPLAINT: %s\n", what.c_str());
    std::fflush(stdout);
    complaints.push_back(what);
  };
  try {
    soak::make_films(folder, 3, 320, 240);
    write_config("[65, 115]", "");
    const NotifySocket notified(folder / "notify");
    end_to_end::Process service(
        {program.string(), folder / "c.yaml", folder, "--faults", std::to_string(seed)}, folder / "out", folder / "err",
        {{"NOTIFY_SOCKET", folder / "notify"}, {"WATCHDOG_USEC", std::to_string(watchdog.count())}});
    const auto longest_start = Clock::now() + std::chrono::duration_cast<Clock::duration>(30s * slowness);
    for (bool is_ready = false; !is_ready;) {  // a signal before that ends any program
      if (service.has_ended() || Clock::now() > longest_start)
        throw std::runtime_error("it does not start:\n" + service.err());
      while (const auto message = notified.next()) is_ready |= message->find("READY=1") != std::string::npos;
      std::this_thread::sleep_for(20ms);
    }
    std::mt19937_64 random(seed);
    const auto any = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
    std::unique_ptr<end_to_end::Process> watcher;
    std::unique_ptr<end_to_end::Connection> silent;
    const auto start = Clock::now();
    const auto end = start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(60 * minutes));
    auto next_row = start;
    auto last_barked = Clock::now();
    double first_mb = 0, warm_mb = 0, last_mb = 0;  // warm: the most of the first fifth, when every queue has been full
    int reloads = 0, saves = 0, scrapes = 0, watchers = 0;
    std::printf("   min   RSS MB  anonymous  threads  files  sets  reloads saves scrapes subscribers\n");
    while (Clock::now() < end) {
      if (service.has_ended()) throw std::runtime_error("the service ended:\n" + service.err());
      while (const auto message = notified.next())
        if (message->find("WATCHDOG=1") != std::string::npos) last_barked = Clock::now();
      if (Clock::now() - last_barked > watchdog) {
        complain("no WATCHDOG=1 for too long: systemd would have killed it");
        last_barked = Clock::now();
      }
      switch (any(12)) {
        case 0:
          write_config(any(2) == 0 ? "[65, 115]" : "[60, 120]", "");
          service.kill(SIGHUP);
          ++reloads;
          break;
        case 1:
          if (any(3) != 0) break;
          write_config("[65, 115]", "no_such_key: 1\n");
          service.kill(SIGHUP);
          ++reloads;
          break;
        case 2:
          if (any(4) != 0) break;
          service.kill(SIGUSR1);
          ++saves;
          break;
        case 3:
          if (!end_to_end::http_get(metrics_port, "/metrics") && Clock::now() - start > 10s * slowness)
            complain("no metrics");
          ++scrapes;
          break;
        case 4:
          silent = std::make_unique<end_to_end::Connection>(metrics_port);
          break;
        case 5:
          watcher.reset();
          if (any(3) == 0) break;
          watcher = std::make_unique<end_to_end::Process>(
              std::vector<std::string>{HUETRACK, "watch", "--domain", std::to_string(domain)}, folder / "watch.out",
              folder / "watch.err");
          ++watchers;
          break;
        default:
          break;
      }
      std::error_code gone;  // the disk is not for ever
      for (const auto& recording : fs::directory_iterator(folder / "recordings", gone))
        if (fs::file_time_type::clock::now() - fs::last_write_time(recording, gone) > 20s)
          fs::remove_all(recording, gone);
      if (Clock::now() >= next_row) {
        next_row +=
            std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(std::min(60.0, minutes * 6)));
        const auto text = end_to_end::http_get(metrics_port, "/metrics");
        const auto metrics = end_to_end::prometheus_samples(text.value_or(""));
        const auto sets = metrics.find("huetrack_sets_total");
        std::error_code error;
        const auto files =
            std::distance(fs::directory_iterator("/proc/" + std::to_string(service.pid()) + "/fd", error), {});
        last_mb = status_mb(service.pid(), "VmRSS");
        const double minute = std::chrono::duration<double>(Clock::now() - start).count() / 60;
        if (first_mb == 0 && minute > std::min(1.0, minutes / 5)) first_mb = last_mb;
        if (minute <= minutes / 5) warm_mb = std::max(warm_mb, last_mb);
        std::printf("%6.1f %8.1f %10.1f %8.0f %6td %6.0f %7d %5d %7d %6d\n", minute, last_mb,
                    status_mb(service.pid(), "RssAnon"), status_mb(service.pid(), "Threads") / 1024 * 1e6, files,
                    sets == metrics.end() ? 0 : sets->second, reloads, saves, scrapes, watchers);
        std::fflush(stdout);
      }
      std::this_thread::sleep_for(250ms);
    }
    watcher.reset();
    last_mb = status_mb(service.pid(), "VmRSS");
    const auto asked = Clock::now();
    service.kill(SIGTERM);
    const int status = service.wait();
    const double took_s = std::chrono::duration<double>(Clock::now() - asked).count();
    std::printf("ended %.2f s after SIGTERM with status %d; %s", took_s, status, service.out().c_str());
    std::printf("RSS at the start %.1f MB, at the end %.1f MB\n", first_mb, last_mb);
    if (status != 0) complain("status " + std::to_string(status) + "\n" + service.err());
    if (took_s > slowness) complain("it took too long to end");
    if (slowness == 1 && last_mb > 1.1 * std::max(first_mb, warm_mb) + 2) complain("its memory grows");
    int warnings = 0;
    std::istringstream log(service.err());
    for (std::string line; std::getline(log, line);) warnings += line.find("warning") != std::string::npos ? 1 : 0;
    std::printf("%d warnings in the log\n", warnings);
  } catch (const std::exception& error) {
    complain(error.what());
  }
  fs::remove_all(folder);
  std::printf("%s: %zu complaints\n", complaints.empty() ? "GOOD" : "BAD", complaints.size());
  return complaints.empty() ? 0 : 1;
}
