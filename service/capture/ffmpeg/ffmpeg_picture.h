// Converts FFmpeg's decoded pictures to Image, in their own pixel format where Image has it.
#pragma once

#include <memory>
#include <optional>

#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/frames/pixel_format.h"

struct SwsContext;

namespace huetrack::capture {

struct FreeScaler {
  void operator()(SwsContext* p) const;
};
using ScalerPtr = std::unique_ptr<SwsContext, FreeScaler>;

// thread-compatible.
class PictureMaker {
 public:
  // nullopt: damaged, or FFmpeg cannot convert it. A picture coded with another matrix than BT.601 becomes BGR; one in
  // another pixel format becomes the nearest of ours.
  std::optional<Image> image_of(FramePtr frame, AVCodecID codec);

 private:
  ScalerPtr scaler_;
};

}  // namespace huetrack::capture
