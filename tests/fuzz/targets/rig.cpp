#include <stdexcept>

#include "calib/files/config_error.h"
#include "calib/model/rig_yaml.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(rig) {
  std::string text;
  try {
    text = calib::to_yaml(calib::read_rig(fuzz::file_with("rig.yaml", input)));
  } catch (const files::ConfigError&) {
    return;
  }
  // What was accepted must be written so that it reads back as the same: an error here is a finding.
  if (calib::to_yaml(calib::read_rig(fuzz::file_with("again.yaml", text))) != text)
    throw std::logic_error("the rig does not read back");
}
