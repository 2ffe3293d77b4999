// recording.yaml, and behind the line "%%" the time stamps times.csv beside it.
#include "recordings/recording.h"

#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(recording) {
  const auto end = std::min(input.find("\n%%\n"), input.size());
  fuzz::file_with("times.csv", input.substr(std::min(end + 4, input.size())));
  try {
    recordings::read_recording(fuzz::file_with("recording.yaml", input.substr(0, end)));
  } catch (const files::ConfigError&) {
  }
}
