#include "calib/model/rig_yaml.h"
#include "calib/yaml/yaml_reader.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(rig) {
  try {
    const calib::CameraRig rig = calib::read_rig(fuzz::file_with("rig.yaml", input));
    // What was accepted must be written so that it reads back as the same.
    if (calib::to_yaml(calib::read_rig(fuzz::file_with("again.yaml", calib::to_yaml(rig)))) != calib::to_yaml(rig))
      throw std::logic_error("the rig does not read back");
  } catch (const yaml::ConfigError&) {
  }
}
