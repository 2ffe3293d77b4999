#include "recordings/growing_recording.h"

#include <chrono>
#include <thread>
#include <utility>

#include "calib/files/config_error.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {
namespace {

constexpr auto poll_every = std::chrono::milliseconds(50);  // for the file

}  // namespace

struct GrowingCamera::Impl {
  Impl(RecordedCamera of, int number) : recorded(std::move(of)), camera(number) {
    recorded.timestamps.clear();  // incomplete
    recorded.received.clear();
    recorded.corrupted.clear();
    recorded.is_listed = false;
  }
  // False: not opened before the stop. The header comes with the first frames.
  bool open(const std::stop_token& stop) {
    std::error_code none;
    while (!stop.stop_requested()) {
      if (std::filesystem::exists(recorded.frames, none) && std::filesystem::file_size(recorded.frames, none) > 0) {
        try {
          reader = std::make_unique<VideoReader>(recorded, 1, warnings, stop);
          return true;
        } catch (const files::ConfigError&) {  // the header is incomplete
        }
      }
      std::this_thread::sleep_for(poll_every);
    }
    return false;
  }

  RecordedCamera recorded;
  const int camera;
  std::vector<std::string> warnings;  // unused: the complete recording is read again
  std::unique_ptr<VideoReader> reader;
};

GrowingCamera::GrowingCamera(RecordedCamera of, int camera) : impl_(std::make_unique<Impl>(std::move(of), camera)) {}
GrowingCamera::~GrowingCamera() = default;

std::optional<capture::Frame> GrowingCamera::next(std::stop_token stop) {
  if (!impl_->reader && !impl_->open(stop)) return std::nullopt;
  while (!stop.stop_requested()) {
    auto picture = impl_->reader->next();
    if (!picture) return std::nullopt;
    if (!picture->stamp || picture->image.width == 0) continue;  // it does not decode
    capture::Frame frame;
    frame.camera = impl_->camera;
    frame.sequence = static_cast<std::uint32_t>(picture->index);
    frame.captured_at = frame.stamped_at = *picture->stamp;
    frame.pixels = std::move(picture->image);
    return frame;
  }
  return std::nullopt;
}

}  // namespace huetrack::recordings
