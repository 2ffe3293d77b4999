#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "camera_tracking/keyframes/keyframe_tracking.h"
#include "particle_filter/resample.h"

namespace huetrack::keyframes {

namespace {

constexpr int widest_px = 100;  // of the searched copy of the image
constexpr std::size_t most_points = 40, fewest_points = 4;
constexpr int columns = 10, rows = 8;  // cells of the image, with one point each
// Random walk, 1 sigma: a constant plus a share of the last step, wider with each frame without a proven pose.
// Positions as shares of the scene's depth.
constexpr double still_rad = 0.012, still_of_depth = 0.010, share_of_step = 0.4;
constexpr double wider_per_frame = 0.35, widest = 4;
constexpr float field_reach_px = 24;  // of a correlation field to either side of the cloud's mean
constexpr float least_ncc = 0.65f;
// Annealing: epsilon_d of ObservationField::mark() per step, px; the walk halves with every step.
constexpr std::array narrowing_px{2.5f, 1.8f, 1.2f, 1.2f};
// Gauss-Newton on the best matches within so many px of the points' projections, twice.
constexpr std::array fit_within_px{2.5f, 1.8f};
constexpr double fit_sigma_px = 0.4;
constexpr std::size_t fewest_matches = 6;
constexpr int fewest_inliers = 5, fit_iterations = 8;

int level_to_search(const Pyramid& pyramid) {
  int level = 0;
  while (level + 1 < pyramid.count() && pyramid.level(level).width > widest_px) ++level;
  return level;
}

}  // namespace

SweptPose KeyframeTracking::coarse(const SweptPose& predicted, const Pyramid& pyramid, const SceneMap& map) {
  const int level = level_to_search(pyramid);
  const Walk walk = scatter(predicted.cam_from_world);
  std::vector<Visible> chosen = one_per_cell(visible(predicted, map, pyramid.count()), map);
  subsample(chosen, most_points);
  correlate(chosen, pyramid, level, map);
  if (chosen.size() < fewest_points) {
    const std::size_t n = particles_.size();
    std::ranges::fill(particles_.weight, 1.0f / static_cast<float>(n));
    effective_sample_size_ = static_cast<double>(n);
    return predicted;
  }
  anneal(chosen, level, map, walk);
  return fit_to_fields({particles_.mean(), predicted.sweep}, chosen, level, map);
}

// Half of the particles about the predicted pose, half about the last one; after an unproven frame, all where they
// were.
KeyframeTracking::Walk KeyframeTracking::scatter(const calib::Rigid3d& predicted) {
  const double moved = step_.translation.norm() / depth_m_, turned = Eigen::AngleAxisd(step_.rotation).angle();
  const double wider = std::min(widest, 1 + wider_per_frame * unproven_);
  const Walk walk{static_cast<float>(wider * (still_rad + share_of_step * turned)),
                  static_cast<float>(wider * depth_m_ * (still_of_depth + share_of_step * moved))};
  if (unproven_ == 0) particles_.reset(particle_count_, predicted);
  if (unproven_ == 0 && particle_count_ > 1) {  // the camera stopped or reversed
    PoseParticles still(particle_count_ / 2, pose_);
    for (auto [to, from] : {std::pair{&particles_.qw, &still.qw},
                            {&particles_.qx, &still.qx},
                            {&particles_.qy, &still.qy},
                            {&particles_.qz, &still.qz},
                            {&particles_.cx, &still.cx},
                            {&particles_.cy, &still.cy},
                            {&particles_.cz, &still.cz}})
      std::ranges::copy(*from, to->begin());
  }
  particles_.walk_normal(walk.rotation_rad, walk.position_m, rng_);
  return walk;
}

// The point with the best detection rate; coarser levels are preferred.
std::vector<KeyframeTracking::Visible> KeyframeTracking::one_per_cell(const std::vector<Visible>& seen,
                                                                      const SceneMap& map) const {
  std::vector<int> best(columns * rows, -1);
  std::vector<double> worth(columns * rows, -1);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto cell = static_cast<std::size_t>(
        std::clamp(static_cast<int>(seen[i].px.y()) * rows / camera_.image_size.height, 0, rows - 1) * columns +
        std::clamp(static_cast<int>(seen[i].px.x()) * columns / camera_.image_size.width, 0, columns - 1));
    const auto& counts = map.point(seen[i].point).found_of_sought;
    const double w = (1.0 + counts[0]) / (2.0 + counts[1]) + 0.5 * seen[i].view->level;
    if (w > worth[cell]) worth[cell] = w, best[cell] = static_cast<int>(i);
  }
  std::vector<Visible> chosen;
  for (const int i : best) {
    if (i >= 0) chosen.push_back(seen[static_cast<std::size_t>(i)]);
  }
  return chosen;
}

// The point's projection for each particle, pixels of the level: u_, v_. The same sweep for all.
void KeyframeTracking::project(const Visible& seen, const SceneMap& map, int level) {
  const std::size_t n = particles_.size();
  u_.resize(n), v_.resize(n);
  particles_.project(lens_, map.point(seen.point).position, u_, v_);
  const float shrink = 1 / static_cast<float>(scale_of(level));
  const float du = seen.swept_px.x() + 0.5f, dv = seen.swept_px.y() + 0.5f;
  for (std::size_t i = 0; i < n; ++i) u_[i] = (u_[i] + du) * shrink - 0.5f, v_[i] = (v_[i] + dv) * shrink - 0.5f;
}

// Keeps the points that have a field; fields_[i] belongs to chosen[i].
void KeyframeTracking::correlate(std::vector<Visible>& chosen, const Pyramid& pyramid, int level, const SceneMap& map) {
  const GreyImage& image = pyramid.level(level);
  fields_.resize(std::max(fields_.size(), chosen.size()));
  std::size_t used = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const Visible s = chosen[i];
    if (!warp(s, map, level)) continue;
    project(s, map, level);
    const CloudMoments cloud = cloud_moments(u_, v_, particles_.weight);
    if (!(cloud.weight_sum > 0.5)) continue;
    const auto cu = static_cast<float>(cloud.mean.x()), cv = static_cast<float>(cloud.mean.y());
    const PixelRegion region{static_cast<int>(std::max(cloud.u_min - 1, cu - field_reach_px)),
                             static_cast<int>(std::max(cloud.v_min - 1, cv - field_reach_px)),
                             static_cast<int>(std::min(cloud.u_max + 1, cu + field_reach_px)),
                             static_cast<int>(std::min(cloud.v_max + 1, cv + field_reach_px))};
    fields_[used].correlate(image, patch_.inner, region);
    if (fields_[used].region().empty()) continue;
    chosen[used++] = s;
  }
  chosen.resize(used);
}

void KeyframeTracking::anneal(const std::vector<Visible>& chosen, int level, const SceneMap& map, const Walk& walk) {
  constexpr bool binary = false;
  log_weight_.resize(particles_.size());
  for (std::size_t step = 0; step < narrowing_px.size(); ++step) {
    std::ranges::fill(log_weight_, 0.0f);
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      project(chosen[i], map, level);
      fields_[i].mark(least_ncc, narrowing_px[step]);
      fields_[i].score(u_, v_, binary, log_weight_);
    }
    particle_filter::normalize_log_weights(log_weight_, particles_.weight);
    if (step == 0) effective_sample_size_ = particle_filter::effective_sample_size(particles_.weight);
    if (step + 1 == narrowing_px.size()) break;
    particles_.resample(rng_, particle_count_);
    const float narrower = std::pow(0.5f, static_cast<float>(step + 1));
    particles_.walk_normal(narrower * walk.rotation_rad, narrower * walk.position_m, rng_);
  }
}

SweptPose KeyframeTracking::fit_to_fields(SweptPose pose, const std::vector<Visible>& chosen, int level,
                                          const SceneMap& map) const {
  for (const float within_px : fit_within_px) {
    std::vector<PoseObservation> observations;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const Eigen::Vector3d& p = map.point(chosen[i].point).position;
      const auto px = project_swept(camera_.model, pose, p);
      if (!px) continue;
      const Eigen::Vector2d at = to_level(px->px, level);
      const NccPeak peak =
          fields_[i].strongest(static_cast<float>(at.x()), static_cast<float>(at.y()), within_px, least_ncc);
      const double offset = static_cast<double>(fields_[i].centre_offset());
      if (peak.rho > 0)
        observations.push_back(
            {p, from_level(Eigen::Vector2d(peak.u + offset, peak.v + offset), level), fit_sigma_px * scale_of(level)});
    }
    if (observations.size() < fewest_matches) break;
    const SweptFit fit = rough_fit(observations, pose, fit_iterations);
    if (fit.fit.inliers < fewest_inliers) break;
    pose = fit.pose;
  }
  return pose;
}

}  // namespace huetrack::keyframes
