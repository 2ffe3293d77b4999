// FFmpeg's decoded pictures as ours, in their own format where we have it. For this module and recordings.
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
  // nullopt: it is damaged, or FFmpeg cannot convert it. What says that it is coded by another matrix than BT.601 comes
  // as BGR, what lies in memory as none of ours does as the nearest of them.
  std::optional<Image> image_of(FramePtr frame, AVCodecID codec);

 private:
  ScalerPtr scaler_;
};

}  // namespace huetrack::capture
