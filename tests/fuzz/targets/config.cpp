// huetrackd.yaml beside a rig; behind the line "%%" what was taught, and behind another one rows.csv, which the
// configuration may name as what a tracked camera starts from.
#include "config/service_config.h"

#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

namespace {

// Up to the line "%%", which goes with it. nullopt: nothing is left of the input.
std::optional<std::string> next_part(std::optional<std::string_view>& input) {
  constexpr std::string_view line = "\n%%\n";
  if (!input) return std::nullopt;
  const std::size_t end = input->find(line);
  const std::string part(input->substr(0, end));
  input = end == std::string_view::npos ? std::nullopt : std::optional(input->substr(end + line.size()));
  return part;
}

// Where our own configurations look for their rig.
bool copy_rigs() {
  const std::filesystem::path rig = HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml";
  for (const char* folder : {".", "recording", "demo/recording"}) {
    std::filesystem::create_directories(fuzz::folder() / folder);
    std::filesystem::copy_file(rig, fuzz::folder() / folder / "rig.yaml",
                               std::filesystem::copy_options::overwrite_existing);
  }
  return true;
}

}  // namespace

HUETRACK_FUZZ_TARGET(config) {
  static const bool has_rigs = copy_rigs();
  if (!has_rigs) return;
  std::optional<std::string_view> rest = input;
  const auto file = fuzz::file_with("huetrackd.yaml", next_part(rest).value());
  const auto taught = next_part(rest);
  fuzz::file_with("rows.csv", rest.value_or(""));
  try {
    const config::ServiceConfig config =
        taught ? config::load_service_config(file, *taught) : config::load_service_config(file);
    config::to_yaml(config);
    config::warnings_of(config);
    if (!config.camera_tracking.camera.empty()) config::tracker_options(config.camera_tracking);
  } catch (const files::ConfigError&) {
  }
}
