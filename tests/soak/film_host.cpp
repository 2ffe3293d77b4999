// What `huetrackd capture` does, on films instead of V4L2 cameras: for the tests of cameras of other hosts.
//   film_host FILMS CONFIG      a folder with CAMERA.yuyv; a camera host's configuration, with the films' sizes
//   film_host --make N FILMS    makes such a folder, of N cameras of 640x480 that see one moment, with its rig.yaml
// All film hosts of one machine play the same moments: a film's frame 0 is when the machine's clock was 0.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <thread>

#include "daemon/capture_command.h"
#include "daemon/service_manager.h"
#include "soak/film_camera.h"
#include "soak/films.h"

namespace {

std::atomic<bool> is_ended = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void on_signal(int) {
  is_ended = true;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace huetrack;
  daemon::set_up_log();
  CLI::App app("huetrackd capture, on films");
  std::filesystem::path config_file, films;
  int made = 0;
  app.add_option("--make", made);
  app.add_option("films", films)->required();
  app.add_option("config", config_file);
  CLI11_PARSE(app, argc, argv);
  for (const int signal : {SIGTERM, SIGINT}) std::signal(signal, on_signal);
  try {
    if (made > 0) {
      soak::make_films(films, made, 640, 480, false);
      return 0;
    }
    const config::CaptureConfig config = config::load_capture_config(config_file);
    std::vector<capture::LiveCamera> cameras;
    for (const auto& camera : config.cameras) {
      soak::FilmCameraOptions film;
      film.camera = int(cameras.size());
      film.film = films / (camera.name + ".yuyv");
      film.width = camera.size->width;
      film.height = camera.size->height;
      film.fps = camera.fps.value_or(30);
      film.is_mjpeg = camera.format == capture::CaptureFormat::mjpeg;
      cameras.push_back(soak::FilmCamera(std::move(film)).live());
    }
    std::stop_source stop;
    const std::jthread ending([&](const std::stop_token& done) {
      while (!is_ended && !done.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      stop.request_stop();
    });
    daemon::capture_cameras(config, std::move(cameras), stop.get_token());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "film_host: %s\n", error.what());
    return 1;
  }
  return 0;
}
