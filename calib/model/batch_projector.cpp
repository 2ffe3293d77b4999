#include "calib/model/batch_projector.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "particle_filter/vector_clones.h"

namespace huetrack::calib {
namespace {

using Coefficients = BatchProjector::Coefficients;
enum class Lens { radtan_k1_k2, radtan_k3, radtan_rational, fisheye, stereographic };

// atan2(y, x) for y >= 0 without a branch, to 2e-7 rad: S. L. Moshier, Cephes, atanf.c.
[[gnu::always_inline]] inline float atan2_upper_half(float y, float x) {
  constexpr float pi = std::numbers::pi_v<float>, tan_pi_8 = 0.4142135624f;
  const float ax = x < 0 ? -x : x;
  const bool steep = y > ax;
  const float low = steep ? ax : y, high = steep ? y : ax;
  const bool reduce = low > tan_pi_8 * high;  // atan(t) = pi/4 + atan((t - 1) / (t + 1))
  const float numerator = reduce ? low - high : low, denominator = reduce ? low + high : high;
  const float t = numerator / (denominator > 0 ? denominator : 1.0f), s = t * t;
  const float tail =
      (((8.05374449538e-2f * s - 1.38776856032e-1f) * s + 1.99777106478e-1f) * s - 3.33329491539e-1f) * s * t + t;
  const float first = reduce ? pi / 4 + tail : tail;
  const float quadrant = steep ? pi / 2 - first : first;
  return x < 0 ? pi - quadrant : quadrant;
}

// The formulas of camera_model.cpp in a form that the compiler vectorises: no branches, selections at the end, one
// reciprocal per point (two for the rational and the fisheye lens), and only the terms of this lens.
template <Lens lens>
[[gnu::always_inline]] inline void project_all(const Coefficients& coefficients, const float* __restrict x,
                                               const float* __restrict y, const float* __restrict z, std::size_t n,
                                               float* __restrict u, float* __restrict v) {
  const Coefficients c = coefficients;  // a local copy: u and v cannot point into it
  const float* r = c.rotation;
  for (std::size_t i = 0; i < n; ++i) {
    const float px = r[0] * x[i] + r[1] * y[i] + r[2] * z[i] + c.translation[0];
    const float py = r[3] * x[i] + r[4] * y[i] + r[5] * z[i] + c.translation[1];
    const float pz = r[6] * x[i] + r[7] * y[i] + r[8] * z[i] + c.translation[2];
    float dx, dy;  // distorted, on the plane z = 1
    bool seen;
    if constexpr (lens == Lens::fisheye) {
      const float rho = std::sqrt(px * px + py * py);
      const float theta = atan2_upper_half(rho, pz), s = theta * theta;
      const float theta_d = theta * (1 + s * (c.k1 + s * (c.k2 + s * (c.k3 + s * c.k4))));
      const float g = theta_d / (rho > 0 ? rho : 1.0f);  // on the axis theta_d is 0
      dx = g * px;
      dy = g * py;
      seen = (theta <= c.limit) & ((rho > 0) | (pz > 0));
    } else if constexpr (lens == Lens::stereographic) {
      const float rho2 = px * px + py * py, length = std::sqrt(rho2 + pz * pz);
      // Behind the camera |P| + Z cancels; it equals rho^2 / (|P| - Z).
      const bool ahead = pz >= 0;
      const float over = ahead ? 2.0f : 2 * (length - pz), under = ahead ? length + pz : rho2, q = over / under;
      const float a = q * px, b = q * py, s = a * a + b * b;
      const float f = 1 + s * (c.k1 + s * (c.k2 + s * (c.k3 + s * c.k4))), p1_p2 = 2 * (c.p1 * b + c.p2 * a);
      dx = a * (f + p1_p2) + (c.p2 + c.k5) * s;
      dy = b * (f + p1_p2) + (c.p1 + c.k6) * s;
      seen = s <= c.limit;
    } else {
      const float inverse_z = 1 / pz;
      const float a = px * inverse_z, b = py * inverse_z, s = a * a + b * b;
      float f = lens == Lens::radtan_k1_k2 ? 1 + s * (c.k1 + s * c.k2) : 1 + s * (c.k1 + s * (c.k2 + s * c.k3));
      if constexpr (lens == Lens::radtan_rational) f /= 1 + s * (c.k4 + s * (c.k5 + s * c.k6));
      const float p1_p2 = 2 * (c.p1 * b + c.p2 * a);  // 2 p1 a b + p2 (s + 2 a a) = a p1_p2 + p2 s, likewise for b
      dx = a * (f + p1_p2) + c.p2 * s;
      dy = b * (f + p1_p2) + c.p1 * s;
      seen = (pz > 0) & (s <= c.limit);
    }
    u[i] = seen ? c.fx * dx + c.cx : BatchProjector::outside;
    v[i] = seen ? c.fy * dy + c.cy : BatchProjector::outside;
  }
}

HUETRACK_CLONES void project_k1_k2(const Coefficients& c, const float* x, const float* y, const float* z, std::size_t n,
                                   float* u, float* v) {
  project_all<Lens::radtan_k1_k2>(c, x, y, z, n, u, v);
}

HUETRACK_CLONES void project_k3(const Coefficients& c, const float* x, const float* y, const float* z, std::size_t n,
                                float* u, float* v) {
  project_all<Lens::radtan_k3>(c, x, y, z, n, u, v);
}

HUETRACK_CLONES void project_rational(const Coefficients& c, const float* x, const float* y, const float* z,
                                      std::size_t n, float* u, float* v) {
  project_all<Lens::radtan_rational>(c, x, y, z, n, u, v);
}

HUETRACK_CLONES void project_fisheye(const Coefficients& c, const float* x, const float* y, const float* z,
                                     std::size_t n, float* u, float* v) {
  project_all<Lens::fisheye>(c, x, y, z, n, u, v);
}

HUETRACK_CLONES void project_stereographic(const Coefficients& c, const float* x, const float* y, const float* z,
                                           std::size_t n, float* u, float* v) {
  project_all<Lens::stereographic>(c, x, y, z, n, u, v);
}

}  // namespace

BatchProjector::BatchProjector(const Camera& camera) : coefficients_{}, kernel_(project_fisheye) {
  Coefficients& c = coefficients_;
  const auto single = [](double value) { return static_cast<float>(value); };
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  for (int i = 0; i < 9; ++i) c.rotation[i] = single(rotation(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) c.translation[i] = single(camera.cam_from_world.translation[i]);
  c.fx = single(camera.model.fx());
  c.fy = single(camera.model.fy());
  c.cx = single(camera.model.cx());
  c.cy = single(camera.model.cy());
  if (const auto* fisheye = std::get_if<FisheyeKannalaBrandt>(&camera.model.lens())) {
    const auto& k = fisheye->distortion;
    c.k1 = single(k[0]), c.k2 = single(k[1]), c.k3 = single(k[2]), c.k4 = single(k[3]);
    c.limit = single(camera.model.limit());
    return;
  }
  const auto* stereographic = std::get_if<Stereographic>(&camera.model.lens());
  const auto& k = stereographic ? stereographic->distortion : std::get<PinholeRadtan>(camera.model.lens()).distortion;
  c.k1 = single(k[0]), c.k2 = single(k[1]), c.p1 = single(k[2]), c.p2 = single(k[3]);
  c.k3 = single(k[4]), c.k4 = single(k[5]), c.k5 = single(k[6]), c.k6 = single(k[7]);
  if (stereographic) {
    c.limit = single(camera.model.limit());
    kernel_ = project_stereographic;
    return;
  }
  c.limit = single(std::min(camera.model.limit(), 1e6));  // 89.9 degrees: beyond, single precision overflows
  kernel_ = k[5] != 0 || k[6] != 0 || k[7] != 0 ? project_rational : k[4] != 0 ? project_k3 : project_k1_k2;
}

}  // namespace huetrack::calib
