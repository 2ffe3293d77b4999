// What somebody measured in the room. The first byte chooses: points for the rig's world, or marked places.
#include "calib/files/config_error.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/measured_points.h"
#include "calib/solver/world_frame.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(measured) {
  if (input.empty()) return;
  static const calib::CameraRig rig = calib::read_rig(HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml");
  const auto file = fuzz::file_with("measured.yaml", input.substr(1));
  try {
    if (static_cast<unsigned char>(input.front()) % 2 == 0) {
      program::read_points(file, rig);
    } else {
      program::read_places(file);
    }
  } catch (const files::ConfigError&) {
  } catch (const solver::CalibrationError&) {
  }
}
