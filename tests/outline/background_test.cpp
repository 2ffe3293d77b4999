#include "outline/background.h"

#include <gtest/gtest.h>

#include <vector>

#include "outline/disc_picture.h"

namespace huetrack::outline {
namespace {

const ObjectDisc middle{{60, 45}, 7};

std::vector<float> row_of(const Background& background, int v, std::vector<float>& looks) {
  std::vector<float> light(DiscPicture::width);
  looks.resize(DiscPicture::width);
  background.light(0, v, DiscPicture::width, light.data(), looks.data());
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

}  // namespace
}  // namespace huetrack::outline
