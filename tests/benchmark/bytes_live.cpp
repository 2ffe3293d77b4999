// MJPEG cameras in real time: what decoding on demand saves the live service, beside pictures decoded whole by
// libjpeg-turbo. Cameras are an HTTP server in this process; each service is a process of its own, the same program
// with another reading of JPEGs. In turn, in one run:
//   tracker  `huetrackd run` with four cameras of 1920x1080: latency from the arrival of a set's last byte to the DDS
//            write of its position, by the samples; CPU time of the process
//   host     `huetrackd capture` with two cameras of 1280x720 for a tracker that asks for matches: CPU time of the host
//   bytes_live [--seconds S] [--rounds N]      of each service, 6 s; 2 rounds
// The machine must be idle. Exit status 1: a service did not track.
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "benchmark/camera_jpegs.h"
#include "benchmark/live_process.h"
#include "benchmark/speed_run.h"
#include "calib/model/rig_yaml.h"
#include "capture/frames/file_descriptor.h"
#include "capture/jpeg/jpeg_reader.h"
#include "capture/loopback_port.h"
#include "clients/huetrack/position_subscription.h"
#include "daemon/capture_command.h"
#include "daemon/live.h"
#include "daemon/service_manager.h"
#include "end_to_end/process.h"
#include "soak/arguments.h"
#include "soak/until_ended.h"

namespace {

using namespace huetrack;
namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int domain = 73, fps = 30;
constexpr int sets_of_film = 20;  // played there and back: 1.3 s

struct Reading {
  const char* name;
  capture::JpegReading reading;
};
constexpr std::array readings{Reading{"whole", capture::JpegReading::whole},
                              Reading{"on demand", capture::JpegReading::on_demand}};

using Film = std::vector<std::shared_ptr<const std::vector<std::uint8_t>>>;

// One camera: motion JPEG over HTTP. Picture k is sent at `start` + k / fps to the client that is connected then.
class FilmServer {
 public:
  FilmServer(Film film, Clock::time_point start) : film_(std::move(film)), start_(start) {
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }
  ~FilmServer() {
    thread_.request_stop();
    ::shutdown(port_.listening.get(), SHUT_RDWR);
  }
  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_.number) + "/video.mjpg"; }

 private:
  void serve(const std::stop_token& stop) const {
    while (!stop.stop_requested()) {
      const capture::FileDescriptor client(::accept4(port_.listening.get(), nullptr, nullptr, SOCK_CLOEXEC));
      if (client.get() < 0) return;
      const timeval patience{.tv_sec = 2, .tv_usec = 0};  // of a service that has ended
      ::setsockopt(client.get(), SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
      std::array<char, 2048> request{};
      if (::recv(client.get(), request.data(), request.size(), 0) > 0 &&
          send(client, "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n"))
        play(client, stop);
    }
  }
  void play(const capture::FileDescriptor& client, const std::stop_token& stop) const {
    constexpr auto period = std::chrono::nanoseconds(1s) / fps;
    for (auto k = (Clock::now() - start_) / period + 1; !stop.stop_requested(); ++k) {
      std::this_thread::sleep_until(start_ + k * period);
      const auto& jpeg = *film_[std::size_t(k) % film_.size()];
      if (!send(client, "--frame\r\nContent-Type: image/jpeg\r\nContent-Length: " + std::to_string(jpeg.size()) +
                            "\r\n\r\n" + std::string(jpeg.begin(), jpeg.end()) + "\r\n"))
        return;
    }
  }
  static bool send(const capture::FileDescriptor& to, const std::string& bytes) {
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t now = ::send(to.get(), bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (now <= 0) return false;
      sent += std::size_t(now);
    }
    return true;
  }

  const Film film_;
  const Clock::time_point start_;
  const capture::LoopbackPort port_;
  std::jthread thread_;
};

// Cameras of one size before a ball, their rig, and a service's configuration of them.
class Cameras {
 public:
  Cameras(int count, int width, int height) {
    figures::Sequence sequence = figures::scene_at(count, width, height, sets_of_film);
    figures::compress(sequence);
    rig_ = sequence.rig;
    const auto start = Clock::now();
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      Film film;
      for (const capture::FrameSet& set : sequence.sets) film.push_back(set.frames[c]->encoded);
      for (std::size_t k = sequence.sets.size() - 2; k > 0; --k) film.push_back(film[k]);
      servers_.push_back(std::make_unique<FilmServer>(std::move(film), start));
    }
  }
  // A tracker's; of_host: it takes them from a camera host of this name.
  void write_tracker(const fs::path& file, const std::string& of_host = "") const {
    const fs::path rig = fs::path(file).replace_extension(".rig.yaml");
    calib::write_rig(rig_, rig);
    std::ofstream out(file);
    out << "version: 1\nrig: " << rig.string() << "\ntargets: {lime: {color: {hue_deg: [65, 115]}}}\n"
        << dds << "cameras:\n";
    for (std::size_t c = 0; c < servers_.size(); ++c)
      out << "  " << rig_.cameras[c].name << ": {"
          << (of_host.empty() ? "device: \"" + servers_[c]->address() + '"'
                              : "host: " + of_host + ", camera: " + rig_.cameras[c].name + ", send: matches")
          << "}\n";
  }
  void write_host(const fs::path& file, const std::string& name) const {
    std::ofstream out(file);
    out << "version: 1\nhost: " << name << "\n" << dds << "cameras:\n";
    for (std::size_t c = 0; c < servers_.size(); ++c) {
      const auto [width, height] = rig_.cameras[c].image_size;
      out << "  " << rig_.cameras[c].name << ": {device: \"" << servers_[c]->address() << "\", size: [" << width << ", "
          << height << "]}\n";
    }
  }

 private:
  static inline const std::string dds = "dds: {domain: " + std::to_string(domain) + ", interfaces: [lo]}\n";
  calib::CameraRig rig_;
  std::vector<std::unique_ptr<FilmServer>> servers_;
};

struct Figures {
  std::vector<double> latency_ms;
  double cpu_s = 0, wall_s = 0;
  std::size_t tracking = 0;

  double cpu_percent() const { return 100 * cpu_s / wall_s; }
  double share_tracking() const { return latency_ms.empty() ? 0 : double(tracking) / double(latency_ms.size()); }
};

// Adds what is published in `seconds`, and the CPU time of `process`, once the ball has been tracked for a second.
void measure(const end_to_end::Process& process, double seconds, Figures& figures) {
  idl::ParticipantOptions participant;
  participant.name = "bytes_live";
  participant.domain = domain;
  participant.interfaces = {"lo"};
  client::PositionSubscription subscription(participant);
  const auto is_tracking = [](const auto& received) { return received->sample.state() == msg::TRACK_STATE_TRACKING; };
  int tracked = 0;  // samples in a row
  for (const auto end = Clock::now() + 20s; tracked < fps && Clock::now() < end;)
    if (const auto received = subscription.next(100ms)) tracked = is_tracking(received) ? tracked + 1 : 0;
  const double cpu_before = figures::cpu_s(process.pid());
  const auto begin = Clock::now();
  const auto end = begin + std::chrono::duration<double>(seconds);
  while (Clock::now() < end) {
    const auto received = subscription.next(100ms);
    if (!received) continue;
    figures.latency_ms.push_back(1e-6 * double(received->sample.published_at() - received->sample.received_at()));
    figures.tracking += is_tracking(received) ? 1 : 0;
  }
  figures.cpu_s += figures::cpu_s(process.pid()) - cpu_before;
  figures.wall_s += std::chrono::duration<double>(Clock::now() - begin).count();
}

class Folder {
 public:
  Folder() {
    if (::mkdtemp(path_.data()) == nullptr) throw std::runtime_error(path_ + ": cannot be made");
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path operator/(const char* name) const { return fs::path(path_) / name; }
  // This program as a service.
  end_to_end::Process service(const char* what, const Reading& reading) const {
    return {{"/proc/self/exe", std::string("--") + what, *this / (what + std::string(".yaml")).c_str(), "--reading",
             reading.name},
            *this / "out",
            *this / "err"};
  }

 private:
  std::string path_ = (fs::temp_directory_path() / "bytes_live_XXXXXX").string();
};

using ByReading = std::array<Figures, readings.size()>;

void measure_tracker(const Folder& folder, const Cameras& cameras, double seconds, ByReading& figures) {
  cameras.write_tracker(folder / "run.yaml");
  for (std::size_t r = 0; r < readings.size(); ++r) {
    const auto tracker = folder.service("run", readings[r]);
    measure(tracker, seconds, figures[r]);
  }
}

void measure_host(const Folder& folder, const Cameras& cameras, double seconds, ByReading& figures) {
  const std::string name = "bytes-live";
  cameras.write_host(folder / "capture.yaml", name);
  cameras.write_tracker(folder / "run.yaml", name);
  for (std::size_t r = 0; r < readings.size(); ++r) {
    const auto host = folder.service("capture", readings[r]);
    const auto tracker = folder.service("run", readings[r]);
    measure(host, seconds, figures[r]);
  }
}

double p(const Figures& figures, double q) {
  return figures::quantile(figures.latency_ms, q);
}

void print(const ByReading& figures, bool has_latency) {
  for (std::size_t r = 0; r < readings.size(); ++r) {
    const Figures& f = figures[r];
    std::printf("  %-10s CPU %5.1f %% of a core", readings[r].name, f.cpu_percent());
    if (has_latency) std::printf("; arrival to DDS write p50 %6.2f, p99 %6.2f ms", p(f, 0.5), p(f, 0.99));
    std::printf("; %zu samples, %.0f %% tracking\n", f.latency_ms.size(), 100 * f.share_tracking());
  }
}

// As `huetrackd run` and `huetrackd capture`.
void serve(const soak::Arguments& line) {
  const std::string name = line.text("reading");
  const auto* const reading = std::ranges::find(readings, name, &Reading::name);
  if (reading == readings.end()) line.end("--reading " + name);
  capture::JpegReader::set_reading(reading->reading);
  daemon::set_up_log();
  soak::until_ended([&](const std::stop_token& stop) {
    if (line.has("capture")) return daemon::capture_cameras(line.text("capture"), stop);
    daemon::LiveRequests requests;
    daemon::run(line.text("run"), {}, requests, stop);
  });
}

// False: one of the services did not track.
bool run(double seconds, std::uint64_t rounds) {
  const Folder folder;
  const Cameras four(4, 1920, 1080), two(2, 1280, 720);
  ByReading tracker, host;
  for (std::uint64_t round = 0; round < rounds; ++round) {
    measure_tracker(folder, four, seconds, tracker);
    measure_host(folder, two, seconds, host);
  }
  std::puts("tracker, four cameras of 1920x1080 at 30 fps:");
  print(tracker, true);
  std::printf("  on demand / whole: CPU %.2f; p50 %.2f, p99 %.2f (aim 0.40)\n", tracker[1].cpu_s / tracker[0].cpu_s,
              p(tracker[1], 0.5) / p(tracker[0], 0.5), p(tracker[1], 0.99) / p(tracker[0], 0.99));
  std::puts("host, `send: matches`, two cameras of 1280x720 at 30 fps:");
  print(host, false);
  std::printf("  on demand / whole: CPU %.2f (aim 0.50)\n", host[1].cpu_s / host[0].cpu_s);
  constexpr double least_tracking = 0.9;  // below it the figures are of a search
  const auto tracks = [](const Figures& f) { return f.share_tracking() >= least_tracking; };
  return std::ranges::all_of(tracker, tracks) && std::ranges::all_of(host, tracks);
}

}  // namespace

int main(int argc, char** argv) {
  const soak::Arguments line(argc, argv, {"seconds", "rounds", "run", "capture", "reading"}, 0,
                             "bytes_live [--seconds S] [--rounds N]");
  try {
    if (line.has("run") || line.has("capture")) return serve(line), 0;
    if (run(line.number("seconds", 6), line.count("rounds", 2))) return 0;
    std::fputs("bytes_live: a service did not track the ball; is the machine busy?\n", stderr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bytes_live: %s\n", error.what());
  }
  return 1;
}
