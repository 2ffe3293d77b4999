#include "camera_tracking/template_patch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "particle_filter/vector_clones.h"

namespace huetrack::camera_tracking {
namespace {

std::optional<Eigen::Vector2d> through(const calib::CameraModel& lens, const Eigen::Matrix3d& h,
                                       const Eigen::Vector2d& px) {
  const auto ray = lens.ray({px});
  if (!ray) return std::nullopt;
  const auto seen = lens.project(h * *ray);
  if (!seen) return std::nullopt;
  return seen->px;
}

constexpr int max_side = 16;

// One row of a window at a sub-pixel position.
HUETRACK_CLONES void interpolate(const std::uint8_t* __restrict a, const std::uint8_t* __restrict b, float w00,
                                 float w01, float w10, float w11, int n, float* __restrict out) {
  for (int i = 0; i < n; ++i) {
    out[i] = w00 * static_cast<float>(a[i]) + w01 * static_cast<float>(a[i + 1]) + w10 * static_cast<float>(b[i]) +
             w11 * static_cast<float>(b[i + 1]);
  }
}

struct Moments {
  float mean, deviation;
};
Moments moments_of(const float* x, int n) {
  float sum = 0;
  for (int i = 0; i < n; ++i) sum += x[i];
  const float mean = sum / static_cast<float>(n);
  float square = 0;
  for (int i = 0; i < n; ++i) square += (x[i] - mean) * (x[i] - mean);
  return {mean, std::sqrt(square / static_cast<float>(n))};
}

}  // namespace

Eigen::Matrix3d plane_homography(const calib::Rigid3d& cam1_from_cam0, const Eigen::Vector3d& normal, double d) {
  return cam1_from_cam0.rotation.toRotationMatrix() + cam1_from_cam0.translation * normal.transpose() / d;
}

std::optional<PatchTransfer> transfer_patch(const calib::CameraModel& lens, const Eigen::Vector2d& px0,
                                            const Eigen::Matrix3d& h) {
  const auto centre = through(lens, h, px0);
  if (!centre) return std::nullopt;
  PatchTransfer patch{*centre, Eigen::Matrix2d::Zero()};
  constexpr double step = 1.0;
  for (int k = 0; k < 2; ++k) {
    const auto shifted = through(lens, h, px0 + step * Eigen::Vector2d::Unit(k));
    if (!shifted) return std::nullopt;
    patch.affine.col(k) = (*shifted - *centre) / step;
  }
  return patch;
}

int search_level(const Eigen::Matrix2d& affine, int source_level, int levels) {
  const double zoom = std::sqrt(std::max(1e-9, std::abs(affine.determinant())));
  return std::clamp(static_cast<int>(std::lround(source_level + std::log2(zoom))), 0, levels - 1);
}

bool warp_patch(const Pyramid& source, const Eigen::Vector2d& source_px, const Eigen::Matrix2d& affine, int level,
                int side, WarpedPatch& out) {
  const double zoom = affine.determinant();
  if (!(zoom > 0.04) || !(zoom < 25)) return false;  // mirrored, edge-on, or another scale altogether
  const Eigen::Matrix2d back = affine.inverse() * scale_of(level);
  if (back.norm() > 16 * scale_of(level)) return false;
  const double step = std::sqrt(std::abs(back.determinant()));
  const int from = std::clamp(static_cast<int>(std::lround(std::log2(step))), 0, source.count() - 1);
  const GreyImage& image = source.level(from);
  const Eigen::Vector2f centre = to_level(source_px, from).cast<float>();
  const Eigen::Matrix2f m = (back / scale_of(from)).cast<float>();
  const int wide = side + 2;
  const float half = 0.5f * static_cast<float>(wide - 1);
  for (const float a : {-half, half}) {
    for (const float b : {-half, half}) {
      const Eigen::Vector2f p = centre + m * Eigen::Vector2f(a, b);
      if (!image.contains(static_cast<double>(p.x()), static_cast<double>(p.y()), 0.01)) return false;
    }
  }
  out.level = level;
  out.bordered.resize(static_cast<std::size_t>(wide * wide));
  out.inner.side = side;
  out.inner.pixels.resize(static_cast<std::size_t>(side * side));
  for (int j = 0; j < wide; ++j) {
    const Eigen::Vector2f start = centre + m * Eigen::Vector2f(-half, static_cast<float>(j) - half);
    for (int i = 0; i < wide; ++i) {
      const Eigen::Vector2f p = start + static_cast<float>(i) * m.col(0);
      out.bordered[static_cast<std::size_t>(j * wide + i)] = sample(image, p.x(), p.y());
    }
  }
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const float grey = out.bordered[static_cast<std::size_t>((j + 1) * wide + i + 1)];
      const auto rounded = static_cast<std::uint8_t>(grey + 0.5f);  // NOLINT(bugprone-incorrect-roundings): 0 to 255
      out.inner.pixels[static_cast<std::size_t>(j * side + i)] = rounded;
    }
  }
  out.inner.finish();
  return out.inner.norm > 0;
}

std::optional<Refined> refine(const GreyImage& image, const WarpedPatch& patch, const Eigen::Vector2d& start,
                              double max_shift) {
  const int side = patch.inner.side, wide = side + 2, n = side * side;
  float t[max_side * max_side], gu[max_side * max_side], gv[max_side * max_side], window[max_side * max_side];
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const float* p = patch.bordered.data() + (j + 1) * wide + i + 1;
      t[j * side + i] = *p;
      gu[j * side + i] = 0.5f * (p[1] - p[-1]);
      gv[j * side + i] = 0.5f * (p[wide] - p[-wide]);
    }
  }
  const Moments tm = moments_of(t, n);
  if (!(tm.deviation > 0.5f)) return std::nullopt;
  float mean_gu = 0, mean_gv = 0;
  for (int k = 0; k < n; ++k) mean_gu += gu[k], mean_gv += gv[k];
  mean_gu /= static_cast<float>(n), mean_gv /= static_cast<float>(n);
  float huu = 0, huv = 0, hvv = 0;  // free offset: gradients about their mean
  for (int k = 0; k < n; ++k) {
    gu[k] -= mean_gu, gv[k] -= mean_gv;
    huu += gu[k] * gu[k], huv += gu[k] * gv[k], hvv += gv[k] * gv[k];
  }
  const float det = huu * hvv - huv * huv;
  if (!(det > 1e-4f * (huu + hvv) * (huu + hvv))) return std::nullopt;  // an edge: it would slide

  const float half = 0.5f * static_cast<float>(side - 1);
  float u = static_cast<float>(start.x()), v = static_cast<float>(start.y());
  Refined out{start, 0, 0};
  for (int iteration = 0; iteration < 10; ++iteration) {
    const float left = u - half, top = v - half;
    const int iu = static_cast<int>(std::floor(left)), iv = static_cast<int>(std::floor(top));
    if (iu < 0 || iv < 0 || iu + side >= image.width || iv + side >= image.height) return std::nullopt;
    const float fu = left - static_cast<float>(iu), fv = top - static_cast<float>(iv);
    for (int j = 0; j < side; ++j) {
      interpolate(image.row(iv + j) + iu, image.row(iv + j + 1) + iu, (1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv,
                  fu * fv, side, window + j * side);
    }
    const Moments wm = moments_of(window, n);
    if (!(wm.deviation > 0.5f)) return std::nullopt;
    const float gain = tm.deviation / wm.deviation;
    float bu = 0, bv = 0, square = 0;
    for (int k = 0; k < n; ++k) {
      const float e = gain * (window[k] - wm.mean) - (t[k] - tm.mean);
      bu += gu[k] * e, bv += gv[k] * e, square += e * e;
    }
    out.rms = std::sqrt(square / static_cast<float>(n));
    // With unit variances, the sum of squared differences is 2 - 2 rho.
    out.ncc = 1 - 0.5f * square / (static_cast<float>(n) * tm.deviation * tm.deviation);
    const float du = -(hvv * bu - huv * bv) / det, dv = -(huu * bv - huv * bu) / det;
    u += du, v += dv;
    const double su = static_cast<double>(u) - start.x(), sv = static_cast<double>(v) - start.y();
    if (!(su * su + sv * sv <= max_shift * max_shift)) return std::nullopt;
    if (du * du + dv * dv < 1e-4f) break;
  }
  out.px = {static_cast<double>(u), static_cast<double>(v)};
  return out;
}

}  // namespace huetrack::camera_tracking
