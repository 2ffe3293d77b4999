#include "camera_tracking/keyframes/keyframe_mapping.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "camera_tracking/keyframes/local_bundle.h"

namespace huetrack::keyframes {
namespace {

constexpr int patch_side = 8;
constexpr int corner_levels = 3;
constexpr int cell_px = 18;  // of a 320 px wide image: at most one new corner per cell
constexpr std::size_t max_seeds = 350;
constexpr double converged = 0.035;  // sigma / inverse depth
constexpr double enough_parallax_rad = 0.025;
constexpr int window = 7;  // key frames that an adjustment moves

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

KeyframeMapping::KeyframeMapping(const calib::Camera& camera) : camera_(camera) {}

void KeyframeMapping::add_look(camera_tracking::MapPoint& point, int keyframe, int level, const Eigen::Vector2d& px) {
  camera_tracking::PointLook look;
  look.keyframe = keyframe, look.level = level, look.px = px;
  const camera_tracking::GreyImage& image =
      map_.keyframes[static_cast<std::size_t>(keyframe)].pyramid->levels[static_cast<std::size_t>(level)];
  const Eigen::Vector2d at = camera_tracking::to_level(px, level);
  look.described = image.contains(at.x(), at.y(), camera_tracking::descriptor_margin);
  if (look.described) look.descriptor = camera_tracking::describe(image, at);
  // The first look stays; of the others the oldest goes.
  const auto n = static_cast<int>(point.looks.size());
  if (point.look_count < n) {
    point.looks[static_cast<std::size_t>(point.look_count++)] = look;
  } else {
    std::move(point.looks.begin() + 2, point.looks.end(), point.looks.begin() + 1);
    point.looks.back() = look;
  }
}

void KeyframeMapping::start(const TrackedFrame& frame, std::span<const Eigen::Vector3d> points,
                            const Eigen::Vector3d& normal, double given_sigma_m,
                            const Eigen::Matrix<double, 6, 6>& start_covariance) {
  map_ = {};
  map_.start_covariance = start_covariance;
  map_.start_centre = calib::inverse(frame.cam_from_world).translation;
  by_point_.clear(), seeds_.clear(), given_sigma_m_.clear(), given_position_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    camera_tracking::MapPoint p;
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
}

void KeyframeMapping::start(camera_tracking::StoredMap stored) {
  map_ = std::move(stored.map);
  by_point_.assign(map_.points.size(), {});
  given_sigma_m_.assign(map_.points.size(), 0);
  given_position_.assign(map_.points.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    if (!map_.points[i].given) continue;
    given_sigma_m_[i] = std::max(1e-4, std::sqrt(map_.points[i].covariance(0, 0)));
    given_position_[i] = map_.points[i].position;
  }
  for (const camera_tracking::PointSighting& s : stored.sightings)
    by_point_[static_cast<std::size_t>(s.point)].push_back(s);
  seeds_.clear();
}

camera_tracking::StoredMap KeyframeMapping::stored() const {
  camera_tracking::StoredMap out{map_, {}, {camera_.image_size.width, camera_.image_size.height}};
  for (const auto& sightings : by_point_) out.sightings.insert(out.sightings.end(), sightings.begin(), sightings.end());
  return out;
}

double KeyframeMapping::median_depth(const calib::Rigid3d& cam_from_world) const {
  std::vector<double> depth;
  for (const camera_tracking::MapPoint& p : map_.points) {
    if (!p.alive) continue;
    const Eigen::Vector3d cam = cam_from_world * p.position;
    const auto px = camera_.model.project(cam);
    if (px && camera_.contains(*px)) depth.push_back(cam.norm());
  }
  if (depth.empty()) return 1;
  std::nth_element(depth.begin(), depth.begin() + static_cast<std::ptrdiff_t>(depth.size() / 2), depth.end());
  return depth[depth.size() / 2];
}

void KeyframeMapping::map(const TrackedFrame& frame) {
  if (!frame.tracked) return;
  for (const camera_tracking::PointSighting& s : frame.sightings) {
    auto& counts = map_.points[static_cast<std::size_t>(s.point)].found_of_sought;
    ++counts[0], ++counts[1];
  }
  for (const int i : frame.missed) ++map_.points[static_cast<std::size_t>(i)].found_of_sought[1];
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    camera_tracking::MapPoint& p = map_.points[i];
    if (!p.alive || p.given || p.found_of_sought[1] < 20) continue;
    if (frame.share_found > 0.5 && p.found_of_sought[0] * 4 < p.found_of_sought[1]) remove(static_cast<int>(i));
    p.found_of_sought[0] = static_cast<std::uint16_t>(p.found_of_sought[0] / 2);
    p.found_of_sought[1] = static_cast<std::uint16_t>(p.found_of_sought[1] / 2);
  }
  if (frame.flow_px < 0.06 * camera_.image_size.width) update_seeds(frame);

  const double depth = median_depth(frame.cam_from_world);
  double nearest = 1e9;
  const calib::Rigid3d world_from_cam = calib::inverse(frame.cam_from_world);
  for (const camera_tracking::Keyframe& k : map_.keyframes) {
    const double moved = (calib::inverse(k.cam_from_world).translation - world_from_cam.translation).norm() / depth;
    const double turned = k.cam_from_world.rotation.angularDistance(frame.cam_from_world.rotation);
    nearest = std::min(nearest, moved / 0.05 + turned / 0.2);
  }
  const bool sharp = frame.flow_px < 0.03 * camera_.image_size.width;
  if (nearest > 1 && frame.number >= last_keyframe_frame_ + 3 && frame.share_found > 0.5 && sharp) {
    add_keyframe(frame);
  }
}

void KeyframeMapping::add_keyframe(const TrackedFrame& frame) {
  const auto index = static_cast<int>(map_.keyframes.size());
  map_.keyframes.push_back({frame.pyramid, frame.cam_from_world});
  ++counters_.keyframes;
  last_keyframe_frame_ = frame.number;
  const Eigen::Vector3d centre = calib::inverse(frame.cam_from_world).translation;
  for (camera_tracking::PointSighting s : frame.sightings) {
    s.keyframe = index;
    camera_tracking::MapPoint& p = map_.points[static_cast<std::size_t>(s.point)];
    if (!p.alive) continue;
    by_point_[static_cast<std::size_t>(s.point)].push_back(s);
    // A new look where the point is seen from another side than in all others.
    double nearest = 1e9;
    for (int k = 0; k < p.look_count; ++k) {
      const camera_tracking::Keyframe& other =
          map_.keyframes[static_cast<std::size_t>(p.looks[static_cast<std::size_t>(k)].keyframe)];
      const Eigen::Vector3d from = calib::inverse(other.cam_from_world).translation - p.position,
                            now = centre - p.position;
      nearest = std::min(nearest, angle_between(from, now) + std::abs(std::log(now.norm() / from.norm())));
    }
    if (nearest < 0.25) continue;
    const int level = p.look_count == 0 ? 0 : p.looks[0].level;
    add_look(p, index, level, s.px);
  }
  if (index > 0) adjust_near(index);
  add_seeds(index);
}

void KeyframeMapping::add_seeds(int keyframe) {
  const camera_tracking::Keyframe& k = map_.keyframes[static_cast<std::size_t>(keyframe)];
  const int cell = std::max(8, cell_px * camera_.image_size.width / 320);
  const int columns = (camera_.image_size.width + cell - 1) / cell,
            rows = (camera_.image_size.height + cell - 1) / cell;
  std::vector<char> taken(static_cast<std::size_t>(columns * rows), 0);
  const auto cell_of = [&](const Eigen::Vector2d& px) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(px.y()) / cell, 0, rows - 1) * columns +
                                    std::clamp(static_cast<int>(px.x()) / cell, 0, columns - 1));
  };
  std::vector<double> depths;
  for (const camera_tracking::MapPoint& p : map_.points) {
    if (!p.alive) continue;
    const Eigen::Vector3d cam = k.cam_from_world * p.position;
    const auto px = camera_.model.project(cam);
    if (!px || !camera_.contains(*px)) continue;
    taken[cell_of(px->px)] = 1;
    depths.push_back(cam.norm());
  }
  for (const Seed& s : seeds_) {  // those that are on their way, about where they will be
    const camera_tracking::Keyframe& from = map_.keyframes[static_cast<std::size_t>(s.keyframe)];
    const auto px =
        camera_.model.project(k.cam_from_world * (calib::inverse(from.cam_from_world) * (s.ray / s.inverse_depth)));
    if (px && camera_.contains(*px)) taken[cell_of(px->px)] = 1;
  }
  std::ranges::sort(depths);
  const double depth = depths.empty() ? median_depth(k.cam_from_world) : depths[depths.size() / 2];
  const double nearest = depths.empty() ? 0.5 * depth : std::min(0.5 * depth, 0.7 * depths.front());

  struct CellCorner {
    Eigen::Vector2d px;
    int level;
    float score;
  };
  std::vector<CellCorner> best(taken.size(), {Eigen::Vector2d::Zero(), -1, 0.0f});
  for (int level = 0; level < std::min(corner_levels, k.pyramid->count()); ++level) {
    const camera_tracking::GreyImage& image = k.pyramid->levels[static_cast<std::size_t>(level)];
    for (const camera_tracking::Corner& c : camera_tracking::detect_corners(image, 12, 10, 40)) {
      const Eigen::Vector2d px = camera_tracking::from_level(c.px, level);
      const std::size_t at = cell_of(px);
      // Fine corners locate better, coarse ones survive blur: a coarse one must be clearly stronger.
      const float score = c.score / static_cast<float>(1 + level);
      if (!taken[at] && score > best[at].score) best[at] = {px, level, score};
    }
  }
  for (const CellCorner& c : best) {
    if (c.level < 0 || seeds_.size() >= max_seeds) continue;
    const auto ray = camera_.model.ray({c.px});
    if (!ray) continue;
    // From nearer than all that is known to infinity: 2 sigmas on either side.
    Seed seed;
    seed.keyframe = keyframe, seed.level = c.level, seed.px = c.px, seed.ray = *ray;
    seed.inverse_depth = 1 / depth;
    seed.sigma = std::max(1 / nearest - 1 / depth, 1 / depth) / 2;
    seeds_.push_back(seed);
    ++counters_.seeds_started;
  }
}

void KeyframeMapping::update_seeds(const TrackedFrame& frame) {
  std::vector<Seed> kept;
  kept.reserve(seeds_.size());
  for (Seed& seed : seeds_) {
    if (!update(seed, frame)) {
      ++counters_.seeds_abandoned;
      continue;
    }
    if (seed.sigma < converged * seed.inverse_depth && seed.found >= 4 && seed.widest_rad > enough_parallax_rad)
      promote(seed);
    else
      kept.push_back(seed);
  }
  seeds_.swap(kept);
}

bool KeyframeMapping::update(Seed& seed, const TrackedFrame& frame) {
  const camera_tracking::Keyframe& k = map_.keyframes[static_cast<std::size_t>(seed.keyframe)];
  const calib::Rigid3d now_from_then = frame.cam_from_world * calib::inverse(k.cam_from_world);
  const double low = std::max(seed.inverse_depth - 2 * seed.sigma, 1e-3), high = seed.inverse_depth + 2 * seed.sigma;
  const auto at = [&](double inverse_depth) {
    return camera_.model.project(now_from_then * (seed.ray / inverse_depth));
  };
  const auto a = at(low), b = at(high), middle = at(seed.inverse_depth);
  if (!a || !b || !middle || !camera_.contains(*middle))
    return seed.failed < 40 && ++seed.failed;  // out of view: maybe it returns
  const Eigen::Matrix3d h = camera_tracking::plane_homography(now_from_then, seed.ray, 1 / seed.inverse_depth);
  const auto patch = camera_tracking::transfer_patch(camera_.model, seed.px, h);
  if (!patch) return ++seed.failed < 10;
  const int level = camera_tracking::search_level(patch->affine, seed.level, frame.pyramid->count());
  if (!camera_tracking::warp_patch(*k.pyramid, seed.px, patch->affine, level, patch_side, patch_))
    return ++seed.failed < 10;
  const camera_tracking::GreyImage& image = frame.pyramid->levels[static_cast<std::size_t>(level)];
  const Eigen::Vector2d from = camera_tracking::to_level(a->px, level), to = camera_tracking::to_level(b->px, level);
  const double length = (to - from).norm();
  if (length > 80) return ++seed.failed < 10;
  // The band along the epipolar line: pixels within reach of it.
  const double reach = 1.5;
  const double offset = static_cast<double>(patch_.inner.centre_offset());
  const camera_tracking::PixelRegion region =
      camera_tracking::clip({static_cast<int>(std::floor(std::min(from.x(), to.x()) - reach - offset)),
                             static_cast<int>(std::floor(std::min(from.y(), to.y()) - reach - offset)),
                             static_cast<int>(std::ceil(std::max(from.x(), to.x()) + reach - offset)),
                             static_cast<int>(std::ceil(std::max(from.y(), to.y()) + reach - offset))},
                            image, patch_side);
  if (region.empty()) return ++seed.failed < 10;
  camera_tracking::ncc_field(image, patch_.inner, region, field_);
  const Eigen::Vector2d along = length > 0 ? Eigen::Vector2d((to - from) / length) : Eigen::Vector2d(1, 0);
  float best = -2, second = -2;
  Eigen::Vector2d best_px = from;
  for (int pass = 0; pass < 2; ++pass) {
    for (int v = region.v0; v <= region.v1; ++v) {
      for (int u = region.u0; u <= region.u1; ++u) {
        const Eigen::Vector2d p(u + offset, v + offset);
        const Eigen::Vector2d d = p - from;
        const double t = along.dot(d);
        if (t < -reach || t > length + reach || std::abs(along.x() * d.y() - along.y() * d.x()) > reach) continue;
        const float rho = field_[static_cast<std::size_t>((v - region.v0) * region.width() + u - region.u0)];
        if (pass == 0 && rho > best) best = rho, best_px = p;
        if (pass == 1 && rho > second && (p - best_px).norm() > 2.9) second = rho;
      }
    }
  }
  if (best < 0.8f) return ++seed.failed < 8;
  if (second > 0.8f && second > best - 0.08f) return seed.failed < 40 && ++seed.failed;  // ambiguous: wait
  const auto refined = camera_tracking::refine(image, patch_, best_px, 1.5);
  if (!refined || refined->ncc < 0.8f) return ++seed.failed < 8;
  // Its depth by the point of the ray nearest to the new ray; how sure from a pixel's error across the parallax.
  const Eigen::Vector2d px = camera_tracking::from_level(refined->px, level);
  const auto ray_now = camera_.model.ray({px});
  if (!ray_now) return ++seed.failed < 8;
  // off the epipolar line by more than noise: something else
  const Eigen::Vector2d d = refined->px - from;
  if (length > 1 && std::abs(along.x() * d.y() - along.y() * d.x()) > reach) return ++seed.failed < 8;
  const double parallax = angle_between(now_from_then.rotation * seed.ray, *ray_now);
  seed.widest_rad = std::max(seed.widest_rad, parallax);
  ++seed.found;
  // Observed inverse depth along the projected curve: linear in small pieces.
  const double step = std::max(1e-4, 0.02 * seed.inverse_depth);
  const auto next = at(seed.inverse_depth + step);
  if (!next) return ++seed.failed < 8;
  const Eigen::Vector2d slope = (next->px - middle->px) / step;  // px per 1/m
  const double per = slope.norm();
  if (per < 1e-6) return true;  // no baseline yet
  // The curve is hyperbolic in the inverse depth; two steps of Newton's method on it.
  double rho = seed.inverse_depth;
  for (int i = 0; i < 3; ++i) {
    const auto p0 = at(rho), p1 = at(rho + step);
    if (!p0 || !p1) break;
    const Eigen::Vector2d g = (p1->px - p0->px) / step;
    if (g.squaredNorm() < 1e-12) break;
    rho = std::max(1e-3, rho + g.dot(px - p0->px) / g.squaredNorm());
  }
  const double sigma_px = 0.7 * camera_tracking::scale_of(level);  // of the corner here, there, and of both poses
  const double sigma = sigma_px / per;
  const double sum = std::sqrt(sigma * sigma + seed.sigma * seed.sigma);
  if (std::abs(rho - seed.inverse_depth) > 3 * sum) return ++seed.failed < 8;
  const double gain = seed.sigma * seed.sigma / (sum * sum);
  seed.inverse_depth = std::max(1e-3, seed.inverse_depth + gain * (rho - seed.inverse_depth));
  seed.sigma *= std::sqrt(1 - gain);
  // Errors of neighbouring frames' poses are alike, so that no number of frames makes a depth surer than this.
  seed.sigma = std::max(seed.sigma, 0.25 * sigma);
  return true;
}

void KeyframeMapping::promote(const Seed& seed) {
  camera_tracking::MapPoint p;
  const camera_tracking::Keyframe& k = map_.keyframes[static_cast<std::size_t>(seed.keyframe)];
  const calib::Rigid3d world_from_cam = calib::inverse(k.cam_from_world);
  const Eigen::Vector3d ray = world_from_cam.rotation * seed.ray;
  p.position = world_from_cam * (seed.ray / seed.inverse_depth);
  const double along = seed.sigma / (seed.inverse_depth * seed.inverse_depth);
  const double across = 0.5 * camera_tracking::scale_of(seed.level) / camera_.model.fx() / seed.inverse_depth;
  p.covariance =
      across * across * Eigen::Matrix3d::Identity() + (along * along - across * across) * ray * ray.transpose();
  const auto index = static_cast<int>(map_.points.size());
  add_look(p, seed.keyframe, seed.level, seed.px);
  map_.points.push_back(p);
  by_point_.push_back(std::vector<camera_tracking::PointSighting>{
      camera_tracking::PointSighting{seed.keyframe, index, seed.px, 0.4 * camera_tracking::scale_of(seed.level)}});
  given_sigma_m_.push_back(0);
  given_position_.push_back(Eigen::Vector3d::Zero());
  ++counters_.points_added;
}

void KeyframeMapping::remove(int point) {
  map_.points[static_cast<std::size_t>(point)].alive = false;
  by_point_[static_cast<std::size_t>(point)].clear();
  ++counters_.points_removed;
}

void KeyframeMapping::adjust_near(int keyframe) {
  // The new key frame, and those that share most points with it, are moved; others that see these points are held.
  std::map<int, int> shared;
  for (const auto& sightings : by_point_) {
    if (std::ranges::none_of(sightings,
                             [keyframe](const camera_tracking::PointSighting& s) { return s.keyframe == keyframe; }))
      continue;
    for (const camera_tracking::PointSighting& s : sightings) ++shared[s.keyframe];
  }
  std::vector<std::pair<int, int>> order;  // (- how many, - which): newest first among equals
  for (const auto& [k, count] : shared) order.emplace_back(-count, -k);
  std::ranges::sort(order);
  std::set<int> moved{keyframe};
  for (const auto& [count, k] : order) {
    if (static_cast<int>(moved.size()) < window) moved.insert(-k);
  }
  BundleProblem problem;
  std::map<int, int> pose_of;
  std::vector<int> point_of;
  bool anchored = false;
  const auto pose_index = [&](int k) {
    const auto [it, fresh] = pose_of.try_emplace(k, static_cast<int>(problem.poses.size()));
    if (fresh)
      problem.poses.push_back({map_.keyframes[static_cast<std::size_t>(k)].cam_from_world, !moved.contains(k)});
    return it->second;
  };
  std::vector<std::pair<std::size_t, std::size_t>> source;  // of each observation: point, place in its list
  for (std::size_t i = 0; i < by_point_.size(); ++i) {
    const auto& sightings = by_point_[i];
    const bool given = given_sigma_m_[i] > 0;
    if (sightings.size() < 2 && !(given && !sightings.empty())) continue;
    if (std::ranges::none_of(sightings,
                             [&](const camera_tracking::PointSighting& s) { return moved.contains(s.keyframe); }))
      continue;
    const auto point = static_cast<int>(problem.points.size());
    BundlePoint p;
    p.position = map_.points[i].position;
    if (given) p.prior = given_position_[i], p.prior_sigma_m = given_sigma_m_[i], anchored = true;
    problem.points.push_back(p);
    point_of.push_back(static_cast<int>(i));
    for (std::size_t k = 0; k < sightings.size(); ++k) {
      problem.observations.push_back(
          {pose_index(sightings[k].keyframe), point, sightings[k].px, sightings[k].sigma_px, false});
      source.emplace_back(i, k);
    }
  }
  const auto held = std::ranges::count_if(problem.poses, &BundlePose::fixed);
  if (!anchored && held < 2) {  // nothing else holds the scale: hold the oldest two
    int hold = 2 - static_cast<int>(held);
    for (const int k : moved) {
      if (hold-- > 0 && k != keyframe && pose_of.contains(k))
        problem.poses[static_cast<std::size_t>(pose_of[k])].fixed = true;
    }
  }
  if (problem.observations.size() < 12) return;
  adjust(camera_.model, problem, 6);
  ++counters_.adjustments;
  for (const auto& [k, at] : pose_of)
    map_.keyframes[static_cast<std::size_t>(k)].cam_from_world =
        problem.poses[static_cast<std::size_t>(at)].cam_from_world;
  for (std::size_t j = 0; j < point_of.size(); ++j) {
    camera_tracking::MapPoint& p = map_.points[static_cast<std::size_t>(point_of[j])];
    p.position = problem.points[j].position;
    p.covariance = problem.points[j].covariance;
  }
  for (std::size_t j = source.size(); j-- > 0;) {
    if (!problem.observations[j].outlier || given_sigma_m_[source[j].first] > 0) continue;
    auto& sightings = by_point_[source[j].first];
    if (!map_.points[source[j].first].alive) continue;
    sightings.erase(sightings.begin() + static_cast<std::ptrdiff_t>(source[j].second));
    if (sightings.size() < 2) remove(static_cast<int>(source[j].first));
  }
}

}  // namespace huetrack::keyframes
