#include "color/color_model.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace huetrack::color {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Wrapping, usual, narrow, narrow through 0, as wide as can be, any hue, ending at 360; with all kinds of limits.
const std::vector<HsiRange> colors{
    {340, 20, 0.4, 1, 0.08, 0.9}, {65, 115, 0.3, 1, 0.1, 0.95}, {200, 203, 0.05, 0.6, 0, 1},   {359, 1, 0, 1, 0, 1},
    {30, 330, 0, 1, 0, 1},        {0, 360, 0.3, 0.7, 0.3, 0.6}, {300, 360, 0.2, 0.9, 0.2, 0.8}};

std::vector<ColorTable> tables(capture::PixelFormat format, capture::ColorRange range) {
  std::vector<ColorTable> out;
  for (const HsiRange& color : colors) out.emplace_back(color, format, range);
  return out;
}

// Every raw value there is, against the formula. A mismatch is counted, not reported one by one: there may be millions.
template <typename Pixel, typename Formula>
void expect_every_pixel_as_the_formula(const std::vector<ColorTable>& table, Formula formula) {
  std::vector<int> wrong(colors.size(), 0), matching(colors.size(), 0);
  for (unsigned i = 0; i < 1u << 24; ++i) {
    const Pixel p{static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i >> 8), static_cast<std::uint8_t>(i >> 16)};
    const Hsi hsi = formula(p);
    for (std::size_t c = 0; c < colors.size(); ++c) {
      const bool expected = contains(colors[c], hsi);
      matching[c] += expected ? 1 : 0;
      wrong[c] += table[c].contains(p) != expected ? 1 : 0;
    }
  }
  EXPECT_THAT(wrong, testing::Each(0));
  for (std::size_t c = 0; c < colors.size(); ++c) {
    EXPECT_GT(matching[c], 10'000) << c;
    EXPECT_LT(matching[c], (1 << 24) - 10'000) << c;
  }
}

TEST(ColorTable, everyYuvOfLimitedRangeAsTheFormula) {
  expect_every_pixel_as_the_formula<capture::Yuv>(
      tables(capture::PixelFormat::yuyv, capture::ColorRange::limited),
      [](capture::Yuv p) { return hsi_of(rgb_of(p, capture::ColorRange::limited)); });
}

TEST(ColorTable, everyYuvOfFullRangeAsTheFormula) {
  expect_every_pixel_as_the_formula<capture::Yuv>(
      tables(capture::PixelFormat::i422, capture::ColorRange::full),
      [](capture::Yuv p) { return hsi_of(rgb_of(p, capture::ColorRange::full)); });
}

TEST(ColorTable, everyBgrAsTheFormula) {
  expect_every_pixel_as_the_formula<capture::Bgr>(tables(capture::PixelFormat::bgr, capture::ColorRange::full),
                                                  [](capture::Bgr p) { return hsi_of(rgb_of(p)); });
}

TEST(ColorTable, ceilingsAreTheBrightestMatchOfTheirChroma) {
  for (const ColorTable& table : tables(capture::PixelFormat::yuyv, capture::ColorRange::limited)) {
    ColorTable::LumaCeiling expected;
    for (unsigned uv = 0; uv < 65536; ++uv) {
      for (const unsigned y : {255u, 200u, 128u, 60u, 16u, 0u, unsigned{table.intervals()[uv].y_max}}) {
        const auto u = static_cast<std::uint8_t>(uv), v = static_cast<std::uint8_t>(uv >> 8),
                   luma = static_cast<std::uint8_t>(y);
        if (!table.contains(capture::Yuv{luma, u, v})) continue;
        expected.of_u[u / 4u] = std::max(expected.of_u[u / 4u], luma);
        expected.of_v[v / 4u] = std::max(expected.of_v[v / 4u], luma);
        // Sixteen steps of four, the fourteen in the middle from 100 to 155.
        const auto step = [](unsigned chroma) { return chroma < 100 ? 0u : chroma > 155 ? 15u : (chroma - 96) / 4; };
        expected.near_grey_of_u[step(u)] = std::max(expected.near_grey_of_u[step(u)], luma);
        expected.near_grey_of_v[step(v)] = std::max(expected.near_grey_of_v[step(v)], luma);
      }
    }
    EXPECT_EQ(table.luma_ceiling().of_u, expected.of_u);
    EXPECT_EQ(table.luma_ceiling().of_v, expected.of_v);
    EXPECT_EQ(table.luma_ceiling().near_grey_of_u, expected.near_grey_of_u);
    EXPECT_EQ(table.luma_ceiling().near_grey_of_v, expected.near_grey_of_v);
  }
}

TEST(ColorTable, builtPieceByPieceIsTheSame) {
  for (const HsiRange& color : colors) {
    const ColorTable at_once(color, capture::PixelFormat::nv12, capture::ColorRange::limited);
    ColorTableBuilder builder(color, capture::PixelFormat::nv12, capture::ColorRange::limited);
    int pieces = 0;
    for (; !builder.is_done(); ++pieces) builder.go_on();
    EXPECT_EQ(pieces, 16);
    const auto is_same = [](ColorTable::Interval a, ColorTable::Interval b) {
      return a.y_min == b.y_min && a.y_max == b.y_max;
    };
    EXPECT_TRUE(std::equal(at_once.intervals(), at_once.intervals() + 65536, builder.table()->intervals(), is_same));
    EXPECT_EQ(at_once.luma_ceiling().of_u, builder.table()->luma_ceiling().of_u);
    EXPECT_EQ(at_once.luma_ceiling().of_v, builder.table()->luma_ceiling().of_v);
    EXPECT_EQ(at_once.luma_ceiling().near_grey_of_u, builder.table()->luma_ceiling().near_grey_of_u);
    EXPECT_EQ(at_once.luma_ceiling().near_grey_of_v, builder.table()->luma_ceiling().near_grey_of_v);
  }
  EXPECT_THROW(ColorTableBuilder({10, 20, 0.5, 0.4, 0, 1}, capture::PixelFormat::nv12, capture::ColorRange::limited),
               std::invalid_argument);
}

TEST(ColorTable, readsOnlyImagesOfItsKind) {
  const ColorTable yuv(colors[0], capture::PixelFormat::nv12, capture::ColorRange::limited),
      bgr(colors[0], capture::PixelFormat::bgr, capture::ColorRange::full);
  EXPECT_TRUE(yuv.is_for(capture::PixelFormat::yuyv, capture::ColorRange::limited));
  EXPECT_TRUE(yuv.is_for(capture::PixelFormat::grey, capture::ColorRange::limited));
  EXPECT_FALSE(yuv.is_for(capture::PixelFormat::yuyv, capture::ColorRange::full));
  EXPECT_FALSE(yuv.is_for(capture::PixelFormat::bgr, capture::ColorRange::limited));
  EXPECT_TRUE(bgr.is_for(capture::PixelFormat::bgr, capture::ColorRange::full));
  EXPECT_FALSE(bgr.is_for(capture::PixelFormat::i444, capture::ColorRange::full));
}

TEST(ColorTable, refusesAnInvalidRange) {
  EXPECT_THROW(ColorTable({10, 20, 0.5, 0.4, 0, 1}, capture::PixelFormat::yuyv, capture::ColorRange::limited),
               std::invalid_argument);
}

// Gonzalez and Woods, Digital Image Processing, section 6.2, as printed.
TEST(Hsi, agreesWithTheTextbook) {
  const int steps = 51;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k) {
        const Rgb c{i / static_cast<double>(steps), j / static_cast<double>(steps), k / static_cast<double>(steps)};
        const Hsi hsi = hsi_of(c);
        ASSERT_NEAR(hsi.intensity, (c.r + c.g + c.b) / 3, 1e-12);
        ASSERT_EQ(hsi.has_hue, !(i == j && j == k));
        if (!hsi.has_hue) {
          ASSERT_EQ(hsi.saturation, 0);
          continue;
        }
        ASSERT_NEAR(hsi.saturation, 1 - 3 / (c.r + c.g + c.b) * std::min({c.r, c.g, c.b}), 1e-12);
        const double cosine =
            0.5 * ((c.r - c.g) + (c.r - c.b)) / std::sqrt((c.r - c.g) * (c.r - c.g) + (c.r - c.b) * (c.g - c.b));
        const double theta = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
        ASSERT_NEAR(std::cos((hsi.hue_deg - (c.b <= c.g ? theta : 360 - theta)) * std::numbers::pi / 180), 1, 1e-12);
        ASSERT_GE(hsi.hue_deg, 0);
        ASSERT_LT(hsi.hue_deg, 360);
      }
    }
  }
}

TEST(Hsi, primariesAndSecondaries) {
  EXPECT_DOUBLE_EQ(hsi_of({1, 0, 0}).hue_deg, 0);
  EXPECT_DOUBLE_EQ(hsi_of({1, 1, 0}).hue_deg, 60);
  EXPECT_DOUBLE_EQ(hsi_of({0, 1, 0}).hue_deg, 120);
  EXPECT_DOUBLE_EQ(hsi_of({0, 1, 1}).hue_deg, 180);
  EXPECT_DOUBLE_EQ(hsi_of({0, 0, 1}).hue_deg, 240);
  EXPECT_DOUBLE_EQ(hsi_of({1, 0, 1}).hue_deg, 300);
  EXPECT_DOUBLE_EQ(hsi_of({1, 0, 0}).saturation, 1);
  EXPECT_DOUBLE_EQ(hsi_of({0.5, 0.25, 0.25}).saturation, 0.25);
  EXPECT_FALSE(hsi_of({0, 0, 0}).has_hue);
  EXPECT_FALSE(hsi_of({0.3, 0.3, 0.3}).has_hue);
  EXPECT_LT(hsi_of({1, 0.5, 0.5 + 1e-17}).hue_deg, 360);
}

TEST(Contains, endsAreInside) {
  const HsiRange range{100, 120, 0.3, 0.6, 0.2, 0.7};
  EXPECT_TRUE(contains(range, {100, 0.3, 0.2, true}));
  EXPECT_TRUE(contains(range, {120, 0.6, 0.7, true}));
  EXPECT_FALSE(contains(range, {99.99, 0.5, 0.5, true}));
  EXPECT_FALSE(contains(range, {120.01, 0.5, 0.5, true}));
  EXPECT_FALSE(contains(range, {110, 0.29, 0.5, true}));
  EXPECT_FALSE(contains(range, {110, 0.61, 0.5, true}));
  EXPECT_FALSE(contains(range, {110, 0.5, 0.19, true}));
  EXPECT_FALSE(contains(range, {110, 0.5, 0.71, true}));
}

TEST(Contains, hueIsACircle) {
  const HsiRange through_zero{340, 20, 0, 1, 0, 1}, up_to_360{340, 360, 0, 1, 0, 1}, any{0, 360, 0, 1, 0, 1};
  for (const double in : {340.0, 359.9, 0.0, 20.0}) EXPECT_TRUE(contains(through_zero, {in, 0.5, 0.5, true})) << in;
  for (const double out : {339.9, 20.1, 180.0}) EXPECT_FALSE(contains(through_zero, {out, 0.5, 0.5, true})) << out;
  // Pure red has hue 0, which is 360: a range 340..360 includes it.
  EXPECT_TRUE(contains(up_to_360, hsi_of({0.8, 0.1, 0.1})));
  EXPECT_FALSE(contains(up_to_360, hsi_of({0.8, 0.11, 0.1})));
  EXPECT_TRUE(contains(any, {0, 0, 0.5, false}));
  EXPECT_FALSE(contains(through_zero, {0, 0, 0.5, false}));  // a grey has no hue
}

TEST(HsiRange, problemsNameTheConstraint) {
  EXPECT_THAT(HsiRange{}.problems(), IsEmpty());
  for (const HsiRange& color : colors) EXPECT_THAT(color.problems(), IsEmpty());
  const double nan = std::nan("");
  const auto with = [](double h0, double h1, double s0, double s1, double i0, double i1) {
    return HsiRange{h0, h1, s0, s1, i0, i1}.problems();
  };
  EXPECT_THAT(with(-1, 20, 0, 1, 0, 1), ElementsAre(HasSubstr("hue must lie in 0..360")));
  EXPECT_THAT(with(0, 361, 0, 1, 0, 1), ElementsAre(HasSubstr("hue must lie in 0..360")));
  EXPECT_THAT(with(nan, 20, 0, 1, 0, 1), ElementsAre(HasSubstr("hue must lie in 0..360")));
  EXPECT_THAT(with(10, 311, 0, 1, 0, 1), ElementsAre(HasSubstr("at most 300 degrees")));
  EXPECT_THAT(with(20, 10, 0, 1, 0, 1), ElementsAre(HasSubstr("at most 300 degrees")));
  EXPECT_THAT(with(10, 20, 0.6, 0.5, 0, 1), ElementsAre(HasSubstr("saturation must be a range")));
  EXPECT_THAT(with(10, 20, 0, 1.5, 0, 1), ElementsAre(HasSubstr("saturation must be a range")));
  EXPECT_THAT(with(10, 20, 0, 1, nan, 1), ElementsAre(HasSubstr("intensity must be a range")));
  EXPECT_EQ(with(-1, 20, 0.6, 0.5, 0.9, 0.1).size(), 3u);
}

}  // namespace
}  // namespace huetrack::color
