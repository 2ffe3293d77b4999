#include "hosts/frame_message.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "capture/frames/jpeg_encoder.h"

namespace huetrack::hosts {
namespace {

using capture::ColorRange;
using capture::PixelFormat;

capture::Frame frame_of(PixelFormat format, int width, int height) {
  auto [image, data] = capture::make_image(format, ColorRange::limited, width, height);
  std::uint8_t value = 3;
  for (int p = 0; p < 3; ++p)
    for (std::size_t i = 0;
         i < capture::plane_row_bytes(format, p, width) * std::size_t(capture::plane_rows(format, p, height)); ++i)
      data[std::size_t(p)][i] = value = std::uint8_t(value * 5 + 7);
  capture::Frame frame;
  frame.sequence = 12;
  frame.pixels = image;
  frame.stamped_at = capture::Timestamp(std::chrono::nanoseconds(1'700'000'000'123'456'789));
  return frame;
}

TEST(FrameMessage, RoundTripsEveryFormat) {
  capture::JpegReader decoder;
  for (const PixelFormat format : {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                                   PixelFormat::i444, PixelFormat::bgr, PixelFormat::grey}) {
    const capture::Frame frame = frame_of(format, 34, 22);
    msg::CameraFrame message;
    to_message(frame, message);
    EXPECT_EQ(message.number(), 12U);
    EXPECT_EQ(message.stamped_at(), 1'700'000'000'123'456'789);
    const capture::Frame back = from_message(std::move(message), decoder);
    ASSERT_EQ(back.status, capture::FrameStatus::ok) << name(format);
    EXPECT_EQ(back.pixels.format, format);
    EXPECT_EQ(back.pixels.range, frame.pixels.range);
    for (int p = 0; p < 3; ++p)
      for (int row = 0; row < capture::plane_rows(format, p, 22); ++row) {
        const auto& a = frame.pixels.planes[std::size_t(p)];
        const auto& b = back.pixels.planes[std::size_t(p)];
        ASSERT_TRUE(std::equal(a.data + row * a.stride,
                               a.data + row * a.stride + capture::plane_row_bytes(format, p, 34),
                               b.data + row * b.stride))
            << name(format) << ", plane " << p << ", row " << row;
      }
  }
}

TEST(FrameMessage, RoundTripsTheCamerasJpeg) {
  capture::Frame frame = frame_of(PixelFormat::i422, 64, 48);
  frame.encoded = std::make_shared<const std::vector<std::uint8_t>>(
      capture::encode_picture(frame.pixels, {.width = 64, .height = 48}, 90));
  msg::CameraFrame message;
  to_message(frame, message);
  EXPECT_EQ(message.bytes().size(), frame.encoded->size());
  capture::JpegReader decoder;
  const capture::Frame back = from_message(std::move(message), decoder);
  ASSERT_EQ(back.status, capture::FrameStatus::ok);
  EXPECT_EQ(*back.encoded, *frame.encoded);
  EXPECT_EQ(back.pixels.width, 64);
}

TEST(FrameMessage, WrongSizeIsDamage) {
  capture::JpegReader decoder;
  const auto status_of = [&](auto&& change) {
    msg::CameraFrame message;
    to_message(frame_of(PixelFormat::yuyv, 32, 16), message);
    change(message);
    return from_message(std::move(message), decoder).status;
  };
  EXPECT_EQ(status_of([](auto&) {}), capture::FrameStatus::ok);
  EXPECT_EQ(status_of([](auto& m) { m.bytes().pop_back(); }), capture::FrameStatus::corrupted);
  EXPECT_EQ(status_of([](auto& m) { m.width(65534); }), capture::FrameStatus::corrupted);
  EXPECT_EQ(status_of([](auto& m) { m.width(31); }), capture::FrameStatus::corrupted);
  EXPECT_EQ(status_of([](auto& m) { m.height(0); }), capture::FrameStatus::corrupted);
  EXPECT_EQ(status_of([](auto& m) { m.format(200); }), capture::FrameStatus::corrupted);
  EXPECT_EQ(status_of([](auto& m) { m.format(0); }), capture::FrameStatus::corrupted);
  EXPECT_EQ(status_of([](auto& m) { m.is_damaged(true); }), capture::FrameStatus::corrupted);
}

}  // namespace
}  // namespace huetrack::hosts
