#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "camera_tracking/corners.h"
#include "camera_tracking/papers/lee_tracker.h"

namespace huetrack::papers {

namespace {

// Candidates: most frames, most frames without a match, and search width on either side of the epipolar line.
constexpr int most_attempts = 60, most_missed = 10;
constexpr double line_reach_px = 4;
constexpr float least_rho = 0.75f;

}  // namespace

LeeMapping::LeeMapping(const calib::Camera& camera, const Options& options, std::uint64_t seed)
    : camera_(camera), options_(options), rng_(seed, 12) {}

void LeeMapping::start(const LeeFrame& first, const StartResult& started) {
  double depth = 0;
  for (std::size_t i = 0; i < started.points.size(); ++i) {
    LeeFeature f;
    f.id = next_id_++;
    f.position = started.points[i];
    f.covariance = started.given_sigma_m * started.given_sigma_m * Eigen::Matrix3d::Identity();
    f.depth = (first.cam_from_world * f.position).norm();
    f.source = {first.pyramid, first.cam_from_world, started.px[i]};
    f.given = true;
    depth += f.depth / static_cast<double>(started.points.size());
    features_.push_back(std::move(f));
    estimators_.emplace_back();
  }
  depth_m_ = depth;
}

void LeeMapping::add(const LeeFeature& feature, double inverse_depth_sigma,
                     const Eigen::Matrix<double, 7, 7>& camera_covariance) {
  LeeFeature f = feature;
  f.id = next_id_++;
  Estimator e;
  if (!f.given)
    e.filter.emplace(camera_.model, f.source.cam_from_world, camera_covariance, 1 / f.depth, inverse_depth_sigma,
                     f.source.px, options_.pixel_sigma * options_.pixel_sigma * Eigen::Matrix2d::Identity());
  depth_m_ = features_.empty() ? f.depth : depth_m_;
  features_.push_back(std::move(f));
  estimators_.push_back(std::move(e));
}

void LeeMapping::map(const LeeFrame& frame) {
  if (!frame.tracked) return;
  update_features(frame);
  update_candidates(frame);
  detect(frame);
}

// Section 3.4: one UKF per feature. Matches and features are ordered by id.
void LeeMapping::update_features(const LeeFrame& frame) {
  const Eigen::Matrix2d rp = options_.pixel_sigma * options_.pixel_sigma * Eigen::Matrix2d::Identity();
  const auto at = [this](int id) {
    const auto it = std::ranges::lower_bound(features_, id, {}, &LeeFeature::id);
    return it != features_.end() && it->id == id ? static_cast<std::size_t>(it - features_.begin()) : features_.size();
  };
  for (const int id : frame.missed) {
    if (const std::size_t i = at(id); i < features_.size()) ++estimators_[i].missed;
  }
  for (const LeeFrame::Match& m : frame.matches) {
    const std::size_t i = at(m.id);
    if (i == features_.size()) continue;
    Estimator& e = estimators_[i];
    ++e.found;
    if (!e.filter) continue;
    ++e.age;
    if (!e.filter->update(frame.cam_from_world, m.found, rp + m.cloud)) {
      ++e.rejected;
      continue;
    }
    if (const auto p = e.filter->position()) {
      features_[i].position = *p;
      features_[i].covariance = e.filter->position_covariance();
      features_[i].depth = e.filter->depth();
    }
  }
  // Wrong features: seldom found, rejected by their own filter, or not converging.
  for (std::size_t i = features_.size(); i-- > 0;) {
    const Estimator& e = estimators_[i];
    if (!e.filter) continue;
    const bool unseen = e.missed > 12 && e.missed > 2 * e.found;
    const bool wrong = e.rejected > 5 && 3 * e.rejected > e.found;
    const bool open = e.age > 60 && std::sqrt(features_[i].covariance.trace()) > 0.15 * features_[i].depth;
    if (!unseen && !wrong && !open) continue;
    features_.erase(features_.begin() + static_cast<std::ptrdiff_t>(i));
    estimators_.erase(estimators_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

void LeeMapping::update_candidates(const LeeFrame& frame) {
  std::vector<FeatureCandidate> kept;
  for (FeatureCandidate& c : candidates_) {
    ++c.attempts;
    c.missed += !sharpen(c, frame);
    if (const auto depth = c.ray.converged()) {
      LeeFeature f;
      f.source = c.source;
      f.depth = 1 / depth->inverse_depth;
      f.position = c.ray.origin() + f.depth * c.ray.direction();
      add(f, std::max(depth->sigma, 0.04 * depth->inverse_depth), c.camera_covariance);
      features_.back().covariance = estimators_.back().filter->position_covariance();
    } else if (c.attempts < most_attempts && c.missed < most_missed) {
      kept.push_back(std::move(c));
    }
  }
  candidates_.swap(kept);
}

// Section 3.3: searches the template along the ray's projection and adds weight at the depths of the intersections with
// the particles' rays. false: not found.
bool LeeMapping::sharpen(FeatureCandidate& c, const LeeFrame& frame) {
  const auto segment = project_ray(camera_.model, c.ray, frame.cam_from_world, line_reach_px);
  if (!segment || !(camera_.contains(segment->a) || camera_.contains(segment->b))) return false;
  const PixelRegion region = clip(segment->box, frame.pyramid->levels.front(), feature_side);
  ncc_field(frame.pyramid->levels.front(), c.templ, region, field_);
  const auto rho_at = [&](int u, int v) {
    return u < region.u0 || u > region.u1 || v < region.v0 || v > region.v1 ? -1.0f : field_[region.index(u, v)];
  };
  const auto is_peak = [&](int u, int v) {
    const float rho = rho_at(u, v);
    return !(rho < least_rho || rho_at(u - 1, v) > rho || rho_at(u + 1, v) >= rho || rho_at(u, v - 1) > rho ||
             rho_at(u, v + 1) >= rho);
  };
  bool found = false;
  c.ray.begin();
  for (int v = region.v0; v <= region.v1; ++v) {
    for (int u = region.u0; u <= region.u1; ++u) {
      if (!is_peak(u, v)) continue;
      if (std::abs(segment->distance(Eigen::Vector2d(u, v))) > line_reach_px) continue;
      const auto ray = camera_.model.ray({Eigen::Vector2d(u, v)});
      if (!ray) continue;
      found = true;
      const float rho = rho_at(u, v);
      for (const calib::Rigid3d& particle : frame.sampled) {
        const calib::Rigid3d back = calib::inverse(particle);
        c.ray.add(back.translation, back.rotation * *ray, static_cast<double>(rho * rho), 1.0 / camera_.model.fx());
      }
    }
  }
  if (found) c.ray.end();
  return found;
}

void LeeMapping::detect(const LeeFrame& frame) {
  std::vector<Eigen::Vector2d> in_view;
  for (const LeeFeature& f : features_) {
    const auto px = camera_.model.project(frame.cam_from_world * f.position);
    if (px && camera_.contains(*px)) in_view.push_back(px->px);
  }
  for (const FeatureCandidate& c : candidates_) {
    const auto px = camera_.model.project(frame.cam_from_world * (c.ray.origin() + depth_m_ * c.ray.direction()));
    if (px && camera_.contains(*px)) in_view.push_back(px->px);
  }
  for (std::size_t i = 0; i < options_.new_per_frame && in_view.size() < options_.wanted_in_view; ++i) {
    const auto px = corner_in_random_box(frame.pyramid->levels.front(), in_view, options_.box_px, rng_);
    if (!px) continue;
    in_view.push_back(*px);
    auto t = cut_template(frame.pyramid->levels.front(), *px);
    const auto ray = camera_.model.ray({*px});
    if (!t || !ray) continue;
    const calib::Rigid3d back = calib::inverse(frame.cam_from_world);
    candidates_.push_back({{frame.pyramid, frame.cam_from_world, *px},
                           frame.state_covariance,
                           options_.pixel_sigma * options_.pixel_sigma * Eigen::Matrix2d::Identity(),
                           DepthRay(back.translation, back.rotation * *ray, 0.25 * depth_m_, 8 * depth_m_),
                           std::move(*t)});
  }
}

SceneMap scene_of(const std::vector<LeeFeature>& features) {
  SceneMap out;
  std::map<std::pair<const Pyramid*, double>, int> frames;  // shared by several features
  for (const LeeFeature& f : features) {
    const auto [it, fresh] = frames.try_emplace({f.source.pyramid.get(), f.source.cam_from_world.translation.x()},
                                                static_cast<int>(out.keyframes.size()));
    if (fresh) out.keyframes.push_back({f.source.pyramid, f.source.cam_from_world});
    MapPoint p;
    p.position = f.position, p.covariance = f.covariance, p.given = f.given;
    p.views[0].keyframe = it->second, p.views[0].px = f.source.px;
    describe(p.views[0], *f.source.pyramid);
    p.view_count = 1;
    out.points.push_back(p);
  }
  return out;
}

void LeeMapping::start(const StoredMap& stored) {
  for (const MapPoint& p : stored.map.points) {
    if (!p.alive || p.view_count == 0) continue;
    const Keyframe& k = stored.map.keyframe(p.views[0].keyframe);
    LeeFeature f;
    f.position = p.position, f.covariance = p.covariance, f.given = p.given;
    f.source = {k.pyramid, k.cam_from_world, p.views[0].px};
    f.depth = (k.cam_from_world * p.position).norm();
    const double sigma = std::sqrt(p.covariance.trace()) / (f.depth * f.depth);
    add(f, std::max(sigma, 1e-3 / f.depth), Eigen::Matrix<double, 7, 7>::Zero());
  }
}

}  // namespace huetrack::papers
