#include "capture/frames/sample_depth.h"

#include <gmock/gmock.h>

#include <vector>

#include "capture/ffmpeg/ffmpeg_picture.h"

namespace huetrack::capture {
namespace {

using testing::ElementsAre;
using testing::Optional;

// The samples after fit(), of one row.
std::vector<int> fitted(SampleDepth& depth, const std::vector<int>& samples, std::endian order = std::endian::big,
                        std::size_t alpha_every = 0) {
  std::vector<std::uint8_t> bytes;
  for (const int sample : samples) {
    const auto low = static_cast<std::uint8_t>(sample & 0xff), high = static_cast<std::uint8_t>(sample >> 8);
    bytes.push_back(order == std::endian::big ? high : low);
    bytes.push_back(order == std::endian::big ? low : high);
  }
  const SampleRows row{.data = bytes.data(),
                       .stride = static_cast<std::ptrdiff_t>(bytes.size()),
                       .samples = samples.size(),
                       .rows = 1,
                       .order = order,
                       .alpha_every = alpha_every};
  depth.fit({&row, 1});
  std::vector<int> result;
  for (std::size_t i = 0; i < bytes.size(); i += 2)
    result.push_back(order == std::endian::big ? bytes[i] << 8 | bytes[i + 1] : bytes[i + 1] << 8 | bytes[i]);
  return result;
}

TEST(SampleDepth, StatedBitsAreScaled) {
  for (const auto order : {std::endian::big, std::endian::little}) {
    SampleDepth depth;
    depth.state(12);
    EXPECT_THAT(fitted(depth, {0, 1, 4095, 5000}, order), ElementsAre(0, 16, 65520, 65535));
    EXPECT_FALSE(depth.unexplained_largest());
  }
}

TEST(SampleDepth, TaggedBitsAreScaledWhereTheyAreTheLowerOnes) {
  SampleDepth lower, upper;
  lower.tag(10), upper.tag(10);
  EXPECT_THAT(fitted(lower, {1, 1023}), ElementsAre(64, 65472));
  EXPECT_THAT(fitted(upper, {64, 65472}), ElementsAre(64, 65472)) << "as PNG wants them";
  EXPECT_FALSE(lower.unexplained_largest() || upper.unexplained_largest());
}

TEST(SampleDepth, TheFirstPictureDecides) {
  SampleDepth depth;
  EXPECT_THAT(fitted(depth, {7, 4095}), ElementsAre(7, 4095));
  EXPECT_THAT(depth.unexplained_largest(), Optional(4095));
  SampleDepth full;
  fitted(full, {40'000}), fitted(full, {7});
  EXPECT_FALSE(full.unexplained_largest());
  SampleDepth dark;
  dark.state(16);
  EXPECT_THAT(fitted(dark, {7, 300}), ElementsAre(7, 300));
  EXPECT_FALSE(dark.unexplained_largest());
  SampleDepth opaque;
  fitted(opaque, {1, 2, 3, 65'535, 4, 5, 6, 65'535}, std::endian::little, 4);
  EXPECT_THAT(opaque.unexplained_largest(), Optional(6));
}

TEST(SampleDepth, IsAskedOfEveryPictureOf16Bits) {
  for (const AVPixelFormat format :
       {AV_PIX_FMT_GRAY16BE, AV_PIX_FMT_GRAY16LE, AV_PIX_FMT_RGB48BE, AV_PIX_FMT_RGBA64LE}) {
    FramePtr frame(not_null(av_frame_alloc()));
    frame->format = format;
    frame->width = frame->height = 2;
    ASSERT_EQ(av_frame_get_buffer(frame.get(), 0), 0);
    const bool is_big = format == AV_PIX_FMT_GRAY16BE || format == AV_PIX_FMT_RGB48BE;
    for (int y = 0; y < 2; ++y)
      for (int i = 0; i < 16 && i < frame->linesize[0]; ++i)  // 0x0800 of 0x0fff
        frame->data[0][y * frame->linesize[0] + i] = i % 2 == (is_big ? 0 : 1) ? 8 : 0;
    PictureMaker pictures;
    pictures.depth().state(12);
    const auto image = pictures.image_of(std::move(frame), AV_CODEC_ID_PNG);
    ASSERT_TRUE(image);
    EXPECT_NEAR(image->format == PixelFormat::bgr ? bgr_at(*image, 1, 1).g : yuv_at(*image, 1, 1).y, 128, 1) << format;
  }
}

}  // namespace
}  // namespace huetrack::capture
