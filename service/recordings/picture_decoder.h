// Decodes pictures that are whole by themselves: JPEG, PNG, WebP, TIFF. Private to this module.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "capture/ffmpeg/ffmpeg_log.h"
#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/ffmpeg/ffmpeg_picture.h"
#include "capture/ffmpeg/stream_decoder.h"
#include "capture/jpeg/jpeg_reader.h"

namespace huetrack::recordings {

// By the first bytes.
bool is_jpeg(std::span<const std::uint8_t> bytes);

// By OpenCV, as calibrations read it: FFmpeg's decoder shows JPEG in TIFF as black. nullopt: damaged, or of no kind
// that it knows. Turned as its tags say.
std::optional<capture::Image> tiff_of(std::span<const std::uint8_t> bytes, capture::PictureMaker& pictures);

// thread-compatible.
class PictureDecoder {
 public:
  PictureDecoder();
  // JPEG with the live cameras' reader, for the same pixels. Turned as its tags say. nullopt: damaged, or of no
  // known kind: see take_problem()
  std::optional<capture::Image> decode(std::shared_ptr<const std::vector<std::uint8_t>> bytes);
  // FFmpeg's picture as an Image. nullopt: it cannot be converted
  std::optional<capture::Image> image_of(capture::FramePtr frame) {
    return pictures_.image_of(std::move(frame), AV_CODEC_ID_RAWVIDEO);
  }
  bool turns() const { return pictures_.turns(); }                          // as the tags so far say
  std::vector<std::string> take_notes() { return pictures_.take_notes(); }  // what a user must know of the pictures
  capture::SampleDepth& depth() { return pictures_.depth(); }
  const capture::SampleDepth& depth() const { return pictures_.depth(); }
  std::string take_problem() { return std::exchange(problem_, {}) + log_.take(); }  // why the last picture has no image

 private:
  std::optional<capture::Image> decode_by_ffmpeg(std::span<const std::uint8_t> bytes, AVCodecID id);

  capture::FfmpegLog log_;
  capture::JpegReader jpeg_;
  std::map<AVCodecID, capture::StreamDecoder> codecs_;
  capture::PictureMaker pictures_;
  std::string problem_;
};

}  // namespace huetrack::recordings
