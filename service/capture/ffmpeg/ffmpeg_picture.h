// Converts FFmpeg's decoded pictures to Image, in their own pixel format where Image has it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/frames/picture_layout.h"
#include "capture/frames/picture_tags.h"
#include "capture/frames/pixel_format.h"
#include "capture/frames/sample_depth.h"

struct SwsContext;

namespace huetrack::capture {

struct FreeScaler {
  void operator()(SwsContext* p) const;
};
using ScalerPtr = std::unique_ptr<SwsContext, FreeScaler>;

AVPixelFormat av_format_of(PixelFormat format);

// thread-compatible.
class PictureMaker {
 public:
  // nullopt: damaged, or FFmpeg cannot convert it. A picture coded with another matrix than BT.601 gets that one; one
  // in another pixel format becomes the nearest of ours.
  // Turned as the tags say; of an interlaced one the first field, in full size.
  std::optional<Image> image_of(FramePtr frame, AVCodecID codec);

  void set_stream(const AVStream& stream);  // its tags
  // Pictures tagged as interlaced stay whole, unless they are turned. are_stated: the tag needs no note.
  void keep_fields(bool are_stated) { keeps_fields_ = true, fields_are_stated_ = are_stated; }
  SampleDepth& depth() { return depth_; }
  const SampleDepth& depth() const { return depth_; }
  // Of the last picture, if it is tagged as interlaced and stayed whole.
  std::optional<FirstField> tagged_field() const { return tagged_field_; }
  // Of the next picture, where it is a file by itself: its own orientation counts before the stream's.
  void tag(const PictureTags& tags);
  // For pictures that FFmpeg did not decode: turned as the tags say.
  Image upright(const Image& image) const { return turned(image, layout_.orientation); }

  bool turns() const { return !layout_.orientation.is_upright(); }  // as the tags so far say

  // What a user must know (notes_on()) of the pictures since set_stream(), each sentence once.
  std::vector<std::string> take_notes();

 private:
  ScalerPtr scaler_;
  PictureLayout layout_;         // of the last picture; is_interlaced: of any
  PictureLayout stream_layout_;  // where a picture says nothing
  bool keeps_fields_ = false, fields_are_stated_ = false;
  SampleDepth depth_;
  std::optional<FirstField> tagged_field_;
  std::vector<std::string> taken_notes_;
};

}  // namespace huetrack::capture
