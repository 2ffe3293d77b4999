#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/model/median.h"

#include "camera_tracking/keyframes/keyframe_tracking.h"

namespace huetrack::keyframes {

namespace {

constexpr std::size_t first_points = 60, most_fine_points = 220;
// The NCC that sub-pixel refinement gains, and that a patch loses one level above its own.
constexpr float refined_gains = 0.1f, blurred_loses = 0.05f;
// Standard deviations of a match, pixels of its level: at the best pixel, and refined.
constexpr double pixel_sigma_px = 0.4, match_sigma_px = 0.25, corner_sigma_px = 0.12;
// Factors of a seed's sigma (its corner was measured once, too) and of the readout's sigma in frames that use seeds.
constexpr double seed_px = 1.41, correlated_seeds = 2;
constexpr int first_reach_px = 4, least_reach_px = 3, most_reach_px = 8;  // of the search, pixels of the level
constexpr double margin_px = 6;                                           // to the level's border
// Fewest observations and inliers of a fit.
constexpr std::size_t first_fit_points = 6, corner_fit_points = 8, fewest_observations = 4;
constexpr int first_fit_inliers = 5, corner_fit_inliers = 6, rough_iterations = 8, iterations = 15;
// Search width for the rectangle's edges, with and without enough points that predict them.
constexpr std::size_t enough_points = 12;
constexpr double near_edge_px = 3, far_edge_px = 7;
constexpr double least_pivot = 1e-9;  // of the information: below, a direction is undetermined

// The smaller standard deviation over the image.
double spread_px(const std::vector<PointSighting>& sightings) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const PointSighting& s : sightings) {
    mean += s.px;
    spread += s.px * s.px.transpose();
  }
  const auto n = static_cast<double>(sightings.size());
  mean /= n;
  spread = spread / n - mean * mean.transpose();
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvalues()[0]));
}

double median_depth_m(const calib::Rigid3d& cam_from_world, const std::vector<PointSighting>& sightings,
                      const SceneMap& map) {
  std::vector<double> depths;
  for (const PointSighting& s : sightings) depths.push_back((cam_from_world * map.point(s.point).position).norm());
  return calib::median(std::move(depths));
}

std::optional<Covariance6d> checked_covariance(const PoseFit& fit) {
  const Eigen::LDLT<Covariance6d> solver(fit.information);
  if (!solver.isPositive() || !(solver.vectorD().minCoeff() > least_pivot)) return std::nullopt;
  const double scale = std::max(1.0, fit.scale);
  return Covariance6d(scale * scale * solver.solve(Covariance6d::Identity()));
}

}  // namespace

ProvenPose KeyframeTracking::fine(const SweptPose& start, const Pyramid& pyramid, const SceneMap& map, bool is_guess,
                                  bool is_near) {
  ProvenPose out;
  out.pose = is_near ? start : first_fit(start, pyramid, map);
  std::vector<Visible> seen = visible(out.pose, map, pyramid.count());
  subsample(seen, most_fine_points);
  Matches matches = match(seen, pyramid, map);
  if (rectangle_ && map.points.size() >= 4) out.pose = add_corners(out.pose, pyramid, map, matches);
  if (is_guess || static_cast<std::size_t>(map.alive_count()) >= most_fine_points)
    return proof_by(matches, out.pose, map, is_guess);
  Matches with_seeds = matches;
  add_seeds(out.pose, pyramid, map, most_fine_points - seen.size(), with_seeds);
  if (with_seeds.observations.size() == matches.observations.size()) return proof_by(matches, out.pose, map, is_guess);
  ProvenPose by_seeds = proof_by(with_seeds, out.pose, map, is_guess);
  if (by_seeds.proven) {
    // The next frames use the same seeds: their measurements are correlated.
    if (by_seeds.readout) by_seeds.readout->sigma_s *= correlated_seeds;
    return by_seeds;
  }
  return proof_by(matches, out.pose, map, is_guess);
}

ProvenPose KeyframeTracking::proof_by(const Matches& matches, const SweptPose& start, const SceneMap& map,
                                      bool is_guess) {
  ProvenPose out;
  out.pose = start;
  out.evidence.sought = matches.sought;
  out.missed = matches.missed;
  if (matches.observations.size() < fewest_observations) return out;
  const SweptFit refined = refine_swept_pose(camera_.model, matches.observations, out.pose, prior_, iterations);
  const PoseFit& fit = refined.fit;
  out.pose = refined.pose;
  out.readout = refined.readout;
  classify(fit, matches, out);
  if (out.sightings.size() < fewest_observations) return out;
  const auto covariance = checked_covariance(fit);
  if (!covariance) return out;
  out.tangent_covariance = *covariance;

  PoseEvidence& e = out.evidence;
  const Covariance6d world = world_covariance(out.pose.cam_from_world, out.tangent_covariance);
  e.image_width_px = camera_.image_size.width;
  e.spread_px = spread_px(out.sightings);
  e.scale = fit.scale;
  e.position_sigma_m = std::sqrt(world.topLeftCorner<3, 3>().trace());
  e.rotation_sigma_rad = std::sqrt(world.bottomRightCorner<3, 3>().trace());
  e.depth_m = median_depth_m(out.pose.cam_from_world, out.sightings, map);
  e.map_points = map.alive_count();
  e.keyframes = static_cast<int>(map.keyframes.size());
  e.is_guess = is_guess;
  out.proven = proof_of(e) != Proof::none;
  if (out.proven) depth_m_ = e.depth_m;
  return out;
}

void KeyframeTracking::Matches::add(int map_point, const PoseObservation& observation, double sigma_px) {
  observations.push_back(observation);
  point.push_back(map_point);
  pixel_sigma.push_back(sigma_px);
}

PixelRegion KeyframeTracking::around(const Eigen::Vector2d& at, int reach_u, int reach_v,
                                     const GreyImage& image) const {
  const double offset = static_cast<double>(patch_.inner.centre_offset());
  const int u = static_cast<int>(std::lround(at.x() - offset)), v = static_cast<int>(std::lround(at.y() - offset));
  return clip({u - reach_u, v - reach_v, u + reach_u, v + reach_v}, image, patch_side);
}

// From some well-spread points, searched one level above their own in a wide region.
SweptPose KeyframeTracking::first_fit(const SweptPose& pose, const Pyramid& pyramid, const SceneMap& map) {
  const std::vector<Visible> seen = visible(pose, map, pyramid.count());
  std::vector<PoseObservation> observations;
  const std::size_t stride = std::max<std::size_t>(1, seen.size() / first_points);
  for (std::size_t i = 0; i < seen.size(); i += stride) {
    const Visible& s = seen[i];
    const int level = std::min(s.level + 1, std::min(2, pyramid.count() - 1));
    if (!warp(s, map, level)) continue;
    const GreyImage& image = pyramid.level(level);
    const PixelRegion region = around(to_level(s.px, level), first_reach_px, first_reach_px, image);
    if (region.empty()) continue;
    ncc_field(image, patch_.inner, region, field_);
    const NccPeak peak = best_of(field_, region);
    if (peak.rho < good_ncc - blurred_loses) continue;
    const double offset = static_cast<double>(patch_.inner.centre_offset());
    const Eigen::Vector2d px = from_level(Eigen::Vector2d(peak.u + offset, peak.v + offset), level);
    observations.push_back(
        {map.point(s.point).position, px, std::hypot(pixel_sigma_px * scale_of(level), s.map_sigma_px)});
  }
  if (observations.size() < first_fit_points) return pose;
  const SweptFit fit = rough_fit(observations, pose, rough_iterations);
  return fit.fit.inliers >= first_fit_inliers ? fit.pose : pose;
}

// Sub-pixel matches near the projections. Fills sought_.
KeyframeTracking::Matches KeyframeTracking::match(const std::vector<Visible>& seen, const Pyramid& pyramid,
                                                  const SceneMap& map) {
  Matches out;
  sought_.clear();
  for (const Visible& s : seen) {
    if (!warp(s, map, s.level)) continue;
    const GreyImage& image = pyramid.level(s.level);
    const Eigen::Vector2d at = to_level(s.px, s.level);
    if (!image.contains(at.x(), at.y(), margin_px)) continue;
    const int reach = std::clamp(static_cast<int>(std::ceil(2 + 2 * s.map_sigma_px / scale_of(s.level))),
                                 least_reach_px, most_reach_px);
    const PixelRegion region = around(at, reach, reach, image);
    if (region.empty()) continue;
    ++out.sought;
    const double search = (reach * scale_of(s.level)) / 2;
    sought_.push_back({s.point, s.px, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()),
                       search * search * Eigen::Matrix2d::Identity()});
    const auto found = find_patch(image, region, s.level);
    if (!found) {
      out.missed.push_back(s.point);
      continue;
    }
    const double sigma = match_sigma_px * scale_of(s.level);
    sought_.back().found_px = *found;
    out.add(s.point, {map.point(s.point).position, sought_.back().found_px, std::hypot(sigma, s.map_sigma_px)}, sigma);
  }
  return out;
}

std::optional<Eigen::Vector2d> KeyframeTracking::find_patch(const GreyImage& image, const PixelRegion& region,
                                                            int level) {
  ncc_field(image, patch_.inner, region, field_);
  const NccPeak peak = best_of(field_, region);
  if (!(peak.rho > good_ncc - refined_gains)) return std::nullopt;
  const double offset = static_cast<double>(patch_.inner.centre_offset());
  const auto refined =
      camera_tracking::refine(image, patch_, Eigen::Vector2d(peak.u + offset, peak.v + offset), most_shift_px);
  if (!refined || refined->ncc < good_ncc) return std::nullopt;
  return from_level(refined->px, level);
}

// While the map has few points, its seeds constrain the rotation, and the motion across their epipolar lines. They are
// no evidence for the pose: along such a line a match is easily found by chance.
void KeyframeTracking::add_seeds(const SweptPose& pose, const Pyramid& pyramid, const SceneMap& map, std::size_t most,
                                 Matches& matches) {
  if (matches.observations.size() < fewest_observations) return;
  const SweptFit about = refine_swept_pose(camera_.model, matches.observations, pose, prior_, rough_iterations);
  if (about.fit.inliers < static_cast<int>(fewest_observations)) return;
  const auto covariance = checked_covariance(about.fit);
  if (!covariance) return;
  const double moved_m = std::sqrt(covariance->bottomRightCorner<3, 3>().trace() / 3);
  std::vector<Visible> seen = visible_seeds(about.pose, moved_m, map, pyramid.count());
  subsample(seen, most);
  for (const Visible& s : seen) {
    if (!warp(s, map, s.level)) continue;
    const GreyImage& image = pyramid.level(s.level);
    const Eigen::Vector2d at = to_level(s.px, s.level);
    if (!image.contains(at.x(), at.y(), margin_px)) continue;
    const Eigen::Vector2d reach = 2 / scale_of(s.level) * s.reach_px.cwiseAbs();
    const PixelRegion region = around(at, least_reach_px + static_cast<int>(std::ceil(reach.x())),
                                      least_reach_px + static_cast<int>(std::ceil(reach.y())), image);
    if (region.empty()) continue;
    const auto found = find_patch(image, region, s.level);
    if (!found) continue;
    const double sigma = match_sigma_px * scale_of(s.level);
    matches.add(-1, {s.position, *found, std::hypot(seed_px * sigma, s.map_sigma_px), s.line_sigma_px}, sigma);
  }
}

// The corners of the start rectangle, by its edges. Returns the pose by which they were predicted: fitted to the points
// if there are enough.
SweptPose KeyframeTracking::add_corners(const SweptPose& start, const Pyramid& pyramid, const SceneMap& map,
                                        Matches& matches) {
  SweptPose pose = start;
  const std::size_t points = matches.observations.size();
  if (points >= corner_fit_points) {
    const SweptFit fit = rough_fit(matches.observations, pose, rough_iterations);
    if (fit.fit.inliers >= corner_fit_inliers) pose = fit.pose;
  }
  std::array<Eigen::Vector2d, 4> about;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto px = project_swept(camera_.model, pose, map.points[i].position);
    if (!px) return pose;
    about[i] = px->px;
  }
  const RectangleCorners corners = measure_rectangle(pyramid.levels.front(), camera_.model, about,
                                                     points >= enough_points ? near_edge_px : far_edge_px, *rectangle_);
  for (std::size_t i = 0; i < 4; ++i) {
    if (!corners.measured[i]) continue;
    matches.add(static_cast<int>(i), {map.points[i].position, corners.px[i], corner_sigma_px}, corner_sigma_px);
    sought_.push_back({static_cast<int>(i), about[i], corners.px[i], 4 * Eigen::Matrix2d::Identity()});
  }
  return pose;
}

void KeyframeTracking::classify(const PoseFit& fit, const Matches& matches, ProvenPose& out) const {
  for (std::size_t i = 0; i < matches.observations.size(); ++i) {
    const int point = matches.point[i];
    if (point < 0) continue;  // a seed
    if (!(fit.weight[i] > inlier_weight)) {
      if (!is_corner(point)) out.missed.push_back(point);
      continue;
    }
    ++(is_corner(point) ? out.evidence.corners : out.evidence.found);
    out.sightings.push_back({-1, point, matches.observations[i].px, matches.pixel_sigma[i]});
  }
}

}  // namespace huetrack::keyframes
