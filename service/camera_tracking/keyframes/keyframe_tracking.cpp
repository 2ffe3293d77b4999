#include "camera_tracking/keyframes/keyframe_tracking.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "camera_tracking/pose_solver.h"
#include "camera_tracking/relocalizer.h"
#include "particle_filter/resample.h"

namespace huetrack::keyframes {
namespace {

constexpr int patch_side = 8;
constexpr float good_ncc = 0.8f;
constexpr std::size_t coarse_points = 40;
constexpr std::size_t first_points = 60;
constexpr std::size_t fine_points = 220;
constexpr double corner_sigma_px = 0.12;
// What a template's match is worth, at its own level, in pixels of that level.
constexpr double match_sigma_px = 0.25;

calib::Camera without_pose(calib::Camera camera) {
  camera.cam_from_world = {};
  return camera;
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

KeyframeTracking::KeyframeTracking(const calib::Camera& camera, std::size_t particle_count, std::uint64_t seed)
    : camera_(camera), lens_(without_pose(camera)), rng_(seed, 1), particle_count_(particle_count), seed_(seed) {}

void KeyframeTracking::set_pose(const calib::Rigid3d& cam_from_world) {
  pose_ = cam_from_world;
  step_ = {};
  unproven_ = 0;
  particles_.reset(particle_count_, pose_);
  effective_sample_size_ = static_cast<double>(particle_count_);
}

void KeyframeTracking::forget() {
  step_ = {};
}

std::vector<KeyframeTracking::Visible> KeyframeTracking::visible(const calib::Rigid3d& pose,
                                                                 const camera_tracking::SceneMap& map,
                                                                 int levels) const {
  std::vector<Visible> out;
  const Eigen::Vector3d centre = calib::inverse(pose).translation;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const camera_tracking::MapPoint& p = map.points[i];
    if (!p.alive || p.look_count == 0 || (rectangle_ && i < 4)) continue;
    const Eigen::Vector3d cam = pose * p.position;
    calib::CameraModel::Jacobian j;
    const auto px = camera_.model.project(cam, j);
    if (!px || px->px.x() < 5 || px->px.y() < 5 || px->px.x() > camera_.image_size.width - 6 ||
        px->px.y() > camera_.image_size.height - 6)
      continue;
    Visible seen;
    seen.point = static_cast<int>(i), seen.px = px->px;
    double least = 0.9;  // radians, and factors of e in distance
    for (int k = 0; k < p.look_count; ++k) {
      const camera_tracking::PointLook& look = p.looks[static_cast<std::size_t>(k)];
      const Eigen::Vector3d then =
          calib::inverse(map.keyframes[static_cast<std::size_t>(look.keyframe)].cam_from_world).translation;
      const double unlike = angle_between(then - p.position, centre - p.position) +
                            std::abs(std::log((centre - p.position).norm() / (then - p.position).norm())) +
                            (k > 0 ? 0.15 : 0.0);
      if (unlike < least) least = unlike, seen.look = &look;
    }
    if (!seen.look) continue;
    const calib::Rigid3d& then = map.keyframes[static_cast<std::size_t>(seen.look->keyframe)].cam_from_world;
    const Eigen::Vector3d source = then * p.position;
    const bool known = p.normal.squaredNorm() > 0.5;
    const Eigen::Vector3d normal =
        known ? Eigen::Vector3d(then.rotation * p.normal) : Eigen::Vector3d(source.normalized());
    const auto view = camera_tracking::transfer_patch(
        camera_.model, seen.look->px,
        camera_tracking::plane_homography(pose * calib::inverse(then), normal, normal.dot(source)));
    if (!view) continue;
    seen.view = *view;
    seen.level = camera_tracking::search_level(view->affine, seen.look->level, levels);
    const Eigen::Matrix<double, 2, 3> d = j * pose.rotation.toRotationMatrix();
    seen.map_sigma_px = std::sqrt(0.5 * (d * p.covariance * d.transpose()).trace());
    out.push_back(seen);
  }
  return out;
}

// Particles about the predicted pose and about the last one, drawn to where templates correlate on a small copy of the
// image: Pupilli and Calway's annealing, with 40 points of which each costs little.
calib::Rigid3d KeyframeTracking::coarse(const calib::Rigid3d& predicted, const camera_tracking::Pyramid& pyramid,
                                        const camera_tracking::SceneMap& map) {
  int level = 0;
  while (level + 1 < pyramid.count() && pyramid.levels[static_cast<std::size_t>(level)].width > 100) ++level;
  const camera_tracking::GreyImage& image = pyramid.levels[static_cast<std::size_t>(level)];

  const double moved = step_.translation.norm() / depth_m_, turned = Eigen::AngleAxisd(step_.rotation).angle();
  const double wider = std::min(4.0, 1 + 0.35 * unproven_);
  const auto rotation = static_cast<float>(wider * (0.012 + 0.4 * turned));
  const auto position = static_cast<float>(wider * depth_m_ * (0.010 + 0.4 * moved));
  if (unproven_ == 0) particles_.reset(particle_count_, predicted);
  if (unproven_ == 0 && particle_count_ > 1) {  // half of them: it stopped, or turned about
    camera_tracking::PoseParticles still(particle_count_ / 2, pose_);
    for (auto [to, from] : {std::pair{&particles_.qw, &still.qw},
                            {&particles_.qx, &still.qx},
                            {&particles_.qy, &still.qy},
                            {&particles_.qz, &still.qz},
                            {&particles_.cx, &still.cx},
                            {&particles_.cy, &still.cy},
                            {&particles_.cz, &still.cz}})
      std::ranges::copy(*from, to->begin());
  }
  particles_.walk_normal(rotation, position, rng_);

  // One point per cell, the one that is found most reliably.
  std::vector<Visible> seen = visible(predicted, map, pyramid.count());
  std::vector<Visible> chosen;
  {
    constexpr int columns = 10, rows = 8;
    std::vector<int> best(columns * rows, -1);
    std::vector<double> worth(columns * rows, -1);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const int cell =
          std::clamp(static_cast<int>(seen[i].px.y()) * rows / camera_.image_size.height, 0, rows - 1) * columns +
          std::clamp(static_cast<int>(seen[i].px.x()) * columns / camera_.image_size.width, 0, columns - 1);
      const auto& counts = map.points[static_cast<std::size_t>(seen[i].point)].found_of_sought;
      const double w = (1.0 + counts[0]) / (2.0 + counts[1]) + 0.5 * seen[i].look->level;
      if (w > worth[static_cast<std::size_t>(cell)])
        worth[static_cast<std::size_t>(cell)] = w, best[static_cast<std::size_t>(cell)] = static_cast<int>(i);
    }
    for (const int i : best) {
      if (i >= 0) chosen.push_back(seen[static_cast<std::size_t>(i)]);
    }
    while (chosen.size() > coarse_points) {  // every so manieth goes
      std::vector<Visible> fewer;
      for (std::size_t i = 0; i < chosen.size(); ++i) {
        if (i * coarse_points / chosen.size() != (i + 1) * coarse_points / chosen.size()) fewer.push_back(chosen[i]);
      }
      chosen.swap(fewer);
    }
  }
  const std::size_t n = particles_.size();
  u_.resize(n), v_.resize(n), log_weight_.resize(n);
  const float shrink = 1 / static_cast<float>(camera_tracking::scale_of(level));
  const auto project = [&](int point) {
    particles_.project(lens_, map.points[static_cast<std::size_t>(point)].position, u_, v_);
    for (std::size_t i = 0; i < n; ++i) u_[i] = (u_[i] + 0.5f) * shrink - 0.5f, v_[i] = (v_[i] + 0.5f) * shrink - 0.5f;
  };
  fields_.resize(std::max(fields_.size(), chosen.size()));
  std::size_t used = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const Visible& s = chosen[i];
    const camera_tracking::Pyramid& source = *map.keyframes[static_cast<std::size_t>(s.look->keyframe)].pyramid;
    if (!camera_tracking::warp_patch(source, s.look->px, s.view.affine, level, patch_side, patch_)) continue;
    project(s.point);
    const camera_tracking::CloudMoments cloud = camera_tracking::cloud_moments(u_, v_, particles_.weight);
    if (!(cloud.weight_sum > 0.5)) continue;
    const float reach = 24;
    const auto cu = static_cast<float>(cloud.mean.x()), cv = static_cast<float>(cloud.mean.y());
    const camera_tracking::PixelRegion region{static_cast<int>(std::max(cloud.u_min - 1, cu - reach)),
                                              static_cast<int>(std::max(cloud.v_min - 1, cv - reach)),
                                              static_cast<int>(std::min(cloud.u_max + 1, cu + reach)),
                                              static_cast<int>(std::min(cloud.v_max + 1, cv + reach))};
    fields_[used].correlate(image, patch_.inner, region);
    if (fields_[used].region().empty()) continue;
    chosen[used++] = s;
  }
  if (used < 4) {
    std::ranges::fill(particles_.weight, 1.0f / static_cast<float>(n));
    effective_sample_size_ = static_cast<double>(n);
    return predicted;
  }
  constexpr float gain = 1.0f;
  const float epsilon_d[] = {2.5f, 1.8f, 1.2f, 1.2f};
  for (std::size_t step = 0; step < 4; ++step) {
    std::ranges::fill(log_weight_, 0.0f);
    for (std::size_t i = 0; i < used; ++i) {
      project(chosen[i].point);
      fields_[i].mark(0.65f, epsilon_d[step]);
      fields_[i].score(u_, v_, gain, false, log_weight_);
    }
    particle_filter::normalize_log_weights(log_weight_, particles_.weight);
    if (step == 0) effective_sample_size_ = huetrack::particle_filter::effective_sample_size(particles_.weight);
    if (step == 3) break;
    particles_.resample(rng_, particle_count_);
    const float narrower = std::pow(0.5f, static_cast<float>(step + 1));
    particles_.walk_normal(narrower * rotation, narrower * position, rng_);
  }
  calib::Rigid3d pose = particles_.mean();
  // Gauss-Newton on the strongest answers near the mean, still on the small image.
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<camera_tracking::PoseObservation> observations;
    for (std::size_t i = 0; i < used; ++i) {
      const Eigen::Vector3d& p = map.points[static_cast<std::size_t>(chosen[i].point)].position;
      const auto px = camera_.model.project(pose * p);
      if (!px) continue;
      const Eigen::Vector2d at = camera_tracking::to_level(px->px, level);
      const camera_tracking::NccPeak peak =
          fields_[i].strongest(static_cast<float>(at.x()), static_cast<float>(at.y()), pass == 0 ? 2.5f : 1.8f, 0.65f);
      const double offset = static_cast<double>(fields_[i].centre_offset());
      if (peak.rho > 0)
        observations.push_back({p,
                                camera_tracking::from_level(Eigen::Vector2d(peak.u + offset, peak.v + offset), level),
                                0.4 * camera_tracking::scale_of(level)});
    }
    if (observations.size() < 6) break;
    const camera_tracking::PoseFit fit = camera_tracking::refine_pose(camera_.model, observations, pose, 8);
    if (fit.inliers < 5) break;
    pose = fit.cam_from_world;
  }
  return pose;
}

// A first fit with some well-spread points at one level above their own, over a wide region.
calib::Rigid3d KeyframeTracking::first_fit(const calib::Rigid3d& pose, const camera_tracking::Pyramid& pyramid,
                                           const camera_tracking::SceneMap& map, const std::vector<Visible>& seen) {
  std::vector<camera_tracking::PoseObservation> observations;
  const std::size_t stride = std::max<std::size_t>(1, seen.size() / first_points);
  for (std::size_t i = 0; i < seen.size(); i += stride) {
    const Visible& s = seen[i];
    const int level = std::min(s.level + 1, std::min(2, pyramid.count() - 1));
    const camera_tracking::Pyramid& source = *map.keyframes[static_cast<std::size_t>(s.look->keyframe)].pyramid;
    if (!camera_tracking::warp_patch(source, s.look->px, s.view.affine, level, patch_side, patch_)) continue;
    const camera_tracking::GreyImage& image = pyramid.levels[static_cast<std::size_t>(level)];
    const Eigen::Vector2d at = camera_tracking::to_level(s.px, level);
    const double offset = static_cast<double>(patch_.inner.centre_offset());
    const int u = static_cast<int>(std::lround(at.x() - offset)), v = static_cast<int>(std::lround(at.y() - offset));
    constexpr int reach = 4;
    const camera_tracking::PixelRegion region =
        camera_tracking::clip({u - reach, v - reach, u + reach, v + reach}, image, patch_side);
    if (region.empty()) continue;
    camera_tracking::ncc_field(image, patch_.inner, region, field_);
    const camera_tracking::NccPeak peak = camera_tracking::best_of(field_, region);
    if (peak.rho < good_ncc - 0.05f) continue;
    const Eigen::Vector2d px = camera_tracking::from_level(Eigen::Vector2d(peak.u + offset, peak.v + offset), level);
    observations.push_back({map.points[static_cast<std::size_t>(s.point)].position, px,
                            std::hypot(0.4 * camera_tracking::scale_of(level), s.map_sigma_px)});
  }
  if (observations.size() < 6) return pose;
  const camera_tracking::PoseFit fit = camera_tracking::refine_pose(camera_.model, observations, pose, 8);
  return fit.inliers >= 5 ? fit.cam_from_world : pose;
}

ProvenPose KeyframeTracking::fine(const calib::Rigid3d& start, const camera_tracking::Pyramid& pyramid,
                                  const camera_tracking::SceneMap& map, bool strict) {
  ProvenPose out;
  calib::Rigid3d pose = first_fit(start, pyramid, map, visible(start, map, pyramid.count()));
  std::vector<Visible> seen = visible(pose, map, pyramid.count());
  if (seen.size() > fine_points) {  // the surest ones, and in the order of the map
    std::vector<Visible> fewer;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (i * fine_points / seen.size() != (i + 1) * fine_points / seen.size()) fewer.push_back(seen[i]);
    }
    seen.swap(fewer);
  }
  out.sought = 0;
  std::vector<camera_tracking::PoseObservation> observations;
  std::vector<int> point_of;
  std::vector<double> pixel_sigma;
  sought_.clear();
  for (const Visible& s : seen) {
    const camera_tracking::Pyramid& source = *map.keyframes[static_cast<std::size_t>(s.look->keyframe)].pyramid;
    if (!camera_tracking::warp_patch(source, s.look->px, s.view.affine, s.level, patch_side, patch_)) continue;
    const camera_tracking::GreyImage& image = pyramid.levels[static_cast<std::size_t>(s.level)];
    const Eigen::Vector2d at = camera_tracking::to_level(s.px, s.level);
    if (!image.contains(at.x(), at.y(), 6)) continue;
    const double offset = static_cast<double>(patch_.inner.centre_offset());
    const int u = static_cast<int>(std::lround(at.x() - offset)), v = static_cast<int>(std::lround(at.y() - offset));
    const int reach =
        std::clamp(static_cast<int>(std::ceil(2 + 2 * s.map_sigma_px / camera_tracking::scale_of(s.level))), 3, 8);
    const camera_tracking::PixelRegion region =
        camera_tracking::clip({u - reach, v - reach, u + reach, v + reach}, image, patch_side);
    if (region.empty()) continue;
    ++out.sought;
    const double search = (reach * camera_tracking::scale_of(s.level)) / 2;
    sought_.push_back({s.point, s.px, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()),
                       search * search * Eigen::Matrix2d::Identity()});
    camera_tracking::ncc_field(image, patch_.inner, region, field_);
    const camera_tracking::NccPeak peak = camera_tracking::best_of(field_, region);
    std::optional<camera_tracking::Refined> refined;
    if (peak.rho > good_ncc - 0.1f)
      refined = camera_tracking::refine(image, patch_, Eigen::Vector2d(peak.u + offset, peak.v + offset), 1.5);
    if (!refined || refined->ncc < good_ncc) {
      out.missed.push_back(s.point);
      continue;
    }
    const double sigma = match_sigma_px * camera_tracking::scale_of(s.level);
    observations.push_back({map.points[static_cast<std::size_t>(s.point)].position,
                            camera_tracking::from_level(refined->px, s.level), std::hypot(sigma, s.map_sigma_px)});
    point_of.push_back(s.point);
    pixel_sigma.push_back(sigma);
    sought_.back().found_px = observations.back().px;
  }
  // The rectangle's edges.
  if (rectangle_ && map.points.size() >= 4) {
    if (observations.size() >= 8) {
      const camera_tracking::PoseFit fit = camera_tracking::refine_pose(camera_.model, observations, pose, 8);
      if (fit.inliers >= 6) pose = fit.cam_from_world;
    }
    std::array<Eigen::Vector2d, 4> about;
    bool before = true;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto px = camera_.model.project(pose * map.points[i].position);
      before = before && px;
      if (px) about[i] = px->px;
    }
    if (before) {
      const camera_tracking::RectangleCorners corners = camera_tracking::measure_rectangle(
          pyramid.levels.front(), camera_.model, about, observations.size() >= 12 ? 3.0 : 7.0, *rectangle_);
      for (std::size_t i = 0; i < 4; ++i) {
        if (!corners.measured[i]) continue;
        observations.push_back({map.points[i].position, corners.px[i], corner_sigma_px});
        point_of.push_back(static_cast<int>(i));
        pixel_sigma.push_back(corner_sigma_px);
        sought_.push_back({static_cast<int>(i), about[i], corners.px[i], 4 * Eigen::Matrix2d::Identity()});
      }
    }
  }
  out.cam_from_world = pose;
  if (observations.size() < 4) return out;
  const camera_tracking::PoseFit fit = camera_tracking::refine_pose(camera_.model, observations, pose, 15);
  out.cam_from_world = fit.cam_from_world;
  out.scale = fit.scale;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  std::vector<double> depths;
  int inliers = 0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const bool corner = rectangle_ && point_of[i] < 4;
    if (!(fit.weight[i] > 0.1)) {
      if (!corner) out.missed.push_back(point_of[i]);
      continue;
    }
    if (corner)
      ++out.corners;
    else
      ++out.found;
    ++inliers;
    mean += observations[i].px;
    spread += observations[i].px * observations[i].px.transpose();
    out.sightings.push_back({-1, point_of[i], observations[i].px, pixel_sigma[i]});
    depths.push_back((fit.cam_from_world * observations[i].p_world).norm());
  }
  if (inliers < 4) return out;
  mean /= inliers;
  spread = spread / inliers - mean * mean.transpose();
  out.spread_px = std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvalues()[0]));
  const Eigen::Matrix<double, 6, 6> information = fit.information;
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(information);
  if (!solver.isPositive() || !(solver.vectorD().minCoeff() > 1e-9)) return out;
  const double scale = std::max(1.0, fit.scale);
  out.tangent_covariance = scale * scale * solver.solve(Eigen::Matrix<double, 6, 6>::Identity());
  std::ranges::sort(depths);
  const double depth = depths[depths.size() / 2];
  // The evidence. Chance finds some share of points anywhere; that they agree on a pose, are many, are a fair share of
  // what should be seen, and lie all over the place is not chance.
  const double wide = camera_.image_size.width / 320.0;
  const double share = out.sought > 0 ? static_cast<double>(out.found) / out.sought : 0;
  const camera_tracking::Covariance6d world =
      camera_tracking::world_covariance(out.cam_from_world, out.tangent_covariance);
  const bool sure = std::sqrt(world.topLeftCorner<3, 3>().trace()) < 0.02 * depth &&
                    std::sqrt(world.bottomRightCorner<3, 3>().trace()) < 0.02;
  const bool by_points =
      out.found >= (strict ? 25 : 15) && share > (strict ? 0.35 : 0.25) && out.spread_px > (strict ? 16 : 11) * wide;
  // At the beginning there are few points, but nothing is in doubt either.
  const bool by_few = !strict && map.keyframes.size() < 4 && out.sought <= 30 && out.found >= 7 && share > 0.6 &&
                      out.spread_px > 16 * wide;
  // Started from 4 to 6 known points: all of them, while nothing else is known.
  const bool by_all = !strict && map.alive_count() < 12 && out.found >= 4 && out.found == out.sought;
  // A rectangle alone is proof while nothing else is known; later, another one of this shape may lie about.
  const bool by_rectangle = out.corners == 4 && (out.sought >= 8 ? share > 0.4 : !strict || map.alive_count() < 12);
  out.proven = sure && fit.scale < 3.5 && (by_points || by_few || by_all || by_rectangle);
  if (out.proven) depth_m_ = depth;
  return out;
}

ProvenPose KeyframeTracking::track(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid,
                                   const camera_tracking::SceneMap& map, bool lost,
                                   const std::optional<calib::Rigid3d>& proposed) {
  ++frames_;
  ProvenPose best;
  if (!lost) {
    // The velocity fades where it is not confirmed.
    const double keep = unproven_ == 0 ? 0.9 : 0.0;
    const calib::Rigid3d predicted = calib::exp(calib::Tangent6d(keep * calib::log(step_))) * pose_;
    const calib::Rigid3d found = coarse(predicted, *pyramid, map);
    best = fine(found, *pyramid, map, false);
    if (!best.proven && unproven_ == 0) {
      ProvenPose other = fine(predicted, *pyramid, map, false);
      if (other.proven) best = std::move(other);
    }
  }
  if (!best.proven && map.keyframes.size() >= 2) {
    if (const auto proposal = camera_tracking::relocalize(camera_, *pyramid, map, seed_ + frames_)) {
      ProvenPose other = fine(proposal->cam_from_world, *pyramid, map, true);
      if (other.proven) best = std::move(other);
    }
  }
  if (!best.proven && proposed) {
    ProvenPose other = fine(*proposed, *pyramid, map, true);
    if (other.proven) best = std::move(other);
  }
  if (best.proven) {
    step_ = unproven_ == 0 ? best.cam_from_world * calib::inverse(pose_) : calib::Rigid3d{};
    pose_ = best.cam_from_world;
    unproven_ = 0;
  } else {
    ++unproven_;
    if (particles_.size() > 0) particles_.resample(rng_, particle_count_);
  }
  return best;
}

}  // namespace huetrack::keyframes
