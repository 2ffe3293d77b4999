// JPEG to planar YUV. Live MJPEG and recorded JPEG share this decoder, so that a replay has exactly the live pixels.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

struct JpegResult {
  std::optional<Image> image;   // i420, i422, i444 or grey; full range, unless the JPEG says otherwise (CS=ITU601)
  bool is_unsupported = false;  // a kind of JPEG that Image cannot hold: 4:1:1, CMYK, odd sizes, ...
  std::string problem;          // why there is no image, in libjpeg's words
};

// thread-compatible. The same bytes give the same pixels on every machine.
class JpegDecoder {
 public:
  JpegDecoder();
  ~JpegDecoder();
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  // Any missing or invalid data makes it fail; the few bytes of padding that many webcams leave before a marker do not.
  // Motion JPEG without Huffman tables gets the standard ones. Does not throw.
  // width, height: an image of another size is refused by its header, before any allocation; 0: any.
  JpegResult decode(std::span<const std::uint8_t> jpeg, int width = 0, int height = 0);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::capture
