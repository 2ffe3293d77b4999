// Reads one camera's pictures from a file of JPEGs one after the other: motion JPEG without a container, or what a
// camera sent over HTTP, with or without its boundaries and headers. Such a file has no times. Private to this module.
#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/jpeg_splitter.h"
#include "recordings/picture_decoder.h"
#include "recordings/picture_stream.h"
#include "recordings/recording.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {

// Text or nothing or the rest of a JPEG, a JPEG, and another one. (A single one is a picture; so are those of a phone
// with a second one inside, which say so in a segment MPF.) False if it cannot be read.
bool is_jpeg_stream(const std::filesystem::path& file);

// thread-compatible.
class JpegStream final : public PictureStream {
 public:
  // camera and warnings must outlive it; the file must be is_jpeg_stream(). keeps_encoded: see ReplayOptions
  JpegStream(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded);

  std::optional<Shown> next() override;
  std::int64_t position() const override { return index_; }
  bool is_turned() const override { return decoder_.turns(); }

 private:
  const RecordedCamera& camera_;
  FrameSelection selection_;
  std::vector<std::string>& warnings_;
  bool keeps_encoded_;
  std::ifstream in_;
  bool begins_inside_ = false;  // a picture, which is not shown yet
  capture::JpegSplitter splitter_;
  PictureDecoder decoder_;
  std::int64_t index_ = 0;
  bool has_warned_ = false;
};

}  // namespace huetrack::recordings
