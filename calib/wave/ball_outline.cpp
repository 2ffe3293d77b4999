#include "calib/wave/ball_outline.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calib/model/median.h"

namespace huetrack::wave {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double margin_px = 7;         // of a patch, beyond the region
constexpr double most_extent_px = 150;  // of a patch; larger regions are as sharp as they need to be

// Ellipse with the region's second moments.
class RegionEllipse {
 public:
  explicit RegionEllipse(const color::ColorRegion& region)
      : centre(region.centre),
        radius(2 * std::pow(region.spread.determinant(), 0.25)),
        reach(2 * region.spread.diagonal().cwiseSqrt()),
        shape_(region.spread.inverse() / 4) {}

  // Approximate signed distance, px; inside: negative.
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
  return {static_cast<double>(pixel.light), static_cast<double>(pixel.blue), static_cast<double>(pixel.red)};
}

void for_each_pixel(const BallPatch& patch, const RegionEllipse& ellipse, double margin, auto&& visit) {
  const PixelRange box = box_around(
      ellipse, margin, {patch.u_min, patch.v_min, patch.u_min + patch.width - 1, patch.v_min + patch.height - 1});
  for (int v = box.v_min; v <= box.v_max; ++v) {
    for (int u = box.u_min; u <= box.u_max; ++u) visit(u, v, patch.at(u, v), ellipse.beyond_edge(u, v));
  }
}

// Brightness of the ball: linear over the region (light from one side).
class Shading {
 public:
  Shading(const RegionEllipse& ellipse) : centre_(ellipse.centre), radius_(ellipse.radius) {}
  void add(int u, int v, double light) {
    const Vector3d at(1, u - centre_.x(), v - centre_.y());
    normal_ += at * at.transpose();
    right_ += at * light;
  }
  // false: nothing lit was added
  bool solve(double otherwise) {
    const double count = normal_(0, 0);
    normal_.diagonal().tail<2>().array() += 0.5 * radius_ * radius_;  // regularisation
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

// Moments of the covered area.
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
    // The outline changes a rim of a pixel. Larger changes of area or centre (over the radius) are errors.
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
  patch.chroma_columns =
      image.format == capture::PixelFormat::bgr || image.format == capture::PixelFormat::i444 ? 1 : 2;
  patch.u_min = box.u_min, patch.v_min = box.v_min;
  patch.width = box.u_max - box.u_min + 1, patch.height = box.v_max - box.v_min + 1;
  for (int v = box.v_min; v <= box.v_max; ++v) {
    for (int u = box.u_min; u <= box.u_max; ++u) {
      const Eigen::Vector3f light = light_at(image, u, v);
      const auto chroma = [](float c) { return static_cast<std::int8_t>(std::clamp(std::lround(c), -128L, 127L)); };
      patch.pixels.push_back({static_cast<std::uint8_t>(std::clamp(std::lround(light[0]), 0L, 255L)), chroma(light[1]),
                              chroma(light[2]), matches.at(u, v)});
    }
  }
  return patch;
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
  constexpr std::size_t least_ring = 8;  // pixels
  if (light.size() < least_ring || object.x() <= 0 || background.x() <= 0) return region;
  const double behind = calib::median(std::move(light));
  const Vector3d of_object = object / object.x(), of_background = background / background.x();
  // Chroma over light: unmixing nearer colours amplifies noise.
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
  constexpr double darkest = 10;  // of 255; limits noise before black
  for_each_pixel(patch, ellipse, rim_px, [&](int u, int v, const BallPatch::Pixel& pixel, double off) {
    if (off > rim_px) return;
    const Vector2d parts = (unmix * light_of(pixel)).cwiseMax(0);  // light of the object, of the background
    coverage.add(u, v, parts.x() / (parts.x() + parts.y() * shading.at(u, v) / std::max(behind, darkest) + noise));
  });
  return coverage.region_or(region, ellipse.radius);
}

namespace {

// Linear light 0..1 from camera values.
constexpr double gamma_of_cameras = 2.2, darkest = 1e-4;

Vector3d linear_rgb(const Vector3d& light) {
  const Vector3d rgb(light[0] + light[2] / 0.713, light[0] - 0.344 * light[1] / 0.564 - 0.714 * light[2] / 0.713,
                     light[0] + light[1] / 0.564);
  return (rgb / 255).cwiseMax(0).cwiseMin(1.2).array().pow(gamma_of_cameras).max(darkest);
}

// Fits position and size of an ellipse of known shape to a patch. Pixels mix ball and background in linear light. The
// ball's light is a quadratic polynomial per colour; the background is scaled by a linear one (the ball's shadow).
// Levenberg-Marquardt; pixels that show the background where the ball should be (occlusion) do not count.
class EllipseFit {
 public:
  using Place = Vector3d;  // centre, px; log of the size

  EllipseFit(const BallPatch& patch, const BackgroundImage& background, const Eigen::Matrix2d& shape,
             const Place& start)
      : shape_inverse_(shape.inverse()), origin_(start.head<2>()), columns_(patch.chroma_columns) {
    size_ = std::exp(start.z()) * std::sqrt(shape.determinant());
    const Vector3d noise = background.noise.cast<double>();
    sigma_ << std::max(3.0, noise[0]), std::max(1.5, noise[1]), std::max(1.5, noise[2]);
    Vector3d level = Vector3d::Zero();
    int inside = 0;
    for (int v = patch.v_min; v < patch.v_min + patch.height; ++v) {
      for (int u = patch.u_min - patch.u_min % columns_; u < patch.u_min + patch.width; u += columns_) {
        if (u < patch.u_min || u + columns_ > patch.u_min + patch.width) continue;
        if (off(start, Vector2d(u + 0.5 * (columns_ - 1), v)) > reach_px) continue;
        for (int k = 0; k < columns_; ++k) {
          const Vector3d light = light_of(patch.at(u + k, v)), behind = background.at(u + k, v).cast<double>();
          pixels_.push_back(
              {Vector2d(u + k, v), light, linear_rgb(behind), ((light - behind).cwiseQuotient(sigma_)).norm()});
          if (off(start, pixels_.back().at) > -1 || !patch.at(u + k, v).match) continue;
          level += linear_rgb(light);
          ++inside;
        }
      }
    }
    level /= std::max(1, inside);
    mean_ = level;
    level_ = std::max(0.02, level.maxCoeff());
  }

  // false: too few pixels.
  bool solve(Place& place) {
    if (!(mean_.maxCoeff() > darkest) || pixels_.size() < 20) return false;
    Unknowns x = Unknowns::Zero();
    x.head<3>() = place;
    for (int k = 0; k < 3; ++k) x[3 + 6 * k] = mean_[k];
    const Unknowns start = x;
    double damping = 1e-3;
    System now = system_at(x, start);
    for (int round = 0; round < 25; ++round) {
      Eigen::MatrixXd damped = now.normal;  // dynamic size: shares the LDLT instantiation
      damped.diagonal() *= 1 + damping;
      const Unknowns next = x - Unknowns(damped.ldlt().solve(Eigen::VectorXd(now.gradient)));
      if (!next.allFinite() || (next - start).head<2>().norm() > 0.7 * size_ || std::abs(next[2] - start[2]) > 0.5) {
        damping *= 10;
        if (damping > 1e6) break;
        continue;
      }
      System there = system_at(next, start);
      if (there.cost < now.cost) {
        const double moved = (next - x).head<3>().norm();
        x = next;
        now = there;
        damping = std::max(1e-7, damping / 10);
        if (moved < 2e-3) break;
      } else {
        damping *= 10;
        if (damping > 1e6) break;
      }
    }
    place = x.head<3>();
    return true;
  }

 private:
  // Position, log size; the ball's light; the background's scale; log blur of light and chroma over the usual one;
  // motion blur along u and along the diagonal.
  static constexpr int unknowns = 3 + 18 + 3 + 2 + 2, blur = 24, smear = 26;
  using Unknowns = Eigen::Matrix<double, unknowns, 1>;
  using Row = Eigen::Matrix<double, 1, unknowns>;
  struct Pixel {
    Vector2d at;
    Vector3d light, behind;  // as the camera gives it; linear
    double changed;          // from the background, in standard deviations
  };
  struct System {
    Eigen::Matrix<double, unknowns, unknowns> normal = Eigen::Matrix<double, unknowns, unknowns>::Zero();  // lower half
    Unknowns gradient = Unknowns::Zero();
    double cost = 0;

    void add(double residual, const Row& slope, double weight) {
      constexpr double loss2 = 4;  // Cauchy's, beyond two standard deviations
      const double r2 = residual * residual, w = weight / (1 + r2 / loss2);
      cost += weight * loss2 * std::log1p(r2 / loss2) / 2;
      normal.selfadjointView<Eigen::Lower>().rankUpdate(slope.transpose(), w);
      gradient.noalias() += w * residual * slope.transpose();
    }
  };
  static constexpr double reach_px = 3.5, usual_blur_px = 0.6;

  double off(const Place& place, const Vector2d& at) const {
    const Vector2d d = at - place.head<2>();
    const Vector2d e = shape_inverse_ * d * std::exp(-place.z());
    const double in_radii = e.norm();
    if (in_radii < 1e-6) return -size_;
    return (in_radii - 1) / in_radii * d.norm();
  }

  // The edge near a pixel.
  struct Edge {
    double off;
    Vector3d by_place;  // derivative of off
    Vector2d along;     // direction of its normal, double angle
    double smeared;
  };
  Edge edge_at(const Unknowns& x, const Vector2d& at) const {
    const Place place = x.head<3>();
    Edge edge;
    edge.off = off(place, at);
    constexpr double h = 1e-3;
    for (int c = 0; c < 3; ++c) {
      Place moved = place;
      moved[c] += h;
      edge.by_place[c] = (off(moved, at) - edge.off) / h;
    }
    // d off / d centre is along the normal of the ellipse.
    const Vector2d normal = -edge.by_place.head<2>().normalized();
    edge.along = {normal.x() * normal.x() - normal.y() * normal.y(), 2 * normal.x() * normal.y()};
    edge.smeared = std::exp(x.segment<2>(smear).dot(edge.along));
    return edge;
  }

  // Predicted pixel and its derivatives.
  struct Prediction {
    Vector3d light;
    Eigen::Matrix<double, 3, unknowns> slopes;
    double cover = 0;
  };
  Prediction predict(const Unknowns& x, const std::array<double, 2>& blurs_px, const Pixel& p) const {
    const Edge edge = edge_at(x, p.at);
    Prediction out;
    out.cover = 0.5 * std::erfc(edge.off / (edge.smeared * blurs_px[0] * std::numbers::sqrt2));
    const Vector2d d = (p.at - origin_) / size_;
    Eigen::Matrix<double, 6, 1> terms;
    terms << 1, d.x(), d.y(), d.x() * d.x(), d.x() * d.y(), d.y() * d.y();
    const Vector3d shade_terms(1, d.x(), d.y());
    const double shade = 1 + x.segment<3>(21).dot(shade_terms);
    for (const int kind : {0, 1}) {
      const double blur_px = edge.smeared * blurs_px[static_cast<std::size_t>(kind)];
      const double a = 0.5 * std::erfc(edge.off / (blur_px * std::numbers::sqrt2));
      const double a_by_off =
          -std::exp(-edge.off * edge.off / (2 * blur_px * blur_px)) / (blur_px * std::sqrt(2 * std::numbers::pi));
      Vector3d rgb;
      Eigen::Matrix<double, 3, unknowns> j = Eigen::Matrix<double, 3, unknowns>::Zero();
      for (int c = 0; c < 3; ++c) {
        const double object = x.segment<6>(3 + 6 * c).dot(terms);
        const double mixed = a * object + (1 - a) * shade * p.behind[c];
        const double lit = std::max(mixed, darkest);
        rgb[c] = 255 * std::pow(lit, 1 / gamma_of_cameras);
        const double slope = mixed > darkest ? rgb[c] / (gamma_of_cameras * lit) : 0;
        j.row(c).head<3>() = slope * (object - shade * p.behind[c]) * a_by_off * edge.by_place.transpose();
        const double by_blur = -slope * (object - shade * p.behind[c]) * a_by_off * edge.off;
        j(c, blur + kind) = by_blur;
        j.row(c).segment<2>(smear) = by_blur * edge.along.transpose();
        j.row(c).segment<6>(3 + 6 * c) = slope * a * terms.transpose();
        j.row(c).segment<3>(21) = slope * (1 - a) * p.behind[c] * shade_terms.transpose();
      }
      const Eigen::Matrix3d& ycc = light_from_rgb();
      const int from = kind == 0 ? 0 : 1, rows = kind == 0 ? 1 : 2;
      out.light.segment(from, rows) = ycc.middleRows(from, rows) * rgb;
      out.slopes.middleRows(from, rows) = ycc.middleRows(from, rows) * j;
    }
    return out;
  }

  System system_at(const Unknowns& x, const Unknowns& start) const {
    // Chroma is blurred more than light.
    const std::array<double, 2> blurs_px{usual_blur_px * std::exp(x[blur]), usual_blur_px * std::exp(x[blur + 1])};
    System out;
    const auto columns = static_cast<std::size_t>(columns_);
    std::array<Prediction, 2> predicted;
    for (std::size_t i = 0; i + columns <= pixels_.size(); i += columns) {
      double shared = 0;
      for (std::size_t k = 0; k < columns; ++k) {
        const Pixel& p = pixels_[i + k];
        predicted[k] = predict(x, blurs_px, p);
        const double weight = 1 - predicted[k].cover / (1 + std::pow(p.changed / 3, 4));
        shared += weight / static_cast<double>(columns);
        out.add((predicted[k].light[0] - p.light[0]) / sigma_[0], predicted[k].slopes.row(0) / sigma_[0], weight);
      }
      for (int c = 1; c < 3; ++c) {
        double residual = 0;
        Row slope = Row::Zero();
        for (std::size_t k = 0; k < columns; ++k) {
          residual += (predicted[k].light[c] - pixels_[i + k].light[c]) / static_cast<double>(columns);
          slope += predicted[k].slopes.row(c) / static_cast<double>(columns);
        }
        out.add(residual / sigma_[c], slope / sigma_[c], shared);
      }
    }
    add_usual(x, start, out);
    return out;
  }

  // Priors.
  void add_usual(const Unknowns& x, const Unknowns& start, System& out) const {
    const auto usual = [&](int i, double sigma) {
      const double r = (x[i] - (i < 3 ? start[i] : 0)) / sigma;
      out.cost += r * r / 2;
      out.normal(i, i) += 1 / (sigma * sigma);
      out.gradient[i] += r / sigma;
    };
    for (int c = 0; c < 3; ++c) {
      for (int i = 1; i < 3; ++i) usual(3 + 6 * c + i, level_);
      for (int i = 3; i < 6; ++i) usual(3 + 6 * c + i, 0.05 * level_);
    }
    usual(21, 0.3);
    for (int i = 22; i < 24; ++i) usual(i, 0.2);
    usual(blur, 0.3);
    usual(blur + 1, 0.7);
    // Tight: a partly hidden ball looks smeared, too.
    for (int i = smear; i < unknowns; ++i) usual(i, 0.05);
  }

  static const Eigen::Matrix3d& light_from_rgb() {
    static const Eigen::Matrix3d m = [] {
      Eigen::Matrix3d out;
      const Eigen::RowVector3d y(0.299, 0.587, 0.114);
      out.row(0) = y;
      out.row(1) = 0.564 * (Eigen::RowVector3d(0, 0, 1) - y);
      out.row(2) = 0.713 * (Eigen::RowVector3d(1, 0, 0) - y);
      return out;
    }();
    return m;
  }

  Eigen::Matrix2d shape_inverse_;
  Vector2d origin_;
  int columns_;
  double size_ = 1, level_ = 1;
  Vector3d sigma_, mean_;
  std::vector<Pixel> pixels_;  // those that share chroma are adjacent
};

}  // namespace

color::ColorRegion outline_over_background(const BallPatch& patch, const color::ColorRegion& region,
                                           const BackgroundImage& background, const Eigen::Matrix2d& shape) {
  // Outside of the ball's blur and chroma bleeding.
  constexpr double ring_from_px = 4, ring_to_px = 7, changed_sigmas = 6, most_changed = 0.5;
  const Eigen::Vector3f steady = background.noise.cwiseMax(Eigen::Vector3f(1, 2.5f, 2.5f));
  if (patch.empty()) return region;
  const auto change = [&](int u, int v) {
    return (light_of(patch.at(u, v)) - background.at(u, v).cast<double>()).cwiseQuotient(steady.cast<double>()).norm();
  };
  // Pixels of the target's colour that differ from the background.
  const RegionEllipse rough(region);
  Coverage moving(region.centre);
  for_each_pixel(patch, rough, 2, [&](int u, int v, const BallPatch::Pixel& pixel, double off) {
    if (off < 2 && pixel.match && change(u, v) > 4) moving.add(u, v, 1);
  });
  const color::ColorRegion start = moving.region_or(region, rough.radius);
  const RegionEllipse ellipse(start);
  int ring = 0, changed = 0;
  for_each_pixel(patch, ellipse, ring_to_px, [&](int u, int v, const BallPatch::Pixel&, double off) {
    if (off < ring_from_px || off > ring_to_px) return;
    ++ring;
    changed += change(u, v) > changed_sigmas ? 1 : 0;
  });
  if (ring < 8 || changed > most_changed * ring) return region;
  const double unit = std::sqrt(shape.determinant());
  EllipseFit::Place place(start.centre.x(), start.centre.y(), std::log(ellipse.radius / unit));
  EllipseFit fit(patch, background, shape, place);
  if (!fit.solve(place)) return region;
  color::ColorRegion out;
  out.centre = place.head<2>();
  const double size = std::exp(place.z());
  out.spread = size * size / 4 * shape * shape.transpose();
  out.area = static_cast<int>(std::lround(std::numbers::pi * size * size * unit * unit));
  return out;
}

}  // namespace huetrack::wave
