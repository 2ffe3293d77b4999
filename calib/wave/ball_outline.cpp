#include "calib/wave/ball_outline.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include "calib/model/median.h"
#include "object_tracking/ball_outline.h"

namespace huetrack::wave {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double margin_px = 7;         // of a patch, beyond the region
constexpr double most_extent_px = 150;  // of a patch; larger regions are as sharp as they need to be

// The ellipse that is as wide as the region.
class RegionEllipse {
 public:
  explicit RegionEllipse(const color::ColorRegion& region)
      : centre(region.centre),
        radius(2 * std::pow(region.spread.determinant(), 0.25)),
        reach(2 * region.spread.diagonal().cwiseSqrt()),
        shape_(region.spread.inverse() / 4) {}

  // Pixels, about; inside it is negative.
  double beyond_edge(int u, int v) const {
    const Vector2d d = Vector2d(u, v) - centre;
    return (std::sqrt(d.dot(shape_ * d)) - 1) * radius;
  }

  const Vector2d centre;
  const double radius;
  const Vector2d reach;

 private:
  Eigen::Matrix2d shape_;
};

struct PixelRange {
  int u_min, v_min, u_max, v_max;
};

PixelRange box_around(const RegionEllipse& ellipse, double margin, const PixelRange& within) {
  const Vector2d low = ellipse.centre - ellipse.reach, high = ellipse.centre + ellipse.reach;
  return {std::max(within.u_min, static_cast<int>(std::floor(low.x() - margin))),
          std::max(within.v_min, static_cast<int>(std::floor(low.y() - margin))),
          std::min(within.u_max, static_cast<int>(std::ceil(high.x() + margin))),
          std::min(within.v_max, static_cast<int>(std::ceil(high.y() + margin)))};
}

Vector3d light_of(const BallPatch::Pixel& pixel) {
  return {double(pixel.light), pixel.blue - 128.0, pixel.red - 128.0};
}

void for_each_pixel(const BallPatch& patch, const RegionEllipse& ellipse, double margin, auto&& visit) {
  const PixelRange box = box_around(
      ellipse, margin, {patch.u_min, patch.v_min, patch.u_min + patch.width - 1, patch.v_min + patch.height - 1});
  for (int v = box.v_min; v <= box.v_max; ++v) {
    for (int u = box.u_min; u <= box.u_max; ++u) visit(u, v, patch.at(u, v), ellipse.beyond_edge(u, v));
  }
}

// How bright the object is over the region: a plane, as a ball is lit from one side.
class Shading {
 public:
  Shading(const RegionEllipse& ellipse) : centre_(ellipse.centre), radius_(ellipse.radius) {}
  void add(int u, int v, double light) {
    const Vector3d at(1, u - centre_.x(), v - centre_.y());
    normal_ += at * at.transpose();
    right_ += at * light;
  }
  // false: nothing was added that is lit
  bool solve(double otherwise) {
    const double count = normal_(0, 0);
    normal_.diagonal().tail<2>().array() += 0.5 * radius_ * radius_;  // few pixels say little about it
    plane_ = count >= 5 ? Vector3d(normal_.ldlt().solve(right_)) : Vector3d(otherwise, 0, 0);
    return plane_[0] > 0;
  }
  double at(int u, int v) const {
    const double lit = plane_[0] + plane_[1] * (u - centre_.x()) + plane_[2] * (v - centre_.y());
    return std::max(plane_[0] / 4, lit);
  }

 private:
  Vector2d centre_;
  double radius_;
  Matrix3d normal_ = Matrix3d::Zero();
  Vector3d right_ = Vector3d::Zero(), plane_ = Vector3d::Zero();
};

// Of how much of each pixel is covered.
class Coverage {
 public:
  explicit Coverage(const Vector2d& around) : around_(around) {}
  void add(int u, int v, double covered) {
    const Vector2d d = Vector2d(u, v) - around_;
    n_ += covered;
    sum_ += covered * d;
    squares_ += covered * d * d.transpose();
  }
  color::ColorRegion region_or(const color::ColorRegion& otherwise, double radius) const {
    // The outline adds or takes a rim of a pixel. What is so much smaller or larger, or is so far aside, over the
    // radius, is something else: light that was taken for the object, or a half of it.
    constexpr double least_area = 0.4, most_area = 2.5, most_aside = 0.5;
    if (n_ < least_area * otherwise.area || n_ > most_area * otherwise.area) return otherwise;
    const Vector2d mean = sum_ / n_;
    color::ColorRegion out;
    out.area = static_cast<int>(std::lround(n_));
    out.centre = around_ + mean;
    out.spread = squares_ / n_ - mean * mean.transpose();
    if (mean.norm() > most_aside * radius || !(out.spread.determinant() > 0) || !(out.spread(0, 0) > 0))
      return otherwise;
    return out;
  }

 private:
  Vector2d around_;
  double n_ = 0;
  Vector2d sum_ = Vector2d::Zero();
  Eigen::Matrix2d squares_ = Eigen::Matrix2d::Zero();
};

}  // namespace

BallPatch patch_around(const capture::Image& image, color::MatchBits& matches, const color::ColorRegion& region) {
  BallPatch patch;
  const RegionEllipse ellipse(region);
  if (2 * ellipse.reach.maxCoeff() + 2 * margin_px > most_extent_px) return patch;
  const PixelRange box = box_around(ellipse, margin_px, {0, 0, image.width - 1, image.height - 1});
  const outline::Picture picture = object_tracking::picture_of(image);
  patch.image_width = image.width, patch.image_height = image.height;
  patch.columns = picture.columns, patch.rows = picture.rows;
  patch.u_min = box.u_min & ~1, patch.v_min = box.v_min & ~1;
  patch.width = std::min(image.width - patch.u_min, (box.u_max - patch.u_min + 2) & ~1);
  patch.height = std::min(image.height - patch.v_min, (box.v_max - patch.v_min + 2) & ~1);
  patch.pixels.reserve(static_cast<std::size_t>(patch.width) * static_cast<std::size_t>(patch.height));
  const auto byte = [](float grey) { return static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L)); };
  for (int v = patch.v_min; v < patch.v_min + patch.height; ++v) {
    for (int u = patch.u_min; u < patch.u_min + patch.width; ++u) {
      const Eigen::Vector3f light = light_at(image, u, v);
      patch.pixels.push_back({byte(light[0]), byte(light[1] + 128), byte(light[2] + 128), matches.at(u, v)});
    }
  }
  return patch;
}

outline::Picture BallPatch::picture() const {
  constexpr std::ptrdiff_t bytes = sizeof(Pixel);
  outline::Picture out;
  out.width = image_width, out.height = image_height;
  out.columns = columns, out.rows = rows;
  out.part_u = u_min, out.part_v = v_min, out.part_width = width, out.part_height = height;
  out.light = {&pixels[0].light, bytes * width, bytes, u_min, v_min};
  out.blue = {&pixels[0].blue, bytes * width * rows, bytes * columns, u_min / columns, v_min / rows};
  out.red = {&pixels[0].red, bytes * width * rows, bytes * columns, u_min / columns, v_min / rows};
  return out;
}

color::ColorRegion outline_over_ring(const BallPatch& patch, const color::ColorRegion& region) {
  constexpr double rim_px = 1, ring_from_px = 2.5, ring_to_px = 4.5, noise = 4;
  if (patch.empty()) return region;
  const RegionEllipse ellipse(region);
  Vector3d object = Vector3d::Zero(), background = Vector3d::Zero();
  std::vector<double> light;
  double inside = 0;
  for_each_pixel(patch, ellipse, ring_to_px, [&](int, int, const BallPatch::Pixel& pixel, double off) {
    if (pixel.match && off < 0) {
      object += light_of(pixel);
      ++inside;
    } else if (!pixel.match && off > ring_from_px && off < ring_to_px) {
      background += light_of(pixel);
      light.push_back(pixel.light);
    }
  });
  constexpr std::size_t least_ring = 8;  // pixels; of fewer the mean is no background's
  if (light.size() < least_ring || object.x() <= 0 || background.x() <= 0) return region;
  const double behind = calib::median(std::move(light));
  const Vector3d of_object = object / object.x(), of_background = background / background.x();
  // Chroma over light: colours that are nearer to one another cannot be unmixed, but multiply the noise of a pixel.
  constexpr double least_contrast = 0.15;
  if ((of_object - of_background).norm() < least_contrast) return region;
  Eigen::Matrix<double, 3, 2> mix;
  mix << of_object, of_background;
  const Eigen::Matrix<double, 2, 3> unmix = (mix.transpose() * mix).inverse() * mix.transpose();
  Shading shading(ellipse);
  for_each_pixel(patch, ellipse, 0, [&](int u, int v, const BallPatch::Pixel& pixel, double off) {
    if (off <= -1 && pixel.match) shading.add(u, v, (unmix * light_of(pixel)).x());
  });
  if (!shading.solve(object.x() / inside)) return region;
  Coverage coverage(region.centre);
  constexpr double darkest = 10;  // of 255: before a black background the quotient would be of noise
  for_each_pixel(patch, ellipse, rim_px, [&](int u, int v, const BallPatch::Pixel& pixel, double off) {
    if (off > rim_px) return;
    const Vector2d parts = (unmix * light_of(pixel)).cwiseMax(0);  // light of the object, of the background
    coverage.add(u, v, parts.x() / (parts.x() + parts.y() * shading.at(u, v) / std::max(behind, darkest) + noise));
  });
  return coverage.region_or(region, ellipse.radius);
}

color::ColorRegion OutlineOverBackground::fit(const BallPatch& patch, const color::ColorRegion& region,
                                              const Eigen::Matrix2d& shape, const outline::Movement& movement,
                                              double t_s) {
  if (patch.empty()) return region;
  const BackgroundImage& background = background_.mean;
  const Vector3d steady = background.noise.cwiseMax(Eigen::Vector3f(1, 2.5f, 2.5f)).cast<double>();
  // Pixels of the target's colour that are not the background's own.
  const RegionEllipse rough(region);
  Coverage moving(region.centre);
  for_each_pixel(patch, rough, 2, [&](int u, int v, const BallPatch::Pixel& pixel, double off) {
    const Vector3d change = (light_of(pixel) - background.at(u, v).cast<double>()).cwiseQuotient(steady);
    if (off < 2 && pixel.match && change.norm() > 4) moving.add(u, v, 1);
  });
  const color::ColorRegion start = moving.region_or(region, rough.radius);
  const RegionEllipse ellipse(start);
  const outline::Ellipse expected{start.centre, ellipse.radius / std::sqrt(shape.determinant()) * shape};
  outline::FitOptions options;
  options.log_size = {0, 0.3};
  options.most_steps = 12;
  constexpr double same_light_radii = 37, same_light_s = 10;
  options.light_correlation =
      std::exp(-(start.centre - lit_px_).norm() / (same_light_radii * ellipse.radius) - (t_s - lit_s_) / same_light_s);
  const outline::Fit fit = fit_.fit(patch.picture(), background_.behind, expected, movement, look_, options);
  if (std::getenv("WAVE_DEBUG")) std::fprintf(stderr, "%d %.2f %.3f\n", int(fit.outcome), fit.misfit, fit.visible);
  if (fit.outcome != outline::FitOutcome::fits) return region;
  if (fit_.learn(look_)) lit_px_ = fit.centre, lit_s_ = t_s;
  const Eigen::Matrix2d axes = std::exp(fit.log_size.value) * expected.axes;
  color::ColorRegion out;
  out.centre = fit.centre;
  out.spread = axes * axes.transpose() / 4;
  out.area = static_cast<int>(std::lround(std::numbers::pi * axes.determinant()));
  return out;
}

}  // namespace huetrack::wave
