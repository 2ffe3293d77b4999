#include "color/color_region.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "color/mask_image.h"

namespace huetrack::color {
namespace {

struct Mask {
  int width, height;
  std::vector<char> at;
  bool operator()(int u, int v) const { return at[static_cast<std::size_t>(v * width + u)] != 0; }
};

Mask random_mask(int width, int height, double density, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  Mask m{width, height, std::vector<char>(static_cast<std::size_t>(width * height))};
  for (char& c : m.at) c = static_cast<double>(rng() >> 11) * 0x1p-53 < density ? 1 : 0;
  return m;
}

struct Flooded {
  std::vector<PixelAt> pixels;
  ColorRegion region() const {
    ColorRegion r;
    r.area = static_cast<int>(pixels.size());
    r.centre = Eigen::Vector2d::Zero();
    for (const PixelAt& p : pixels) r.centre += Eigen::Vector2d(p.u, p.v) / r.area;
    r.spread = Eigen::Matrix2d::Identity() / 12;
    for (const PixelAt& p : pixels) {
      const Eigen::Vector2d d = Eigen::Vector2d(p.u, p.v) - r.centre;
      r.spread += d * d.transpose() / r.area;
    }
    return r;
  }
};

// The obvious way: 8-connected flood fill from every pixel that is still dry.
std::vector<ColorRegion> flood_fill(const Mask& mask, const PixelBox& box) {
  std::vector<char> wet(mask.at.size(), 0);
  const auto dry = [&](int u, int v) {
    return u >= std::max(0, box.u_min) && v >= std::max(0, box.v_min) && u <= std::min(box.u_max, mask.width - 1) &&
           v <= std::min(box.v_max, mask.height - 1) && mask(u, v) &&
           wet[static_cast<std::size_t>(v * mask.width + u)] == 0;
  };
  std::vector<ColorRegion> out;
  for (int v = 0; v < mask.height; ++v) {
    for (int u = 0; u < mask.width; ++u) {
      if (!dry(u, v)) continue;
      Flooded f;
      const auto pour = [&](int x, int y) {
        wet[static_cast<std::size_t>(y * mask.width + x)] = 1;
        f.pixels.push_back({x, y});
      };
      pour(u, v);
      for (std::size_t i = 0; i < f.pixels.size(); ++i) {
        const PixelAt p = f.pixels[i];
        for (int dv = -1; dv <= 1; ++dv) {
          for (int du = -1; du <= 1; ++du) {
            if (dry(p.u + du, p.v + dv)) pour(p.u + du, p.v + dv);
          }
        }
      }
      out.push_back(f.region());
    }
  }
  return out;
}

// In an order that both share: by place, since equal areas have none.
void expect_same_regions(std::vector<ColorRegion> got, std::vector<ColorRegion> expected) {
  EXPECT_TRUE(std::ranges::is_sorted(got, std::ranges::greater{}, &ColorRegion::area));
  const auto by_place = [](const ColorRegion& a, const ColorRegion& b) {
    return std::tuple(a.area, std::round(1e6 * a.centre.y()), std::round(1e6 * a.centre.x())) <
           std::tuple(b.area, std::round(1e6 * b.centre.y()), std::round(1e6 * b.centre.x()));
  };
  std::ranges::sort(got, by_place), std::ranges::sort(expected, by_place);
  ASSERT_EQ(got.size(), expected.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    ASSERT_EQ(got[i].area, expected[i].area);
    ASSERT_LT((got[i].centre - expected[i].centre).norm(), 1e-9);
    ASSERT_LT((got[i].spread - expected[i].spread).norm(), 1e-6 * expected[i].spread.norm());
  }
}

struct View {
  capture::Image image;
  MatchBits bits;
  explicit View(const Mask& mask) : image(mask_image(mask.width, mask.height, mask)), bits(mask.width, mask.height) {
    bits.look_at(image, mask_table());
  }
};

constexpr double no_reach = 1e-9;

TEST(RegionFinder, findsTheRegionsOfAFloodFill) {
  RegionFinder finder;
  std::uint64_t seed = 0;
  for (const auto& [width, height] : {std::pair{64, 48}, {130, 70}, {57, 9}, {9, 57}, {1, 1}, {3, 200}}) {
    for (const double density : {0.05, 0.2, 0.35, 0.5, 0.9, 1.0}) {
      const Mask mask = random_mask(width, height, density, ++seed);
      View view(mask);
      const PixelBox all{0, 0, width - 1, height - 1}, beyond{-50, -50, 500, 500}, part{3, 2, 60, 20};
      for (const PixelBox& box : {all, beyond, part}) {
        auto expected = flood_fill(mask, box);
        // Rings and dots with one centre are one region by the rule of the reach, however small.
        const auto same_centre = [&](const ColorRegion& a) {
          return std::ranges::count_if(expected,
                                       [&](const ColorRegion& b) { return (a.centre - b.centre).norm() < 1e-6; }) > 1;
        };
        if (std::ranges::any_of(expected, same_centre)) continue;
        SCOPED_TRACE(testing::Message() << width << "x" << height << " density " << density);
        expect_same_regions(finder.find(view.bits, box, 1, no_reach), expected);
        std::erase_if(expected, [](const ColorRegion& r) { return r.area < 6; });
        expect_same_regions(finder.find(view.bits, box, 6, no_reach), expected);
      }
    }
  }
}

TEST(RegionFinder, emptyBoxAndEmptyImage) {
  RegionFinder finder;
  View full(random_mask(40, 40, 1, 1));
  EXPECT_TRUE(finder.find(full.bits, {10, 10, 9, 20}, 1, 0).empty());
  EXPECT_TRUE(finder.find(full.bits, {50, 50, 60, 60}, 1, 0).empty());
  EXPECT_TRUE(finder.find(full.bits, {-9, -9, -1, -1}, 1, 0).empty());
  View empty(random_mask(40, 40, 0, 1));
  EXPECT_TRUE(finder.find(empty.bits, {0, 0, 39, 39}, 1, 0).empty());
}

Mask draw(int width, int height, const std::function<bool(int, int)>& inside) {
  Mask m{width, height, std::vector<char>(static_cast<std::size_t>(width * height))};
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) m.at[static_cast<std::size_t>(v * width + u)] = inside(u, v) ? 1 : 0;
  }
  return m;
}

bool in_disc(int u, int v, double cu, double cv, double r) {
  return std::hypot(u - cu, v - cv) <= r;
}

TEST(RegionFinder, poleBeforeABallDoesNotCutItInTwo) {
  RegionFinder finder;
  View view(draw(80, 60, [](int u, int v) { return in_disc(u, v, 40, 30, 10) && (u < 38 || u > 41); }));
  const auto& apart = finder.find(view.bits, {0, 0, 79, 59}, 5, no_reach);
  EXPECT_EQ(apart.size(), 2u);
  const auto& whole = finder.find(view.bits, {0, 0, 79, 59}, 5, 13);
  ASSERT_EQ(whole.size(), 1u);
  EXPECT_NEAR(whole[0].centre.x(), 40, 0.6);
  EXPECT_NEAR(whole[0].centre.y(), 30, 1e-9);
  EXPECT_GT(whole[0].area, 220);
}

TEST(HullOf, isTheDiscWhateverItsStripesLeaveOut) {
  for (const double r : {1.0, 4.3, 9.0, 25.4}) {
    int disc = 0;
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (int v = 0; v < 80; ++v) {
      for (int u = 0; u < 80; ++u) {
        if (!in_disc(u, v, 40.2, 38.9, r)) continue;
        ++disc;
        spread += (Eigen::Vector2d(u, v) - Eigen::Vector2d(40.2, 38.9)) *
                  (Eigen::Vector2d(u, v) - Eigen::Vector2d(40.2, 38.9)).transpose();
      }
    }
    spread /= disc;
    View whole(draw(80, 80, [&](int u, int v) { return in_disc(u, v, 40.2, 38.9, r); }));
    const ConvexHull hull = hull_of(whole.bits, {0, 0, 79, 79});
    EXPECT_EQ(hull.area, disc) << r;
    if (r > 4) {
      EXPECT_LT((hull.spread - spread).norm(), 0.12 * spread.norm()) << r;
    }
    View striped(draw(80, 80, [&](int u, int v) { return in_disc(u, v, 40.2, 38.9, r) && v % 3 != 0; }));
    if (r > 4) {
      EXPECT_NEAR(hull_of(striped.bits, {0, 0, 79, 79}).area, disc, 0.07 * disc) << r;
    }
  }
}

TEST(HullOf, lineAndNothing) {
  View line(draw(80, 60, [](int u, int v) { return v == 20 && u >= 5 && u <= 70; }));
  const ConvexHull hull = hull_of(line.bits, {0, 0, 79, 59});
  EXPECT_EQ(hull.area, 66);
  EXPECT_EQ(hull.spread, Eigen::Matrix2d::Zero().eval());
  EXPECT_EQ(hull_of(line.bits, {30, 10, 30, 40}).area, 1);
  EXPECT_EQ(hull_of(line.bits, {0, 30, 79, 59}).area, 0);
  EXPECT_EQ(hull_of(line.bits, {90, 0, 99, 9}).area, 0);
}

// Two objects further apart than the reach stay two, and a chain of pieces does not pull them together.
TEST(RegionFinder, reachIsFromTheLargestPart) {
  RegionFinder finder;
  View view(draw(100, 40, [](int u, int v) {
    return in_disc(u, v, 20, 20, 6) || in_disc(u, v, 29, 20, 2) || in_disc(u, v, 37, 20, 2) || in_disc(u, v, 70, 20, 5);
  }));
  const auto& regions = finder.find(view.bits, {0, 0, 99, 39}, 5, 10);
  ASSERT_EQ(regions.size(), 3u);
  EXPECT_NEAR(regions[0].centre.x(), 21, 1.1);
  EXPECT_NEAR(regions[1].centre.x(), 70, 1e-9);
  EXPECT_NEAR(regions[2].centre.x(), 37, 1e-9);
}

TEST(RegionFinder, boxCutsRegions) {
  RegionFinder finder;
  View view(draw(60, 60, [](int u, int v) { return in_disc(u, v, 30, 30, 10); }));
  const auto& half = finder.find(view.bits, {30, 0, 59, 59}, 1, 0);
  ASSERT_EQ(half.size(), 1u);
  EXPECT_NEAR(half[0].centre.x(), 30 + 4 * 10 / (3 * 3.14159), 0.3);
}

TEST(RegionFinder, searchFindsWhatAGridPointHits) {
  RegionFinder finder;
  const Mask mask = draw(320, 240, [](int u, int v) {
    return in_disc(u, v, 60, 50, 6) || in_disc(u, v, 250, 200, 4) || in_disc(u, v, 318, 120, 5) ||
           (u > 150 && u < 220 && v < 60) || (u == 101 && v == 121);
  });
  View view(mask);
  const auto& regions = finder.search(view.bits, 4, 30, 4, no_reach);
  ASSERT_EQ(regions.size(), 3u);  // not the wide rectangle, not the lone pixel
  EXPECT_LT((regions[0].centre - Eigen::Vector2d(60, 50)).norm(), 1e-9);
  EXPECT_LT((regions[1].centre - Eigen::Vector2d(317, 120)).norm(), 1);
  EXPECT_LT((regions[2].centre - Eigen::Vector2d(250, 200)).norm(), 1e-9);
  EXPECT_LT(view.bits.tiles_looked_at(), 40u * 30u / 2);
}

// A grid point belongs to the region that has it, not to a larger one that reaches around it.
TEST(RegionFinder, searchFindsABallInsideAFrame) {
  RegionFinder finder;
  View view(draw(160, 160, [](int u, int v) {
    const int d = std::max(std::abs(u - 80), std::abs(v - 80));
    return in_disc(u, v, 80, 80, 6) || (d >= 16 && d <= 18 && u < 90);
  }));
  const auto& regions = finder.search(view.bits, 160, 30, 4, no_reach);  // the one grid point is (80, 80)
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_LT((regions[0].centre - Eigen::Vector2d(80, 80)).norm(), 1e-9);
}

TEST(RegionFinder, searchInFieldsOfColorEnds) {
  RegionFinder finder;
  View full(random_mask(640, 480, 1, 1));
  EXPECT_TRUE(finder.search(full.bits, 2, 20, 4, no_reach).empty());
  View noise(random_mask(640, 480, 0.3, 1));
  EXPECT_LE(finder.search(noise.bits, 2, 20, 1, no_reach).size(), 200u);
}

}  // namespace
}  // namespace huetrack::color
