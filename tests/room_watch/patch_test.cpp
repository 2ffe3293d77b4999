#include "room_watch/patch.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <random>

namespace huetrack::room_watch {
namespace {

using Brightness = std::function<double(double, double)>;

double spots(double u, double v) {
  return 120 + 40 * std::sin(0.7 * u + 0.2 * v) + 30 * std::cos(0.3 * u - 0.8 * v);
}

capture::Image picture(const Brightness& brightness, double noise = 0,
                       capture::PixelFormat format = capture::PixelFormat::grey, int size = 80) {
  const auto out = capture::make_image(format, capture::ColorRange::full, size, size);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 1);
  const int step = format == capture::PixelFormat::yuyv ? 2 : 1;
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u)
      out.data[0][v * out.image.planes[0].stride + u * step] =
          static_cast<std::uint8_t>(std::lround(std::clamp(brightness(u, v) + noise * normal(random), 0.0, 255.0)));
  return out.image;
}

Patch patch_at(const capture::Image& image, int column, int row, int scale = 1) {
  std::array<float, std::size_t(seen_side) * seen_side> blocks;
  EXPECT_TRUE(Luma(image, scale).read(column, row, seen_side, seen_side, blocks.data()));
  SeenPatch seen;
  std::ranges::transform(blocks, seen.begin(), [](float b) { return static_cast<std::uint8_t>(std::lround(b)); });
  return make_patch(Eigen::Vector2d(column, row).array() + double(seen_side - 1) / 2, seen).value();
}

TEST(Patch, IsFoundToATwentiethOfABlockInAnotherLight) {
  const Patch patch = patch_at(picture(spots), 30, 30);
  for (const Eigen::Vector2d& shift : {Eigen::Vector2d(0.37, -0.61), Eigen::Vector2d(-1.4, 1.2)}) {
    const auto dimmed = picture([&](double u, double v) { return 0.6 * spots(u - shift.x(), v - shift.y()) + 25; });
    const Found found = find(patch, Luma(dimmed, 1), patch.centre);
    ASSERT_EQ(found.outcome, Found::Outcome::found);
    EXPECT_NEAR((found.centre - patch.centre - shift).norm(), 0, 0.05) << found.centre.transpose();
    EXPECT_GT(found.correlation, 0.99f);
  }
}

// A wave keeps exp(-(w sigma)^2 / 2) of itself in a Gaussian blur, so these are blurred exactly.
Brightness spots_out_of_focus(double sigma) {
  const auto kept = [sigma](double w2) { return std::exp(-w2 * sigma * sigma / 2); };
  const double a = kept(0.49 + 0.04), b = kept(0.09 + 0.64), c = kept(2.0);
  return [=](double u, double v) {
    return 120 + 30 * a * std::sin(0.7 * u + 0.2 * v) + 25 * b * std::cos(0.3 * u - 0.8 * v) + 25 * c * std::sin(u - v);
  };
}

TEST(Patch, MeasuresTheBlurOfDefocus) {
  const Patch patch = patch_at(picture(spots_out_of_focus(0)), 30, 30);
  for (const double sigma : {0.0, 0.7, 1.0, 1.3}) {
    const auto soft = spots_out_of_focus(sigma);
    const auto dimmed = picture([&](double u, double v) { return 0.6 * soft(u, v) + 30; });
    const Found found = find(patch, Luma(dimmed, 1), patch.centre);
    ASSERT_EQ(found.outcome, Found::Outcome::found) << sigma;
    EXPECT_NEAR(blur_of(patch, double(found.loss)), sigma, 0.2 * sigma + 0.1);
  }
}

TEST(Patch, InterpolationLosesNoDetail) {
  const Patch patch = patch_at(picture(spots_out_of_focus(0)), 30, 30);
  const auto soft = spots_out_of_focus(0);
  const auto moved = picture([&](double u, double v) { return soft(u - 0.5, v + 0.5); });
  const Found found = find(patch, Luma(moved, 1), patch.centre);
  ASSERT_EQ(found.outcome, Found::Outcome::found);
  EXPECT_LT(std::abs(found.loss), 0.15f);
}

TEST(Patch, ReportsTheSigmaOfNoise) {
  const Patch patch = patch_at(picture(spots), 30, 30);
  const Found found = find(patch, Luma(picture(spots, 8), 1), patch.centre);
  ASSERT_EQ(found.outcome, Found::Outcome::found);
  EXPECT_GT(found.sigma, 0.01f);
  EXPECT_LT((found.centre - patch.centre).norm(), 4 * double(found.sigma));
}

TEST(Patch, IsNotFoundInSomethingElse) {
  const Patch patch = patch_at(picture(spots), 30, 30);
  const auto other = picture([](double u, double v) { return spots(1.6 * v + 3, 0.7 * u); });
  EXPECT_EQ(find(patch, Luma(other, 1), patch.centre).outcome, Found::Outcome::differs);
  const auto nothing = picture([](double, double) { return 100.0; }, 1);
  const Found found = find(patch, Luma(nothing, 1), patch.centre);
  EXPECT_EQ(found.outcome, Found::Outcome::differs);
  EXPECT_LT(found.contrast, 0.1f * patch.contrast());
}

TEST(Patch, IsOutsideAtTheImagesEdge) {
  const Patch patch = patch_at(picture(spots), 30, 30);
  EXPECT_EQ(find(patch, Luma(picture(spots), 1), {2, 40}).outcome, Found::Outcome::outside);
}

TEST(Patch, NeedsTextureInBothDirections) {
  SeenPatch stripes;
  for (std::size_t k = 0; k < stripes.size(); ++k) stripes[k] = k % seen_side < 7 ? 40 : 200;
  EXPECT_FALSE(make_patch({20, 20}, stripes));
}

TEST(Patch, IsFoundFarAwayBySearch) {
  const auto spot = [](double du, double dv) {
    return [=](double u, double v) {
      const double a = u - 40 - du, b = v - 40 - dv;
      return 60 + 150 * std::exp(-(a * a + 2 * b * b) / 20) +
             90 * std::exp(-((a - 4) * (a - 4) + (b + 3) * (b + 3)) / 6);
    };
  };
  const Patch patch = patch_at(picture(spot(0, 0), 2), 33, 33);
  const auto place = search(patch, Luma(picture(spot(11, -9), 2), 1), patch.centre, 15);
  ASSERT_TRUE(place);
  EXPECT_LT((*place - patch.centre - Eigen::Vector2d(11, -9)).norm(), 2);
  EXPECT_FALSE(search(patch, Luma(picture([](double, double) { return 100.0; }, 2), 1), patch.centre, 15));
}

TEST(Luma, BlocksAreMeansInAllFormats) {
  for (const auto format : {capture::PixelFormat::grey, capture::PixelFormat::yuyv}) {
    const auto image = picture([](double u, double v) { return 2 * u + v; }, 0, format);
    const Luma luma(image, 4);
    EXPECT_EQ(luma.columns(), 20);
    EXPECT_FLOAT_EQ(luma.at(3, 5), float(2 * 13.5 + 21.5));
    std::array<float, 6> window;
    ASSERT_TRUE(luma.read(3, 5, 3, 2, window.data()));
    EXPECT_FLOAT_EQ(window[4], luma.at(4, 6));
    EXPECT_FALSE(luma.read(18, 5, 3, 2, window.data()));
  }
}

}  // namespace
}  // namespace huetrack::room_watch
