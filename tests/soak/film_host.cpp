// What `huetrackd capture` does, on films instead of V4L2 cameras: for the tests of cameras of other hosts.
//   film_host [OPTIONS] FILMS CONFIG
//     FILMS: a folder with CAMERA.yuyv; CONFIG: a camera host's configuration, with the films' sizes
//     --dequeued FILE     when each frame was there: a CSV of camera, stamp_ns, at_ns
//     --spread N          N cameras free-run: camera K of them exposes K / N of a period after the first
//     --ready-made A,B    which pixels have a hue from A to B is found out once for each frame of the film, and sent
//                         again in every round, with a picture once a second: so that many cameras leave a machine to
//                         the tracker
//     --clock START,PPM   this process is shown a monotonic clock that runs fast since START (wrong_clock.c)
//   film_host --receive FILE FILMS CONFIG
//     takes the cameras of a tracker's configuration, as a tracker does, and does no more: when each frame was there,
//     as
//     --dequeued; at the end it prints how long a JPEG takes to decode
//   film_host --make N FILMS
//     makes such a folder, of N cameras of 640x480 that see one moment, with its rig.yaml
// All film hosts of one machine play the same moments: a film's frame 0 is when the machine's clock was 0.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "color/match_tiles.h"
#include "daemon/capture_command.h"
#include "daemon/service_manager.h"
#include "hosts/match_finder.h"
#include "soak/arguments.h"
#include "soak/film_camera.h"
#include "soak/films.h"
#include "soak/until_ended.h"

namespace {

using namespace huetrack;

constexpr int films_loop = 60;                     // frames, as films.h makes them
constexpr std::uint32_t decoded_again_every = 20;  // often enough for a median

// thread-safe. What was written is in the file within a second, also of a process that is killed.
class Times {
 public:
  explicit Times(const std::string& file) : file_(std::fopen(file.c_str(), "w")) {
    if (file_ == nullptr) throw std::runtime_error(file + ": cannot be written");
    std::fputs("camera,stamp_ns,at_ns\n", file_);
  }
  ~Times() { std::fclose(file_); }
  Times(const Times&) = delete;
  Times& operator=(const Times&) = delete;
  void add(const std::string& camera, const capture::Frame& frame) {
    const capture::Timestamp now = capture::unix_now();
    const std::scoped_lock lock(mutex_);
    std::fprintf(file_, "%s,%lld,%lld\n", camera.c_str(),
                 static_cast<long long>(frame.stamped_at.time_since_epoch().count()),
                 static_cast<long long>(now.time_since_epoch().count()));
    if (now < flushed_at_ + std::chrono::milliseconds(500)) return;
    flushed_at_ = now;
    std::fflush(file_);
  }

 private:
  std::mutex mutex_;
  std::FILE* file_;
  capture::Timestamp flushed_at_{};  // guarded by mutex_
};

class TimedSource final : public capture::FrameSource {
 public:
  TimedSource(std::unique_ptr<capture::FrameSource> source, std::string camera, Times& times)
      : source_(std::move(source)), camera_(std::move(camera)), times_(times) {}
  std::optional<capture::Frame> next(std::stop_token stop) override {
    auto frame = source_->next(std::move(stop));
    if (frame) times_.add(camera_, *frame);
    return frame;
  }

 private:
  std::unique_ptr<capture::FrameSource> source_;
  std::string camera_;
  Times& times_;
};

class ReadyMadeSource final : public capture::FrameSource {
 public:
  ReadyMadeSource(std::unique_ptr<capture::FrameSource> source, const color::HsiRange& color)
      : source_(std::move(source)) {
    look_for_.colors.push_back(color::matched_color(color));
  }
  std::optional<capture::Frame> next(std::stop_token stop) override {
    auto frame = source_->next(std::move(stop));
    if (!frame || !frame->encoded) return frame;
    const bool has_picture = frame->sequence % 30 == 0;
    Bytes& ready = ready_[{frame->encoded.get(), has_picture}];
    if (!ready) {
      frame->stamped_at += has_picture ? std::chrono::hours(pictures_++) : std::chrono::hours(0);
      look_for_.picture_every = has_picture ? std::chrono::seconds(1) : std::chrono::seconds(0);
      const auto bytes = finder_.find(*frame, look_for_);
      if (!bytes) throw std::runtime_error("the film does not decode");
      ready = std::make_shared<const std::vector<std::uint8_t>>(bytes->begin(), bytes->end());
      frame->stamped_at = frame->captured_at;
    }
    frame->encoded = ready;
    frame->matches = none_;
    return frame;
  }

 private:
  using Bytes = std::shared_ptr<const std::vector<std::uint8_t>>;
  std::unique_ptr<capture::FrameSource> source_;
  hosts::MatchFinder finder_;
  hosts::MatchFinderOptions look_for_;
  int pictures_ = 0;
  std::map<std::pair<const void*, bool>, Bytes> ready_;  // by the JPEG, which a film keeps
  const std::shared_ptr<const capture::Matches> none_ = std::make_shared<const capture::Matches>();
};

struct WrongClock {
  double start_s = 0, ppm = 0;
};

std::vector<capture::LiveCamera> films_of(const config::CaptureConfig& config, const std::filesystem::path& films,
                                          const WrongClock& clock, int spread,
                                          const std::optional<color::HsiRange>& ready_made, Times* times) {
  std::vector<capture::LiveCamera> cameras;
  for (const auto& camera : config.cameras) {
    soak::FilmCameraOptions film;
    film.camera = int(cameras.size());
    film.film = films / (camera.name + ".yuyv");
    film.width = camera.size->width;
    film.height = camera.size->height;
    film.fps = camera.fps.value_or(30);
    if (clock.ppm != 0) {
      // Frames are there when they are by the machine's own clock, whatever clock this process is shown: from a moment
      // on, shortly before START, at which the film begins anew.
      const double loop_s = films_loop * capture::seconds(capture::duration_of(1 / film.fps));
      const double began_s = loop_s * std::floor(clock.start_s / loop_s);
      const double fast = 1e-6 * clock.ppm;
      film.start += std::chrono::duration_cast<std::chrono::steady_clock::duration>(
          std::chrono::duration<double>(began_s + fast * (began_s - clock.start_s)));
      film.fps /= 1 + fast;
    }
    if (spread > 0)  // cam7 is the eighth
      film.phase = capture::duration_of(std::stod(camera.name.substr(camera.name.find_first_of("0123456789"))) /
                                        (spread * film.fps));
    film.is_mjpeg = camera.format == capture::CaptureFormat::mjpeg;
    film.decodes = false;
    cameras.push_back(soak::FilmCamera(std::move(film)).live());
    if (ready_made)
      cameras.back().source = std::make_unique<ReadyMadeSource>(std::move(cameras.back().source), *ready_made);
    if (times != nullptr)
      cameras.back().source = std::make_unique<TimedSource>(std::move(cameras.back().source), camera.name, *times);
  }
  return cameras;
}

void receive(const config::ServiceConfig& config, Times& times, const std::stop_token& stop) {
  std::vector<capture::LiveCamera> cameras = pipeline::open_cameras(config, stop);
  std::mutex mutex;
  std::vector<double> decoding_ms;  // guarded by mutex while there are threads
  {
    std::vector<std::jthread> reading;
    for (auto& camera : cameras)
      reading.emplace_back([&, stop] {
        const std::string& name = config.rig.cameras[std::size_t(camera.camera)].name;
        capture::JpegDecoder decoder;
        while (const auto frame = camera.source->next(stop)) {
          times.add(name, *frame);
          if (!frame->encoded || frame->sequence % decoded_again_every != 0) continue;
          const auto before = std::chrono::steady_clock::now();
          decoder.decode(*frame->encoded);
          const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - before;
          const std::scoped_lock lock(mutex);
          decoding_ms.push_back(took.count());
        }
      });
  }
  std::ranges::sort(decoding_ms);
  if (!decoding_ms.empty()) std::printf("{\"decoding_ms\": %.3f}\n", decoding_ms[decoding_ms.size() / 2]);
}

}  // namespace

int main(int argc, char** argv) {
  daemon::set_up_log();
  const soak::Arguments line(argc, argv, {"make", "spread", "ready-made", "dequeued", "receive", "clock"}, 1,
                             "film_host [OPTIONS] FILMS CONFIG");
  const int made = static_cast<int>(line.count("make", 0)), spread = static_cast<int>(line.count("spread", 0));
  const std::string dequeued = line.text("dequeued"), received = line.text("receive");
  const std::filesystem::path films = line.word(0), config_file = line.word(1);
  double start_s = 0, ppm = 0;
  std::optional<color::HsiRange> ready_made;
  if (line.has("ready-made")) {
    color::HsiRange& color = ready_made.emplace();
    if (std::sscanf(line.text("ready-made").c_str(), "%lf,%lf", &color.hue_min_deg, &color.hue_max_deg) != 2)
      line.end("--ready-made");
  }
  if (line.has("clock") && std::sscanf(line.text("clock").c_str(), "%lf,%lf", &start_s, &ppm) != 2) line.end("--clock");
  try {
    if (made > 0) {
      soak::make_films(films, made, 640, 480, false);
      return 0;
    }
    if (!received.empty()) {
      Times times(received);
      soak::until_ended(
          [&](const std::stop_token& stop) { receive(config::load_service_config(config_file), times, stop); });
      return 0;
    }
    const config::CaptureConfig config = config::load_capture_config(config_file);
    const auto times = dequeued.empty() ? nullptr : std::make_unique<Times>(dequeued);
    auto cameras = films_of(config, films, {.start_s = start_s, .ppm = ppm}, spread, ready_made, times.get());
    soak::until_ended([&](const std::stop_token& stop) { daemon::capture_cameras(config, std::move(cameras), stop); });
  } catch (const std::exception& error) {
    std::fprintf(stderr, "film_host: %s\n", error.what());
    return 1;
  }
  return 0;
}
