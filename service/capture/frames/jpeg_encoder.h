// Small JPEG pictures of an image, for people to look at: the image is sampled down where it lies, in its own pixel
// format, and no pixel is converted but those of the picture.
#pragma once

#include <cstdint>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

struct PictureSize {
  int width = 0;  // pixels
  int height = 0;
};
// The image's, scaled to at most `width` (>= 16), never up; both even.
PictureSize picture_size(const Image& image, int width);

// Pixel (x, y) of the picture is the mean of four pixels of the box of the image that it stands for (of one where the
// picture is nearly as large as the image): the picture's pixel (x, y) has its centre at ((x + 0.5) * image.width /
// width - 0.5, ...) of the image. quality: 1..100. Does not throw but std::bad_alloc; empty when libjpeg refuses. Pure;
// safe from any thread.
std::vector<std::uint8_t> encode_picture(const Image& image, PictureSize size, int quality);

}  // namespace huetrack::capture
