#include "benchmark/wave_recording.h"

#include <string>
#include <utility>

#include "calib/model/rig_yaml.h"
#include "calib/wave/background.h"
#include "config/service_config.h"
#include "recordings/replay_source.h"

namespace huetrack::figures {

WaveRecording wave_recording(const std::filesystem::path& folder) {
  const config::ServiceConfig config = config::load_service_config(folder / "huetrackd.yaml");
  WaveRecording r{config.rig,
                  calib::read_rig(folder / "rig_off.yaml"),
                  config.targets.front(),
                  {config.object_tracking.volume.min, config.object_tracking.volume.max},
                  {},
                  {},
                  {}};
  const std::vector<std::string> names = r.truth.camera_names();
  recordings::ReplaySource source(recordings::read_recording(folder), names);
  wave::BallFinder finder(r.start, r.target);
  wave::BackgroundSamples background(names.size());
  std::vector<std::size_t> next(names.size(), 0);
  while (const auto frame = source.next({})) {
    background.add(*frame);
    const std::size_t number = next[static_cast<std::size_t>(frame->camera)]++;
    auto found = finder.detect(*frame);
    if (!found) continue;
    r.frames.push_back(std::move(*found));
    r.stamp_s.push_back(capture::seconds(frame->stamped_at));
    r.number.push_back(number);
  }
  wave::refine_outlines(r.frames, background, r.start);
  return r;
}

}  // namespace huetrack::figures
