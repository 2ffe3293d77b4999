// Everything that reads a compressed image gets the pixels of the whole one, and decodes no more than it needs.
#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "capture/frames/crop.h"
#include "capture/on_demand_copy.h"
#include "color/color_region.h"
#include "color/color_window.h"
#include "color/match_tiles.h"
#include "color/random_image.h"
#include "color/unit_filter.h"

namespace huetrack::color {
namespace {

constexpr int width = 330, height = 150;

class OnDemandBits : public testing::TestWithParam<std::tuple<capture::PixelFormat, bool>> {
 protected:
  using Places = std::vector<std::pair<int, int>>;

  // What `look` makes of the whole image and of one on demand is the same.
  template <typename Look>
  void expect_same(const Look& look) {
    MatchBits whole(width, height), partly(width, height);
    const capture::Image on_demand = capture::on_demand_copy(image_, std::get<1>(GetParam()));
    whole.look_at(image_, table_);
    partly.look_at(on_demand, table_);
    EXPECT_EQ(look(partly), look(whole));
    decoded_ = on_demand.on_demand->decoded_units();
  }

  static Places places(const std::vector<PixelAt>& hits) {
    Places out;
    for (const auto [u, v] : hits) out.emplace_back(u, v);
    return out;
  }

  const capture::PixelFormat format_ = std::get<0>(GetParam());
  const capture::Image image_ = background_image(format_, width, height, 5);
  const ColorTable table_{common_color(format_), format_, capture::ColorRange::limited};
  std::size_t decoded_ = 0;
};
INSTANTIATE_TEST_SUITE_P(, OnDemandBits, testing::Combine(testing::ValuesIn(all_formats), testing::Bool()),
                         [](const auto& param) {
                           return std::string(capture::name(std::get<0>(param.param))) +
                                  (std::get<1>(param.param) ? "_bounds" : "");
                         });

TEST_P(OnDemandBits, OfWindows) {
  expect_same([](MatchBits& bits) {
    const std::vector<float> u{3, 100, 101, 327, 200}, v{2, 60, 61, 147, -40};
    std::vector<std::uint8_t> k(u.size());
    bits.count_5x5(u.data(), v.data(), u.size(), k.data());
    return k;
  });
  EXPECT_LE(decoded_, 10U);
}

TEST_P(OnDemandBits, OfBoxes) {
  expect_same([](MatchBits& bits) {
    std::vector<std::uint64_t> rows;
    for (const PixelBox box : {PixelBox{30, 20, 80, 50}, {-5, 120, 20, 200}, {300, 140, 329, 149}}) {
      bits.look(box);
      for (int v = std::max(0, box.v_min); v <= std::min(box.v_max, height - 1); ++v)
        rows.push_back(bits.row(std::max(0, box.u_min), v));
    }
    return rows;
  });
  EXPECT_LE(decoded_, 40U);
}

// Boxes of more than a twenty-fifth of the image: by the bounds of their units.
TEST_P(OnDemandBits, OfLargeBoxes) {
  for (const PixelBox box : {PixelBox{-9, -9, 400, 200}, {101, 33, 303, 148}, {0, 75, 330, 91}}) {
    expect_same([box](MatchBits& bits) {
      bits.look(box);
      std::vector<std::uint64_t> rows;
      for (int v = std::max(0, box.v_min); v <= std::min(box.v_max, height - 1); ++v)
        for (int u = std::max(0, box.u_min); u < std::min(box.u_max, width); u += 57) rows.push_back(bits.row(u, v));
      return rows;
    });
  }
}

TEST_P(OnDemandBits, OfSinglePixelsAndTiles) {
  expect_same([](MatchBits& bits) {
    std::vector<std::uint64_t> out;
    for (int i = 0; i < 140; i += 7) out.push_back(bits.at(2 * i, i) ? 1 : 0);
    out.push_back(bits.tile_with_left_out({42, 19}));
    out.push_back(bits.tile_with_left_out({10, 3}));
    return out;
  });
}

TEST_P(OnDemandBits, OfGrids) {
  for (const int step : {1, 3, 8, 20, 45}) {
    expect_same([step](MatchBits& bits) {
      std::vector<PixelAt> hits;
      bits.grid(step, hits);
      return places(hits);
    });
  }
  EXPECT_LE(decoded_, 7U * 4);  // of the last step; one row of units has its points below the image
}

TEST_P(OnDemandBits, OfRegions) {
  expect_same([](MatchBits& bits) {
    RegionFinder finder;
    std::vector<double> out;
    for (const ColorRegion& r : finder.components(bits, 2, {}, 6, 60, 2))
      out.insert(out.end(), {r.centre.x(), r.centre.y(), double(r.area)});
    for (const ColorRegion& r : finder.search(bits, 3, 20, 2, 4))
      out.insert(out.end(), {r.centre.x(), r.centre.y(), double(r.area)});
    return out;
  });
}

TEST_P(OnDemandBits, OfAllTiles) {
  std::vector<std::uint64_t> whole, partly;
  match_tiles(image_, table_, whole);
  match_tiles(capture::on_demand_copy(image_, std::get<1>(GetParam())), table_, partly);
  EXPECT_EQ(partly, whole);
}

TEST_P(OnDemandBits, OfACrop) {
  const capture::Crop crop{10, 6, 300, 130};
  const capture::Image whole = capture::cropped(image_, crop);
  const capture::Image partly = capture::cropped(capture::on_demand_copy(image_, std::get<1>(GetParam())), crop);
  std::vector<std::uint64_t> tiles, expected_tiles;
  match_tiles(whole, table_, expected_tiles);
  match_tiles(partly, table_, tiles);
  EXPECT_EQ(tiles, expected_tiles);
  MatchBits bits(crop.width, crop.height), expected_bits(crop.width, crop.height);
  for (const int step : {3, 20}) {
    std::vector<PixelAt> hits, expected;
    expected_bits.look_at(whole, table_);
    expected_bits.grid(step, expected);
    const capture::Image anew = capture::cropped(capture::on_demand_copy(image_, std::get<1>(GetParam())), crop);
    bits.look_at(anew, table_);
    bits.grid(step, hits);
    EXPECT_EQ(places(hits), places(expected)) << step;
  }
}

// One coloured spot on grey: nothing else is decoded.
TEST(UnitFilter, LeavesOutWhatCannotMatch) {
  constexpr auto format = capture::PixelFormat::i420;
  capture::WritableImage made = capture::make_image(format, capture::ColorRange::full, 640, 480);
  std::fill_n(made.data[0], 640 * 480, 100);
  std::fill_n(made.data[1], 2 * 320 * 240, 128);
  for (int v = 100; v < 103; ++v)
    for (int u = 146; u < 149; ++u) made.data[1][v * 320 + u] = 60, made.data[2][v * 320 + u] = 110;
  const ColorTable table({60, 180, 0.3, 1, 0.05, 0.95}, format, capture::ColorRange::full);
  const capture::Image image = capture::on_demand_copy(made.image, true);
  MatchBits bits(640, 480);
  bits.look_at(image, table);
  std::vector<PixelAt> hits;
  bits.grid(2, hits);
  EXPECT_EQ(hits.size(), 9U);
  EXPECT_EQ(image.on_demand->decoded_units(), 1U);
  const capture::Image again = capture::on_demand_copy(made.image, true);
  bits.look_at(again, table);
  bits.look({200, 150, 500, 350});
  EXPECT_NE(bits.row(290, 202), 0U);
  EXPECT_EQ(again.on_demand->decoded_units(), 1U);
}

}  // namespace
}  // namespace huetrack::color
