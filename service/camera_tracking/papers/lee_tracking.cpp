#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "camera_tracking/papers/lee_tracker.h"
#include "camera_tracking/papers/mean_polish.h"
#include "particle_filter/resample.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::papers {

namespace {

constexpr double least_half_px = 4, most_half_px = 28, most_half_lost_px = 56;  // of a search region
// A pose is supported if most projections of the cloud are narrower than this (a wide one matches anything), and at
// least 4 features and 40 % of those searched for lie within this chi-square gate (2 dof, 99.8 %).
constexpr double narrow_px = 8, agreeing_distance2 = 12;
constexpr std::size_t fewest_seen = 4;

// One feature's term of eq. (4)'s exponent, for all particles: -(m - y)^T C^-1 (m - y) / 2.
HUETRACK_CLONES void add_log_likelihood(const float* __restrict u, const float* __restrict v, std::size_t n, float yu,
                                        float yv, float a, float b, float c, float* __restrict out) {
  for (std::size_t i = 0; i < n; ++i) {
    // A projection without a pixel is clamped to a large distance.
    const float du = std::max(-1e4f, u[i] - yu), dv = std::max(-1e4f, v[i] - yv);
    out[i] -= 0.5f * (a * du * du + 2 * b * du * dv + c * dv * dv);
  }
}

}  // namespace

LeeTracking::LeeTracking(const calib::Camera& camera, const Options& options, std::uint64_t seed)
    : camera_(camera), options_(options), lens_(without_pose(camera)), rng_(seed, 11) {}

void LeeTracking::start(const calib::Rigid3d& cam_from_world) {
  particles_.reset(options_.particle_count, cam_from_world);
  supported_ = true;
}

// Eq. (4), with the cloud's covariance before the weighting.
void LeeTracking::weigh(const Cloud& cloud, const Eigen::Vector2d& px) {
  const Eigen::Matrix2d c =
      (options_.cloud_share * cloud.moments.covariance + 0.25 * Eigen::Matrix2d::Identity()).inverse();
  const Eigen::Vector2f y = px.cast<float>();
  add_log_likelihood(cloud.u.data(), cloud.v.data(), cloud.u.size(), y.x(), y.y(), static_cast<float>(c(0, 0)),
                     static_cast<float>(c(0, 1)), static_cast<float>(c(1, 1)), log_weight_.data());
}

CloudMoments LeeTracking::cloud_of(const Eigen::Vector3d& p_world) {
  if (clouds_.empty()) clouds_.emplace_back();
  Cloud& cloud = clouds_.front();
  cloud.u.resize(particles_.size()), cloud.v.resize(particles_.size());
  particles_.project(lens_, p_world, cloud.u, cloud.v);
  return cloud_moments(cloud.u, cloud.v, particles_.weight);
}

calib::Rigid3d LeeTracking::track_points(const std::vector<Eigen::Vector3d>& points,
                                         const std::vector<Eigen::Vector2d>& px) {
  particles_.resample(rng_, options_.particle_count);
  particles_.walk_normal(static_cast<float>(options_.rotation_rad), static_cast<float>(options_.position_m), rng_);
  log_weight_.assign(particles_.size(), 0.0f);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!px[i].allFinite()) continue;
    const CloudMoments moments = cloud_of(points[i]);
    clouds_.front().moments = moments;
    weigh(clouds_.front(), px[i]);
  }
  particle_filter::normalize_log_weights(log_weight_, particles_.weight);
  return particles_.mean();
}

std::vector<LeeTracking::Visible> LeeTracking::project(const std::vector<LeeFeature>& features,
                                                       const calib::Rigid3d& predicted) {
  const std::size_t n = particles_.size();
  std::vector<Visible> visible;
  for (std::size_t i = 0; i < features.size(); ++i) {
    const auto px = camera_.model.project(predicted * features[i].position);
    if (!px || !camera_.contains(*px)) continue;
    const std::size_t k = visible.size();
    if (clouds_.size() <= k) clouds_.emplace_back();
    Cloud& cloud = clouds_[k];
    cloud.u.resize(n), cloud.v.resize(n);
    particles_.project(lens_, features[i].position, cloud.u, cloud.v);
    cloud.moments = cloud_moments(cloud.u, cloud.v, particles_.weight);
    if (cloud.moments.weight_sum < 0.5) continue;
    visible.push_back({i, k});
  }
  return visible;
}

// NCC in the search regions with predicted templates (section 3.5). Returns the matched ones.
std::vector<LeeTracking::Visible> LeeTracking::measure(const GreyImage& image, const std::vector<LeeFeature>& features,
                                                       const calib::Rigid3d& predicted,
                                                       const std::vector<Visible>& visible, LeeFrame& out) {
  std::vector<Visible> seen;
  const double most = supported_ ? most_half_px : most_half_lost_px;
  for (const Visible& x : visible) {
    const LeeFeature& f = features[x.feature];
    const CloudMoments& m = clouds_[x.cloud].moments;
    if (!predict_template(camera_.model, f.source, f.depth, predicted, patch_)) continue;
    const double half_u = std::clamp(3 * std::sqrt(m.covariance(0, 0)), least_half_px, most),
                 half_v = std::clamp(3 * std::sqrt(m.covariance(1, 1)), least_half_px, most);
    const PixelRegion region = clip(box_around(m.mean, half_u, half_v), image, feature_side);
    ncc_field(image, patch_.inner, region, field_);
    const NccPeak peak = best_of(field_, region);
    if (peak.rho < options_.threshold) {
      out.missed.push_back(f.id);
      continue;
    }
    out.matches.push_back({f.id, m.mean, refined(peak, field_, region), m.covariance});
    seen.push_back(x);
  }
  return seen;
}

// Whether the weighted cloud is narrow and consistent with the measurements. Sets the covariances of eq. (9).
bool LeeTracking::is_supported(const std::vector<Visible>& seen, LeeFrame& out) const {
  const std::size_t total = seen.size() + out.missed.size();
  std::size_t agree = 0, narrow = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Cloud& cloud = clouds_[seen[i].cloud];
    const CloudMoments m = cloud_moments(cloud.u, cloud.v, particles_.weight);
    out.matches[i].projected = m.mean, out.matches[i].cloud = m.covariance;
    const Eigen::Vector2d error = out.matches[i].found - m.mean;
    agree += error.dot((m.covariance + Eigen::Matrix2d::Identity()).inverse() * error) < agreeing_distance2;
    narrow += m.covariance.trace() < 2 * narrow_px * narrow_px;
  }
  return agree >= fewest_seen && 5 * agree >= 2 * total && 2 * narrow > seen.size();
}

std::optional<PoseFit> LeeTracking::polished(const std::vector<LeeFeature>& features, const std::vector<Visible>& seen,
                                             const LeeFrame& frame) const {
  std::vector<PoseObservation> found;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const LeeFeature& f = features[seen[i].feature];
    found.push_back({f.position, frame.matches[i].found,
                     sigma_px_of(camera_.model, 0.5, std::sqrt(f.covariance.trace() / 3), f.depth)});
  }
  return polish_mean(camera_.model, particles_, frame.cam_from_world, found);
}

LeeFrame LeeTracking::track(std::uint64_t number, const std::shared_ptr<const Pyramid>& pyramid,
                            const std::vector<LeeFeature>& features) {
  LeeFrame out;
  out.number = number, out.pyramid = pyramid;
  // Step 1: resample.
  particles_.resample(rng_, options_.particle_count);
  // Step 2: the motion model, eq. (3), and the features' projections.
  const double wider = supported_ ? 1 : options_.wider_unseen;
  particles_.walk_normal(static_cast<float>(wider * options_.rotation_rad),
                         static_cast<float>(wider * options_.position_m), rng_);
  const std::size_t n = particles_.size();
  const calib::Rigid3d predicted = particles_.mean();
  const std::vector<Visible> visible = project(features, predicted);
  in_view_ = static_cast<int>(visible.size());
  // Step 3: measure them.
  const std::vector<Visible> seen = measure(pyramid->levels.front(), features, predicted, visible, out);
  // Step 4: eq. (4). Without a measurement all particles weigh the same, and the cloud disperses.
  log_weight_.assign(n, 0.0f);
  for (std::size_t i = 0; i < seen.size(); ++i) weigh(clouds_[seen[i].cloud], out.matches[i].found);
  // Step 5: normalise, and the mean.
  particle_filter::normalize_log_weights(log_weight_, particles_.weight);
  out.cam_from_world = particles_.mean();
  out.tracked = supported_ = is_supported(seen, out);
  // Too few matches are ignored: chance matches would hold the cloud together at a wrong place.
  const std::size_t total = seen.size() + out.missed.size();
  if (seen.size() < fewest_seen || 5 * seen.size() < 2 * total)
    particles_.weight.assign(n, 1.0f / static_cast<float>(n));
  if (!out.tracked) return out;
  if (options_.polish) {
    out.polished = polished(features, seen, out);
    if (out.polished) out.cam_from_world = out.polished->cam_from_world;
  }
  out.state_covariance = state_covariance(particles_, out.cam_from_world);
  std::vector<std::uint32_t> drawn(options_.sampled);
  particle_filter::systematic_ancestors(particles_.weight, rng_.uniform(), drawn);
  for (const std::uint32_t i : drawn) out.sampled.push_back(particles_.pose(i));
  return out;
}

}  // namespace huetrack::papers
