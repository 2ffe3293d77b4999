#include "hosts/frame_message.h"

#include <utility>

namespace huetrack::hosts {
namespace {

constexpr std::uint8_t is_jpeg = 0;
constexpr int planes = 3, formats = 7;

std::uint8_t word_of(capture::PixelFormat format) {
  return static_cast<std::uint8_t>(static_cast<int>(format) + 1);
}
static_assert(static_cast<int>(capture::PixelFormat::yuyv) == 0 && static_cast<int>(capture::PixelFormat::bgr) == 5 &&
              static_cast<int>(capture::PixelFormat::grey) == 6);

std::size_t plane_bytes(capture::PixelFormat format, int plane, int width, int height) {
  return capture::plane_row_bytes(format, plane, width) *
         static_cast<std::size_t>(capture::plane_rows(format, plane, height));
}

}  // namespace

void to_message(const capture::Frame& frame, msg::CameraFrame& out) {
  out.number(frame.sequence);
  out.stamped_at(frame.stamped_at.time_since_epoch().count());
  const capture::Image& image = frame.pixels;
  out.width(static_cast<std::uint16_t>(image.width));
  out.height(static_cast<std::uint16_t>(image.height));
  out.is_full_range(image.range == capture::ColorRange::full);
  out.is_damaged(frame.status != capture::FrameStatus::ok);
  out.format(frame.encoded ? is_jpeg : word_of(image.format));
  std::vector<std::uint8_t>& bytes = out.bytes();
  bytes.clear();
  if (out.is_damaged()) return;
  if (frame.encoded) {
    bytes.assign(frame.encoded->begin(), frame.encoded->end());
    return;
  }
  for (int p = 0; p < planes; ++p) {
    const std::size_t row_bytes = capture::plane_row_bytes(image.format, p, image.width);
    const capture::Plane& plane = image.planes[static_cast<std::size_t>(p)];
    for (int row = 0; row < capture::plane_rows(image.format, p, image.height); ++row)
      bytes.insert(bytes.end(), plane.data + row * plane.stride,
                   plane.data + row * plane.stride + static_cast<std::ptrdiff_t>(row_bytes));
  }
}

capture::Frame from_message(msg::CameraFrame&& message, capture::JpegDecoder& decoder) {
  capture::Frame out;
  out.status = capture::FrameStatus::corrupted;
  if (message.is_damaged()) return out;
  auto bytes = std::make_shared<std::vector<std::uint8_t>>(std::move(message.bytes()));
  if (message.format() == is_jpeg) {
    if (message.width() == 0 || message.height() == 0) return out;
    capture::JpegResult decoded = decoder.decode(*bytes, message.width(), message.height());
    if (!decoded.image) return out;
    out.pixels = std::move(*decoded.image);
    out.encoded = std::move(bytes);
    out.status = capture::FrameStatus::ok;
    return out;
  }
  if (message.format() > formats) return out;
  const auto format = static_cast<capture::PixelFormat>(message.format() - 1);
  const int width = message.width(), height = message.height();
  if (width == 0 || height == 0 || (capture::needs_even_width(format) && width % 2 != 0) ||
      (capture::needs_even_height(format) && height % 2 != 0))
    return out;
  std::size_t at = 0;
  for (int p = 0; p < planes; ++p) at += plane_bytes(format, p, width, height);
  if (at != bytes->size()) return out;
  capture::Image& image = out.pixels;
  image = {.format = format,
           .range = message.is_full_range() ? capture::ColorRange::full : capture::ColorRange::limited,
           .width = width,
           .height = height,
           .planes = {},
           .owner = {}};
  at = 0;
  for (int p = 0; p < planes; ++p) {
    const std::size_t row_bytes = capture::plane_row_bytes(format, p, width);
    if (row_bytes == 0) break;
    image.planes[static_cast<std::size_t>(p)] = {bytes->data() + at, static_cast<std::ptrdiff_t>(row_bytes)};
    at += plane_bytes(format, p, width, height);
  }
  image.owner = std::move(bytes);
  out.status = capture::FrameStatus::ok;
  return out;
}

capture::Frame from_message(msg::CameraMatches&& message, capture::JpegDecoder& decoder, capture::Image& latest,
                            int width, int height) {
  capture::Frame out;
  out.status = capture::FrameStatus::corrupted;
  if (message.is_damaged()) return out;
  auto decoded = capture::decode_matches(message.bytes(), decoder, latest, width, height);
  if (!decoded) return out;
  out.pixels = std::move(decoded->source);
  out.matches = std::move(decoded->matches);
  out.encoded = std::make_shared<std::vector<std::uint8_t>>(std::move(message.bytes()));
  out.status = capture::FrameStatus::ok;
  return out;
}

}  // namespace huetrack::hosts
