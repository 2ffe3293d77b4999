// One contract, held by every lens model on a grid: the lenses range from none to the strongest that people calibrate.
#include "calib/model/camera_model.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <ostream>
#include <string>
#include <vector>

namespace huetrack::calib {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double infinity = std::numeric_limits<double>::infinity();

struct TestLens {
  std::string name;
  CameraModel model;
  int width, height;
  bool folds = false;  // somewhere, the distorted radius stops growing
};

void PrintTo(const TestLens& lens, std::ostream* out) {
  *out << lens.name;
}

std::vector<TestLens> lenses() {
  const auto pinhole = [](double f, double cx, double cy, std::array<double, 8> k) {
    return CameraModel(PinholeRadtan{f, 1.01 * f, cx, cy, k});
  };
  const auto fisheye = [](double f, double cx, double cy, std::array<double, 4> k) {
    return CameraModel(FisheyeKannalaBrandt{f, 0.99 * f, cx, cy, k});
  };
  const auto stereographic = [](double f, double cx, double cy, std::array<double, 8> k) {
    return CameraModel(Stereographic{f, 1.01 * f, cx, cy, k});
  };
  return {
      {"stereographic_plain", stereographic(300, 320, 240, {}), 640, 480},
      {"stereographic_tilted", stereographic(600, 645, 352, {-0.3, 0.79, 2e-3, -3e-3, -0.57, 0.18, 3e-3, -2e-3}), 1280,
       720},
      {"stereographic_folding", stereographic(300, 500, 480, {-0.03, -0.005, 1e-4, 0}), 1000, 960, true},
      {"pinhole_without_distortion", pinhole(525, 320, 240, {}), 640, 480},
      {"pinhole_like_the_rendered_rigs", pinhole(241.7, 157.3, 122.4, {-0.145, 0.033, -4e-4, 5e-4}), 320, 240},
      {"pinhole_five_coefficients", pinhole(900, 961, 530, {-0.35, 0.15, 1e-3, -2e-3, -0.03}), 1920, 1080, true},
      {"pinhole_pincushion", pinhole(400, 310, 250, {0.25, 0.1, 2e-3, 1e-3, 0.05}), 640, 480},
      {"pinhole_folding_within_reach", pinhole(420, 320, 240, {-0.28, 0, 1e-4, -1e-4}), 640, 480, true},
      {"pinhole_rational", pinhole(520, 325, 238, {0.5, -0.3, 5e-4, 3e-4, 0.02, 0.85, -0.2, 0.03}), 640, 480, true},
      {"pinhole_rational_wide", pinhole(330, 640, 360, {8.1, 4.2, 1e-4, -5e-5, 0.25, 8.5, 6.6, 1.1}), 1280, 720},
      {"fisheye_without_distortion", fisheye(300, 320, 240, {}), 640, 480},
      {"fisheye_usual", fisheye(286, 421, 403, {-0.0034, 0.0011, -0.0005, 0.00002}), 848, 800, true},
      {"fisheye_strong", fisheye(350, 500, 480, {0.12, -0.06, 0.03, -0.008}), 1000, 960, true},
      {"fisheye_folding", fisheye(300, 320, 240, {-0.08, 0.01, -0.01, 0.0004}), 640, 480, true},
  };
}

class CameraModelContract : public testing::TestWithParam<TestLens> {
 protected:
  const CameraModel& model() const { return GetParam().model; }
  bool is_pinhole() const { return model().name() == "pinhole_radtan"; }

  std::vector<RawPixel> pixel_grid(int step_px) const {
    std::vector<RawPixel> pixels;
    for (int y = 0; y < GetParam().height; y += step_px) {
      for (int x = 0; x < GetParam().width; x += step_px) pixels.push_back({{x + 0.25, y - 0.25}});
    }
    pixels.push_back({{model().cx(), model().cy()}});
    return pixels;
  }

  // Directions all around, as points at `depth_m`.
  std::vector<Eigen::Vector3d> point_grid(double depth_m) const {
    std::vector<Eigen::Vector3d> points;
    for (double theta = 0; theta < pi; theta += pi / 90) {
      for (double phi = 0.1; phi < 2 * pi; phi += pi / 9) {
        points.emplace_back(depth_m * std::sin(theta) * std::cos(phi), depth_m * std::sin(theta) * std::sin(phi),
                            depth_m * std::cos(theta));
      }
    }
    return points;
  }

  // In the units of CameraModel::limit().
  double reach(const Eigen::Vector3d& p) const {
    if (is_pinhole()) return (p.head<2>() / p.z()).squaredNorm();
    const double theta = std::atan2(p.head<2>().norm(), p.z());
    return model().name() == "stereographic" ? 4 * std::tan(theta / 2) * std::tan(theta / 2) : theta;
  }
};

TEST_P(CameraModelContract, RayProjectsBackToItsPixel) {
  int rays = 0, none = 0;
  for (const RawPixel& pixel : pixel_grid(10)) {
    const auto ray = model().ray(pixel);
    if (!ray) {
      ++none;
      continue;
    }
    ++rays;
    ASSERT_NEAR(ray->norm(), 1, 1e-14);
    for (const double depth_m : {0.3, 1.0, 5.0}) {
      const auto back = model().project(*ray * depth_m);
      ASSERT_TRUE(back) << pixel.px.transpose();
      ASSERT_LT((back->px - pixel.px).norm(), 1e-6) << pixel.px.transpose();
    }
  }
  EXPECT_GT(rays, 0.6 * (rays + none));
  // A pixel without a ray is one that the lens never reaches.
  if (std::isinf(model().limit())) {
    EXPECT_EQ(none, 0);
  }
}

TEST_P(CameraModelContract, RayOfAProjectionIsTheOriginalDirection) {
  int seen = 0;
  for (const Eigen::Vector3d& p : point_grid(1.5)) {
    // Near the limit the pixel hardly moves with the direction, so the direction is not to be had back exactly.
    if (is_pinhole() ? p.z() <= 0.05 : false) continue;
    if (reach(p) > 0.95 * model().limit()) continue;
    const auto pixel = model().project(p);
    ASSERT_TRUE(pixel) << p.transpose();
    const auto ray = model().ray(*pixel);
    ASSERT_TRUE(ray) << p.transpose();
    ASSERT_LT((*ray - p.normalized()).norm(), 1e-9) << p.transpose();
    ++seen;
  }
  EXPECT_GT(seen, 100);
}

TEST_P(CameraModelContract, NothingIsProjectedBehindOrBeyondTheLimit) {
  for (const Eigen::Vector3d& p : point_grid(2)) {
    const bool behind = is_pinhole() && p.z() <= 0;
    if (behind || reach(p) > model().limit()) {
      EXPECT_FALSE(model().project(p)) << p.transpose();
    }
  }
  EXPECT_FALSE(model().project({0, 0, 0}));
  EXPECT_FALSE(model().project({0, 0, -1}));
  EXPECT_FALSE(model().project({std::nan(""), 0, 1}));
  EXPECT_FALSE(model().project({0, infinity, 1}));
  EXPECT_FALSE(model().ray({{infinity, 0}}));
  EXPECT_FALSE(model().ray({{0, std::nan("")}}));
}

TEST_P(CameraModelContract, AnalyticJacobianAgreesWithDifferences) {
  int checked = 0;
  for (const double depth_m : {0.3, 5.0}) {
    for (Eigen::Vector3d p : point_grid(depth_m)) {
      if ((is_pinhole() && p.z() < 0.1 * depth_m) || reach(p) > 0.95 * model().limit()) continue;
      CameraModel::Jacobian jacobian, differences;
      const auto pixel = model().project(p, jacobian);
      ASSERT_TRUE(pixel);
      EXPECT_EQ(pixel->px, model().project(p)->px);
      const double h = 1e-5 * depth_m;
      for (int i = 0; i < 3; ++i) {
        // Fourth order, so that the differences and not the step set the tolerance.
        const auto at = [&](double step) {
          return model().project(p + step * Eigen::Vector3d::Unit(i)).value_or(RawPixel{{NAN, NAN}}).px;
        };
        differences.col(i) = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
      }
      EXPECT_LT((jacobian - differences).norm(), 1e-6 * (1 + jacobian.norm())) << p.transpose();
      ++checked;
    }
  }
  EXPECT_GT(checked, 200);
}

TEST_P(CameraModelContract, AgreesWithOpenCv) {
  const auto matrix = cv::Matx33d(model().fx(), 0, model().cx(), 0, model().fy(), model().cy(), 0, 0, 1);
  std::vector<cv::Point3d> points;
  std::vector<Eigen::Vector2d> ours;
  for (const double depth_m : {0.3, 1.0, 5.0}) {
    for (const Eigen::Vector3d& p : point_grid(depth_m)) {
      if (p.z() < 0.05 * depth_m) continue;  // OpenCV's fisheye knows no sideways
      const auto pixel = model().project(p);
      if (!pixel) continue;
      points.emplace_back(p.x(), p.y(), p.z());
      ours.push_back(pixel->px);
    }
  }
  ASSERT_GT(points.size(), 500u);
  std::vector<cv::Point2d> theirs;
  if (std::holds_alternative<Stereographic>(model().lens())) return;  // OpenCV has none
  if (const auto* lens = std::get_if<PinholeRadtan>(&model().lens())) {
    const std::vector<double> k(lens->distortion.begin(), lens->distortion.end());
    cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), matrix, k, theirs);
  } else {
    const auto& k4 = std::get<FisheyeKannalaBrandt>(model().lens()).distortion;
    cv::fisheye::projectPoints(points, theirs, cv::Affine3d(), matrix, cv::Vec4d(k4[0], k4[1], k4[2], k4[3]));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double size = 1 + ours[i].norm();  // a ray 87 degrees off an undistorted axis is at 10^4 px
    EXPECT_NEAR(theirs[i].x, ours[i].x(), 1e-6 * std::max(1.0, size / 1e4)) << points[i];
    EXPECT_NEAR(theirs[i].y, ours[i].y(), 1e-6 * std::max(1.0, size / 1e4)) << points[i];
  }
}

TEST_P(CameraModelContract, UndistortedPixelsArePinholePixels) {
  for (const RawPixel& pixel : pixel_grid(20)) {
    const auto ray = model().ray(pixel);
    const auto ideal = model().undistort(pixel);
    ASSERT_EQ(ideal.has_value(), ray.has_value() && ray->z() > 0);
    if (!ideal) continue;
    EXPECT_NEAR(ideal->px.x(), model().fx() * ray->x() / ray->z() + model().cx(), 1e-9 * (1 + ideal->px.norm()));
    EXPECT_NEAR(ideal->px.y(), model().fy() * ray->y() / ray->z() + model().cy(), 1e-9 * (1 + ideal->px.norm()));
  }
}

TEST_P(CameraModelContract, TheRadiusGrowsUpToTheLimitAndNoFurther) {
  const double limit = model().limit();
  ASSERT_GT(limit, 0);
  // The radial part only: the limit leaves the tangential terms out.
  const auto radius = [&](double r) {
    if (const auto* lens = std::get_if<PinholeRadtan>(&model().lens())) {
      const auto& k = lens->distortion;
      const double s = r * r;
      return r * (1 + k[0] * s + k[1] * s * s + k[4] * s * s * s) / (1 + k[5] * s + k[6] * s * s + k[7] * s * s * s);
    }
    const double s = r * r;
    if (const auto* lens = std::get_if<Stereographic>(&model().lens())) {
      const auto& k = lens->distortion;
      return r * (1 + k[0] * s + k[1] * s * s + k[4] * s * s * s + k[5] * s * s * s * s);
    }
    const auto& k = std::get<FisheyeKannalaBrandt>(model().lens()).distortion;
    return r * (1 + k[0] * s + k[1] * s * s + k[2] * s * s * s + k[3] * s * s * s * s);
  };
  constexpr double widest = 128.65;  // of a stereographic lens, and as far as its limit goes
  const bool is_stereographic = model().name() == "stereographic";
  const double end = is_pinhole() ? std::sqrt(std::min(limit, 25.0)) : is_stereographic ? std::sqrt(limit) : limit;
  for (int i = 0; i < 1000; ++i) EXPECT_LT(radius(end * i / 1001), radius(end * (i + 1) / 1001)) << i;
  EXPECT_EQ(is_pinhole()       ? std::isfinite(limit)
            : is_stereographic ? limit < widest
                               : limit < pi,
            GetParam().folds)
      << limit;
  if (GetParam().folds) {
    EXPECT_GT(radius(end), radius(end * 1.001));
  }
}

INSTANTIATE_TEST_SUITE_P(Lenses, CameraModelContract, testing::ValuesIn(lenses()),
                         [](const auto& test) { return test.param.name; });

TEST(CameraModel, LimitsThatCanBeWrittenDown) {
  const auto pinhole = [](std::array<double, 8> k) {
    return CameraModel(PinholeRadtan{500, 500, 320, 240, k}).limit();
  };
  EXPECT_EQ(pinhole({}), infinity);
  EXPECT_EQ(pinhole({0.1}), infinity);
  EXPECT_NEAR(pinhole({-0.28}), 1 / (3 * 0.28), 1e-14);    // 1 + 3 k1 s = 0
  EXPECT_NEAR(pinhole({0, -0.2}), 1, 1e-14);               // 1 + 5 k2 s^2 = 0
  EXPECT_NEAR(pinhole({0, 0, 0, 0, -1.0 / 7}), 1, 1e-14);  // 1 + 7 k3 s^3 = 0
  EXPECT_EQ(pinhole({-1, 0.45}), infinity);                // 1 - 3 s + 2.25 s^2 only touches 0: the radius grows on
  EXPECT_NEAR(pinhole({0, 0, 0, 0, 0, 1}), 1, 1e-14);      // r / (1 + s): (1 - s) / (1 + s)^2
  EXPECT_NEAR(pinhole({0, 0, 0, 0, 0, -0.5}), 2, 1e-14);   // the pole of 1 / (1 - s / 2)
  EXPECT_EQ(pinhole({-1e-12}), infinity);                  // folds where no camera looks
  EXPECT_EQ(pinhole({0, 0, 0.1, -0.1}), infinity);         // tangential terms are left out
  // One more dip further out does not matter: the first one counts.
  EXPECT_NEAR(pinhole({-0.5, 0.05}), (1.5 - std::sqrt(2.25 - 1)) / 0.5, 1e-13);
  const auto fisheye = [](std::array<double, 4> k) {
    return CameraModel(FisheyeKannalaBrandt{300, 300, 320, 240, k}).limit();
  };
  EXPECT_EQ(fisheye({}), pi);
  EXPECT_NEAR(fisheye({-1.0 / 3}), 1, 1e-14);
  EXPECT_NEAR(fisheye({0, 0, 0, -1.0 / 9}), 1, 1e-14);
  EXPECT_EQ(fisheye({-0.001}), pi);
}

TEST(CameraModel, TheFisheyeSeesBehindItself) {
  const CameraModel model(FisheyeKannalaBrandt{100, 100, 320, 240, {}});
  const double theta = 2.5;  // 143 degrees
  const auto pixel = model.project({3 * std::sin(theta), 0, 3 * std::cos(theta)});
  ASSERT_TRUE(pixel);
  EXPECT_LT((pixel->px - Eigen::Vector2d(320 + 250, 240)).norm(), 1e-12);
  EXPECT_FALSE(model.undistort(*pixel));
  EXPECT_NEAR(model.ray(*pixel)->z(), std::cos(theta), 1e-14);
  EXPECT_FALSE(model.ray({{320 + 100 * 3.2, 240}}));  // more than pi
}

TEST(CameraModel, APixelBeyondTheFoldHasNoRay) {
  const CameraModel model(PinholeRadtan{100, 100, 0, 0, {-1.0 / 3}});  // r (1 - r^2 / 3): at most 2/3
  EXPECT_NEAR(model.limit(), 1, 1e-14);
  EXPECT_TRUE(model.ray({{66.6, 0}}));
  EXPECT_FALSE(model.ray({{66.7, 0}}));
  EXPECT_TRUE(model.project({0.999, 0, 1}));
  EXPECT_FALSE(model.project({1.001, 0, 1}));
}

TEST(CameraModel, ALensWithNanParametersCoversNothing) {
  for (const double bad : {std::nan(""), infinity}) {
    const CameraModel pinhole(PinholeRadtan{500, 500, 320, 240, {bad}}),
        fisheye(FisheyeKannalaBrandt{bad, 1, 0, 0, {}});
    for (const CameraModel* model : {&pinhole, &fisheye}) {
      EXPECT_FALSE(model->project({0, 0, 1}));
      EXPECT_FALSE(model->ray({{1, 1}}));
      EXPECT_FALSE(model->undistort({{1, 1}}));
    }
  }
}

}  // namespace
}  // namespace huetrack::calib
