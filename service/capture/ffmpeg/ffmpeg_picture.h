// Converts FFmpeg's decoded pictures to Image, in their own pixel format where Image has it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/frames/picture_layout.h"
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
  // Turned as its tag or the stream's says; of an interlaced one the first field, in full size.
  std::optional<Image> image_of(FramePtr frame, AVCodecID codec);

  void set_stream(const AVStream& stream);      // its tags
  void keep_fields() { keeps_fields_ = true; }  // pictures tagged as interlaced stay whole
  // For pictures that FFmpeg did not decode: turned as their own tag (nullopt: none) or the stream's says.
  Image upright(const Image& image, std::optional<Orientation> own = {});

  bool turns() const { return !layout_.orientation.is_upright(); }  // as the tags so far say

  // What a user must know (notes_on()) of the pictures since set_stream(), each sentence once.
  std::vector<std::string> take_notes();

 private:
  ScalerPtr scaler_;
  PictureLayout layout_;
  bool keeps_fields_ = false;
  std::vector<std::string> taken_notes_;
};

}  // namespace huetrack::capture
