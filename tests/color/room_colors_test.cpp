#include "color/room_colors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "capture/frames/pixel_format.h"

namespace huetrack::color {
namespace {

constexpr int room_width = 320, room_height = 240;
const HsiRange orange_range{.hue_min_deg = 10,
                            .hue_max_deg = 50,
                            .saturation_min = 0.3,
                            .saturation_max = 1,
                            .intensity_min = 0.15,
                            .intensity_max = 0.9};
constexpr capture::Bgr wood{45, 90, 140}, vivid{20, 130, 240}, wall{120, 120, 120};

// Wood below the middle, a grey wall above it, and discs of another colour, lit from the left. All with noise of 2 grey
// values.
struct WoodenRoom {
  capture::Image image;
  explicit WoodenRoom(std::vector<Disc> discs, capture::Bgr of_discs = vivid, bool is_shaded = true) {
    std::mt19937_64 rng(1);
    const auto noise = [&] { return int(rng() % 7) - 3; };
    capture::WritableImage out =
        capture::make_image(capture::PixelFormat::bgr, capture::ColorRange::full, room_width, room_height);
    for (int v = 0; v < room_height; ++v) {
      for (int u = 0; u < room_width; ++u) {
        capture::Bgr p = v > room_height / 2 ? wood : wall;
        for (const Disc& d : discs) {
          const Eigen::Vector2d at = (Eigen::Vector2d(u, v) - d.px) / d.radius_px;
          if (at.norm() > 1) continue;
          const double light = is_shaded ? 0.85 - 0.15 * at.x() - 0.1 * at.y() : 1;
          p = {std::uint8_t(light * of_discs.b), std::uint8_t(light * of_discs.g), std::uint8_t(light * of_discs.r)};
        }
        std::uint8_t* const to = out.data[0] + v * out.image.planes[0].stride + 3 * u;
        to[0] = std::uint8_t(p.b + noise()), to[1] = std::uint8_t(p.g + noise()), to[2] = std::uint8_t(p.r + noise());
      }
    }
    image = out.image;
  }
};

const ColorTable& orange_table() {
  static const ColorTable table(orange_range, capture::PixelFormat::bgr, capture::ColorRange::full);
  return table;
}

struct Finder {
  MatchBits view{room_width, room_height};
  std::shared_ptr<RoomColors> colors = std::make_shared<RoomColors>();
  DiscFinder finder;
  std::vector<ColorRegion> in(const WoodenRoom& room, double smallest_px, double largest_px) {
    view.look_at(room.image, orange_table());
    colors->learn(view, orange_table(), capture::PixelFormat::bgr, {}, 12);
    view.set_room(colors);
    return finder.find(view, {0, 0, room_width - 1, room_height - 1}, smallest_px, largest_px);
  }
};

TEST(DiscFinder, FindsAVividDiscOnWoodThatMatches) {
  for (const double radius : {3.0, 5.0, 8.0}) {
    const Disc disc{{140.3, 160.6}, radius};
    Finder finder;
    const auto found = finder.in(WoodenRoom({disc}), 0.8 * radius, 1.2 * radius);
    ASSERT_FALSE(found.empty()) << radius;
    EXPECT_LT((found[0].centre - disc.px).norm(), 0.25 * radius) << radius;  // its shadow is as wood
    EXPECT_NEAR(std::sqrt(found[0].area / 3.14159), radius, 0.2 * radius + 0.3);
    EXPECT_LT(std::sqrt(found[0].of_disc.trace() / 2), 1) << radius;
  }
}

TEST(DiscFinder, FindsNothingWhereOnlyWoodMatches) {
  Finder finder;
  EXPECT_TRUE(finder.in(WoodenRoom({}), 3, 12).empty());
}

// A hand of another colour hides half of it: what is left does not fix its centre to a fraction of a pixel.
TEST(DiscFinder, AHalfHiddenDiscIsFoundAndItsAreaSaysSo) {
  const Disc disc{{140, 160}, 10};
  WoodenRoom room({disc});
  for (int v = 0; v < room_height; ++v) {
    for (int u = 140; u < 170; ++u) {
      auto* const to = const_cast<std::uint8_t*>(room.image.planes[0].data) + v * room.image.planes[0].stride + 3 * u;
      to[0] = 90, to[1] = 60, to[2] = 60;
    }
  }
  Finder finder;
  const auto found = finder.in(room, 10, 10);
  ASSERT_FALSE(found.empty());
  EXPECT_NEAR(found[0].area, 157, 30);
  EXPECT_LT((found[0].centre - disc.px).norm(), 6);
}

TEST(DiscFinder, SeparatesTwoDiscsThatTheWoodJoins) {
  Finder finder;
  const auto found = finder.in(WoodenRoom({{{80, 170}, 6}, {{180, 180}, 6}}), 5, 8);
  ASSERT_EQ(found.size(), 2u);
}

TEST(RoomColors, WhatIsAnObjectsIsNotCounted) {
  const Disc disc{{140, 160}, 40};  // large: its colours are as frequent as a piece of furniture's
  MatchBits view(room_width, room_height);
  const WoodenRoom room({disc});
  view.look_at(room.image, orange_table());
  RoomColors counted, spared;
  counted.learn(view, orange_table(), capture::PixelFormat::bgr, {}, 12);
  const std::vector<Disc> objects{{disc.px, disc.radius_px + 1}};
  spared.learn(view, orange_table(), capture::PixelFormat::bgr, objects, 12);
  EXPECT_GT(spared.evidence(view, 140, 160), counted.evidence(view, 140, 160));
  EXPECT_EQ(spared.evidence(view, 40, 200), counted.evidence(view, 40, 200));
}

TEST(RoomColors, ATableOfAnotherColourBeginsAnew) {
  MatchBits view(room_width, room_height);
  const WoodenRoom room({});
  view.look_at(room.image, orange_table());
  RoomColors colors;
  for (int i = 0; i < 5; ++i) colors.learn(view, orange_table(), capture::PixelFormat::bgr, {}, 12);
  HsiRange blue = orange_range;
  blue.hue_min_deg = 200, blue.hue_max_deg = 260;
  const ColorTable of_blue(blue, capture::PixelFormat::bgr, capture::ColorRange::full);
  view.look_at(room.image, of_blue);
  colors.learn(view, of_blue, capture::PixelFormat::bgr, {}, 12);
  const WoodenRoom with_blue({{{140, 160}, 6}}, {230, 60, 30});
  view.look_at(with_blue.image, of_blue);
  EXPECT_GT(colors.evidence(view, 140, 160), 0);  // no pixel of it was seen
}

// A pixel that differs a little from what it usually shows is that, disturbed; one that differs much is something else.
TEST(RoomColors, ADisturbedPixelOfTheRoomIsNoEvidence) {
  MatchBits view(room_width, room_height);
  const WoodenRoom bare({});
  view.look_at(bare.image, orange_table());
  RoomColors colors;
  std::vector<Disc> everything{{{160, 120}, 400}};
  colors.learn(view, orange_table(), capture::PixelFormat::bgr, everything, 12);
  std::vector<UsualPixels> usual(std::size_t(view.tile_stride() * view.tile_rows()));
  for (int tile = 0; tile < int(usual.size()); ++tile) {
    const TileAt at{std::uint16_t(tile % view.tile_stride()), std::uint16_t(tile / view.tile_stride())};
    for (int bit = 0; bit < 64; ++bit) {
      const int u = at.pixel_u() + bit % 8, v = at.pixel_v() + bit / 8;
      if (u >= 0 && v >= 0 && u < room_width && v < room_height)
        usual[std::size_t(tile)][std::size_t(bit)] = view.values_at(u, v);
    }
    view.leave_out(std::size_t(tile), ~std::uint64_t{0}, &usual[std::size_t(tile)]);
  }
  view.set_light({.gain = 1, .shift = {}, .gate = {4, 4, 4}});
  const WoodenRoom darker({{{80, 180}, 10}}, {42, 86, 134}, false), other({{{80, 180}, 10}});
  view.look_at(darker.image, orange_table());
  ASSERT_TRUE(view.at(80, 180));
  EXPECT_LT(colors.evidence(view, 80, 180), 0);
  view.look_at(other.image, orange_table());
  EXPECT_GT(colors.evidence(view, 80, 180), 2 * RoomColors::evidence_unit);
}

}  // namespace
}  // namespace huetrack::color
