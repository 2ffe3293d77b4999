#include "capture/frames/pixels_on_demand.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>
#include <vector>

#include "capture/frames/jpeg_encoder.h"
#include "capture/frames/recycler.h"
#include "capture/jpeg/jpeg_reader.h"
#include "capture/on_demand_copy.h"

namespace huetrack::capture {
namespace {

Image noise_image(PixelFormat format, int width, int height, unsigned seed = 3) {
  WritableImage out = make_image(format, ColorRange::full, width, height);
  std::minstd_rand random(seed);
  for (std::size_t i = 0; i < packed_bytes(out.image); ++i) out.data[0][i] = static_cast<std::uint8_t>(random() >> 9);
  return out.image;
}

bool are_equal(const Image& a, const Image& b) {
  std::vector<std::uint8_t> of_a(packed_bytes(a)), of_b(packed_bytes(b));
  pack(a, of_a.data());
  pack(b, of_b.data());
  return of_a == of_b;
}

// The restored switch of all readers.
class Reading {
 public:
  explicit Reading(JpegReading reading) { JpegReader::set_reading(reading); }
  ~Reading() { JpegReader::set_reading(JpegReading::on_demand); }
};

class OnDemandOf : public testing::TestWithParam<PixelFormat> {};

TEST_P(OnDemandOf, CopiesAndSinglePixelsAreThoseOfTheWholeImage) {
  const Image whole = noise_image(GetParam(), 150, 90);
  const Image partly = on_demand_copy(whole);
  for (const auto& [u, v] : {std::pair(0, 0), {149, 0}, {40, 70}, {149, 89}}) {
    if (GetParam() == PixelFormat::bgr) {
      EXPECT_EQ(bgr_at(partly, u, v).g, bgr_at(whole, u, v).g);
      continue;
    }
    EXPECT_EQ(yuv_at(partly, u, v).y, yuv_at(whole, u, v).y) << u << " " << v;
    EXPECT_EQ(yuv_at(partly, u, v).u, yuv_at(whole, u, v).u) << u << " " << v;
  }
  EXPECT_EQ(partly.on_demand->decoded_units(), 4U);
  EXPECT_TRUE(are_equal(partly, whole));
  EXPECT_FALSE(copy_of(partly).on_demand);
}

INSTANTIATE_TEST_SUITE_P(PixelsOnDemand, OnDemandOf,
                         testing::Values(PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                                         PixelFormat::i444, PixelFormat::bgr, PixelFormat::grey));

TEST(PixelsOnDemand, DecodesWhatARectangleTouchesAndNothingTwice) {
  const Image image = on_demand_copy(noise_image(PixelFormat::i420, 2000, 64));  // 125 columns of units: two words
  const auto& pixels = dynamic_cast<const CopyOnDemand&>(*image.on_demand);
  require(image, 15, 15, 17, 16);
  EXPECT_EQ(pixels.decoded_units(), 2U);
  EXPECT_EQ(pixels.calls(), 1);
  require(image, 0, 0, 32, 16);
  EXPECT_EQ(pixels.calls(), 1);
  require(image, 0, 0, 64, 16);  // two are there
  EXPECT_EQ(pixels.decoded_units(), 4U);
  EXPECT_EQ(pixels.calls(), 2);
  require(image, 63 * 16, 20, 65 * 16, 21);  // on both sides of a word's end
  EXPECT_EQ(pixels.decoded_units(), 6U);
  require(image, -100, -100, 0, 0);
  require(image, 5000, 0, 6000, 10);
  require(image, 10, 10, 10, 10);
  EXPECT_EQ(pixels.decoded_units(), 6U);
  require_all(image);
  EXPECT_EQ(pixels.decoded_units(), pixels.units());
  EXPECT_EQ(pixels.units(), 125U * 4);
}

TEST(PixelsOnDemand, SeveralThreadsShareAnImage) {
  const Image whole = noise_image(PixelFormat::i422, 640, 480);
  for (unsigned round = 0; round < 20; ++round) {
    const Image image = on_demand_copy(whole);
    std::atomic<int> wrong = 0;
    {
      std::vector<std::jthread> threads;
      for (unsigned t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
          std::minstd_rand random(10 * round + t + 1);
          for (int i = 0; i < 200; ++i) {
            const int u = static_cast<int>(random() % 600), v = static_cast<int>(random() % 440);
            require(image, u, v, u + 40, v + 40);
            for (int k = 0; k < 40; ++k) {
              const Yuv there = yuv_at(image, u + k, v + k), expected = yuv_at(whole, u + k, v + k);
              wrong += there.y != expected.y || there.v != expected.v;
            }
          }
        });
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_LE(image.on_demand->decoded_units(), image.on_demand->units());
  }
}

TEST(Recycler, GivesObjectsOutAgainAndKeepsFew) {
  std::shared_ptr<FrameMemory> late;
  {
    Recycler<FrameMemory> recycler(1);
    auto a = recycler.take(), b = recycler.take();
    const FrameMemory* const first = a.get();
    EXPECT_NE(a, b);
    const std::uint8_t* const bytes = a->bytes(1000);
    EXPECT_EQ(a->bytes(1000), bytes);
    a.reset();
    b.reset();  // freed: one is kept
    late = recycler.take();
    EXPECT_EQ(late.get(), first);
    EXPECT_EQ(late->bytes(900), bytes);
  }
  late.reset();  // after the recycler
}

TEST(Recycler, FreesObjectsThatPointToThemselvesWeakly) {
  static int alive = 0;
  struct Counted : std::enable_shared_from_this<Counted> {
    Counted() { ++alive; }
    ~Counted() { --alive; }
  };
  {
    Recycler<Counted> recycler;
    recycler.take();
    EXPECT_EQ(alive, 1);  // unused, and kept
  }
  EXPECT_EQ(alive, 0);
}

TEST(JpegReader, GivesTheDecodersPixelsWhereTheyAreAskedFor) {
  const Reading poisoned(JpegReading::poisoned);
  const auto jpeg = encode_picture(noise_image(PixelFormat::i420, 320, 240), {.width = 320, .height = 240}, 90);
  JpegReader reader;
  JpegDecoder decoder;
  const Image whole = *decoder.decode(jpeg).image;
  for (int i = 0; i < 3; ++i) {
    const Image image = *reader.read(reader.keep(jpeg)).image;
    ASSERT_TRUE(image.on_demand);
    EXPECT_EQ(image.on_demand->decoded_units(), 0U);
    require(image, 100, 50, 101, 51);
    EXPECT_EQ(image.on_demand->decoded_units(), 1U);
    EXPECT_EQ(yuv_at(image, 100, 50).y, yuv_at(whole, 100, 50).y);
    EXPECT_NE(image.planes[0].data[0], whole.planes[0].data[0]);  // random
    EXPECT_TRUE(are_equal(image, whole));
  }
}

TEST(JpegReader, ItsImagesOutliveIt) {
  const auto jpeg = encode_picture(noise_image(PixelFormat::i420, 64, 48), {.width = 64, .height = 48}, 90);
  Image image;
  {
    JpegReader reader;
    image = *reader.read(reader.keep(jpeg)).image;
  }
  EXPECT_TRUE(are_equal(image, *JpegDecoder().decode(jpeg).image));
}

TEST(JpegReader, RefusesWhatTheDecoderRefuses) {
  auto jpeg = encode_picture(noise_image(PixelFormat::i420, 64, 48), {.width = 64, .height = 48}, 90);
  JpegReader reader;
  EXPECT_FALSE(reader.read(reader.keep(jpeg), 32, 48).image);
  jpeg.resize(jpeg.size() / 2);
  const JpegResult half = reader.read(reader.keep(jpeg));
  EXPECT_FALSE(half.image);
  EXPECT_EQ(half.problem, JpegDecoder().decode(jpeg).problem);
  EXPECT_FALSE(reader.read(reader.keep({})).image);
}

TEST(JpegReader, ReadsWholeOnRequest) {
  const Reading whole(JpegReading::whole);
  const auto jpeg = encode_picture(noise_image(PixelFormat::i420, 64, 48), {.width = 64, .height = 48}, 90);
  JpegReader reader;
  EXPECT_FALSE(reader.read(reader.keep(jpeg)).image->on_demand);
}

}  // namespace
}  // namespace huetrack::capture
