// Runs the service on failing films for a long time and bothers it: reloads, good and bad; saved pre-rolls, also to a
// disk that is full for a while; colours that are taught; subscribers that come and go; readers of the metrics, silent
// ones too; beside it the page's bridge with pages that come and go. Prints their memory as it goes. See run.sh, which
// gives it a mount namespace for that disk.
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "end_to_end/http.h"
#include "end_to_end/process.h"
#include "end_to_end/teaching_page.h"
#include "soak/arguments.h"
#include "soak/films.h"

namespace {

using namespace huetrack;
namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int domain = 70, metrics_port = 19468, page_port = 19469;

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

struct SoakOptions {
  double minutes = 60, slowness = 1;
  std::uint64_t seed = 1;
  fs::path program = FILM_SERVICE;
};

Clock::duration duration_of(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

// Where recordings go: a disk of its own, that can be full.
class SmallDisk {
 public:
  static constexpr int size_mb = 400;

  // throws std::runtime_error: it may not be mounted
  explicit SmallDisk(fs::path folder) : folder_(std::move(folder)) {
    fs::create_directories(folder_);
    const std::string options = "size=" + std::to_string(size_mb) + "m";
    if (::mount("huetrack_soak", folder_.c_str(), "tmpfs", 0, options.c_str()) != 0)
      throw std::runtime_error(std::string("no disk of its own can be mounted (") + std::strerror(errno) +
                               "): run it by tests/soak/run.sh");
  }
  ~SmallDisk() { ::umount2(folder_.c_str(), MNT_DETACH); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool is_full() const { return fs::exists(filler()); }
  void fill() const {
    std::ofstream file(filler(), std::ios::binary);
    const std::string block(1 << 16, 'x');
    while (file.write(block.data(), std::streamsize(block.size())).flush()) {
    }
  }
  void free() const { fs::remove(filler()); }
  // Finished recordings, but those that are older than this.
  std::ptrdiff_t recordings(std::chrono::seconds age) const {
    std::ptrdiff_t count = 0;
    std::error_code gone;
    for (const auto& recording : fs::directory_iterator(folder_, gone))
      count += fs::exists(recording.path() / "recording.yaml", gone) &&
                       fs::file_time_type::clock::now() - fs::last_write_time(recording, gone) < age
                   ? 1
                   : 0;
    return count;
  }
  // As somebody does who moves them elsewhere.
  void take_away_older_than(std::chrono::seconds age) const {
    std::error_code gone;
    for (const auto& recording : fs::directory_iterator(folder_, gone))
      if (recording.is_directory(gone) && fs::file_time_type::clock::now() - fs::last_write_time(recording, gone) > age)
        fs::remove_all(recording, gone);
  }

 private:
  fs::path filler() const { return folder_ / "filler"; }
  fs::path folder_;
};

// A process' resident memory over the run.
class MemoryRecord {
 public:
  void add(double minute, double of_minutes, double now_mb) {
    if (first_mb_ == 0 && minute > std::min(1.0, of_minutes / 5)) first_mb_ = now_mb;
    if (minute <= of_minutes / 5) warm_mb_ = std::max(warm_mb_, now_mb);
  }
  double first_mb() const { return first_mb_; }
  bool is_flat(double last_mb) const { return last_mb <= 1.1 * std::max(first_mb_, warm_mb_) + 2; }

 private:
  double first_mb_ = 0, warm_mb_ = 0;  // warm: the most of the first fifth, when every queue has been full
};

// The service, and all that happens to it.
class Soak {
 public:
  Soak(const SoakOptions& options, const fs::path& folder)
      : options_(options),
        folder_(folder),
        watchdog_(duration_of(4 * options.slowness)),
        random_(options.seed),
        disk_(folder / "recordings") {}

  // throws std::exception: what ended it early
  void run() {
    start();
    started_ = next_row_ = last_barked_ = Clock::now();
    std::printf(
        "   min   RSS MB  anonymous  threads  files  sets  reloads saves scrapes subscribers taught full disks bridge "
        "MB "
        "pages\n");
    for (const auto end = started_ + duration_of(60 * options_.minutes); Clock::now() < end;) {
      if (service_->has_ended()) throw std::runtime_error("the service ended:\n" + service_->err());
      if (bridge_->has_ended()) throw std::runtime_error("the page's bridge ended:\n" + bridge_->err());
      listen_to_watchdog();
      disturb();
      disk_.take_away_older_than(20s);
      watch_disk();
      if (Clock::now() >= next_row_) print_row();
      std::this_thread::sleep_for(250ms);
    }
    end();
  }

  void complain(const std::string& what) {
    std::printf("COMPLAINT: %s\n", what.c_str());
    std::fflush(stdout);
    ++complaints_;
  }
  std::size_t complaints() const { return complaints_; }

 private:
  void write_config(const std::string& hue, const std::string& more) const {
    const std::string text =
        soak::film_config(folder_, 200,
                          "quorum: 1\ndds: {domain: " + std::to_string(domain) +
                              ", interfaces: [lo]}\nmetrics: {port: " + std::to_string(metrics_port) +
                              "}\nrecord: {folder: " + (folder_ / "recordings").string() +
                              ", pre_roll_s: 2, pre_roll_mb: 64, after_s: 1}\ncontrol: {allow_teach: true}\n" + more);
    std::ofstream(folder_ / "c.yaml") << std::string(text).replace(text.find("[65, 115]"), 9, hue);
  }

  void start() {
    soak::make_films(folder_, 3, 320, 240);
    write_config("[65, 115]", "");
    notified_.emplace(folder_ / "notify");
    const auto watchdog = std::chrono::duration_cast<std::chrono::microseconds>(watchdog_);
    service_.emplace(std::vector<std::string>{options_.program.string(), folder_ / "c.yaml", folder_, "--faults",
                                              std::to_string(options_.seed)},
                     folder_ / "out", folder_ / "err",
                     std::map<std::string, std::string>{{"NOTIFY_SOCKET", folder_ / "notify"},
                                                        {"WATCHDOG_USEC", std::to_string(watchdog.count())}});
    const auto longest_start = Clock::now() + duration_of(30 * options_.slowness);
    for (bool is_ready = false; !is_ready;) {  // a signal before that ends any program
      if (service_->has_ended() || Clock::now() > longest_start)
        throw std::runtime_error("it does not start:\n" + service_->err());
      while (const auto message = notified_->next()) is_ready |= message->find("READY=1") != std::string::npos;
      std::this_thread::sleep_for(20ms);
    }
    bridge_.emplace(std::vector<std::string>{HUETRACK, "view", "--port", std::to_string(page_port), "--domain",
                                             std::to_string(domain), "--interface", "lo"},
                    folder_ / "bridge.out", folder_ / "bridge.err");
  }

  void listen_to_watchdog() {
    while (const auto message = notified_->next())
      if (message->find("WATCHDOG=1") != std::string::npos) last_barked_ = Clock::now();
    if (Clock::now() - last_barked_ <= watchdog_) return;
    complain("no WATCHDOG=1 for too long: systemd would have killed it");
    last_barked_ = Clock::now();
  }

  int any(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }
  void reload(const std::string& hue, const std::string& more) {
    write_config(hue, more);
    service_->kill(SIGHUP);
    ++reloads_;
  }

  // One of the things that users do, now and then.
  void disturb() {
    switch (any(14)) {
      case 0:
        reload(any(2) == 0 ? "[65, 115]" : "[60, 120]", "");
        break;
      case 1:
        if (any(3) == 0) reload("[65, 115]", "no_such_key: 1\n");
        break;
      case 2:
        if (any(4) != 0) break;
        service_->kill(SIGUSR1);
        ++saves_;
        break;
      case 3:
        if (!end_to_end::http_get(metrics_port, "/metrics") &&
            Clock::now() - started_ > duration_of(10 * options_.slowness))
          complain("no metrics");
        ++scrapes_;
        break;
      case 4:
        silent_ = std::make_unique<end_to_end::Connection>(metrics_port);
        break;
      case 5:
        watcher_.reset();
        if (any(3) == 0) break;
        watcher_ = std::make_unique<end_to_end::Process>(
            std::vector<std::string>{HUETRACK, "watch", "--domain", std::to_string(domain)}, folder_ / "watch.out",
            folder_ / "watch.err");
        ++watchers_;
        break;
      case 6:
        if (any(10) == 0) teach();
        break;
      case 7:
        if (any(20) != 0 || disk_.is_full() || is_save_awaited_ || disk_checked_) break;
        disk_.fill();
        ++full_disks_;
        disk_changes_ = Clock::now() + 15s;
        service_->kill(SIGUSR1);
        ++saves_;
        break;
      case 8:  // a page; it reads only when it is its turn
        pages_.push_back(std::make_unique<end_to_end::Connection>(page_port));
        pages_.back()->send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
        ++pages_opened_;
        if (pages_.size() > 6) pages_.erase(pages_.begin());
        break;
      case 9:
        if (pages_.empty()) break;
        pages_[std::size_t(any(int(pages_.size())))]->receive_some();
        if (any(8) == 0) pages_.clear();
        break;
      default:
        break;
    }
  }

  // Full for a quarter of a minute; what is asked for after it must be on it.
  void watch_disk() {
    if (disk_.is_full() && Clock::now() > disk_changes_) {
      disk_.free();
      disk_changes_ = Clock::now() + duration_of(2);
      is_save_awaited_ = true;
    } else if (is_save_awaited_ && Clock::now() > disk_changes_) {
      service_->kill(SIGUSR1);
      ++saves_;
      is_save_awaited_ = false;
      disk_checked_ = Clock::now() + duration_of(12 * options_.slowness);
    } else if (disk_checked_ && Clock::now() > *disk_checked_) {
      if (disk_.recordings(15s) == 0) complain("nothing is recorded since the disk is free again");
      disk_checked_.reset();
    }
  }

  // What is greenest in one view, as a user clicks at it. Cameras fail and balls hide: not all of it is granted.
  void teach() {
    if (!page_) page_.emplace(domain);
    page_->listen();
    page_->positions.clear();
    if (!page_->scene) return;
    const huetrack::msg::TeachReply frozen = page_->ask(huetrack::msg::TEACH_ACTION_FREEZE);
    const auto seen = std::ranges::find_if(frozen.cameras(), [](const auto& camera) { return !camera.jpeg().empty(); });
    if (!frozen.granted() || seen == frozen.cameras().end()) return;
    const std::vector<huetrack::msg::TeachPoint> clicked{end_to_end::lime_in(*seen)};
    if (!page_->ask(huetrack::msg::TEACH_ACTION_LOOK, clicked).granted()) return;
    lessons_ += page_->ask(huetrack::msg::TEACH_ACTION_APPLY, clicked).granted() ? 1 : 0;
  }

  void print_row() {
    next_row_ += duration_of(std::min(60.0, options_.minutes * 6));
    const auto text = end_to_end::http_get(metrics_port, "/metrics");
    const auto metrics = end_to_end::prometheus_samples(text.value_or(""));
    const auto sets = metrics.find("huetrack_sets_total");
    std::error_code error;
    const auto files =
        std::distance(fs::directory_iterator("/proc/" + std::to_string(service_->pid()) + "/fd", error), {});
    const double now_mb = status_mb(service_->pid(), "VmRSS");
    const double minute = std::chrono::duration<double>(Clock::now() - started_).count() / 60;
    const double bridge_mb = status_mb(bridge_->pid(), "VmRSS");
    service_memory_.add(minute, options_.minutes, now_mb);
    bridge_memory_.add(minute, options_.minutes, bridge_mb);
    std::printf("%6.1f %8.1f %10.1f %8.0f %6td %6.0f %7d %5d %7d %6d %6d %6d %8.1f %6d\n", minute, now_mb,
                status_mb(service_->pid(), "RssAnon"), status_mb(service_->pid(), "Threads") / 1024 * 1e6, files,
                sets == metrics.end() ? 0 : sets->second, reloads_, saves_, scrapes_, watchers_, lessons_, full_disks_,
                bridge_mb, pages_opened_);
    std::fflush(stdout);
  }

  void end() {
    watcher_.reset();
    const double last_mb = status_mb(service_->pid(), "VmRSS"), bridge_mb = status_mb(bridge_->pid(), "VmRSS");
    const auto asked = Clock::now();
    service_->kill(SIGTERM);
    const int status = service_->wait();
    const double took_s = std::chrono::duration<double>(Clock::now() - asked).count();
    std::printf("ended %.2f s after SIGTERM with status %d; %s", took_s, status, service_->out().c_str());
    std::printf("RSS at the start %.1f MB, at the end %.1f MB; of the bridge %.1f and %.1f MB\n",
                service_memory_.first_mb(), last_mb, bridge_memory_.first_mb(), bridge_mb);
    if (status != 0) complain("status " + std::to_string(status) + "\n" + service_->err());
    if (took_s > options_.slowness) complain("it took too long to end");
    if (options_.slowness == 1 && !service_memory_.is_flat(last_mb)) complain("its memory grows");
    if (!bridge_memory_.is_flat(bridge_mb)) complain("the bridge's memory grows");
    int warnings = 0;
    std::istringstream log(service_->err());
    for (std::string line; std::getline(log, line);) warnings += line.find("warning") != std::string::npos ? 1 : 0;
    std::printf("%d warnings in the log\n", warnings);
  }

  const SoakOptions& options_;
  const fs::path folder_;
  const Clock::duration watchdog_;
  std::mt19937_64 random_;
  std::optional<NotifySocket> notified_;
  std::optional<end_to_end::Process> service_;
  std::optional<end_to_end::Process> bridge_;
  std::vector<std::unique_ptr<end_to_end::Connection>> pages_;
  std::unique_ptr<end_to_end::Connection> silent_;
  std::unique_ptr<end_to_end::Process> watcher_;
  Clock::time_point started_, next_row_, last_barked_;
  MemoryRecord service_memory_, bridge_memory_;
  int pages_opened_ = 0;
  int reloads_ = 0, saves_ = 0, scrapes_ = 0, watchers_ = 0, lessons_ = 0, full_disks_ = 0;
  const SmallDisk disk_;
  Clock::time_point disk_changes_;  // when it is freed, or asked for a recording again
  std::optional<Clock::time_point> disk_checked_;
  bool is_save_awaited_ = false;
  std::optional<end_to_end::TeachingPage> page_;
  std::size_t complaints_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const soak::Arguments line(argc, argv, {"minutes", "seed", "service", "slowness"}, 0, "soak [OPTIONS]");
  SoakOptions options;
  options.minutes = line.number("minutes", options.minutes);
  options.seed = line.count("seed", options.seed);
  options.program = line.text("service", options.program.string());  // film_service of another build
  options.slowness = line.number("slowness", options.slowness);      // of a sanitized build: patience times it
  if (!(options.minutes > 0) || !(options.slowness > 0) || !fs::exists(options.program)) line.end("a value");
  std::string folder = (fs::temp_directory_path() / "soak_XXXXXX").string();
  if (!::mkdtemp(folder.data())) return 1;
  std::size_t complaints = 0;
  {
    Soak soak(options, folder);
    try {
      soak.run();
    } catch (const std::exception& error) {
      soak.complain(error.what());
    }
    complaints = soak.complaints();
  }
  fs::remove_all(folder);
  std::printf("%s: %zu complaints\n", complaints == 0 ? "GOOD" : "BAD", complaints);
  return complaints == 0 ? 0 : 1;
}
