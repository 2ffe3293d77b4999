#include "capture/frames/pixel_format.h"

#include <algorithm>
#include <cassert>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "capture/frames/image_copy.h"

namespace huetrack::capture {
namespace {

constexpr std::array<std::pair<PixelFormat, std::string_view>, 7> names{{{PixelFormat::yuyv, "yuyv"},
                                                                         {PixelFormat::nv12, "nv12"},
                                                                         {PixelFormat::i420, "i420"},
                                                                         {PixelFormat::i422, "i422"},
                                                                         {PixelFormat::i444, "i444"},
                                                                         {PixelFormat::bgr, "bgr"},
                                                                         {PixelFormat::grey, "grey"}}};

const std::uint8_t* row(const Image& image, std::size_t plane, int v) {
  return image.planes[plane].data + v * image.planes[plane].stride;
}

}  // namespace

std::string_view name(PixelFormat format) {
  return std::ranges::find(names, format, &std::pair<PixelFormat, std::string_view>::first)->second;
}

bool needs_even_width(PixelFormat format) {
  return format == PixelFormat::yuyv || format == PixelFormat::i422 || needs_even_height(format);
}

bool needs_even_height(PixelFormat format) {
  return format == PixelFormat::nv12 || format == PixelFormat::i420;
}

Yuv yuv_at(const Image& image, int u, int v) {
  assert(u >= 0 && u < image.width && v >= 0 && v < image.height);
  require(image, u, v, u + 1, v + 1);
  switch (image.format) {
    case PixelFormat::yuyv: {
      const std::uint8_t* pair = row(image, 0, v) + (u & ~1) * 2;
      return {pair[(u & 1) * 2], pair[1], pair[3]};
    }
    case PixelFormat::nv12: {
      const std::uint8_t* chroma = row(image, 1, v / 2) + (u & ~1);
      return {row(image, 0, v)[u], chroma[0], chroma[1]};
    }
    case PixelFormat::i420:
      return {row(image, 0, v)[u], row(image, 1, v / 2)[u / 2], row(image, 2, v / 2)[u / 2]};
    case PixelFormat::i422:
      return {row(image, 0, v)[u], row(image, 1, v)[u / 2], row(image, 2, v)[u / 2]};
    case PixelFormat::i444:
      return {row(image, 0, v)[u], row(image, 1, v)[u], row(image, 2, v)[u]};
    case PixelFormat::grey:
      return {row(image, 0, v)[u], 128, 128};
    case PixelFormat::bgr:
      break;
  }
  assert(false && "a bgr image has no YUV: use bgr_at()");
  return {0, 128, 128};
}

Bgr bgr_at(const Image& image, int u, int v) {
  assert(image.format == PixelFormat::bgr && u >= 0 && u < image.width && v >= 0 && v < image.height);
  require(image, u, v, u + 1, v + 1);
  const std::uint8_t* pixel = row(image, 0, v) + 3 * u;
  return {pixel[0], pixel[1], pixel[2]};
}

std::size_t plane_row_bytes(PixelFormat format, int plane, int width) {
  const auto w = static_cast<std::size_t>(width);
  switch (format) {
    case PixelFormat::yuyv:
      return plane == 0 ? 2 * w : 0;
    case PixelFormat::bgr:
      return plane == 0 ? 3 * w : 0;
    case PixelFormat::grey:
      return plane == 0 ? w : 0;
    case PixelFormat::nv12:
      return plane <= 1 ? w : 0;
    case PixelFormat::i420:
    case PixelFormat::i422:
      return plane == 0 ? w : plane <= 2 ? w / 2 : 0;
    case PixelFormat::i444:
      return plane <= 2 ? w : 0;
  }
  return 0;
}

int plane_rows(PixelFormat format, int plane, int height) {
  if (plane_row_bytes(format, plane, 2) == 0) return 0;
  return plane > 0 && needs_even_height(format) ? height / 2 : height;
}

WritableImage make_image(PixelFormat format, ColorRange range, int width, int height) {
  if (width < 1 || height < 1 || (needs_even_width(format) && width % 2 != 0) ||
      (needs_even_height(format) && height % 2 != 0))
    throw std::invalid_argument("no " + std::string(name(format)) + " image can be " + std::to_string(width) + "x" +
                                std::to_string(height) + " pixels: the format needs even sizes");
  WritableImage result;
  Image& image = result.image;
  image.format = format;
  image.range = format == PixelFormat::bgr ? ColorRange::full : range;
  image.width = width;
  image.height = height;
  auto memory = std::make_shared<std::vector<std::uint8_t>>(packed_bytes(image));
  std::uint8_t* const first = memory->data();
  set_packed(image, first, std::move(memory));
  for (std::size_t i = 0; i < 3 && image.planes[i].data != nullptr; ++i)
    result.data[i] = first + (image.planes[i].data - first);
  return result;
}

}  // namespace huetrack::capture
