#include "object_tracking/sighting.h"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <numbers>

#include "color/mask_image.h"
#include "scene/scene.h"

namespace huetrack::object_tracking {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

double mahalanobis2(const Vector2d& d, const Eigen::Matrix2d& covariance) {
  return d.dot(covariance.inverse() * d);
}

// A disc of radius r at (50.3, 49.6), hidden where its points lie less than `cut` along `angle` from its centre.
Sighting sighting_of_disc(double r, double angle, double cut, double pixel_noise_px = 0.2) {
  const Vector2d centre(50.3, 49.6), axis(std::cos(angle), std::sin(angle));
  const capture::Image image = color::mask_image(100, 100, [&](int u, int v) {
    const Vector2d d = Vector2d(u, v) - centre;
    return d.norm() <= r && d.dot(axis) >= cut;
  });
  color::MatchBits bits(100, 100);
  bits.look_at(image, color::mask_table());
  color::RegionFinder finder;
  const auto& regions = finder.find(bits, {0, 0, 99, 99}, 1, 0);
  TargetView view{};
  view.image = &image;
  Sighting s = sighting_of(view, regions.at(0), r, pixel_noise_px, {});
  s.px -= centre;  // now the error
  return s;
}

// Of the edge, with samples of one pixel.
double rounding(double radius_px) {
  return 1 / (12 * std::numbers::pi * radius_px);
}

TEST(Volume, APlaceMayBeInsideIfOneSigmaAlongItsRayIs) {
  const Volume volume{{-1, -1, 0}, {1, 1, 2}};
  const Vector3d ray = Vector3d(1, 0.2, -0.1).normalized(), p(1.4, 0, 1);
  const auto covariance = [&](double along_m) {
    return Eigen::Matrix3d(1e-6 * Eigen::Matrix3d::Identity() + along_m * along_m * ray * ray.transpose());
  };
  EXPECT_FALSE(inside(volume, p, 0.04));
  EXPECT_FALSE(may_be_inside(volume, p, covariance(0.3), 0.04));
  EXPECT_TRUE(may_be_inside(volume, p, covariance(0.5), 0.04));
  EXPECT_FALSE(may_be_inside(volume, p + Vector3d(0, 1.3, 0), covariance(0.5), 0.04)) << "the ray passes by";
  EXPECT_TRUE(may_be_inside(volume, {0, 0, 1}, Eigen::Matrix3d::Zero(), 0));
  EXPECT_FALSE(may_be_inside(volume, p, Eigen::Matrix3d::Zero(), 0.04));
}

TEST(SightingOf, HullIsTheSizeOfALargeStripedDiscOnly) {
  for (const double r : {6.0, 25.0}) {
    const capture::Image image = color::mask_image(
        100, 100, [&](int u, int v) { return Vector2d(u - 50.3, v - 49.6).norm() <= r && v % 4 != 0; });
    color::MatchBits bits(100, 100);
    bits.look_at(image, color::mask_table());
    color::RegionFinder finder;
    const color::ColorRegion region = finder.find(bits, {0, 0, 99, 99}, 1, 2 * r).at(0);
    TargetView view{};
    view.image = &image, view.matches = &bits;
    Sighting s = sighting_of(view, region, r, 0.2, {});
    ASSERT_TRUE(s.size);
    EXPECT_LT(s.size->radius_px, 0.93 * r);
    measure_hull(view, region, {}, s);
    if (r > 10)
      EXPECT_NEAR(s.size->radius_px, r, 0.03 * r);
    else
      EXPECT_EQ(s.size->radius_px, s.radius_px);
  }
}

TEST(SightingOf, WholeDiscHasThePixelNoise) {
  for (const double r : {3.0, 5.0, 8.0, 16.0, 30.0}) {
    const Sighting s = sighting_of_disc(r, 0, -100);
    EXPECT_NEAR(s.support, 1, 0.12) << r;
    EXPECT_LT(s.px.norm(), 0.3) << r;
    const double variance = 0.04 + 0.0016 * r * r + rounding(r);
    EXPECT_LT((s.covariance - 0.8 * variance * Eigen::Matrix2d::Identity()).norm(), 1e-9) << r;
    EXPECT_NEAR(s.bias_sigma_px * s.bias_sigma_px, 0.2 * variance, 1e-9) << r;
  }
  EXPECT_NEAR(sighting_of_disc(8, 0, -100, 2.0).covariance(0, 0), 0.8 * (4 + 0.0016 * 64 + rounding(8)), 1e-9);
}

TEST(SightingOf, HiddenHalfIsUncertainAcrossTheCutOnly) {
  for (const double angle : {0.0, 0.5, 1.2, 2.0, 3.0, 4.5}) {
    const double r = 12;
    const Sighting s = sighting_of_disc(r, angle, 0);
    const Vector2d across(std::cos(angle), std::sin(angle)), along(-across.y(), across.x());
    EXPECT_NEAR(s.px.dot(across), 4 * r / (3 * std::numbers::pi), 0.5);
    EXPECT_NEAR(s.support, 0.5, 0.05);
    const double sigma_across = std::sqrt(across.dot(s.covariance * across)),
                 sigma_along = std::sqrt(along.dot(s.covariance * along));
    EXPECT_GT(sigma_across, 0.3 * r) << angle;
    EXPECT_LT(sigma_along, 0.06 * r) << angle;
  }
}

// Worst case: a quarter hidden, a misfit just within a small disc's shape noise; there the truth is four sigma away,
// elsewhere within three.
TEST(SightingOf, CovarianceContainsTheTruth) {
  int all = 0, beyond_three = 0;
  for (const double r : {4.0, 8.0, 16.0}) {
    for (double angle = 0; angle < 6.2; angle += 0.7) {
      for (int tenths = -8; tenths < 8; ++tenths) {
        const Sighting s = sighting_of_disc(r, angle, tenths / 10.0 * r);
        const double d2 =
            mahalanobis2(s.px, s.covariance + s.bias_sigma_px * s.bias_sigma_px * Eigen::Matrix2d::Identity());
        EXPECT_LT(d2, 18) << "radius " << r << ", cut at " << tenths / 10.0 << " r, " << angle;
        ++all, beyond_three += d2 > 9 ? 1 : 0;
      }
    }
  }
  EXPECT_LT(beyond_three, 0.08 * all);
}

TEST(SightingOf, TooWideRegionIsUncertain) {
  color::ColorRegion region;
  region.area = 400;
  region.centre = {10, 10};
  region.spread << 100, 0, 0, 16;  // half widths of discs of radius 20 and 8
  const capture::Image image;
  TargetView view{};
  view.image = &image;
  const Sighting s = sighting_of(view, region, 8, 0.2, {});
  EXPECT_GT(std::sqrt(s.covariance(0, 0)), 1.3 * (20 - 8 - 1.6) - 1e-9);
  EXPECT_LT(std::sqrt(s.covariance(1, 1)), 0.5);
  EXPECT_EQ(s.support, 1);
}

// Rolling shutter: downward motion stretches a ball, sideways motion shears it.
TEST(SightingOf, ExpectsTheShapeOfAMovingBall) {
  const double r = 10, row_s = 6e-5, usual = 2 * 0.8 * (0.2 + rounding(r));
  const Vector2d velocity(900, 1500);
  Eigen::Matrix2d outline_from_disc = Eigen::Matrix2d::Identity();
  outline_from_disc.col(1) += row_s * velocity / (1 - row_s * velocity.y());
  color::ColorRegion region;
  region.area = 314;
  region.centre = {50, 50};
  region.spread = r * r / 4 * outline_from_disc * outline_from_disc.transpose();
  const capture::Image image;
  TargetView view{};
  view.image = &image;
  const ImageMotion known{.velocity = 3 * velocity, .row_s = 3 * row_s, .longest_exposure_s = 0};
  region.spread = r * r / 4 * Eigen::Matrix2d::Identity();
  EXPECT_GT(sighting_of(view, region, r, 0.2, known).covariance.trace(), 1) << "a disc is not what such a ball shows";
  const ImageMotion motion{.velocity = velocity, .row_s = row_s, .longest_exposure_s = 0};
  region.spread = r * r / 4 * outline_from_disc * outline_from_disc.transpose();
  EXPECT_NEAR(sighting_of(view, region, r, 0.2, motion).covariance.trace(), usual, 1e-9);
  // Blur: half of the motion during the exposure, along the path only.
  ImageMotion smeared{.velocity = {600, 0}, .row_s = 0, .longest_exposure_s = 0.01};
  region.spread << 12.5 * 12.5 / 4, 0, 0, r * r / 4;
  EXPECT_NEAR(sighting_of(view, region, r, 0.2, smeared).covariance.trace(), usual, 1e-9);
  smeared.velocity = {0, 600};
  EXPECT_GT(sighting_of(view, region, r, 0.2, smeared).covariance(0, 0), 0.3);
}

TEST(ProjectBall, MatchesTheCameraAndNumericDifferences) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).build();
  for (const calib::Camera& camera : scene.rig.cameras) {
    for (const Vector3d& p : {Vector3d(0, 0, 1), Vector3d(0.3, -0.2, 1.2), Vector3d(-0.4, 0.3, 0.7)}) {
      const auto at = project_ball(camera, p, 0.04);
      ASSERT_TRUE(at);
      EXPECT_EQ(at->px, camera.project_world(p)->px);
      const double h = 1e-6;
      for (int i = 0; i < 3; ++i) {
        const Vector3d step = h * Vector3d::Unit(i);
        const Vector2d slope = (camera.project_world(p + step)->px - camera.project_world(p - step)->px) / (2 * h);
        EXPECT_LT((at->jacobian.col(i) - slope).norm(), 1e-4);
      }
      const double distance = (p - camera.centre()).norm();
      EXPECT_NEAR(at->radius_px, 0.04 * camera.model.fx() / distance, 0.12 * at->radius_px);
    }
    EXPECT_FALSE(project_ball(camera, 3 * camera.centre(), 0.04));  // behind it
  }
}

// Three cameras, exact measurements of a moving point, each at its own time.
class Rig : public testing::Test {
 protected:
  Rig() {
    target.name = "ball";
    scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).build();
    for (std::size_t i = 0; i < 3; ++i) {
      TargetView view{};
      view.index = static_cast<int>(i);
      view.camera = &scene.rig.cameras[i];
      view.frame = &frames[i];
      view.image = &frames[i].pixels;
      views.push_back(view);
    }
  }
  Sighting exact(std::size_t view, const Vector3d& at_p, const Eigen::Matrix2d& covariance) const {
    Sighting s;
    s.row.camera = static_cast<int>(view);
    s.camera = &scene.rig.cameras[view];
    s.px = s.camera->project_world(at_p)->px;
    s.covariance = covariance;
    s.support = 1;
    return s;
  }
  // The region of a ball.
  color::ColorRegion region(std::size_t view, const Vector3d& centre, double radius_m = 0.04) const {
    const auto at = project_ball(scene.rig.cameras[view], centre, radius_m);
    color::ColorRegion r;
    r.area = static_cast<int>(std::numbers::pi * at->radius_px * at->radius_px);
    r.centre = at->px;
    r.spread = at->radius_px * at->radius_px / 4 * Eigen::Matrix2d::Identity();
    return r;
  }
  std::vector<PositionCandidate> cross(const std::vector<std::vector<color::ColorRegion>>& regions,
                                       std::size_t most = 10) const {
    return cross_rays(views, regions, target, options, MotionState(scene.rig, false), most);
  }

  scene::Scene scene;
  std::array<capture::Frame, 3> frames;  // of one moment
  std::vector<TargetView> views;
  TargetOptions target;
  ObjectTrackerOptions options;  // its volume is (-1, -1, 0) .. (1, 1, 2)
  const Vector3d p{0.2, -0.1, 1.1};
};

TEST_F(Rig, InformationTriangulates) {
  Eigen::Matrix2d covariance;
  covariance << 0.3, 0.1, 0.1, 0.2;
  const std::vector<Sighting> sightings{exact(0, p, covariance), exact(1, p, 2 * covariance), exact(2, p, covariance)};
  Vector3d estimate = p + Vector3d(0.03, -0.02, 0.04);
  for (int i = 0; i < 3; ++i) {
    const PositionInformation z = information_of(sightings, estimate);
    estimate = z.information.inverse() * z.vector;
  }
  EXPECT_LT((estimate - p).norm(), 1e-6);
}

TEST_F(Rig, InformationIsTheSumOfSquaredSlopes) {
  Eigen::Matrix2d covariance;
  covariance << 0.3, 0.1, 0.1, 0.2;
  const std::vector<Sighting> sightings{exact(0, p, covariance), exact(1, p, 2 * covariance)};
  const PositionInformation z = information_of(sightings, p);
  // Half of the second derivatives of the misfit, which is 0 at p, by numeric differences.
  const double h = 1e-5;
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  for (const Sighting& s : sightings) {
    Eigen::Matrix<double, 2, 3> slope;
    for (int i = 0; i < 3; ++i) {
      const Vector3d step = h * Vector3d::Unit(i);
      slope.col(i) = (s.camera->project_world(p + step)->px - s.camera->project_world(p - step)->px) / (2 * h);
    }
    expected += slope.transpose() * s.covariance.inverse() * slope;
  }
  EXPECT_LT((z.information - expected).norm(), 1e-5 * expected.norm());
}

TEST_F(Rig, OneViewLeavesItsRayUncertain) {
  const std::vector<Sighting> one{exact(0, p, Eigen::Matrix2d::Identity())};
  const PositionInformation z = information_of(one, p);
  const Vector3d ray = (p - scene.rig.cameras[0].centre()).normalized();
  EXPECT_NEAR(ray.dot(z.information * ray) / z.information.trace(), 0, 1e-9);
  EXPECT_GT(Eigen::FullPivLU<Eigen::Matrix3d>(z.information).setThreshold(1e-9).rank(), 1);
}

TEST_F(Rig, CrossesRaysAtTheBall) {
  const auto found = cross({{region(0, p)}, {region(1, p)}, {region(2, p)}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT((found[0].position - p).norm(), 1e-4);
  EXPECT_EQ(found[0].sightings.size(), 3u);
  EXPECT_NEAR(found[0].score, 3, 0.1);
  EXPECT_LT(found[0].covariance.trace(), 1e-4);
}

TEST_F(Rig, TwoViewsSufficeAndAThirdThatMissesAddsNothing) {
  const auto found = cross({{region(0, p)}, {region(1, p)}, {}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT((found[0].position - p).norm(), 1e-4);
  EXPECT_NEAR(found[0].score, 2, 0.1);
  EXPECT_TRUE(cross({{region(0, p)}, {}, {}}).empty());
  EXPECT_TRUE(cross({{}, {}, {}}).empty());
}

TEST_F(Rig, PrefersTheBallToClutter) {
  const Vector3d other(-0.5, 0.4, 0.8);
  const auto found =
      cross({{region(0, other), region(0, p)}, {region(1, p)}, {region(2, p), region(2, {0.7, 0.7, 0.5})}});
  ASSERT_FALSE(found.empty());
  EXPECT_LT((found[0].position - p).norm(), 1e-3);
  const auto both =
      cross({{region(0, other), region(0, p)}, {region(1, p), region(1, other)}, {region(2, p), region(2, other)}});
  ASSERT_GE(both.size(), 2u);
  EXPECT_LT(std::min((both[0].position - p).norm(), (both[1].position - p).norm()), 1e-3);
  EXPECT_LT(std::min((both[0].position - other).norm(), (both[1].position - other).norm()), 1e-3);
  EXPECT_EQ(
      cross({{region(0, other), region(0, p)}, {region(1, p), region(1, other)}, {region(2, p), region(2, other)}}, 1)
          .size(),
      1u);
}

TEST_F(Rig, FindsNothingOutsideTheVolume) {
  options.volume = {{-1, -1, 0}, {1, 1, 1.05}};
  EXPECT_TRUE(cross({{region(0, p)}, {region(1, p)}, {region(2, p)}}).empty());
  options.volume.max.z() = 1.07;  // the ball reaches into it
  EXPECT_FALSE(cross({{region(0, p)}, {region(1, p)}, {region(2, p)}}).empty());
}

TEST_F(Rig, FindsNothingOfAnotherSize) {
  EXPECT_TRUE(cross({{region(0, p, 0.12)}, {region(1, p, 0.12)}, {region(2, p, 0.12)}}).empty());
  EXPECT_TRUE(cross({{region(0, p, 0.01)}, {region(1, p, 0.01)}, {region(2, p, 0.01)}}).empty());
}

TEST_F(Rig, FindsNothingWhereRaysDoNotMeet) {
  EXPECT_TRUE(cross({{region(0, p)}, {region(1, p + Vector3d(0, 0, 0.3))}, {}}).empty());
}

}  // namespace
}  // namespace huetrack::object_tracking
