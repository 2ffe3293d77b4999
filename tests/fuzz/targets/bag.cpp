// A ROS bag: its messages, and what is read of them. The first byte says which container.
#include <array>

#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"
#include "recordings/bags/bag.h"
#include "recordings/bags/messages.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(bag) {
  constexpr std::array<const char*, 3> names{"a.mcap", "a.bag", "a.db3"};
  if (input.empty() || fuzz::is_long_to_decode(input)) return;
  const auto file = fuzz::file_with(names.at(static_cast<unsigned char>(input[0]) % names.size()), input.substr(1));
  constexpr int most = 20;  // messages of a topic, frames
  try {
    for (const auto& topic : bags::contents_of(file).topics) {
      bags::TopicReader reader(file, topic.name);
      for (int i = 0; i < most; ++i) {
        const auto message = reader.next();
        if (!message) break;
        bags::picture_of(*message);
        bags::lens_of(*message);
        bags::transforms_of(*message);
      }
    }
    const recordings::Recording recording = recordings::read_recording(file);
    std::vector<std::string> cameras;
    for (const auto& camera : recording.cameras) cameras.push_back(camera.name);
    recordings::ReplaySource source(recording, cameras, {.decoder_threads = 1});
    for (int i = 0; i < most && source.next({}); ++i) {
    }
  } catch (const files::ConfigError&) {
  }
}
