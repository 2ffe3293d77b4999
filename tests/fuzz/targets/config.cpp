// huetrackd.yaml beside a rig; behind the line "%%" what was taught.
#include "config/service_config.h"

#include "calib/yaml/yaml_reader.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(config) {
  static const bool has_rig =
      std::filesystem::copy_file(HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml", fuzz::folder() / "rig.yaml",
                                 std::filesystem::copy_options::overwrite_existing);
  const auto end = std::min(input.find("\n%%\n"), input.size());
  const auto file = fuzz::file_with("huetrackd.yaml", input.substr(0, end));
  try {
    if (!has_rig) return;
    const config::ServiceConfig config = end < input.size()
                                             ? config::load_service_config(file, std::string(input.substr(end + 4)))
                                             : config::load_service_config(file);
    config::to_yaml(config);
    config::warnings_of(config);
  } catch (const yaml::ConfigError&) {
  }
}
