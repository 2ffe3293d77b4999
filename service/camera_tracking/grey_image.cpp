#include "camera_tracking/grey_image.h"

#include "particle_filter/vector_clones.h"

namespace huetrack::camera_tracking {
namespace {

HUETRACK_CLONES void every_second(const std::uint8_t* __restrict in, int n, std::uint8_t* __restrict out) {
  for (int i = 0; i < n; ++i) out[i] = in[2 * i];
}

HUETRACK_CLONES void luma_of_bgr(const std::uint8_t* __restrict in, int n, std::uint8_t* __restrict out) {
  for (int i = 0; i < n; ++i) {  // BT.601, in 1/256
    out[i] = static_cast<std::uint8_t>((29 * in[3 * i] + 150 * in[3 * i + 1] + 77 * in[3 * i + 2] + 128) >> 8);
  }
}

HUETRACK_CLONES void mean_of_2x2(const std::uint8_t* __restrict a, const std::uint8_t* __restrict b, int n,
                                 std::uint8_t* __restrict out) {
  for (int i = 0; i < n; ++i) {
    out[i] = static_cast<std::uint8_t>((a[2 * i] + a[2 * i + 1] + b[2 * i] + b[2 * i + 1] + 2) >> 2);
  }
}

}  // namespace

GreyImage make_grey(int width, int height, std::uint8_t*& pixels) {
  auto bytes =
      std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  pixels = bytes->data();
  return {width, height, width, pixels, std::move(bytes), capture::ColorRange::full};
}

GreyImage grey_of(const capture::Image& image) {
  capture::require_all(image);
  const capture::Plane& plane = image.planes[0];
  if (image.format != capture::PixelFormat::yuyv && image.format != capture::PixelFormat::bgr)
    return {image.width, image.height, plane.stride, plane.data, image.owner, image.range};
  std::uint8_t* out = nullptr;
  GreyImage grey = make_grey(image.width, image.height, out);
  grey.range = image.format == capture::PixelFormat::bgr ? capture::ColorRange::full : image.range;
  for (int v = 0; v < image.height; ++v) {
    (image.format == capture::PixelFormat::yuyv ? every_second : luma_of_bgr)(plane.data + v * plane.stride,
                                                                              image.width, out + v * image.width);
  }
  return grey;
}

GreyImage half_size(const GreyImage& image) {
  std::uint8_t* out = nullptr;
  GreyImage half = make_grey(image.width / 2, image.height / 2, out);
  half.range = image.range;
  for (int v = 0; v < half.height; ++v)
    mean_of_2x2(image.row(2 * v), image.row(2 * v + 1), half.width, out + v * half.width);
  return half;
}

Pyramid make_pyramid(GreyImage image, int max_levels) {
  Pyramid p;
  p.levels.push_back(std::move(image));
  while (p.count() < max_levels && p.levels.back().width >= 60 && p.levels.back().height >= 60)
    p.levels.push_back(half_size(p.levels.back()));
  return p;
}

}  // namespace huetrack::camera_tracking
