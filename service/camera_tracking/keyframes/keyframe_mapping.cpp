#include "camera_tracking/keyframes/keyframe_mapping.h"

#include <Eigen/LU>
#include <algorithm>

#include "calib/model/median.h"
#include "camera_tracking/keyframes/swept_fit.h"

namespace huetrack::keyframes {

namespace {

// A point is judged by its detection rate after so many searches; then both counts are halved.
constexpr int judged_after = 20;
constexpr int least_found_share = 4;  // fewer than one in so many: removed
// A frame updates the map only if more than this share of the points was found (else its pose is weak) and its flow is
// below these shares of the image's width (else it is blurred).
constexpr double enough_found = 0.5, sharp_for_seeds = 0.06, sharp_for_keyframe = 0.03;
constexpr double most_readout_sigma_px = 1.5;  // PosedFrame::readout_sigma_px of a frame that updates the map
// A new key frame: distance from all others as a share of the depth, or rotation.
constexpr double keyframe_moved = 0.05, keyframe_turned_rad = 0.2;
constexpr std::uint64_t frames_between_keyframes = 3;
constexpr double new_view = 0.25;  // dissimilarity from all other views: radians plus |log| of the distances' ratio
constexpr int window = 7;          // key frames of an adjustment
constexpr std::size_t fewest_to_adjust = 12;  // observations
constexpr int adjust_iterations = 6;
// A key frame is refitted when the readout's sigma has fallen to this share.
constexpr double refit_at_share = 0.6;
constexpr std::size_t fewest_to_refit = 4;  // observations
constexpr std::size_t most_refitted = 14;   // per frame, the oldest first
constexpr double seed_sigma_px = 0.4;       // of a seed's corner, pixels of its level

}  // namespace

KeyframeMapping::KeyframeMapping(const calib::Camera& camera) : camera_(camera) {}

void KeyframeMapping::add_view(MapPoint& point, int keyframe, int level, const Eigen::Vector2d& px) {
  PointView view;
  view.keyframe = keyframe, view.level = level, view.px = px;
  describe(view, *map_.keyframe(keyframe).pyramid);
  // The first view stays; of the others the oldest is replaced.
  const auto n = static_cast<int>(point.views.size());
  if (point.view_count < n) {
    point.view(point.view_count++) = view;
  } else {
    std::move(point.views.begin() + 2, point.views.end(), point.views.begin() + 1);
    point.views.back() = view;
  }
}

void KeyframeMapping::start(const PosedFrame& frame, std::span<const Eigen::Vector3d> points,
                            const Eigen::Vector3d& normal, double given_sigma_m,
                            const Eigen::Matrix<double, 6, 6>& start_covariance) {
  map_ = {};
  map_.start_covariance = start_covariance;
  map_.start_centre = calib::inverse(frame.pose.cam_from_world).translation;
  priors_.clear(), speed_px_s_.clear(), is_sharp_.clear();
  by_point_.clear(), seeds_.clear(), given_sigma_m_.clear(), given_position_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    MapPoint p;
    p.position = points[i];
    p.covariance = given_sigma_m * given_sigma_m * Eigen::Matrix3d::Identity();
    p.normal = normal;
    p.given = true;
    map_.points.push_back(p);
    by_point_.emplace_back();
    given_sigma_m_.push_back(given_sigma_m);
    given_position_.push_back(points[i]);
  }
  add_keyframe(frame);
  export_seeds();
}

void KeyframeMapping::start(StoredMap stored) {
  map_ = std::move(stored.map);
  priors_.assign(map_.keyframes.size(), std::nullopt);
  speed_px_s_.assign(map_.keyframes.size(), 0);
  is_sharp_.assign(map_.keyframes.size(), true);
  by_point_.assign(map_.points.size(), {});
  given_sigma_m_.assign(map_.points.size(), 0);
  given_position_.assign(map_.points.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    if (!map_.points[i].given) continue;
    given_sigma_m_[i] = std::max(1e-4, std::sqrt(map_.points[i].covariance(0, 0)));
    given_position_[i] = map_.points[i].position;
  }
  for (const PointSighting& s : stored.sightings) by_point_[static_cast<std::size_t>(s.point)].push_back(s);
  seeds_.clear();
}

StoredMap KeyframeMapping::stored() const {
  StoredMap out{map_, {}, {camera_.image_size.width, camera_.image_size.height}};
  for (const auto& sightings : by_point_) out.sightings.insert(out.sightings.end(), sightings.begin(), sightings.end());
  return out;
}

double KeyframeMapping::median_depth(const calib::Rigid3d& cam_from_world) const {
  std::vector<double> depth;
  for (const MapPoint& p : map_.points) {
    if (!p.alive) continue;
    const Eigen::Vector3d cam = cam_from_world * p.position;
    const auto px = camera_.model.project(cam);
    if (px && camera_.contains(*px)) depth.push_back(cam.norm());
  }
  return calib::median(std::move(depth), 1.0);
}

void KeyframeMapping::map(const PosedFrame& frame) {
  if (!frame.tracked) return;
  count_detections(frame);
  refit_outdated(frame.readout);
  if (frame.flow_px < sharp_for_seeds * camera_.image_size.width && frame.readout_sigma_px < most_readout_sigma_px)
    update_seeds(frame);
  if (is_new_keyframe(frame)) add_keyframe(frame);
  export_seeds();
}

// Updates the detection rates and removes points that are seldom found.
void KeyframeMapping::count_detections(const PosedFrame& frame) {
  for (const PointSighting& s : frame.sightings) {
    auto& counts = map_.point(s.point).found_of_sought;
    ++counts[0], ++counts[1];
  }
  for (const int i : frame.missed) ++map_.point(i).found_of_sought[1];
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    MapPoint& p = map_.points[i];
    if (!p.alive || p.given || p.found_of_sought[1] < judged_after) continue;
    if (frame.share_found > enough_found && p.found_of_sought[0] * least_found_share < p.found_of_sought[1])
      remove(static_cast<int>(i));
    p.found_of_sought[0] = static_cast<std::uint16_t>(p.found_of_sought[0] / 2);
    p.found_of_sought[1] = static_cast<std::uint16_t>(p.found_of_sought[1] / 2);
  }
}

bool KeyframeMapping::is_new_keyframe(const PosedFrame& frame) const {
  if (frame.number < last_keyframe_frame_ + frames_between_keyframes || !(frame.share_found > enough_found) ||
      !(frame.flow_px < sharp_for_keyframe * camera_.image_size.width) ||
      !(frame.readout_sigma_px < most_readout_sigma_px))
    return false;
  const double depth = median_depth(frame.pose.cam_from_world);
  const Eigen::Vector3d centre = calib::inverse(frame.pose.cam_from_world).translation;
  return std::ranges::all_of(map_.keyframes, [&](const Keyframe& k) {
    const double moved = (calib::inverse(k.cam_from_world).translation - centre).norm() / depth;
    const double turned = k.cam_from_world.rotation.angularDistance(frame.pose.cam_from_world.rotation);
    return moved / keyframe_moved + turned / keyframe_turned_rad > 1;
  });
}

void KeyframeMapping::add_keyframe(const PosedFrame& frame) {
  const auto index = static_cast<int>(map_.keyframes.size());
  map_.keyframes.push_back({frame.pyramid, frame.pose.cam_from_world, frame.pose.sweep});
  priors_.push_back(frame.prior);
  is_sharp_.push_back(frame.flow_px < sharp_for_keyframe * camera_.image_size.width);
  speed_px_s_.push_back(frame.readout.sigma_s > 0 ? frame.readout_sigma_px / frame.readout.sigma_s : 0);
  last_keyframe_frame_ = frame.number;
  const Eigen::Vector3d centre = calib::inverse(frame.pose.cam_from_world).translation;
  for (PointSighting s : frame.sightings) {
    s.keyframe = index;
    MapPoint& p = map_.point(s.point);
    if (!p.alive) continue;
    by_point_[static_cast<std::size_t>(s.point)].push_back(s);
    double nearest = 1e9;
    for (int k = 0; k < p.view_count; ++k) {
      const Keyframe& other = map_.keyframe(p.view(k).keyframe);
      const Eigen::Vector3d from = calib::inverse(other.cam_from_world).translation - p.position,
                            now = centre - p.position;
      nearest = std::min(nearest, angle_between(from, now) + std::abs(std::log(now.norm() / from.norm())));
    }
    if (nearest < new_view) continue;
    const int level = p.view_count == 0 ? 0 : p.views[0].level;
    add_view(p, index, level, s.px);
  }
  if (index > 0) adjust_window(window_of(index), index);
  add_seeds(index);
}

void KeyframeMapping::promote(const Seed& seed) {
  MapPoint p;
  const Keyframe& k = map_.keyframe(seed.view.keyframe);
  const calib::Rigid3d world_from_cam = calib::inverse(k.pose().at(seed.view.px.y()));
  const Eigen::Vector3d ray = world_from_cam.rotation * seed.ray;
  p.position = world_from_cam * (seed.ray / seed.inverse_depth);
  const double along = seed.sigma / (seed.inverse_depth * seed.inverse_depth);
  const double across = 0.5 * scale_of(seed.view.level) / camera_.model.fx() / seed.inverse_depth;
  p.covariance =
      across * across * Eigen::Matrix3d::Identity() + (along * along - across * across) * ray * ray.transpose();
  const auto index = static_cast<int>(map_.points.size());
  add_view(p, seed.view.keyframe, seed.view.level, seed.view.px);
  map_.points.push_back(p);
  by_point_.push_back(std::vector<PointSighting>{
      PointSighting{seed.view.keyframe, index, seed.view.px, seed_sigma_px * scale_of(seed.view.level)}});
  given_sigma_m_.push_back(0);
  given_position_.push_back(Eigen::Vector3d::Zero());
}

void KeyframeMapping::remove(int point) {
  map_.point(point).alive = false;
  by_point_[static_cast<std::size_t>(point)].clear();
}

// The key frame, and those that share most points with it.
std::set<int> KeyframeMapping::window_of(int keyframe) const {
  std::map<int, int> shared;
  for (const auto& sightings : by_point_) {
    if (std::ranges::none_of(sightings, [keyframe](const PointSighting& s) { return s.keyframe == keyframe; }))
      continue;
    for (const PointSighting& s : sightings) ++shared[s.keyframe];
  }
  std::vector<std::pair<int, int>> order;  // (- shared points, - key frame): newest first among equals
  for (const auto& [k, count] : shared) order.emplace_back(-count, -k);
  std::ranges::sort(order);
  std::set<int> moved{keyframe};
  for (const auto& [count, k] : order) {
    if (static_cast<int>(moved.size()) < window) moved.insert(-k);
  }
  return moved;
}

// All points that they see; other key frames that see these points are fixed.
KeyframeMapping::LocalProblem KeyframeMapping::problem_of(const std::set<int>& moved, int keyframe) const {
  LocalProblem local;
  BundleProblem& problem = local.bundle;
  bool anchored = false;
  const auto pose_index = [&](int k) {
    const auto [it, fresh] = local.pose_of.try_emplace(k, static_cast<int>(problem.poses.size()));
    const Keyframe& frame = map_.keyframe(k);
    if (fresh) problem.poses.push_back({frame.cam_from_world, !moved.contains(k), frame.sweep});
    return it->second;
  };
  for (std::size_t i = 0; i < by_point_.size(); ++i) {
    const auto& sightings = by_point_[i];
    const bool given = given_sigma_m_[i] > 0;
    if (sightings.size() < 2 && !(given && !sightings.empty())) continue;
    if (std::ranges::none_of(sightings, [&](const PointSighting& s) { return moved.contains(s.keyframe); })) continue;
    const auto point = static_cast<int>(problem.points.size());
    BundlePoint p;
    p.position = map_.points[i].position;
    if (given) p.prior = given_position_[i], p.prior_sigma_m = given_sigma_m_[i], anchored = true;
    problem.points.push_back(p);
    local.point_of.push_back(static_cast<int>(i));
    for (std::size_t k = 0; k < sightings.size(); ++k) {
      problem.observations.push_back(
          {pose_index(sightings[k].keyframe), point, sightings[k].px, sightings[k].sigma_px, false});
      local.source.emplace_back(i, k);
    }
  }
  const auto fixed = std::ranges::count_if(problem.poses, &BundlePose::fixed);
  if (!anchored && fixed < 2) {  // gauge and scale: fix the oldest two
    int to_fix = 2 - static_cast<int>(fixed);
    for (const int k : moved) {
      if (to_fix-- > 0 && k != keyframe && local.pose_of.contains(k))
        problem.poses[static_cast<std::size_t>(local.pose_of[k])].fixed = true;
    }
  }
  return local;
}

void KeyframeMapping::apply(const LocalProblem& local) {
  for (const auto& [k, at] : local.pose_of)
    map_.keyframe(k).cam_from_world = local.bundle.poses[static_cast<std::size_t>(at)].cam_from_world;
  for (std::size_t j = 0; j < local.point_of.size(); ++j) {
    MapPoint& p = map_.point(local.point_of[j]);
    p.position = local.bundle.points[j].position;
    p.covariance = local.bundle.points[j].covariance;
  }
  // Backwards, so that the remaining indices stay valid.
  for (std::size_t j = local.source.size(); j-- > 0;) {
    const auto [point, place] = local.source[j];
    if (!local.bundle.observations[j].outlier || given_sigma_m_[point] > 0) continue;
    auto& sightings = by_point_[point];
    if (!map_.points[point].alive) continue;
    sightings.erase(sightings.begin() + static_cast<std::ptrdiff_t>(place));
    if (sightings.size() < 2) remove(static_cast<int>(point));
  }
}

// Refits the key frames whose motion was fitted with a less certain readout.
void KeyframeMapping::refit_outdated(const Readout& readout) {
  std::set<int> outdated;
  for (std::size_t k = 0; k < priors_.size() && outdated.size() < most_refitted; ++k) {
    if (!priors_[k] || !(readout.sigma_s < refit_at_share * priors_[k]->readout.sigma_s)) continue;
    priors_[k]->readout = readout;
    outdated.insert(static_cast<int>(k));
  }
  if (!outdated.empty()) adjust_window(outdated, *outdated.rbegin());
}

// Fits pose and motion to the current points.
void KeyframeMapping::refit(const std::set<int>& keyframes) {
  std::map<int, std::vector<PoseObservation>> seen;
  for (std::size_t i = 0; i < by_point_.size(); ++i) {
    for (const PointSighting& s : by_point_[i]) {
      if (keyframes.contains(s.keyframe)) seen[s.keyframe].push_back({map_.points[i].position, s.px, s.sigma_px});
    }
  }
  for (const auto& [k, observations] : seen) {
    const std::optional<MotionPrior>& prior = priors_[static_cast<std::size_t>(k)];
    if (!prior || observations.size() < fewest_to_refit) continue;
    Keyframe& keyframe = map_.keyframe(k);
    const SweptFit fit = refine_swept_pose(camera_.model, observations, keyframe.pose(), *prior);
    keyframe.cam_from_world = fit.pose.cam_from_world, keyframe.sweep = fit.pose.sweep;
  }
}

void KeyframeMapping::adjust_window(const std::set<int>& moved, int keyframe) {
  refit(moved);  // the adjustment does not change their motion
  LocalProblem local = problem_of(moved, keyframe);
  if (local.bundle.observations.size() < fewest_to_adjust) return;
  adjust(camera_.model, local.bundle, adjust_iterations);
  apply(local);
}

}  // namespace huetrack::keyframes
