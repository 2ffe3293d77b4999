#include "color/match_tiles.h"

#include <gmock/gmock.h>

#include "color/color_region.h"
#include "color/color_window.h"
#include "color/random_image.h"

namespace huetrack::color {
namespace {

struct Extent {
  int width, height;
};
const std::vector<Extent> extents{{64, 48}, {66, 50}, {70, 46}, {8, 8}, {4, 2}, {2, 4}, {530, 18}, {56, 10}};

// What is asked of both of them, in any order, gets the same answer.
void expect_same(MatchBits& a, MatchBits& b, Extent size) {
  std::vector<float> u, v;
  for (int y = -3; y < size.height + 3; ++y)
    for (int x = -3; x < size.width + 3; ++x) u.push_back(static_cast<float>(x)), v.push_back(static_cast<float>(y));
  std::vector<std::uint8_t> k_a(u.size()), k_b(u.size());
  a.count_5x5(u.data(), v.data(), u.size(), k_a.data());
  b.count_5x5(u.data(), v.data(), u.size(), k_b.data());
  EXPECT_EQ(k_a, k_b);
  a.look_anew(), b.look_anew();
  for (const int step : {3, 8}) {
    std::vector<PixelAt> at_a, at_b;
    for (const bool is_all : {false, true}) {
      is_all ? a.grid_with_left_out(step, at_a) : a.grid(step, at_a);
      is_all ? b.grid_with_left_out(step, at_b) : b.grid(step, at_b);
      ASSERT_EQ(at_a.size(), at_b.size());
      for (std::size_t i = 0; i < at_a.size(); ++i) EXPECT_TRUE(at_a[i].u == at_b[i].u && at_a[i].v == at_b[i].v) << i;
    }
  }
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) ASSERT_EQ(a.at(x, y), b.at(x, y)) << x << ", " << y;
  for (int y = 0; y < size.height; ++y)
    for (int x = -8; x < size.width; ++x) ASSERT_EQ(a.row(x, y), b.row(x, y)) << x << ", " << y;
  for (int y = 0; y < a.tile_rows(); ++y)
    for (int x = 0; x < a.tile_stride(); ++x) {
      const TileAt tile{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
      ASSERT_EQ(a.tile_with_left_out(tile), b.tile_with_left_out(tile));
    }
  a.look_anew(), b.look_anew();
  RegionFinder finder_a, finder_b;
  const auto found_a = finder_a.components(a, 2, {}, 6, 60, 2);
  const auto& found_b = finder_b.components(b, 2, {}, 6, 60, 2);
  ASSERT_EQ(found_a.size(), found_b.size());
  for (std::size_t i = 0; i < found_a.size(); ++i) {
    EXPECT_EQ(found_a[i].area, found_b[i].area);
    EXPECT_EQ(found_a[i].centre, found_b[i].centre);
    EXPECT_EQ(found_a[i].spread, found_b[i].spread);
  }
  EXPECT_EQ(a.tiles_looked_at(), b.tiles_looked_at());
}

class MatchTiles : public testing::TestWithParam<capture::PixelFormat> {};
INSTANTIATE_TEST_SUITE_P(, MatchTiles, testing::ValuesIn(all_formats),
                         [](const auto& param) { return std::string(capture::name(param.param)); });

TEST_P(MatchTiles, GiveMatchBitsWhatTheImageGives) {
  const ColorTable table(common_color(GetParam()), GetParam(), capture::ColorRange::limited);
  for (const Extent size : extents) {
    MatchBits of_image(size.width, size.height), of_tiles(size.width, size.height);
    for (std::uint64_t frame = 1; frame <= 6; ++frame) {
      SCOPED_TRACE(testing::Message() << size.width << "x" << size.height << " frame " << frame);
      if (frame == 3) {
        const std::vector<PixelBox> boxes{{-3, 2, 5, 4}, {size.width - 2, 0, size.width + 9, size.height}};
        of_image.ignore(boxes), of_tiles.ignore(boxes);
      }
      if (frame == 4 && of_image.tile_rows() > 3) {
        const auto tile = static_cast<std::size_t>(of_image.tile_stride() + 1);
        of_image.leave_out(tile, 0xff00ff), of_tiles.leave_out(tile, 0xff00ff);
      }
      const capture::Image image = random_image(GetParam(), size.width, size.height, frame);
      capture::Matches::OfColor matches;
      match_tiles(image, table, matches.tiles);
      of_image.look_at(image, table);
      // In between one of pixels: nothing of either kind is left over for the other.
      if (frame == 5)
        of_tiles.look_at(image, table);
      else
        of_tiles.look_at(matches);
      expect_same(of_image, of_tiles, size);
    }
  }
}

// Left out while they show their usual values; what stands before them matches.
TEST_P(MatchTiles, PixelsAreLeftOutOnlyWhileTheyShowTheirUsualValues) {
  constexpr int width = 48, height = 40;
  const ColorTable table(common_color(GetParam()), GetParam(), capture::ColorRange::limited);
  const capture::Image usual = random_image(GetParam(), width, height, 1);
  const capture::Image other = random_image(GetParam(), width, height, 2);
  MatchBits bits(width, height), plain(width, height);
  bits.look_at(usual, table);
  std::vector<UsualPixels> values(static_cast<std::size_t>(bits.tile_stride() * bits.tile_rows()));
  for (int tv = 1; tv <= height / 8; ++tv) {
    for (int tu = 1; tu <= width / 8; ++tu) {
      const auto at = static_cast<std::size_t>(tv * bits.tile_stride() + tu);
      for (int k = 0; k < 64; ++k)
        values[at][static_cast<std::size_t>(k)] = bits.values_at(8 * (tu - 1) + k % 8, 8 * (tv - 1) + k / 8);
      bits.leave_out(at, ~std::uint64_t{0}, &values[at]);
    }
  }
  bits.set_light({.gain = 1, .shift = {}, .gate = {6, 6, 6}});
  std::vector<PixelAt> hits;
  bits.look_at(usual, table);
  bits.grid(3, hits);
  EXPECT_TRUE(hits.empty());
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) EXPECT_FALSE(bits.at(u, v)) << u << ", " << v;

  bits.look_at(other, table), plain.look_at(other, table);
  int seen = 0, left_out = 0;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      if (!plain.at(u, v)) continue;
      const auto now = bits.values_at(u, v);
      const auto& was = values[static_cast<std::size_t>((v / 8 + 1) * bits.tile_stride() + u / 8 + 1)]
                              [static_cast<std::size_t>(v % 8 * 8 + u % 8)];
      bool is_usual = true;
      for (std::size_t c = 0; c < 3; ++c) is_usual = is_usual && std::abs(now[c] - was[c]) <= 6;
      EXPECT_EQ(bits.at(u, v), !is_usual) << u << ", " << v;
      ++(is_usual ? left_out : seen);
    }
  }
  EXPECT_GT(seen, 20);
  bits.grid(1, hits);
  EXPECT_EQ(std::ssize(hits), seen);
  // Forgotten with leave_out_nothing().
  bits.leave_out_nothing();
  bits.look_at(usual, table), plain.look_at(usual, table);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) EXPECT_EQ(bits.at(u, v), plain.at(u, v));
}

// Brighter light and another white balance are no change of the scene.
TEST(MatchBits, UsualValuesFollowTheLight) {
  const LightChange light{.gain = 1.25f, .shift = {0, 2, -3}, .gate = {2, 2, 2}};
  const std::array<std::uint8_t, 3> usual{100, 110, 160};
  const auto yuv = expected_values(light, usual, capture::PixelFormat::i420);
  EXPECT_FLOAT_EQ(yuv[0], 125);
  EXPECT_FLOAT_EQ(yuv[1], 107.5f);
  EXPECT_FLOAT_EQ(yuv[2], 165);
  EXPECT_TRUE(shows(light, yuv, {126, 107, 166}));
  EXPECT_FALSE(shows(light, yuv, {100, 110, 160}));
  const auto bgr = expected_values(light, usual, capture::PixelFormat::bgr);
  EXPECT_FLOAT_EQ(bgr[1], 139.5f);
  EXPECT_FLOAT_EQ(bgr[2], 197);
}

TEST(MatchedColor, IsTheRange) {
  const HsiRange range{340, 20, 0.25, 0.9, 0.15, 0.85};
  EXPECT_EQ(range_of(matched_color(range)), range);
  EXPECT_NE(matched_color(range), matched_color(HsiRange{340, 20, 0.25, 0.9, 0.15, 0.86}));
}

}  // namespace
}  // namespace huetrack::color
