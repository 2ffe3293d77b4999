#include "page/recording_picture.h"

#include <array>
#include <stdexcept>

#include "capture/frames/jpeg_encoder.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::page {
namespace {

constexpr int list_picture_width = 160;  // twice that of the page's list, for dense screens
constexpr int list_picture_quality = 75;
constexpr int most_frames = 30;  // about a second: a camera that has no picture by then has none worth waiting for

}  // namespace

std::vector<std::uint8_t> recording_picture(const std::filesystem::path& folder) {
  const recordings::Recording recording = recordings::read_recording(folder);
  for (const recordings::RecordedCamera& camera : recording.cameras) {
    if (camera.is_listed && camera.timestamps.empty()) continue;  // it delivered nothing
    const std::array<std::string, 1> name{camera.name};
    recordings::ReplaySource source(recording, name, {.takes_matches = true});
    for (int i = 0; i < most_frames; ++i) {
      auto frame = source.next({});
      if (!frame) break;
      if (frame->status != capture::FrameStatus::ok || !capture::take_picture(*frame, capture::picture_of(*frame)))
        continue;
      return capture::encode_picture(frame->pixels, capture::picture_size(frame->pixels, list_picture_width),
                                     list_picture_quality);
    }
  }
  throw std::runtime_error("this recording has no picture");
}

}  // namespace huetrack::page
