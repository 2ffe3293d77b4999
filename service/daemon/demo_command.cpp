#include "daemon/demo_command.h"

#include <fmt/format.h>

#include <atomic>
#include <cstdio>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

#include "calib/files/temporary_folder.h"
#include "config/service_config.h"
#include "daemon/demo_cameras.h"
#include "daemon/page_process.h"
#include "page/control_handler.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;

constexpr const char* config_name = "huetrackd.yaml";
constexpr const char* recording_name = "recording";

void introduce(const DemoCommand& command, const fs::path& folder) {
  fmt::print(
      "The demo plays a recording of two cameras in the place of live ones, forwards and backwards, and tracks it.\n"
      "On the page, try: Teach, Targets, Record, Calibrate with the object; and in another terminal: huetrack watch\n"
      "Its files are in {}{}\n"
      "Ctrl-C ends it.\n",
      folder.string(),
      command.folder.empty() ? ", which is deleted at the end (huetrackd demo FOLDER keeps them)" : "");
  std::fflush(stdout);
}

}  // namespace

fs::path bundled_demo(const fs::path& program) {
  for (fs::path above = program.parent_path();; above = above.parent_path()) {
    for (const char* const place : {"share/huetrack/demo", "configs/demo"})
      if (std::error_code none; fs::exists(above / place / config_name, none)) return above / place;
    if (above == above.parent_path()) break;
  }
  throw std::runtime_error(
      "the demo's recording is not installed: neither share/huetrack/demo nor configs/demo is above " +
      program.string() + "; bash configs/install.sh installs it");
}

fs::path copy_demo(const fs::path& from, const fs::path& to) {
  const fs::path config = to / config_name;
  if (std::error_code none; fs::exists(config, none)) return config;
  std::error_code error;
  fs::create_directories(to, error);
  if (error) throw std::runtime_error("cannot write " + to.string() + ": " + error.message());
  fs::copy(from / recording_name, to / recording_name, fs::copy_options::recursive);
  fs::copy_file(from / config_name, config);
  std::ofstream out(config, std::ios::app);
  out << "# `huetrackd demo` plays the recording in the place of these cameras.\ncameras:\n";
  for (const std::string& name : config::load_service_config(from / config_name).rig.camera_names())
    out << fmt::format("  {}: {{device: {}{}}}\n", name, page::played_device, name);
  out.close();
  if (!out) throw std::runtime_error("cannot write " + config.string());
  return config;
}

void run_demo(const DemoCommand& command, LiveRequests& requests, const std::stop_token& stop) {
  std::error_code none;
  std::optional<files::TemporaryFolder> temporary;
  if (command.folder.empty()) temporary.emplace("huetrack-demo");
  const fs::path folder = temporary ? temporary->path() : fs::absolute(command.folder);
  const fs::path file = copy_demo(bundled_demo(fs::read_symlink("/proc/self/exe", none)), folder);
  config::ServiceConfig config = config::load_service_config(file);
  const auto film = std::make_shared<const DemoFilm>(recordings::read_recording(folder / recording_name),
                                                     config.rig.camera_names(), stop);
  introduce(command, folder);
  std::atomic<bool> page_ended = false;
  std::stop_source end;
  const std::stop_callback end_too(stop, [&end] { end.request_stop(); });
  const auto page = command.with_page ? start_page(command.port,
                                                   [&] {
                                                     page_ended = true;
                                                     end.request_stop();
                                                   })
                                      : nullptr;
  if (command.with_page && !page)
    throw std::runtime_error(
        "the page's program, huetrack, is neither next to huetrackd nor on the PATH: install it, or give --no-page");
  run_live_while_asked(
      std::move(config),
      [film](const config::ServiceConfig& of, const std::stop_token&) {
        return demo_cameras(film, of.rig.camera_names());
      },
      {}, requests, end.get_token());
  if (page_ended) throw std::runtime_error("the page has ended, and the demo with it; the page's reason is above");
}

}  // namespace huetrack::daemon
