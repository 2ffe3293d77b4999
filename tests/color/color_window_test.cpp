#include "color/color_window.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "color/mask_image.h"
#include "color/random_image.h"

namespace huetrack::color {
namespace {

struct Size {
  int width, height;
};
// Multiples of the tile and not; narrower than a tile, than a window, than a word.
const std::vector<Size> sizes{{64, 48}, {66, 50}, {70, 46}, {8, 8}, {4, 2}, {2, 4}, {130, 18}, {56, 10}};

struct Windows {
  std::vector<float> u, v;
  void add(double at_u, double at_v) { u.push_back(static_cast<float>(at_u)), v.push_back(static_cast<float>(at_v)); }
};

// What eq. (6) asks for: the pixel that (u, v) rounds to, halves upwards; the test's own arithmetic, in double.
int expected_count(const capture::Image& image, const ColorTable& table, float u, float v) {
  const double ru = std::floor(static_cast<double>(u) + 0.5), rv = std::floor(static_cast<double>(v) + 0.5);
  if (!(ru >= 0 && rv >= 0 && ru < image.width && rv < image.height)) return MatchBits::outside;
  return count_5x5_reference(image, table, static_cast<int>(ru), static_cast<int>(rv));
}

std::vector<int> counts(MatchBits& bits, const Windows& w) {
  std::vector<std::uint8_t> k(w.u.size() + 1, 201);
  bits.count_5x5(w.u.data(), w.v.data(), w.u.size(), k.data());
  EXPECT_EQ(k.back(), 201);
  return {k.begin(), k.end() - 1};
}

std::vector<int> expected_counts(const capture::Image& image, const ColorTable& table, const Windows& w) {
  std::vector<int> out;
  for (std::size_t i = 0; i < w.u.size(); ++i) out.push_back(expected_count(image, table, w.u[i], w.v[i]));
  return out;
}

// The middle of every pixel, and of those around the image.
Windows every_pixel(Size size) {
  Windows w;
  for (int v = -4; v < size.height + 4; ++v) {
    for (int u = -4; u < size.width + 4; ++u) w.add(u, v);
  }
  return w;
}

Windows strewn(Size size, int n, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  const auto uniform = [&](double from, double to) {
    return from + (to - from) * static_cast<double>(rng() >> 11) * 0x1p-53;
  };
  Windows w;
  for (int i = 0; i < n; ++i) w.add(uniform(-6, size.width + 6), uniform(-6, size.height + 6));
  return w;
}

// Every format, with each kind of inner loops.
enum class Vectors { portable, avx2, avx512 };
constexpr std::array suffixes{"", "_avx2", "_avx512"};  // of a test's name

const WindowKernels* kernels_of(Vectors vectors) {
  if (vectors == Vectors::portable) return &portable_window_kernels();
  return vectors == Vectors::avx2 ? avx2_window_kernels() : avx512_window_kernels();
}

class EveryFormat : public testing::TestWithParam<std::tuple<capture::PixelFormat, Vectors>> {
 protected:
  void SetUp() override {
    if (kernels == nullptr) GTEST_SKIP() << "this machine or this build has no such vectors";
  }
  const capture::PixelFormat format = std::get<0>(GetParam());
  const WindowKernels* const kernels = kernels_of(std::get<1>(GetParam()));
  const ColorTable table{common_color(format), format, capture::ColorRange::limited};
};
INSTANTIATE_TEST_SUITE_P(, EveryFormat,
                         testing::Combine(testing::ValuesIn(all_formats),
                                          testing::Values(Vectors::portable, Vectors::avx2, Vectors::avx512)),
                         [](const auto& param) {
                           return std::string(capture::name(std::get<0>(param.param))) +
                                  suffixes[static_cast<std::size_t>(std::get<1>(param.param))];
                         });

TEST_P(EveryFormat, referenceCountsPixelByPixel) {
  const capture::Image image = random_image(format, 20, 20, 1);
  for (const auto& [u, v] : {std::pair{0, 0}, {2, 2}, {10, 9}, {19, 19}, {18, 1}}) {
    int k = 0;
    for (int y = v - 2; y <= v + 2; ++y) {
      for (int x = u - 2; x <= u + 2; ++x)
        k += x >= 0 && x < 20 && y >= 0 && y < 20 && matches_at(image, table, x, y) ? 1 : 0;
    }
    EXPECT_EQ(count_5x5_reference(image, table, u, v), k);
  }
}

TEST_P(EveryFormat, everyWindowAsTheReference) {
  for (const Size size : sizes) {
    MatchBits bits(size.width, size.height, *kernels);
    const Windows w = every_pixel(size);
    for (std::uint64_t frame = 1; frame <= 3; ++frame) {  // nothing is left over from the frame before
      const capture::Image image = random_image(format, size.width, size.height, frame);
      bits.look_at(image, table);
      const std::vector<int> expected = expected_counts(image, table, w);
      EXPECT_EQ(counts(bits, w), expected) << size.width << "x" << size.height << " frame " << frame;
      EXPECT_EQ(counts(bits, w), expected) << "again, now that all tiles are known";
      if (size.width > 40) {
        EXPECT_GT(std::ranges::count_if(expected, [](int k) { return k > 0 && k < 25; }), 100);
      }
    }
  }
}

TEST_P(EveryFormat, anyNumberOfStrewnWindowsAsTheReference) {
  const Size size{70, 46};
  MatchBits bits(size.width, size.height, *kernels);
  for (int n = 0; n < 70; ++n) {
    const capture::Image image = random_image(format, size.width, size.height, static_cast<std::uint64_t>(n));
    bits.look_at(image, table);
    const Windows w = strewn(size, n, static_cast<std::uint64_t>(n));
    ASSERT_EQ(counts(bits, w), expected_counts(image, table, w)) << n;
  }
  const capture::Image image = random_image(format, size.width, size.height, 99);
  bits.look_at(image, table);
  const Windows w = strewn(size, 5000, 99);
  ASSERT_EQ(counts(bits, w), expected_counts(image, table, w));
}

TEST_P(EveryFormat, fewPixelsOfTheColourInABackground) {
  const HsiRange lime{65, 115, 0.3, 1, 0.1, 0.95};
  const ColorTable narrow(
      format == capture::PixelFormat::grey || format == capture::PixelFormat::bgr ? common_color(format) : lime, format,
      capture::ColorRange::limited);
  const Size size{120, 70};
  MatchBits bits(size.width, size.height, *kernels);
  for (std::uint64_t frame = 1; frame <= 5; ++frame) {
    const capture::Image image = background_image(format, size.width, size.height, frame);
    bits.look_at(image, narrow);
    const Windows w = every_pixel(size);
    const std::vector<int> expected = expected_counts(image, narrow, w);
    ASSERT_EQ(counts(bits, w), expected) << frame;
    EXPECT_GT(std::ranges::count(expected, 0), 1000);
    EXPECT_GT(std::ranges::count_if(expected, [](int k) { return k > 0 && k <= 25; }), 50);
  }
}

TEST_P(EveryFormat, rowsAndPixelsAsTheImage) {
  for (const Size size : sizes) {
    const capture::Image image = random_image(format, size.width, size.height, 7);
    MatchBits bits(size.width, size.height, *kernels);
    bits.look_at(image, table);
    bits.look({-100, -100, 1000, 1000});  // clipped
    for (int v = 0; v < size.height; ++v) {
      for (int u = -MatchBits::margin; u < size.width; ++u) {
        const std::uint64_t row = bits.row(u, v);
        for (int i = 0; i < 57; ++i) {
          const bool in = u + i >= 0 && u + i < size.width;
          ASSERT_EQ(row >> i & 1, in && matches_at(image, table, u + i, v) ? 1u : 0u) << u << " + " << i << ", " << v;
        }
      }
    }
    MatchBits fresh(size.width, size.height, *kernels);
    fresh.look_at(image, table);
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) ASSERT_EQ(fresh.at(u, v), matches_at(image, table, u, v)) << u << ", " << v;
    }
  }
}

TEST_P(EveryFormat, gridAsTheImage) {
  for (const Size size : sizes) {
    const capture::Image image = random_image(format, size.width, size.height, 8);
    MatchBits bits(size.width, size.height, *kernels);
    bits.look_at(image, table);
    for (const int step : {1, 2, 3, 7, 200}) {
      std::vector<PixelAt> hits{{-1, -1}};
      bits.grid(step, hits);
      std::vector<std::pair<int, int>> got, expected;
      for (const PixelAt& p : hits) got.emplace_back(p.u, p.v);
      for (int v = step / 2; v < size.height; v += step) {
        for (int u = step / 2; u < size.width; u += step) {
          if (matches_at(image, table, u, v)) expected.emplace_back(u, v);
        }
      }
      EXPECT_EQ(got, expected) << step;
    }
  }
}

TEST(MatchBits, imagesWithPaddedRows) {
  const ColorTable table(common_color(capture::PixelFormat::i420), capture::PixelFormat::i420,
                         capture::ColorRange::limited);
  const capture::Image wide = random_image(capture::PixelFormat::i420, 96, 32, 1);
  capture::Image left = wide;  // the left part of it: rows are longer than pixels
  left.width = 42;
  MatchBits bits(42, 32);
  bits.look_at(left, table);
  const Windows w = every_pixel({42, 32});
  EXPECT_EQ(counts(bits, w), expected_counts(left, table, w));
}

TEST(MatchBits, coordinatesThatAreNoPixel) {
  const ColorTable table(common_color(capture::PixelFormat::yuyv), capture::PixelFormat::yuyv,
                         capture::ColorRange::limited);
  const capture::Image image = random_image(capture::PixelFormat::yuyv, 40, 30, 1);
  MatchBits bits(40, 30);
  bits.look_at(image, table);
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<double, double>> outside{
      {nan, 5}, {5, nan},   {inf, 5},   {-inf, 5}, {5, inf},  {5, -inf}, {-1e9, -1e9}, {1e30, 5},        {-1, 5},
      {5, -1},  {-0.51, 5}, {5, -0.51}, {39.5, 5}, {5, 29.5}, {40, 5},   {5, 30},      {2147483648., 1}, {3e9, 3e9}};
  Windows w;
  for (const auto& [u, v] : outside) w.add(u, v), w.add(20, 15);  // between windows that are inside
  const std::vector<int> k = counts(bits, w);
  for (std::size_t i = 0; i < outside.size(); ++i) {
    EXPECT_EQ(k[2 * i], MatchBits::outside) << outside[i].first << ", " << outside[i].second;
    EXPECT_EQ(k[2 * i + 1], count_5x5_reference(image, table, 20, 15));
  }
  Windows border;
  border.add(-0.5, -0.5), border.add(39.49, 29.49), border.add(-0.49, 29.4);
  EXPECT_EQ(counts(bits, border),
            (std::vector<int>{count_5x5_reference(image, table, 0, 0), count_5x5_reference(image, table, 39, 29),
                              count_5x5_reference(image, table, 0, 29)}));
}

// The point of it all: the cost follows the windows, not the image.
TEST(MatchBits, looksOnlyWhereAWindowIs) {
  const ColorTable table(common_color(capture::PixelFormat::nv12), capture::PixelFormat::nv12,
                         capture::ColorRange::limited);
  const capture::Image image = random_image(capture::PixelFormat::nv12, 1920, 1080, 1);
  MatchBits bits(1920, 1080);
  bits.look_at(image, table);
  EXPECT_EQ(bits.tiles_looked_at(), 0u);
  Windows one;
  one.add(1000.2, 500.4);
  counts(bits, one);
  EXPECT_LE(bits.tiles_looked_at(), 4u);
  Windows cloud;
  for (int i = 0; i < 2000; ++i) cloud.add(1000 + i % 40, 500 + i % 37);
  counts(bits, cloud);
  const std::uint64_t once = bits.tiles_looked_at();
  EXPECT_LE(once, 49u);  // 44 x 41 pixels touch at most 7 x 7 tiles
  EXPECT_GE(once, 25u);
  counts(bits, cloud);
  EXPECT_EQ(bits.tiles_looked_at(), once);  // known
  Windows beside;
  beside.add(-5, 4), beside.add(3000, 4);
  counts(bits, beside);
  EXPECT_EQ(bits.tiles_looked_at(), once);
  bits.look({1000, 500, 1007, 507});
  EXPECT_EQ(bits.tiles_looked_at(), once);
  bits.look_at(image, table);
  counts(bits, cloud);
  EXPECT_GE(bits.tiles_looked_at(), once + 25);  // a new frame is looked at anew
}

TEST(MatchBits, ignoredBoxesMatchNothing) {
  const capture::PixelFormat format = capture::PixelFormat::yuyv;
  const capture::Image image = random_image(format, 66, 50, 5);
  const ColorTable table(common_color(format), format, image.range);
  const std::vector<PixelBox> boxes{{3, 5, 20, 9}, {40, 30, 400, 41}, {-9, -9, 0, 0}};
  const auto is_ignored = [&](int u, int v) {
    return std::ranges::any_of(
        boxes, [&](const PixelBox& b) { return u >= b.u_min && u <= b.u_max && v >= b.v_min && v <= b.v_max; });
  };
  MatchBits bits(66, 50);
  bits.ignore(boxes);
  bits.look_at(image, table);
  for (int v = 0; v < 50; ++v)
    for (int u = 0; u < 66; ++u)
      ASSERT_EQ(bits.at(u, v), matches_at(image, table, u, v) && !is_ignored(u, v)) << u << ", " << v;
  std::vector<PixelAt> hits;
  bits.grid(3, hits);
  EXPECT_FALSE(hits.empty());
  for (const PixelAt& p : hits) EXPECT_FALSE(is_ignored(p.u, p.v));
  bits.ignore({});
  bits.look_at(image, table);
  std::size_t inside = 0;
  for (int v = 5; v <= 9; ++v)
    for (int u = 3; u <= 20; ++u) inside += bits.at(u, v) ? 1 : 0;
  EXPECT_GT(inside, 0u);
}

TEST(MatchBits, RowsThatWereNotClassifiedAreEmpty) {
  const ColorTable any({0, 360, 0, 1, 0, 1}, capture::PixelFormat::grey, capture::ColorRange::limited);
  const capture::Image image = random_image(capture::PixelFormat::grey, 64, 64, 1);
  MatchBits bits(64, 64);
  bits.look_at(image, any);
  EXPECT_EQ(bits.row(0, 20), 0u);
  bits.look({16, 16, 23, 23});
  EXPECT_EQ(bits.row(0, 20), 0xff0000u);
  EXPECT_EQ(bits.row(0, 24), 0u);
  bits.look_at(image, any);
  EXPECT_EQ(bits.row(0, 20), 0u);
  bits.look({5, 5, 4, 8});  // empty
  EXPECT_EQ(bits.tiles_looked_at(), 1u);
}

// One pixel that matches is reported wherever its tile is among those that a row reads, and nowhere else; nor of the
// picture before.
TEST(MatchBits, ReportsWhereNoRowHasAMatch) {
  constexpr int width = 150, height = 70;
  for (const auto& [match_u, match_v] : {std::pair{0, 0}, {77, 31}, {149, 69}}) {
    const capture::Image image =
        mask_image(width, height, [&, u = match_u, v = match_v](int at_u, int at_v) { return at_u == u && at_v == v; });
    const capture::Image empty = mask_image(width, height, [](int, int) { return false; });
    MatchBits bits(width, height);
    bits.look_at(image, mask_table());
    EXPECT_FALSE(bits.has_any(std::max(0, match_u - 8), match_v)) << "not looked at yet";
    bits.look({0, 0, width - 1, height - 1});
    for (int v = 0; v < height; ++v) {
      for (int u = -MatchBits::margin; u < width; ++u) {
        const int first_tile = (u + MatchBits::margin) / 8, tile = (match_u + MatchBits::margin) / 8;
        const bool is_among = v / 8 == match_v / 8 && tile >= first_tile && tile < first_tile + 8;
        ASSERT_EQ(bits.has_any(u, v), is_among) << u << ", " << v;
        if (!is_among) {
          ASSERT_EQ(bits.row(u, v), 0u) << u << ", " << v;
        }
      }
    }
    bits.look_at(empty, mask_table());
    bits.look({0, 0, width - 1, height - 1});
    EXPECT_FALSE(bits.has_any(std::max(0, match_u - 8), match_v));
  }
}

}  // namespace
}  // namespace huetrack::color
