#include "capture/frames/crop.h"

#include <gmock/gmock.h>

#include <deque>
#include <optional>

#include "capture/cropped_source.h"
#include "capture/frames/image_copy.h"
#include "capture/jpeg/jpeg_reader.h"
#include "capture/jpeg_maker.h"
#include "capture/on_demand_copy.h"

namespace huetrack::capture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using namespace std::chrono_literals;

constexpr PixelFormat cropped_formats[] = {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                                           PixelFormat::i444, PixelFormat::bgr,  PixelFormat::grey};

WritableImage noise(PixelFormat format) {
  WritableImage image = make_image(format, ColorRange::full, 32, 16);
  for (int p = 0; p < 3; ++p) {
    const std::size_t bytes = plane_row_bytes(format, p, 32) * static_cast<std::size_t>(plane_rows(format, p, 16));
    for (std::size_t i = 0; i < bytes; ++i)
      image.data[std::size_t(p)][i] = static_cast<std::uint8_t>(37 * i + i / 7 + 11 * p);
  }
  return image;
}

TEST(Crop, HasThePixelsOfItsPart) {
  for (const PixelFormat format : cropped_formats) {
    SCOPED_TRACE(std::string(name(format)));
    const Image whole = noise(format).image;
    const Image part = cropped(whole, {10, 4, 14, 6});
    EXPECT_EQ(part.width, 14);
    EXPECT_EQ(part.owner, whole.owner);
    for (int v = 0; v < 6; ++v)
      for (int u = 0; u < 14; ++u) {
        if (format == PixelFormat::bgr) {
          const Bgr a = bgr_at(part, u, v), b = bgr_at(whole, u + 10, v + 4);
          ASSERT_EQ(std::tie(a.b, a.g, a.r), std::tie(b.b, b.g, b.r));
        } else {
          const Yuv a = yuv_at(part, u, v), b = yuv_at(whole, u + 10, v + 4);
          ASSERT_EQ(std::tie(a.y, a.u, a.v), std::tie(b.y, b.u, b.v));
        }
      }
  }
}

std::vector<std::uint8_t> packed(const Image& image) {
  std::vector<std::uint8_t> bytes(packed_bytes(image));
  pack(image, bytes.data());
  return bytes;
}

TEST(Crop, OfACompressedImageIsDecodedOnDemand) {
  for (const PixelFormat format : cropped_formats) {
    SCOPED_TRACE(std::string(name(format)));
    WritableImage made = make_image(format, ColorRange::full, 200, 120);
    for (std::size_t i = 0; i < packed_bytes(made.image); ++i)
      made.data[0][i] = static_cast<std::uint8_t>(37 * i + i / 7);
    const Image whole = on_demand_copy(made.image);
    const Crop crop{54, 22, 98, 66};
    const Image part = cropped(whole, crop);
    EXPECT_EQ(whole.on_demand->decoded_units(), 0U);
    ASSERT_TRUE(part.on_demand);
    require(part, 10, 10, 11, 11);  // columns 54 .. 69 of the whole image are the part's first unit
    EXPECT_EQ(part.on_demand->decoded_units(), 1U);
    EXPECT_EQ(whole.on_demand->decoded_units(), 4U);
    EXPECT_EQ(packed(part), packed(cropped(made.image, crop)));
    EXPECT_EQ(whole.on_demand->decoded_units(), 7U * 5);  // units 3 .. 9 of 13, rows 1 .. 5 of 8
  }
}

TEST(Crop, OfACompressedImageOutlivesIt) {
  const Image kept = noise(PixelFormat::i420).image;
  Image part;
  {
    const Image whole = on_demand_copy(kept);
    part = cropped(whole, {16, 4, 10, 6});
  }
  EXPECT_EQ(packed(part), packed(cropped(kept, {16, 4, 10, 6})));
}

// Their samples are within them, and they are no wider than those of the units below.
TEST(Crop, KnowsTheBoundsOfItsUnits) {
  const auto jpeg = make_jpeg({.width = 192, .height = 128, .noise = 10});
  JpegReader reader;
  const Image whole = *reader.read(reader.keep(jpeg)).image;
  for (const Crop crop : {Crop{64, 32, 96, 64}, Crop{54, 22, 98, 66}}) {
    SCOPED_TRACE(text_of(crop));
    const Image part = cropped(whole, crop);
    const PixelsOnDemand& pixels = *part.on_demand;
    const std::vector<PixelBounds> wide(pixels.bounds().begin(), pixels.bounds().end());
    ASSERT_EQ(wide.size(), pixels.units());
    const bool is_aligned = crop.u % 16 == 0;
    int narrower = 0;
    for (std::size_t unit = 0; unit < wide.size(); ++unit) {
      PixelBounds narrow = wide[unit];
      pixels.narrow_chroma(unit, narrow);
      EXPECT_EQ(narrow.y.min, wide[unit].y.min);
      narrower += narrow.u.max - narrow.u.min < wide[unit].u.max - wide[unit].u.min;
      SampleBounds y = no_sample, u = no_sample, v = no_sample;
      const int left = static_cast<int>(unit) % pixels.columns() * 16,
                top = static_cast<int>(unit) / pixels.columns() * 16;
      for (int row = top; row < std::min(top + 16, crop.height); ++row)
        for (int column = left; column < std::min(left + 16, crop.width); ++column) {
          const Yuv p = yuv_at(part, column, row);
          y.include({p.y, p.y}), u.include({p.u, p.u}), v.include({p.v, p.v});
        }
      EXPECT_TRUE(y.min >= wide[unit].y.min && y.max <= wide[unit].y.max) << unit;
      EXPECT_TRUE(u.min >= narrow.u.min && u.max <= narrow.u.max) << unit;
      EXPECT_TRUE(v.min >= narrow.v.min && v.max <= narrow.v.max) << unit;
      if (is_aligned) {
        EXPECT_TRUE(u.min == narrow.u.min && u.max == narrow.u.max) << unit;
        const auto below = static_cast<std::size_t>((crop.v + top) / 16 * 12 + (crop.u + left) / 16);
        EXPECT_EQ(wide[unit].y.max, whole.on_demand->bounds()[below].y.max) << unit;
      }
    }
    EXPECT_GT(narrower, 0);
  }
  EXPECT_TRUE(cropped(on_demand_copy(noise(PixelFormat::i420).image), {2, 2, 8, 8}).on_demand->bounds().empty());
}

TEST(Crop, HasTheEighthOfItsWholeBlocks) {
  JpegReader reader;
  const Image whole = *reader.read(reader.keep(make_jpeg({.width = 192, .height = 128, .noise = 10}))).image;
  const Image all = whole.on_demand->eighth();
  const auto expect_part = [&](const Crop& crop, int u0, int v0, int width, int height) {
    SCOPED_TRACE(text_of(crop));
    const Image part = cropped(whole, crop).on_demand->eighth();
    ASSERT_EQ(part.width, width);
    ASSERT_EQ(part.height, height);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        const Yuv a = yuv_at(part, u, v), b = yuv_at(all, u0 + u, v0 + v);
        ASSERT_EQ(std::tie(a.y, a.u, a.v), std::tie(b.y, b.u, b.v)) << u << "," << v;
      }
  };
  expect_part({64, 32, 96, 64}, 8, 4, 12, 8);
  expect_part({54, 22, 98, 66}, 8, 4, 10, 6);
  expect_part({96, 0, 96, 128}, 12, 0, 12, 16);
  EXPECT_FALSE(has_pixels(cropped(whole, {2, 2, 20, 20}).on_demand->eighth()));  // no block is wholly in it
  EXPECT_FALSE(has_pixels(cropped(on_demand_copy(noise(PixelFormat::i420).image), {0, 0, 16, 16}).on_demand->eighth()));
}

TEST(Crop, FitsThePicturesChroma) {
  const auto fits = [](Crop crop, PixelFormat format) { return problem_of(crop, format, 32, 16).empty(); };
  EXPECT_TRUE(fits({1, 1, 3, 3}, PixelFormat::bgr));
  EXPECT_TRUE(fits({0, 0, 32, 16}, PixelFormat::nv12));
  EXPECT_FALSE(fits({1, 0, 4, 4}, PixelFormat::yuyv));
  EXPECT_FALSE(fits({0, 0, 3, 4}, PixelFormat::i422));
  EXPECT_TRUE(fits({0, 1, 4, 3}, PixelFormat::i422));
  EXPECT_FALSE(fits({0, 1, 4, 4}, PixelFormat::nv12));
  EXPECT_FALSE(fits({2, 0, 32, 16}, PixelFormat::bgr));
  EXPECT_FALSE(fits({2147483647, 0, 2147483647, 16}, PixelFormat::bgr));
  EXPECT_THROW(cropped(noise(PixelFormat::i420).image, {1, 0, 4, 4}), std::invalid_argument);
}

CameraRequest request(const std::string& name, std::optional<Crop> crop) {
  CameraRequest out;
  out.name = name;
  out.device = "/dev/video0";
  out.width = 1280;
  out.height = 480;
  out.crop = crop;
  return out;
}

TEST(SharedDevices, AreOpenedOnce) {
  std::vector<CameraRequest> requests{request("left", Crop{0, 0, 640, 480}), request("other", std::nullopt),
                                      request("right", Crop{640, 0, 640, 480})};
  requests[1].device = "/dev/video2";
  requests[0].timing.latency = 30ms;
  for (std::size_t c = 0; c < requests.size(); ++c) requests[c].camera = int(c);
  EXPECT_EQ(problem_of(requests), "");
  const auto devices = by_device(requests);
  ASSERT_EQ(devices.size(), 2u);
  EXPECT_EQ(devices[0].options.name, "left+right");
  EXPECT_EQ(devices[0].options.timing, FrameTiming{});
  ASSERT_EQ(devices[0].parts.size(), 2u);
  EXPECT_EQ(devices[0].parts[0].timing.latency, 30ms);
  EXPECT_EQ(devices[0].parts[1].camera, 2);
  EXPECT_TRUE(devices[1].parts.empty());
}

TEST(SharedDevices, HaveOneFormat) {
  const Crop left{0, 0, 640, 480}, right{640, 0, 640, 480};
  std::vector<CameraRequest> requests{request("left", left), request("right", std::nullopt)};
  EXPECT_THAT(problem_of(requests),
              HasSubstr("camera right has the device of left: cameras that share a device need a crop each"));
  requests[1].crop = right;
  requests[1].fps = 15;
  EXPECT_THAT(problem_of(requests), HasSubstr("one format, size, fps, controls"));
  EXPECT_THAT(problem_of(std::vector{request("a", Crop{1, 0, 640, 480})}), HasSubstr("must be even numbers"));
  EXPECT_THAT(problem_of(std::vector{request("a", Crop{960, 0, 640, 480})}),
              HasSubstr("the picture, which is 1280x480"));
}

class GivenFrames final : public FrameSource {
 public:
  std::deque<Frame> frames;
  std::optional<Frame> next(std::stop_token) override {
    if (frames.empty()) return std::nullopt;
    Frame frame = frames.front();
    frames.pop_front();
    return frame;
  }
};

TEST(CroppedSource, DeliversAFramePerPartWithTheDevicesStamp) {
  auto device = std::make_unique<GivenFrames>();
  const Image whole = noise(PixelFormat::yuyv).image;
  for (std::uint32_t k = 0; k < 3; ++k) {
    Frame frame;
    frame.sequence = k;
    frame.captured_at = frame.stamped_at = Timestamp(k * 33ms);
    frame.encoded = std::make_shared<const std::vector<std::uint8_t>>(3);
    if (k == 1)
      frame.status = FrameStatus::corrupted;
    else
      frame.pixels = k == 0 ? whole : make_image(PixelFormat::yuyv, ColorRange::full, 8, 8).image;  // another size
    device->frames.push_back(frame);
  }
  CroppedSource source(std::move(device),
                       {{4, {0, 0, 16, 16}, {.latency = 10ms, .readout = 20ms}}, {7, {16, 0, 16, 16}, {}}});
  std::vector<int> cameras;
  for (int k = 0; k < 3; ++k) {
    const auto left = source.next({}), right = source.next({});
    ASSERT_TRUE(left && right);
    EXPECT_EQ(left->camera, 4);
    EXPECT_EQ(right->camera, 7);
    EXPECT_EQ(left->stamped_at, Timestamp(k * 33ms));
    EXPECT_EQ(left->captured_at, Timestamp(k * 33ms - 10ms));
    EXPECT_EQ(left->readout, 20ms);
    EXPECT_EQ(right->captured_at, Timestamp(k * 33ms));
    EXPECT_EQ(right->sequence, std::uint32_t(k));
    EXPECT_EQ(left->encoded, nullptr);
    EXPECT_EQ(left->status, k == 0 ? FrameStatus::ok : FrameStatus::corrupted) << k;
    if (k == 0) {
      EXPECT_EQ(yuv_at(right->pixels, 3, 5).y, yuv_at(whole, 19, 5).y);
    }
  }
  EXPECT_FALSE(source.next({}));
}

}  // namespace
}  // namespace huetrack::capture
