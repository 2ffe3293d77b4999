// Memory layouts of the images that cameras and decoders deliver. Images are never converted as a whole: readers access
// single pixels in place.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

#include "capture/frames/pixels_on_demand.h"

namespace huetrack::capture {

enum class PixelFormat : std::uint8_t {
  yuyv,  // packed 4:2:2, Y0 U Y1 V
  nv12,  // planar Y, then interleaved U V at half width and half height
  i420,  // planar Y, U, V; chroma at half width and half height
  i422,  // planar Y, U, V; chroma at half width (what a 4:2:2 MJPEG decodes to)
  i444,  // planar Y, U, V at full size
  bgr,   // packed 8-bit B G R
  grey,  // Y only: no colour, so no coloured target matches
};

// Value range. YUYV/NV12 webcams: limited (Y 16..235, chroma 16..240). JPEG, and so MJPEG: full (0..255). Both with the
// BT.601 matrix, as UVC and JFIF specify. BGR is always full.
enum class ColorRange : std::uint8_t { limited, full };

std::string_view name(PixelFormat format);  // "yuyv", ...

struct Plane {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;  // bytes from one row to the next
};

// An image in the camera's own format, read-only. `owner` keeps the bytes alive (a decoder's frame, an mmap()ed buffer
// that returns to the driver when the last reader lets go, a plain vector); tracker, recorder and preview share it.
// Planes: yuyv, bgr, grey use planes[0]; nv12 planes[0..1]; i4xx planes[0..2] = Y, U, V.
// Readers of planes call require() or require_all() first: the bytes of a compressed image are undefined before.
struct Image {
  PixelFormat format = PixelFormat::grey;
  ColorRange range = ColorRange::limited;
  int width = 0;  // pixels; even for yuyv, nv12, i420, i422
  int height = 0;
  std::array<Plane, 3> planes{};
  std::shared_ptr<const void> owner;
  std::shared_ptr<const PixelsOnDemand> on_demand = {};  // nullptr: all pixels are there
};

// Makes columns u0 .. u1 - 1 of rows v0 .. v1 - 1 readable; clipped to the image. thread-safe.
inline void require(const Image& image, int u0, int v0, int u1, int v1) {
  if (image.on_demand) image.on_demand->require(u0, v0, u1, v1);
}
inline void require_all(const Image& image) {
  if (image.on_demand) image.on_demand->require_all();
}

// False: the image has only a format, range and size.
inline bool has_pixels(const Image& image) {
  return image.planes[0].data != nullptr;
}

struct Yuv {
  std::uint8_t y, u, v;
};
struct Bgr {
  std::uint8_t b, g, r;
};

// The raw pixel at column u, row v (both inside the image), decoded if it is not yet. For YUV formats; grey gives
// u = v = 128.
Yuv yuv_at(const Image& image, int u, int v);
// For bgr images.
Bgr bgr_at(const Image& image, int u, int v);

// A new image of zero bytes with tight rows (stride = row bytes), all planes in one allocation, and writable access to
// them: for decoders, tests and simulators. throws std::invalid_argument on an odd size where the format needs an even
// one.
struct WritableImage {
  Image image;
  std::array<std::uint8_t*, 3> data{};
};
WritableImage make_image(PixelFormat format, ColorRange range, int width, int height);

// Neighbouring columns or rows share chroma, so an odd size cannot be stored.
bool needs_even_width(PixelFormat format);
bool needs_even_height(PixelFormat format);

// Bytes per row, and rows, of a plane; 0 where the format does not have it.
std::size_t plane_row_bytes(PixelFormat format, int plane, int width);
int plane_rows(PixelFormat format, int plane, int height);

}  // namespace huetrack::capture
