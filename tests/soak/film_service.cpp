// What `huetrackd run` does, on films instead of V4L2 cameras: for figures, for the soak, and for tests that kill it.
//   film_service CONFIG FILMS [--faults SEED] [--phases spread|together] [--tracks FILE] [--make CAMERAS |
//   --make-boards PLACES | --make-waves THROWS]
// FILMS: a folder with CAMERA.yuyv for every camera of the configuration, in the rig's size; each plays at the camera's
// fps (default 30). --make: they are made first, of so many cameras, with their rig.yaml (films.h). Signals as
// huetrackd.
// --make-boards: made are films of two new cameras (board_films.h), which see a board as long as they are not
// calibrated; and where CONFIG is not there, it is made: these cameras, and that everything may be asked, on --domain.
// --make-waves: the same with three new cameras (wave_films.h), which always see a ball: it is waved,
// and thrown so often.
#include <csignal>
#include <cstdio>
#include <fstream>

#include "daemon/live.h"
#include "daemon/service_manager.h"
#include "soak/arguments.h"
#include "soak/board_films.h"
#include "soak/film_camera.h"
#include "soak/films.h"
#include "soak/until_ended.h"
#include "soak/wave_films.h"

namespace {

huetrack::daemon::LiveRequests requests;

// Nothing but which cameras there are, and what the page may do.
void write_first_config(const std::filesystem::path& file, int cameras, int fps, int domain) {
  std::ofstream out(file);
  out << "version: 1\nrig: none\ncameras:\n";
  for (int c = 0; c < cameras; ++c)
    out << "  cam" << c << ": {device: " << c << ", size: [320, 240], fps: " << fps << "}\n";
  out << "record: {folder: recordings, pre_roll_s: 20}\n"
         "control: {allow_teach: true, allow_record: true}\n"
         "dds: {domain: "
      << domain << ", interfaces: [lo]}\n";
}

void on_signal(int signal) {
  if (signal == SIGHUP) requests.reload = true;
  if (signal == SIGUSR1) requests.save = true;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace huetrack;
  daemon::set_up_log();
  const soak::Arguments line(argc, argv, {"faults", "phases", "tracks", "make", "make-boards", "make-waves", "domain"},
                             2, "film_service CONFIG FILMS [OPTIONS]");
  const std::filesystem::path config_file = line.word(0), films = line.word(1);
  const std::optional<std::uint64_t> faults =
      line.has("faults") ? std::optional(line.count("faults", 0)) : std::nullopt;
  const std::string phases = line.text("phases", "spread");
  if (phases != "spread" && phases != "together") line.end("--phases");
  daemon::LiveCommand options;
  options.tracks = line.text("tracks");
  const int cameras_to_make = static_cast<int>(line.count("make", 0));
  const int board_places = static_cast<int>(line.count("make-boards", 0));
  const int throws = static_cast<int>(line.count("make-waves", 0));
  const int domain = static_cast<int>(line.count("domain", 0));
  for (const int signal : {SIGHUP, SIGUSR1}) std::signal(signal, on_signal);
  try {
    if (cameras_to_make > 0) soak::make_films(films, cameras_to_make, 320, 240, phases == "spread");
    if (board_places > 0) soak::make_board_films(films, board_places);
    if (throws > 0) soak::make_wave_films(films, throws);
    if (!std::filesystem::exists(config_file) && board_places > 0)
      write_first_config(config_file, 2, soak::board_fps, domain);
    if (!std::filesystem::exists(config_file) && throws > 0) write_first_config(config_file, 3, soak::wave_fps, domain);
    const config::ServiceConfig config = config::load_service_config(config_file);
    const auto play = [&](const config::ServiceConfig& now, const std::stop_token&) {
      const auto start = std::chrono::steady_clock::now();
      std::vector<pipeline::LiveCamera> cameras;
      for (const auto& camera : now.cameras) {
        soak::FilmCameraOptions film;
        film.camera = now.rig.index_of(camera.name).value();
        film.film = films / (camera.name + (board_places > 0 && !now.is_calibrated() ? ".board.yuyv" : ".yuyv"));
        film.width = now.rig.cameras[std::size_t(film.camera)].image_size.width;
        film.height = now.rig.cameras[std::size_t(film.camera)].image_size.height;
        film.fps = camera.fps.value_or(30);
        film.start = start;
        if (phases == "spread")
          film.phase = capture::duration_of(double(cameras.size()) / double(now.cameras.size()) / film.fps);
        film.faults = faults;
        cameras.push_back(soak::FilmCamera(std::move(film)).live());
      }
      return cameras;
    };
    const daemon::LiveSummary summary = soak::until_ended([&](const std::stop_token& stop) {
      return daemon::run_live_while_asked(config, play, options, requests, stop);
    });
    std::printf("%llu sets tracked, %llu dropped\n", static_cast<unsigned long long>(summary.figures.sets_tracked),
                static_cast<unsigned long long>(summary.figures.sets_dropped));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "film_service: %s\n", error.what());
    return 1;
  }
  return 0;
}
