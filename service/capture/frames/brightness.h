// The component of an image that is its brightness, or what is nearest to it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

struct Brightness {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;  // bytes
  int step = 1;               // bytes from one pixel to the next
};

inline Brightness brightness_of(const Image& image) {
  const Plane& plane = image.planes[0];
  switch (image.format) {
    case PixelFormat::bgr:
      return {plane.data + 1, plane.stride, 3};
    case PixelFormat::yuyv:
      return {plane.data, plane.stride, 2};
    default:
      return {plane.data, plane.stride, 1};
  }
}

}  // namespace huetrack::capture
