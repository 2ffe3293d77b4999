#include "capture/frames/jpeg_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "capture/clips.h"

namespace huetrack::capture {
namespace {

using testing::HasSubstr;

// One JPEG of the given kind, as FFmpeg codes it.
std::vector<std::uint8_t> jpeg_of(AVPixelFormat format, AVColorRange range = AVCOL_RANGE_JPEG, int width = 64,
                                  int height = 48, bool standard_huffman = false) {
  std::vector<std::uint8_t> bytes;
  const TemporaryFolder folder;
  write_clip(folder / "one.mkv", {.codec = "mjpeg",
                                  .format = format,
                                  .range = range,
                                  .width = width,
                                  .height = height,
                                  .frames = 1,
                                  .standard_huffman = standard_huffman,
                                  .tamper = [&](int, AVPacket& packet) {
                                    bytes.assign(packet.data, packet.data + packet.size);
                                    return true;
                                  }});
  return bytes;
}

TEST(JpegDecoder, DecodesThePlanesAsCoded) {
  JpegDecoder decoder;
  for (const auto& [coded, format] :
       {std::pair{AV_PIX_FMT_YUVJ420P, PixelFormat::i420}, std::pair{AV_PIX_FMT_YUVJ422P, PixelFormat::i422},
        std::pair{AV_PIX_FMT_YUVJ444P, PixelFormat::i444}}) {
    const auto result = decoder.decode(jpeg_of(coded));
    ASSERT_TRUE(result.image) << result.problem;
    EXPECT_EQ(result.image->format, format);
    EXPECT_EQ(result.image->range, ColorRange::full);
    ASSERT_EQ(result.image->width, 64);
    ASSERT_EQ(result.image->height, 48);
    // what paint() painted, coded at a high quality
    for (int v = 14; v < 48; ++v)
      for (int u = 18; u < 64; ++u) {
        const Yuv yuv = yuv_at(*result.image, u, v);
        ASSERT_NEAR(yuv.y, level_of_frame(0), 8) << u << "," << v;
        ASSERT_NEAR(yuv.u, 120, 14) << u << "," << v;
        ASSERT_NEAR(yuv.v, 140, 14) << u << "," << v;
      }
  }
}

TEST(JpegDecoder, DecodesSizesOfPartialBlocks) {
  JpegDecoder decoder;
  const auto result = decoder.decode(jpeg_of(AV_PIX_FMT_YUVJ420P, AVCOL_RANGE_JPEG, 50, 34));
  ASSERT_TRUE(result.image) << result.problem;
  EXPECT_EQ(result.image->width, 50);
  EXPECT_EQ(result.image->height, 34);
  EXPECT_NEAR(yuv_at(*result.image, 49, 33).y, level_of_frame(0), 8);
  EXPECT_NEAR(yuv_at(*result.image, 49, 33).v, 140, 14);
}

// Whoever sent it: nothing is made of it, and the next one is decoded.
TEST(JpegDecoder, RefusesAnotherSizeByItsHeader) {
  JpegDecoder decoder;
  std::vector<std::uint8_t> jpeg = jpeg_of(AV_PIX_FMT_YUVJ420P);
  const auto refused = decoder.decode(jpeg, 64, 32);
  EXPECT_FALSE(refused.image);
  EXPECT_FALSE(refused.is_unsupported);
  EXPECT_THAT(refused.problem, HasSubstr("64x48"));
  EXPECT_TRUE(decoder.decode(jpeg, 64, 48).image);
  // Before the data are looked at: none are there.
  jpeg.resize(jpeg.size() / 2);
  EXPECT_THAT(decoder.decode(jpeg, 32, 48).problem, HasSubstr("its size is 64x48"));
}

TEST(JpegDecoder, ReadsLimitedRange) {
  JpegDecoder decoder;
  const auto result = decoder.decode(jpeg_of(AV_PIX_FMT_YUV420P, AVCOL_RANGE_MPEG));
  ASSERT_TRUE(result.image) << result.problem;
  EXPECT_EQ(result.image->range, ColorRange::limited);
}

TEST(JpegDecoder, OddSizesAreUnsupportedNotDamaged) {
  JpegDecoder decoder;
  const auto result = decoder.decode(jpeg_of(AV_PIX_FMT_YUVJ420P, AVCOL_RANGE_JPEG, 51, 34));
  EXPECT_FALSE(result.image);
  EXPECT_TRUE(result.is_unsupported);
  EXPECT_THAT(result.problem, HasSubstr("51x34"));
}

// What many webcams send.
std::vector<std::uint8_t> without_huffman_tables(std::vector<std::uint8_t> jpeg) {
  int cut = 0;
  for (std::size_t i = 2; i + 4 < jpeg.size() && jpeg[i] == 0xFF && jpeg[i + 1] != 0xDA;) {
    const std::size_t length = 2 + (std::size_t{jpeg[i + 2]} << 8 | jpeg[i + 3]);
    if (jpeg[i + 1] == 0xC4) {
      jpeg.erase(jpeg.begin() + static_cast<std::ptrdiff_t>(i), jpeg.begin() + static_cast<std::ptrdiff_t>(i + length));
      ++cut;
    } else {
      i += length;
    }
  }
  EXPECT_GT(cut, 0);
  return jpeg;
}

TEST(JpegDecoder, UsesStandardHuffmanTablesByDefault) {
  const auto jpeg = jpeg_of(AV_PIX_FMT_YUVJ422P, AVCOL_RANGE_JPEG, 64, 48, true);
  JpegDecoder decoder;
  const auto whole = decoder.decode(jpeg);
  ASSERT_TRUE(whole.image);
  JpegDecoder fresh;
  const auto without = fresh.decode(without_huffman_tables(jpeg));
  ASSERT_TRUE(without.image) << without.problem;
  EXPECT_EQ(hash_of(*without.image), hash_of(*whole.image));
}

// A picture with damaged tables must not affect later ones.
TEST(JpegDecoder, TablesDoNotLeakIntoTheNextPicture) {
  const auto without = without_huffman_tables(jpeg_of(AV_PIX_FMT_YUVJ422P, AVCOL_RANGE_JPEG, 64, 48, true));
  JpegDecoder fresh;
  const auto alone = fresh.decode(without);
  ASSERT_TRUE(alone.image) << alone.problem;
  JpegDecoder decoder;
  ASSERT_TRUE(decoder.decode(jpeg_of(AV_PIX_FMT_YUVJ422P)).image);  // its tables are its own
  const auto after = decoder.decode(without);
  ASSERT_TRUE(after.image) << after.problem;
  EXPECT_EQ(hash_of(*after.image), hash_of(*alone.image));
}

TEST(JpegDecoder, AcceptsAFewBytesOfPadding) {
  auto jpeg = jpeg_of(AV_PIX_FMT_YUVJ422P);
  JpegDecoder decoder;
  const auto clean = decoder.decode(jpeg);
  jpeg.insert(jpeg.end() - 2, {0x00, 0x00});  // before the end marker, as some webcams do
  const auto padded = decoder.decode(jpeg);
  ASSERT_TRUE(padded.image) << padded.problem;
  EXPECT_EQ(hash_of(*padded.image), hash_of(*clean.image));
  jpeg.insert(jpeg.end() - 2, 200, 0x11);
  EXPECT_FALSE(decoder.decode(jpeg).image);
  const std::vector<std::uint8_t> trailing = [&] {
    auto bytes = jpeg_of(AV_PIX_FMT_YUVJ422P);
    bytes.resize(bytes.size() + 512, 0);  // behind the end marker: the rest of a buffer
    return bytes;
  }();
  EXPECT_TRUE(decoder.decode(trailing).image);
}

TEST(JpegDecoder, TruncationIsDamageOfThatPictureOnly) {
  const auto jpeg = jpeg_of(AV_PIX_FMT_YUVJ420P);
  JpegDecoder decoder;
  const auto whole = decoder.decode(jpeg);
  ASSERT_TRUE(whole.image);
  for (std::size_t length = 0; length < jpeg.size(); ++length) {
    const auto cut = decoder.decode(std::span(jpeg).first(length));
    ASSERT_FALSE(cut.image) << length << " of " << jpeg.size() << " bytes";
    ASSERT_FALSE(cut.problem.empty());
    ASSERT_FALSE(cut.is_unsupported) << cut.problem;
    if (length % 50 != 0) continue;
    const auto again = decoder.decode(jpeg);
    ASSERT_TRUE(again.image) << "after " << length << " bytes: " << again.problem;
    ASSERT_EQ(hash_of(*again.image), hash_of(*whole.image));
  }
}

TEST(JpegDecoder, FlippedBytesNeverCrash) {
  const auto jpeg = jpeg_of(AV_PIX_FMT_YUVJ422P);
  JpegDecoder decoder;
  std::srand(1);
  int without_image = 0;
  for (int round = 0; round < 3000; ++round) {
    auto bad = jpeg;
    for (int k = 0; k < 3; ++k)
      bad[static_cast<std::size_t>(std::rand()) % bad.size()] = static_cast<std::uint8_t>(std::rand());
    const auto result = decoder.decode(bad);
    if (!result.image)
      ++without_image;
    else
      hash_of(*result.image);  // every byte of it is there
  }
  EXPECT_GT(without_image, 100);
}

}  // namespace
}  // namespace huetrack::capture
