// A film of a recording: what FFmpeg makes of it, through our reader.
#include "calib/yaml/yaml_reader.h"
#include "capture/recording.h"
#include "capture/replay_source.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(video) {
  capture::Recording recording;
  recording.file = fuzz::folder() / "recording.yaml";
  capture::RecordedCamera camera;
  camera.name = "cam0";
  camera.frames = fuzz::file_with("film", input);
  camera.fps = 30;
  recording.cameras.push_back(camera);
  const std::string names[] = {"cam0"};
  try {
    capture::ReplaySource source(recording, names, {.decoder_threads = 1});
    for (int i = 0; i < 20 && source.next({}); ++i) {
    }
  } catch (const yaml::ConfigError&) {
  }
}
