#include "camera_tracking/papers/feature_template.h"

#include <algorithm>
#include <cmath>

#include "camera_tracking/corners.h"

namespace huetrack::papers {

std::optional<NccTemplate> cut_template(const GreyImage& image, const Eigen::Vector2d& px) {
  const int half = feature_side / 2;
  const int u = static_cast<int>(std::floor(px.x())), v = static_cast<int>(std::floor(px.y()));
  if (!image.contains(u, v, half + 1)) return std::nullopt;
  const double a = px.x() - u, b = px.y() - v;
  NccTemplate t;
  t.side = feature_side;
  for (int j = -half; j <= half; ++j) {
    const std::uint8_t *row = image.row(v + j) + u, *next = image.row(v + j + 1) + u;
    for (int i = -half; i <= half; ++i)
      t.pixels.push_back(static_cast<std::uint8_t>(
          std::lround((1 - b) * ((1 - a) * row[i] + a * row[i + 1]) + b * ((1 - a) * next[i] + a * next[i + 1]))));
  }
  t.finish();
  if (!(t.norm > 0)) return std::nullopt;
  return t;
}

bool predict_template(const calib::CameraModel& lens, const FeatureSource& source, double depth,
                      const calib::Rigid3d& cam_from_world, WarpedPatch& out) {
  const auto ray = lens.ray({source.px});
  if (!ray) return false;
  const calib::Rigid3d now_from_then = cam_from_world * calib::inverse(source.cam_from_world);
  const auto patch = transfer_patch(lens, source.px, plane_homography(now_from_then, *ray, depth));
  return patch && warp_patch(*source.pyramid, source.px, patch->affine, 0, feature_side, out);
}

PixelRegion box_around(const Eigen::Vector2d& centre, double half_u, double half_v) {
  return {static_cast<int>(std::floor(centre.x() - half_u)), static_cast<int>(std::floor(centre.y() - half_v)),
          static_cast<int>(std::ceil(centre.x() + half_u)), static_cast<int>(std::ceil(centre.y() + half_v))};
}

double EpipolarSegment::distance(const Eigen::Vector2d& px) const {
  const Eigen::Vector2d d = px - a.px;
  return along.x() * d.y() - along.y() * d.x();
}

std::optional<EpipolarSegment> project_ray(const calib::CameraModel& lens, const DepthRay& ray,
                                           const calib::Rigid3d& cam_from_world, double reach_px) {
  constexpr double tail = 0.02, longest_px = 120;
  const auto [first, last] = ray.interval(tail);
  const auto a = lens.project(cam_from_world * (ray.origin() + ray.direction() / first));
  const auto b = lens.project(cam_from_world * (ray.origin() + ray.direction() / last));
  if (!a || !b || !((a->px - b->px).norm() < longest_px)) return std::nullopt;
  const Eigen::Vector2d along =
      (b->px - a->px).norm() > 0.5 ? Eigen::Vector2d((b->px - a->px).normalized()) : Eigen::Vector2d(1, 0);
  const Eigen::Vector2d middle = 0.5 * (a->px + b->px);
  return EpipolarSegment{*a, *b, along,
                         box_around(middle, 0.5 * std::abs(a->px.x() - b->px.x()) + reach_px,
                                    0.5 * std::abs(a->px.y() - b->px.y()) + reach_px)};
}

std::optional<Eigen::Vector2d> corner_in_random_box(const GreyImage& image, std::span<const Eigen::Vector2d> features,
                                                    int box, particle_filter::Rng& rng) {
  const int margin = feature_side, apart = feature_side / 2;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const int u = margin + static_cast<int>(rng.uniform() * (image.width - 2 * margin - box));
    const int v = margin + static_cast<int>(rng.uniform() * (image.height - 2 * margin - box));
    const bool overlaps = std::ranges::any_of(features, [&](const Eigen::Vector2d& f) {
      return f.x() >= u - apart && f.y() >= v - apart && f.x() <= u + box + apart && f.y() <= v + box + apart;
    });
    if (overlaps) continue;
    const auto corners = detect_corners(image, 20, margin, 120, u, v, u + box, v + box);
    if (!corners.empty()) return corners.front().px;
  }
  return std::nullopt;
}

Eigen::Matrix<double, 7, 7> state_covariance(const PoseParticles& particles, const calib::Rigid3d& mean) {
  const Eigen::Vector3d c = calib::inverse(mean).translation;
  Eigen::Matrix<double, 7, 7> sum = Eigen::Matrix<double, 7, 7>::Zero();
  const Eigen::Vector4d q0(mean.rotation.w(), mean.rotation.x(), mean.rotation.y(), mean.rotation.z());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    Eigen::Vector4d q =
        Eigen::Vector4f(particles.qw[i], particles.qx[i], particles.qy[i], particles.qz[i]).cast<double>();
    if (q.dot(q0) < 0) q = -q;
    Eigen::Matrix<double, 7, 1> e;
    e << Eigen::Vector3f(particles.cx[i], particles.cy[i], particles.cz[i]).cast<double>() - c, q - q0;
    sum += static_cast<double>(particles.weight[i]) * e * e.transpose();
  }
  return sum;
}

}  // namespace huetrack::papers
