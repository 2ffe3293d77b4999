#include "outline/background.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "outline/disc_picture.h"

namespace huetrack::outline {
namespace {

const ObjectDisc middle{{60, 45}, 7};

std::vector<float> row_of(const Background& background, int v, std::vector<float>& looks) {
  std::vector<float> light(DiscPicture::width);
  looks.resize(DiscPicture::width);
  std::vector<int> us(DiscPicture::width), vs(DiscPicture::width, v);
  std::iota(us.begin(), us.end(), 0);
  background.light({us.data(), vs.data(), DiscPicture::width}, light.data(), looks.data());
  return light;
}

TEST(Background, KnowsNothingAtFirst) {
  const Background background(DiscPicture::width, DiscPicture::height);
  std::vector<float> looks;
  row_of(background, 45, looks);
  for (const float of : looks) EXPECT_EQ(of, 0);
}

TEST(Background, IsTheMeanOfWhatWasSeen) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture, clean;
  for (unsigned i = 0; i < 40; ++i)
    background.learn(picture.draw({.has_disc = false, .noise = 3}, i), middle, {0, 0}, nullptr, 0);
  const Picture truth = clean.draw({.has_disc = false, .noise = 0}, 1);
  std::vector<float> looks;
  const std::vector<float> light = row_of(background, 45, looks);
  double sum2 = 0;
  for (int u = 48; u < 72; ++u) {
    EXPECT_GE(looks[static_cast<std::size_t>(u)], 4);
    sum2 += std::pow(static_cast<double>(light[static_cast<std::size_t>(u)]) - *truth.light.at(u, 45), 2);
  }
  EXPECT_LT(std::sqrt(sum2 / 24), 1.5);
  EXPECT_NEAR(static_cast<double>(background.light_noise()), 3, 0.5);
}

// Of a picture of which a part is there, that part, and nothing else; of a whole one that comes rarely, all.
TEST(Background, LearnsPartsAndWholePictures) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture;
  std::vector<float> looks;
  for (unsigned i = 0; i < 4; ++i) {
    Picture part = picture.draw({.has_disc = false, .noise = 3}, i);
    part.part_u = 50, part.part_v = 38, part.part_width = 22, part.part_height = 16;
    background.learn(part, middle, {0, 0}, nullptr, 0);
  }
  row_of(background, 45, looks);
  for (std::size_t u = 0; u < looks.size(); ++u) EXPECT_EQ(looks[u], u >= 50 && u < 72 ? 4 : 0) << u;
  for (const int v : {37, 54}) {
    row_of(background, v, looks);
    EXPECT_EQ(*std::ranges::max_element(looks), 0) << v;
  }
  background.learn_all(picture.draw({.has_disc = false, .noise = 3}, 9), nullptr, 0);
  row_of(background, 45, looks);
  for (std::size_t u = 0; u < looks.size(); ++u) EXPECT_EQ(looks[u], u >= 50 && u < 72 ? 5 : 1) << u;
  row_of(background, 2, looks);
  EXPECT_EQ(*std::ranges::min_element(looks), 1);
}

TEST(Background, DoesNotLearnWhatIsHidden) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture;
  const ObjectDisc hidden{{60, 45}, 12};
  for (unsigned i = 0; i < 20; ++i) background.learn(picture.draw({}, i), middle, {0, 0}, &hidden, 1);
  std::vector<float> looks;
  row_of(background, 45, looks);
  for (int u = 0; u < DiscPicture::width; ++u) {
    if (std::abs(u - 60) < 12) {
      EXPECT_EQ(looks[static_cast<std::size_t>(u)], 0) << u;
    }
  }
}

TEST(Background, FollowsARoomThatChanges) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture, clean;
  for (unsigned i = 0; i < 30; ++i) background.learn(picture.draw({.has_disc = false}, i), middle, {0, 0}, nullptr, 0);
  for (unsigned i = 0; i < 60; ++i)
    background.learn(picture.draw({.has_disc = false, .light = 2}, i), middle, {0, 0}, nullptr, 0);
  const Picture truth = clean.draw({.has_disc = false, .noise = 0, .light = 2}, 1);
  std::vector<float> looks;
  const std::vector<float> light = row_of(background, 45, looks);
  for (int u = 50; u < 70; ++u)
    EXPECT_NEAR(static_cast<double>(light[static_cast<std::size_t>(u)]), *truth.light.at(u, 45), 3) << u;
}

// Of pictures that come rarely a tile that is well known takes one of four; all of them follow all the same.
TEST(Background, RareWholePicturesFollowTheRoomEverywhere) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture, clean;
  for (unsigned i = 0; i < 20; ++i) background.learn_all(picture.draw({.has_disc = false}, i), nullptr, 0);
  for (unsigned i = 0; i < 240; ++i) background.learn_all(picture.draw({.has_disc = false, .light = 2}, i), nullptr, 0);
  const Picture truth = clean.draw({.has_disc = false, .noise = 0, .light = 2}, 1);
  std::vector<float> looks;
  for (const int v : {2, 20, 45, 70}) {
    const std::vector<float> light = row_of(background, v, looks);
    for (int u = 0; u < DiscPicture::width; ++u)
      EXPECT_NEAR(static_cast<double>(light[static_cast<std::size_t>(u)]), *truth.light.at(u, v), 3) << u << " " << v;
  }
}

// Wherever it goes, and nowhere else: tiles that its way touches, and whose middles lie near it.
TEST(Background, LearnsAllThatTheObjectIsAboutToReach) {
  DiscPicture picture;
  Picture part = picture.draw({.has_disc = false, .noise = 3}, 1);
  part.part_width = DiscPicture::width, part.part_height = DiscPicture::height;  // no others in turn
  for (const Eigen::Vector2d& ahead : {Eigen::Vector2d(0, 0), Eigen::Vector2d(60, 0), Eigen::Vector2d(-70, 30),
                                       Eigen::Vector2d(0, -60), Eigen::Vector2d(50, 45), Eigen::Vector2d(3, 1e-9)}) {
    Background background(DiscPicture::width, DiscPicture::height);
    for (int i = 0; i < 60; ++i) background.learn(part, middle, ahead, nullptr, 0);
    std::vector<float> looks;
    for (int v = 8; v < DiscPicture::height; v += Background::tile_px) {
      row_of(background, v, looks);
      for (int u = 8; u < DiscPicture::width; u += Background::tile_px) {
        const Eigen::Vector2d off = Eigen::Vector2d(u, v) - middle.px;
        double nearest = 1e9;
        for (int k = 0; k <= 200; ++k) nearest = std::min(nearest, (off - k / 200.0 * ahead).norm());
        const double reach = middle.radius_px + 8, near = reach + 0.7 * Background::tile_px;
        if (std::abs(nearest - near) < 0.1) continue;
        const Eigen::Array2d half = Eigen::Array2d::Constant(Background::tile_px / 2.0);
        const bool is_touched = (off.array() + half > ahead.array().min(0.0) - reach).all() &&
                                (off.array() - half <= ahead.array().max(0.0) + reach).all();
        EXPECT_EQ(looks[static_cast<std::size_t>(u)] > 0, is_touched && nearest < near)
            << u << ", " << v << " on the way by " << ahead.transpose();
      }
    }
  }
}

// A webcam's picture, in which an object rests: nothing may be left to guess where it comes later.
TEST(Background, HasSeenAWholePictureWithinASecond) {
  constexpr int width = 640, height = 480;
  const std::vector<std::uint8_t> grey(width * height, 100);
  Picture picture;
  picture.width = width, picture.height = height, picture.is_grey = true;
  picture.light = {grey.data(), width, 1};
  Background background(width, height);
  for (int i = 0; i < 31; ++i) background.learn(picture, {{100, 100}, 8}, {0, 0}, nullptr, 0);
  std::vector<int> us(width), vs(width);
  std::iota(us.begin(), us.end(), 0);
  std::vector<float> light(width), looks(width);
  for (int v = 0; v < height; ++v) {
    std::ranges::fill(vs, v);
    background.light({us.data(), vs.data(), width}, light.data(), looks.data());
    ASSERT_GT(*std::ranges::min_element(looks), 0) << "row " << v;
  }
}

}  // namespace
}  // namespace huetrack::outline
