// Small JPEG previews of an image. It is subsampled in its own pixel format; only the preview's pixels are converted.
#pragma once

#include <cstdint>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

struct PictureSize {
  int width = 0;  // pixels
  int height = 0;
};
// The image's size, scaled down to at most `width` (>= 16); both even.
PictureSize picture_size(const Image& image, int width);

// Each pixel of the picture is the mean of four pixels of the image's box that it covers (of one where the picture is
// nearly as large as the image). Its centre lies at ((x + 0.5) * image.width / width - 0.5, ...) of the image.
// quality: 1..100. Throws only std::bad_alloc; empty when libjpeg refuses. Pure; safe from any thread.
std::vector<std::uint8_t> encode_picture(const Image& image, PictureSize size, int quality);

}  // namespace huetrack::capture
