#include "hosts/frame_message.h"

#include <utility>

#include "capture/frames/image_copy.h"

namespace huetrack::hosts {
namespace {

constexpr std::uint8_t is_jpeg = 0;
constexpr int formats = 7;

std::uint8_t word_of(capture::PixelFormat format) {
  return static_cast<std::uint8_t>(static_cast<int>(format) + 1);
}
static_assert(static_cast<int>(capture::PixelFormat::yuyv) == 0 && static_cast<int>(capture::PixelFormat::bgr) == 5 &&
              static_cast<int>(capture::PixelFormat::grey) == 6);

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
  bytes.resize(capture::packed_bytes(image));
  capture::pack(image, bytes.data());
}

capture::Frame from_message(msg::CameraFrame&& message, capture::JpegReader& reader) {
  capture::Frame out;
  out.status = capture::FrameStatus::corrupted;
  if (message.is_damaged()) return out;
  auto bytes = std::make_shared<std::vector<std::uint8_t>>(std::move(message.bytes()));
  if (message.format() == is_jpeg) {
    if (message.width() == 0 || message.height() == 0) return out;
    capture::JpegResult decoded = reader.read(bytes, message.width(), message.height());
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
  capture::Image image{.format = format,
                       .range = message.is_full_range() ? capture::ColorRange::full : capture::ColorRange::limited,
                       .width = width,
                       .height = height,
                       .planes = {},
                       .owner = {}};
  if (capture::packed_bytes(image) != bytes->size()) return out;
  capture::set_packed(image, bytes->data(), bytes);
  out.pixels = std::move(image);
  out.status = capture::FrameStatus::ok;
  return out;
}

capture::Frame from_message(msg::CameraMatches&& message, capture::JpegReader& reader, capture::Image& latest,
                            int width, int height) {
  capture::Frame out;
  out.status = capture::FrameStatus::corrupted;
  if (message.is_damaged()) return out;
  auto decoded = capture::decode_matches(message.bytes(), reader.decoder(), latest, width, height);
  if (!decoded) return out;
  out.pixels = std::move(decoded->source);
  out.matches = std::move(decoded->matches);
  out.encoded = std::make_shared<std::vector<std::uint8_t>>(std::move(message.bytes()));
  out.status = capture::FrameStatus::ok;
  return out;
}

}  // namespace huetrack::hosts
