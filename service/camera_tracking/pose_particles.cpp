#include "camera_tracking/pose_particles.h"

#include <algorithm>
#include <cmath>

#include "particle_filter/resample.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::camera_tracking {
namespace {

// q <- dq q, c <- c + dc, with dq from the small rotation vector (a, b, c) by its second-order quaternion, normalised.
HUETRACK_CLONES void step(std::size_t n, const float* __restrict a, const float* __restrict b,
                          const float* __restrict c, float scale, float* __restrict qw, float* __restrict qx,
                          float* __restrict qy, float* __restrict qz) {
  for (std::size_t i = 0; i < n; ++i) {
    const float x = 0.5f * scale * a[i], y = 0.5f * scale * b[i], z = 0.5f * scale * c[i];
    const float w = 1.0f - 0.5f * (x * x + y * y + z * z);
    const float nw = w * qw[i] - x * qx[i] - y * qy[i] - z * qz[i];
    const float nx = w * qx[i] + x * qw[i] + y * qz[i] - z * qy[i];
    const float ny = w * qy[i] - x * qz[i] + y * qw[i] + z * qx[i];
    const float nz = w * qz[i] + x * qy[i] - y * qx[i] + z * qw[i];
    const float inv = 1.0f / std::sqrt(nw * nw + nx * nx + ny * ny + nz * nz);
    qw[i] = nw * inv, qx[i] = nx * inv, qy[i] = ny * inv, qz[i] = nz * inv;
  }
}

HUETRACK_CLONES void add_scaled(std::size_t n, const float* __restrict d, float scale, float* __restrict out) {
  for (std::size_t i = 0; i < n; ++i) out[i] += scale * d[i];
}

HUETRACK_CLONES void rotation_of(std::size_t n, const float* __restrict qw, const float* __restrict qx,
                                 const float* __restrict qy, const float* __restrict qz, float* __restrict a,
                                 float* __restrict b, float* __restrict c, float* __restrict d, float* __restrict e,
                                 float* __restrict f, float* __restrict g, float* __restrict h, float* __restrict k) {
  for (std::size_t i = 0; i < n; ++i) {
    const float w = qw[i], x = qx[i], y = qy[i], z = qz[i];
    a[i] = 1 - 2 * (y * y + z * z), b[i] = 2 * (x * y - w * z), c[i] = 2 * (x * z + w * y);
    d[i] = 2 * (x * y + w * z), e[i] = 1 - 2 * (x * x + z * z), f[i] = 2 * (y * z - w * x);
    g[i] = 2 * (x * z - w * y), h[i] = 2 * (y * z + w * x), k[i] = 1 - 2 * (x * x + y * y);
  }
}

// One row of p_cam = R (z - c).
HUETRACK_CLONES void row_times(std::size_t n, const float* __restrict a, const float* __restrict b,
                               const float* __restrict c, const float* __restrict cx, const float* __restrict cy,
                               const float* __restrict cz, float px, float py, float pz, float* __restrict out) {
  for (std::size_t i = 0; i < n; ++i) out[i] = a[i] * (px - cx[i]) + b[i] * (py - cy[i]) + c[i] * (pz - cz[i]);
}

}  // namespace

calib::Camera without_pose(calib::Camera camera) {
  camera.cam_from_world = {};
  return camera;
}

void PoseParticles::reset(std::size_t count, const calib::Rigid3d& cam_from_world) {
  const Eigen::Vector3d centre = calib::inverse(cam_from_world).translation;
  const Eigen::Quaterniond& q = cam_from_world.rotation;
  for (auto* array : {&qw, &qx, &qy, &qz, &cx, &cy, &cz, &weight, &x_, &y_, &z_}) array->resize(count);
  for (auto& array : rotation_) array.resize(count);
  std::ranges::fill(qw, static_cast<float>(q.w()));
  std::ranges::fill(qx, static_cast<float>(q.x()));
  std::ranges::fill(qy, static_cast<float>(q.y()));
  std::ranges::fill(qz, static_cast<float>(q.z()));
  std::ranges::fill(cx, static_cast<float>(centre.x()));
  std::ranges::fill(cy, static_cast<float>(centre.y()));
  std::ranges::fill(cz, static_cast<float>(centre.z()));
  std::ranges::fill(weight, 1.0f / static_cast<float>(count));
  rotation_is_valid_ = false;
}

void PoseParticles::walk_uniform(float rotation_rad, float position_m, particle_filter::Rng& rng) {
  const std::size_t padded = (size() + 15) / 16 * 16;
  scratch_.resize(6 * padded);
  rng.fill_uniform(scratch_);
  for (float& x : scratch_) x = 2 * x - 1;
  walk(padded, rotation_rad, position_m);
}

void PoseParticles::walk_normal(float rotation_rad, float position_m, particle_filter::Rng& rng) {
  scratch_.resize(6 * size());
  rng.fill_normal(scratch_);
  walk(size(), rotation_rad, position_m);
}

void PoseParticles::walk(std::size_t stride, float rotation_rad, float position_m) {
  const std::size_t n = size();
  const float* d = scratch_.data();
  step(n, d, d + stride, d + 2 * stride, rotation_rad, qw.data(), qx.data(), qy.data(), qz.data());
  add_scaled(n, d + 3 * stride, position_m, cx.data());
  add_scaled(n, d + 4 * stride, position_m, cy.data());
  add_scaled(n, d + 5 * stride, position_m, cz.data());
  rotation_is_valid_ = false;
}

void PoseParticles::resample(particle_filter::Rng& rng, std::size_t count) {
  ancestor_.resize(count);
  particle_filter::systematic_ancestors(weight, rng.uniform(), ancestor_);
  for (auto* array : {&qw, &qx, &qy, &qz, &cx, &cy, &cz}) {
    scratch_.resize(count);
    for (std::size_t i = 0; i < count; ++i) scratch_[i] = (*array)[ancestor_[i]];
    array->swap(scratch_);
    array->resize(count);
  }
  weight.assign(count, 1.0f / static_cast<float>(count));
  for (auto* array : {&x_, &y_, &z_}) array->resize(count);
  for (auto& array : rotation_) array.resize(count);
  rotation_is_valid_ = false;
}

void PoseParticles::update_rotations() {
  auto& r = rotation_;
  rotation_of(size(), qw.data(), qx.data(), qy.data(), qz.data(), r[0].data(), r[1].data(), r[2].data(), r[3].data(),
              r[4].data(), r[5].data(), r[6].data(), r[7].data(), r[8].data());
  rotation_is_valid_ = true;
}

void PoseParticles::project(const calib::BatchProjector& lens, const Eigen::Vector3d& p, std::span<float> u,
                            std::span<float> v) {
  if (!rotation_is_valid_) update_rotations();
  const auto& r = rotation_;
  const Eigen::Vector3f z = p.cast<float>();
  float* out[3] = {x_.data(), y_.data(), z_.data()};
  for (std::size_t k = 0; k < 3; ++k) {
    row_times(size(), r[3 * k].data(), r[3 * k + 1].data(), r[3 * k + 2].data(), cx.data(), cy.data(), cz.data(), z.x(),
              z.y(), z.z(), out[k]);
  }
  lens.project(x_.data(), y_.data(), z_.data(), size(), u.data(), v.data());
}

calib::Rigid3d PoseParticles::pose(std::size_t i) const {
  const auto d = [i](const std::vector<float>& a) { return static_cast<double>(a[i]); };
  const Eigen::Quaterniond q = Eigen::Quaterniond(d(qw), d(qx), d(qy), d(qz)).normalized();
  return {q, -(q * Eigen::Vector3d(d(cx), d(cy), d(cz)))};
}

std::vector<calib::Rigid3d> PoseParticles::world_from_cameras(std::size_t most) const {
  std::vector<calib::Rigid3d> out;
  for (std::size_t i = 0; i < std::min(size(), most); ++i) out.push_back(calib::inverse(pose(i)));
  return out;
}

calib::Rigid3d PoseParticles::mean() const {
  // The cloud is narrow: the normalised sum of its quaternions, brought to one hemisphere, is the mean rotation.
  const auto best = static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin());
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < size(); ++i) {
    const float side = qw[i] * qw[best] + qx[i] * qx[best] + qy[i] * qy[best] + qz[i] * qz[best];
    const double w = static_cast<double>(weight[i]);
    const Eigen::Vector4f qi(qx[i], qy[i], qz[i], qw[i]);
    q += (side < 0 ? -w : w) * qi.cast<double>();
    c += w * Eigen::Vector3f(cx[i], cy[i], cz[i]).cast<double>();
  }
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(q).normalized();
  return {rotation, -(rotation * c)};
}

Covariance6d PoseParticles::covariance(const calib::Rigid3d& mean_cam_from_world) const {
  const calib::Rigid3d world_from_mean = calib::inverse(mean_cam_from_world);
  Covariance6d sum = Covariance6d::Zero();
  for (std::size_t i = 0; i < size(); ++i) {
    const calib::Rigid3d p = pose(i);
    // world_from_camera of the particle: R_i^T = exp(w) R^T
    const Eigen::AngleAxisd turn((p.rotation.inverse() * mean_cam_from_world.rotation).normalized());
    const double angle = turn.angle() > 3.14159265358979 ? turn.angle() - 6.28318530717959 : turn.angle();
    Eigen::Matrix<double, 6, 1> e;
    e << Eigen::Vector3f(cx[i], cy[i], cz[i]).cast<double>() - world_from_mean.translation, angle * turn.axis();
    sum += static_cast<double>(weight[i]) * e * e.transpose();
  }
  return sum;
}

CloudMoments cloud_moments(std::span<const float> u, std::span<const float> v, std::span<const float> weight) {
  CloudMoments m;
  m.u_min = m.v_min = 1e9f, m.u_max = m.v_max = -1e9f;
  double su = 0, sv = 0, suu = 0, suv = 0, svv = 0, sw = 0;
  double ou = 0, ov = 0;  // the first pixel, about which is summed: no cancellation
  bool first = true;
  for (std::size_t i = 0; i < u.size(); ++i) {
    if (!(u[i] > 0.5f * calib::BatchProjector::outside)) continue;
    if (first) ou = static_cast<double>(u[i]), ov = static_cast<double>(v[i]), first = false;
    const double w = static_cast<double>(weight[i]), du = static_cast<double>(u[i]) - ou,
                 dv = static_cast<double>(v[i]) - ov;
    sw += w, su += w * du, sv += w * dv, suu += w * du * du, suv += w * du * dv, svv += w * dv * dv;
    m.u_min = std::min(m.u_min, u[i]), m.u_max = std::max(m.u_max, u[i]);
    m.v_min = std::min(m.v_min, v[i]), m.v_max = std::max(m.v_max, v[i]);
  }
  m.weight_sum = sw;
  if (!(sw > 0)) return m;
  su /= sw, sv /= sw;
  m.mean = {ou + su, ov + sv};
  m.covariance << suu / sw - su * su, suv / sw - su * sv, suv / sw - su * sv, svv / sw - sv * sv;
  return m;
}

}  // namespace huetrack::camera_tracking
