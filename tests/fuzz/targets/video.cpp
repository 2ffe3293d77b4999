// A film of a recording: what FFmpeg makes of it, through our reader.
#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(video) {
  recordings::Recording recording;
  recording.file = fuzz::folder() / "recording.yaml";
  recordings::RecordedCamera camera;
  camera.name = "cam0";
  camera.frames = fuzz::file_with("film", input);
  camera.fps = 30;
  recording.cameras.push_back(camera);
  const std::string names[] = {"cam0"};
  try {
    recordings::ReplaySource source(recording, names, {.decoder_threads = 1});
    for (int i = 0; i < 20 && source.next({}); ++i) {
    }
  } catch (const files::ConfigError&) {
  }
}
