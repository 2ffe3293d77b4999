#include "page/recorded_moments.h"

#include "color_teaching/spread_moments.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::page {

std::vector<capture::FrameSet> recorded_moments(const config::ServiceConfig& config, std::span<const std::string> words,
                                                const std::stop_token& stop) {
  recordings::ReplaySource source(recordings::read_recording(words), config.rig.camera_names(),
                                  {.timing = config::frame_timing(config.rig), .takes_matches = true});
  color_teaching::SpreadMoments moments(config.rig.cameras.size());
  while (auto frame = source.next(stop))
    if (frame->status == capture::FrameStatus::ok && take_picture(*frame, own_picture_of(*frame))) moments.add(*frame);
  return moments.take();
}

}  // namespace huetrack::page
