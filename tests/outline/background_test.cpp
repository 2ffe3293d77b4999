#include "outline/background.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "outline/disc_picture.h"

namespace huetrack::outline {
namespace {

const ObjectDisc middle{{60, 45}, 7};

std::vector<float> row_of(const Background& background, int v, std::vector<float>& counts) {
  std::vector<float> light(DiscPicture::width);
  counts.resize(DiscPicture::width);
  std::vector<int> us(DiscPicture::width), vs(DiscPicture::width, v);
  std::iota(us.begin(), us.end(), 0);
  background.light({us.data(), vs.data(), DiscPicture::width}, light.data(), counts.data());
  return light;
}

TEST(Background, KnowsNothingAtFirst) {
  const Background background(DiscPicture::width, DiscPicture::height);
  std::vector<float> counts;
  row_of(background, 45, counts);
  for (const float of : counts) EXPECT_EQ(of, 0);
}

TEST(Background, IsTheMeanOfThePictures) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture, clean;
  for (unsigned i = 0; i < 40; ++i)
    background.learn(picture.draw({.has_disc = false, .noise = 3}, i), middle, {0, 0}, nullptr, 0);
  const Picture truth = clean.draw({.has_disc = false, .noise = 0}, 1);
  std::vector<float> counts;
  const std::vector<float> light = row_of(background, 45, counts);
  double sum2 = 0;
  for (int u = 48; u < 72; ++u) {
    EXPECT_GE(counts[static_cast<std::size_t>(u)], 4);
    sum2 += std::pow(static_cast<double>(light[static_cast<std::size_t>(u)]) - *truth.light.at(u, 45), 2);
  }
  EXPECT_LT(std::sqrt(sum2 / 24), 1.5);
  EXPECT_NEAR(static_cast<double>(background.light_noise()), std::hypot(3, background_noise.model_light), 0.5);
}

// A partial picture updates its part only; learn_all() updates everything.
TEST(Background, LearnsPartsAndWholePictures) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture;
  std::vector<float> counts;
  for (unsigned i = 0; i < 4; ++i) {
    Picture part = picture.draw({.has_disc = false, .noise = 3}, i);
    part.part_u = 50, part.part_v = 38, part.part_width = 22, part.part_height = 16;
    background.learn(part, middle, {0, 0}, nullptr, 0);
  }
  row_of(background, 45, counts);
  for (std::size_t u = 0; u < counts.size(); ++u) EXPECT_EQ(counts[u], u >= 50 && u < 72 ? 4 : 0) << u;
  for (const int v : {37, 54}) {
    row_of(background, v, counts);
    EXPECT_EQ(*std::ranges::max_element(counts), 0) << v;
  }
  background.learn_all(picture.draw({.has_disc = false, .noise = 3}, 9), nullptr, 0);
  row_of(background, 45, counts);
  for (std::size_t u = 0; u < counts.size(); ++u) EXPECT_EQ(counts[u], u >= 50 && u < 72 ? 5 : 1) << u;
  row_of(background, 2, counts);
  EXPECT_EQ(*std::ranges::min_element(counts), 1);
}

TEST(Background, DoesNotLearnWhatIsHidden) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture;
  const ObjectDisc hidden{{60, 45}, 12};
  for (unsigned i = 0; i < 20; ++i) background.learn(picture.draw({}, i), middle, {0, 0}, &hidden, 1);
  std::vector<float> counts;
  row_of(background, 45, counts);
  for (int u = 0; u < DiscPicture::width; ++u) {
    if (std::abs(u - 60) < 12) {
      EXPECT_EQ(counts[static_cast<std::size_t>(u)], 0) << u;
    }
  }
}

TEST(Background, FollowsAChangingRoom) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture, clean;
  for (unsigned i = 0; i < 30; ++i) background.learn(picture.draw({.has_disc = false}, i), middle, {0, 0}, nullptr, 0);
  for (unsigned i = 0; i < 60; ++i)
    background.learn(picture.draw({.has_disc = false, .light = 2}, i), middle, {0, 0}, nullptr, 0);
  const Picture truth = clean.draw({.has_disc = false, .noise = 0, .light = 2}, 1);
  std::vector<float> counts;
  const std::vector<float> light = row_of(background, 45, counts);
  for (int u = 50; u < 70; ++u)
    EXPECT_NEAR(static_cast<double>(light[static_cast<std::size_t>(u)]), *truth.light.at(u, 45), 3) << u;
}

TEST(Background, RareWholePicturesFollowTheRoomEverywhere) {
  Background background(DiscPicture::width, DiscPicture::height);
  DiscPicture picture, clean;
  for (unsigned i = 0; i < 20; ++i) background.learn_all(picture.draw({.has_disc = false}, i), nullptr, 0);
  for (unsigned i = 0; i < 60; ++i) background.learn_all(picture.draw({.has_disc = false, .light = 2}, i), nullptr, 0);
  const Picture truth = clean.draw({.has_disc = false, .noise = 0, .light = 2}, 1);
  std::vector<float> counts;
  for (const int v : {2, 20, 45, 70}) {
    const std::vector<float> light = row_of(background, v, counts);
    for (int u = 0; u < DiscPicture::width; ++u)
      EXPECT_NEAR(static_cast<double>(light[static_cast<std::size_t>(u)]), *truth.light.at(u, v), 3) << u << " " << v;
  }
}

// Exactly the tiles that the path touches and whose centres lie near it.
TEST(Background, LearnsThePathAhead) {
  DiscPicture picture;
  Picture part = picture.draw({.has_disc = false, .noise = 3}, 1);
  part.part_width = DiscPicture::width, part.part_height = DiscPicture::height;  // no others in turn
  for (const Eigen::Vector2d& ahead : {Eigen::Vector2d(0, 0), Eigen::Vector2d(60, 0), Eigen::Vector2d(-70, 30),
                                       Eigen::Vector2d(0, -60), Eigen::Vector2d(50, 45), Eigen::Vector2d(3, 1e-9)}) {
    Background background(DiscPicture::width, DiscPicture::height);
    for (int i = 0; i < 60; ++i) background.learn(part, middle, ahead, nullptr, 0);
    std::vector<float> counts;
    for (int v = 8; v < DiscPicture::height; v += Background::tile_px) {
      row_of(background, v, counts);
      for (int u = 8; u < DiscPicture::width; u += Background::tile_px) {
        const Eigen::Vector2d off = Eigen::Vector2d(u, v) - middle.px;
        double nearest = 1e9;
        for (int k = 0; k <= 200; ++k) nearest = std::min(nearest, (off - k / 200.0 * ahead).norm());
        const double reach = middle.radius_px + 8, near = reach + 0.7 * Background::tile_px;
        if (std::abs(nearest - near) < 0.1) continue;
        const Eigen::Array2d half = Eigen::Array2d::Constant(Background::tile_px / 2.0);
        const bool is_touched = (off.array() + half > ahead.array().min(0.0) - reach).all() &&
                                (off.array() - half <= ahead.array().max(0.0) + reach).all();
        EXPECT_EQ(counts[static_cast<std::size_t>(u)] > 0, is_touched && nearest < near)
            << u << ", " << v << " on the way by " << ahead.transpose();
      }
    }
  }
}

// Of a webcam's picture in which the object rests: later no background needs to be guessed.
TEST(Background, CoversTheWholePictureWithinASecond) {
  constexpr int width = 640, height = 480;
  const std::vector<std::uint8_t> grey(width * height, 100);
  Picture picture;
  picture.width = width, picture.height = height, picture.is_grey = true;
  picture.light = {grey.data(), width, 1};
  Background background(width, height);
  for (int i = 0; i < 31; ++i) background.learn(picture, {{100, 100}, 8}, {0, 0}, nullptr, 0);
  std::vector<int> us(width), vs(width);
  std::iota(us.begin(), us.end(), 0);
  std::vector<float> light(width), counts(width);
  for (int v = 0; v < height; ++v) {
    std::ranges::fill(vs, v);
    background.light({us.data(), vs.data(), width}, light.data(), counts.data());
    ASSERT_GT(*std::ranges::min_element(counts), 0) << "row " << v;
  }
}

// The same model without vectors and fixed-point numbers, of one sample.
struct PlainMean {
  double mean = 0;
  int count = 0;
  void add(double value, double gate) {
    if (count > 0 && std::abs(value - mean) < gate) {
      count = std::min(count + 1, 16);
      mean += (value - mean) / count;
    } else {
      count -= 2;
      if (count <= 0) mean = value, count = 1;
    }
  }
};

struct Sharing {
  int columns, rows;
};
class BackgroundOf : public testing::TestWithParam<Sharing> {};

// Random pictures with outliers and a disc that hides a part of each; seven of them, so that the gate is that of the
// initial noise.
TEST_P(BackgroundOf, AgreesWithAPlainMean) {
  constexpr int width = 72, height = 56;
  const auto [columns, rows] = GetParam();
  const int chroma_width = width / columns, chroma_height = height / rows;
  std::mt19937 rng(6);
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> share(0, 1);
  Background background(width, height);
  const double gate = std::max(8.0, 5.0 * static_cast<double>(background_noise.initial_noise));
  std::vector<PlainMean> light(width * height), blue(static_cast<std::size_t>(chroma_width * chroma_height)), red(blue);
  for (int picture = 0; picture < 7; ++picture) {
    const ObjectDisc hidden{{70 * share(rng), 50 * share(rng)}, 5 + 8 * share(rng)};
    const auto draw = [&](std::vector<std::uint8_t>& plane) {
      for (std::size_t k = 0; k < plane.size(); ++k)
        plane[k] = static_cast<std::uint8_t>(
            std::clamp(60.0 + static_cast<double>(k % 90) + noise(rng) + (share(rng) < 0.1 ? 40 : 0), 0.0, 255.0));
    };
    std::vector<std::uint8_t> y(light.size()), b(blue.size()), r(red.size());
    draw(y), draw(b), draw(r);
    Picture shown;
    shown.width = width, shown.height = height, shown.columns = columns, shown.rows = rows;
    shown.light = {y.data(), width, 1}, shown.blue = {b.data(), chroma_width, 1},
    shown.red = {r.data(), chroma_width, 1};
    background.learn_all(shown, &hidden, 1);
    const auto add = [&](std::vector<PlainMean>& means, const std::vector<std::uint8_t>& plane, int across, int by_u,
                         int by_v, double zero) {
      const double reach = hidden.radius_px + 0.5 * std::hypot(by_u - 1, by_v - 1);
      for (std::size_t k = 0; k < plane.size(); ++k) {
        const int u = static_cast<int>(k) % across, v = static_cast<int>(k) / across;
        const Eigen::Vector2d centre(by_u * u + 0.5 * (by_u - 1), by_v * v + 0.5 * (by_v - 1));
        if ((centre - hidden.px).norm() > reach) means[k].add(plane[k] - zero, gate);
      }
    };
    add(light, y, width, 1, 1, 0), add(blue, b, chroma_width, columns, rows, 128);
    add(red, r, chroma_width, columns, rows, 128);
    // Both chromas share the smaller count.
    for (std::size_t k = 0; k < blue.size(); ++k) blue[k].count = red[k].count = std::min(blue[k].count, red[k].count);
  }
  Picture shown;
  shown.width = width, shown.height = height, shown.columns = columns, shown.rows = rows;
  int compared = 0;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      float value, b, r, count, chroma_count;
      background.at_pixels(shown, {&u, &v, 1}, {&value, &b, &r, &count, &chroma_count});
      const PlainMean& expected = light[static_cast<std::size_t>(v * width + u)];
      const auto sample = static_cast<std::size_t>(v / rows * chroma_width + u / columns);
      ASSERT_EQ(count, expected.count) << u << " " << v;
      ASSERT_EQ(chroma_count, blue[sample].count) << u << " " << v;
      if (expected.count > 0) {
        ASSERT_NEAR(static_cast<double>(value), expected.mean, 0.1) << u << " " << v;
      }
      if (chroma_count == 0) continue;
      ASSERT_NEAR(static_cast<double>(b), blue[sample].mean, 0.1) << u << " " << v;
      ASSERT_NEAR(static_cast<double>(r), red[sample].mean, 0.1) << u << " " << v;
      ++compared;
    }
  }
  EXPECT_GT(compared, width * height / 2);
  for (int v = 0; v < chroma_height; ++v) {
    for (int u = 0; u < chroma_width; ++u) {
      float value, b, r, count, chroma_count;
      background.at_chroma(shown, {&u, &v, 1}, {&value, &b, &r, &count, &chroma_count});
      double mean = 0;
      int least = 255;
      for (int k = 0; k < columns * rows; ++k) {
        const auto at = static_cast<std::size_t>((v * rows + k / columns) * width + u * columns + k % columns);
        mean += light[at].mean / (columns * rows), least = std::min(least, light[at].count);
      }
      ASSERT_EQ(count, least) << u << " " << v;
      if (least > 0) {
        ASSERT_NEAR(static_cast<double>(value), mean, 0.1) << u << " " << v;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Layouts, BackgroundOf, testing::Values(Sharing{1, 1}, Sharing{2, 1}, Sharing{2, 2}),
                         [](const auto& param) {
                           return std::to_string(param.param.columns) + "x" + std::to_string(param.param.rows);
                         });

// A picture larger than the memory: the tiles updated longest ago are replaced, and the others keep their means.
TEST(Background, ReplacesTheOldestTiles) {
  constexpr int width = 1280, height = 640;  // 3200 tiles
  const std::vector<std::uint8_t> grey(width * height, 100);
  Picture picture;
  picture.width = width, picture.height = height, picture.is_grey = true;
  picture.light = {grey.data(), width, 1};
  Background background(width, height);
  const auto count_at = [&](int u, int v) {
    float light, count;
    background.light({&u, &v, 1}, &light, &count);
    return count;
  };
  background.learn(picture, {{40, 40}, 8}, {0, 0}, nullptr, 0);
  EXPECT_GT(count_at(40, 40), 0);
  for (int i = 0; i < 3; ++i) background.learn_all(picture, nullptr, 0);
  int known = 0;
  for (int v = 8; v < height; v += Background::tile_px)
    for (int u = 8; u < width; u += Background::tile_px) known += count_at(u, v) > 0 ? 1 : 0;
  EXPECT_EQ(known, static_cast<int>(Background::max_tiles));
  background.forget();
  EXPECT_EQ(count_at(40, 40), 0);
}

}  // namespace
}  // namespace huetrack::outline
