#include <algorithm>
#include <cmath>
#include <iterator>

#include "camera_tracking/keyframes/keyframe_mapping.h"

namespace huetrack::keyframes {

namespace {

constexpr std::size_t max_seeds = 350;
constexpr int corner_levels = 3;
constexpr int cell_px = 18, least_cell_px = 8;  // of a 320 px wide image: at most one new corner per cell
constexpr int corner_threshold = 12, corner_margin_px = 10;
constexpr float least_corner_score = 40;
// Initial depth of a seed: the scene's median, at least these shares of it and of the nearest point.
constexpr double nearest_of_depth = 0.5, nearest_of_nearest = 0.7;
constexpr double least_inverse_depth = 1e-3;  // 1/m: as good as infinity

// A seed becomes a point below this relative sigma, with enough parallax and detections.
constexpr double converged = 0.035, enough_parallax_rad = 0.025;
constexpr int often_found = 4;

constexpr double longest_line_px = 80;  // of an epipolar search: longer ones are ambiguous
constexpr double reach_px = 1.5;        // from the epipolar line: errors of the poses
// A second peak within this NCC of the best one, and at least so far from it, makes the match ambiguous.
constexpr float rival_loses = 0.08f;
constexpr double rival_px = 2.9;

// Failures after which a seed is abandoned: more patience for seeds out of view and for ambiguous matches.
constexpr int failures_hidden = 41, failures_distorted = 10, failures_missed = 8;

constexpr double seen_sigma_px = 0.7;  // of both corners and both poses; pixels of the level
constexpr double gate_sigmas = 3;
// Least sigma of a depth as a share of one measurement's: the errors of neighbouring poses are correlated.
constexpr double least_share_of_sigma = 0.25;

// The projection of a segment of a seed's ray, pixels of a level.
struct EpipolarLine {
  EpipolarLine(const Eigen::Vector2d& a, const Eigen::Vector2d& b) : from(a), to(b), length((b - a).norm()) {
    if (length > 0) along = (to - from) / length;
  }
  double distance(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d d = p - from;
    return std::abs(along.x() * d.y() - along.y() * d.x());
  }
  bool is_near(const Eigen::Vector2d& p) const {
    const double t = along.dot(p - from);
    return !(t < -reach_px || t > length + reach_px || distance(p) > reach_px);
  }
  Eigen::Vector2d from, to;
  double length;
  Eigen::Vector2d along{1, 0};
};

PixelRegion box_of(const EpipolarLine& line, double offset) {
  const Eigen::Vector2d low = line.from.cwiseMin(line.to), high = line.from.cwiseMax(line.to);
  return {static_cast<int>(std::floor(low.x() - reach_px - offset)),
          static_cast<int>(std::floor(low.y() - reach_px - offset)),
          static_cast<int>(std::ceil(high.x() + reach_px - offset)),
          static_cast<int>(std::ceil(high.y() + reach_px - offset))};
}

struct Strongest {
  float ncc = -2, rival_ncc = -2;
  Eigen::Vector2d px;  // of ncc
  bool is_ambiguous() const { return rival_ncc > good_ncc && rival_ncc > ncc - rival_loses; }
};
// Of the anchors near the line.
Strongest strongest(const std::vector<float>& field, const PixelRegion& region, const EpipolarLine& line,
                    double offset) {
  Strongest out;
  out.px = line.from;
  const auto each = [&](const auto& visit) {
    for (int v = region.v0; v <= region.v1; ++v) {
      for (int u = region.u0; u <= region.u1; ++u) {
        const Eigen::Vector2d p(u + offset, v + offset);
        if (line.is_near(p)) visit(field[region.index(u, v)], p);
      }
    }
  };
  each([&](float ncc, const Eigen::Vector2d& p) {
    if (ncc > out.ncc) out.ncc = ncc, out.px = p;
  });
  each([&](float ncc, const Eigen::Vector2d& p) {
    if (ncc > out.rival_ncc && (p - out.px).norm() > rival_px) out.rival_ncc = ncc;
  });
  return out;
}

}  // namespace

void KeyframeMapping::add_seeds(int keyframe) {
  const Keyframe& k = map_.keyframe(keyframe);
  const int cell = std::max(least_cell_px, cell_px * camera_.image_size.width / 320);
  const int columns = (camera_.image_size.width + cell - 1) / cell,
            rows = (camera_.image_size.height + cell - 1) / cell;
  std::vector<char> taken(static_cast<std::size_t>(columns * rows), 0);
  const auto cell_of = [&](const Eigen::Vector2d& px) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(px.y()) / cell, 0, rows - 1) * columns +
                                    std::clamp(static_cast<int>(px.x()) / cell, 0, columns - 1));
  };
  std::vector<double> depths;
  for (const MapPoint& p : map_.points) {
    if (!p.alive) continue;
    const auto seen = project_swept(camera_.model, k.pose(), p.position);
    if (!seen || !camera_.contains({seen->px})) continue;
    taken[cell_of(seen->px)] = 1;
    depths.push_back((k.cam_from_world * p.position).norm());
  }
  for (const Seed& s : seeds_) {
    const Keyframe& from = map_.keyframe(s.view.keyframe);
    const auto seen = project_swept(camera_.model, k.pose(),
                                    calib::inverse(from.pose().at(s.view.px.y())) * (s.ray / s.inverse_depth));
    if (seen && camera_.contains({seen->px})) taken[cell_of(seen->px)] = 1;
  }

  struct CellCorner {
    Eigen::Vector2d px;
    int level;
    float score;
  };
  std::vector<CellCorner> best(taken.size(), {Eigen::Vector2d::Zero(), -1, 0.0f});
  for (int level = 0; level < std::min(corner_levels, k.pyramid->count()); ++level) {
    const GreyImage& image = k.pyramid->level(level);
    for (const Corner& c : detect_corners(image, corner_threshold, corner_margin_px, least_corner_score)) {
      const Eigen::Vector2d px = from_level(c.px, level);
      const std::size_t at = cell_of(px);
      // Fine corners are more precise, coarse ones survive blur: a coarse one must be clearly stronger.
      const float score = c.score / static_cast<float>(1 + level);
      if (!taken[at] && score > best[at].score) best[at] = {px, level, score};
    }
  }

  std::ranges::sort(depths);
  const double depth = depths.empty() ? median_depth(k.cam_from_world) : depths[depths.size() / 2];
  const double nearest = depths.empty() ? nearest_of_depth * depth
                                        : std::min(nearest_of_depth * depth, nearest_of_nearest * depths.front());
  for (const CellCorner& c : best) {
    if (c.level < 0 || seeds_.size() >= max_seeds) continue;
    const auto ray = camera_.model.ray({c.px});
    if (!ray) continue;
    // 2 sigmas reach from nearer than all known points to infinity.
    Seed seed;
    seed.view.keyframe = keyframe, seed.view.level = c.level, seed.view.px = c.px, seed.ray = *ray;
    seed.row_px_per_s = k.sweep.fraction(c.px.y()) * speed_px_s_[static_cast<std::size_t>(keyframe)];
    seed.inverse_depth = 1 / depth;
    seed.sigma = std::max(1 / nearest - 1 / depth, 1 / depth) / 2;
    seeds_.push_back(seed);
  }
}

void KeyframeMapping::export_seeds() {
  map_.seeds.clear();
  std::ranges::copy_if(seeds_, std::back_inserter(map_.seeds),
                       [this](const Seed& s) { return is_sharp_[static_cast<std::size_t>(s.view.keyframe)]; });
}

void KeyframeMapping::update_seeds(const PosedFrame& frame) {
  std::vector<Seed> kept;
  kept.reserve(seeds_.size());
  for (Seed& seed : seeds_) {
    if (!update(seed, frame)) continue;
    if (seed.sigma < converged * seed.inverse_depth && seed.found >= often_found &&
        seed.widest_rad > enough_parallax_rad)
      promote(seed);
    else
      kept.push_back(seed);
  }
  seeds_.swap(kept);
}

bool KeyframeMapping::update(Seed& seed, const PosedFrame& frame) {
  using Result = SeedMeasurement::Result;
  const SeedMeasurement seen = search(seed, frame);
  if (seen.result == Result::found) {
    ++seed.found;
    if (update_depth(seed, seen, frame)) return true;
  }
  const bool is_hidden = seen.result == Result::out_of_view || seen.result == Result::ambiguous;
  return ++seed.failed < (is_hidden                          ? failures_hidden
                          : seen.result == Result::distorted ? failures_distorted
                                                             : failures_missed);
}

// Along the epipolar line, within 2 sigmas of its depth.
KeyframeMapping::SeedMeasurement KeyframeMapping::search(const Seed& seed, const PosedFrame& frame) {
  using Result = SeedMeasurement::Result;
  const Keyframe& k = map_.keyframe(seed.view.keyframe);
  const calib::Rigid3d world_from_then = calib::inverse(k.pose().at(seed.view.px.y()));
  const auto at = [&](double inverse_depth) {
    return project_swept(camera_.model, frame.pose, world_from_then * (seed.ray / inverse_depth));
  };
  const auto far = at(std::max(seed.inverse_depth - 2 * seed.sigma, least_inverse_depth)),
             near = at(seed.inverse_depth + 2 * seed.sigma), middle = at(seed.inverse_depth);
  if (!far || !near || !middle || !camera_.contains({middle->px})) return {Result::out_of_view};

  const Eigen::Matrix3d h =
      plane_homography(middle->cam_from_world * world_from_then, seed.ray, 1 / seed.inverse_depth);
  const auto patch = transfer_patch(camera_.model, seed.view.px, h);
  if (!patch) return {Result::distorted};
  const int level = search_level(patch->affine, seed.view.level, frame.pyramid->count());
  if (!warp_patch(*k.pyramid, seed.view.px, patch->affine, level, patch_side, patch_)) return {Result::distorted};
  const EpipolarLine line(to_level(far->px, level), to_level(near->px, level));
  if (line.length > longest_line_px) return {Result::distorted};
  const GreyImage& image = frame.pyramid->level(level);
  const double offset = static_cast<double>(patch_.inner.centre_offset());
  const PixelRegion region = clip(box_of(line, offset), image, patch_side);
  if (region.empty()) return {Result::distorted};

  ncc_field(image, patch_.inner, region, field_);
  const Strongest best = strongest(field_, region, line, offset);
  if (best.ncc < good_ncc) return {Result::not_found};
  if (best.is_ambiguous()) return {Result::ambiguous};
  const auto refined = refine(image, patch_, best.px, most_shift_px);
  if (!refined || refined->ncc < good_ncc) return {Result::not_found};
  if (line.length > 1 && line.distance(refined->px) > reach_px) return {Result::not_found};
  const SeedMeasurement seen{Result::found, from_level(refined->px, level), level};
  return camera_.model.ray({seen.px}) ? seen : SeedMeasurement{};
}

// Kalman update of the inverse depth.
bool KeyframeMapping::update_depth(Seed& seed, const SeedMeasurement& seen, const PosedFrame& frame) const {
  const calib::Rigid3d now = frame.pose.at(seen.px.y());
  const Keyframe& k = map_.keyframe(seed.view.keyframe);
  const calib::Rigid3d now_from_then = now * calib::inverse(k.pose().at(seed.view.px.y()));
  const auto at = [&](double inverse_depth) {
    return camera_.model.project(now_from_then * (seed.ray / inverse_depth));
  };
  seed.widest_rad =
      std::max(seed.widest_rad, angle_between(now_from_then.rotation * seed.ray, *camera_.model.ray({seen.px})));
  const double step = std::max(1e-4, 0.02 * seed.inverse_depth);
  const auto middle = at(seed.inverse_depth), next = at(seed.inverse_depth + step);
  if (!middle || !next) return false;
  const double px_per_inverse_depth = ((next->px - middle->px) / step).norm();
  if (px_per_inverse_depth < 1e-6) return true;  // no baseline yet
  // The measured inverse depth: some Gauss-Newton steps, since the projection is hyperbolic in it.
  double rho = seed.inverse_depth;
  for (int i = 0; i < 3; ++i) {
    const auto p0 = at(rho), p1 = at(rho + step);
    if (!p0 || !p1) break;
    const Eigen::Vector2d slope = (p1->px - p0->px) / step;
    if (slope.squaredNorm() < 1e-12) break;
    rho = std::max(least_inverse_depth, rho + slope.dot(seen.px - p0->px) / slope.squaredNorm());
  }
  const double row_sigma_px = frame.pose.sweep.fraction(seen.px.y()) * frame.readout_sigma_px;
  const double sigma = std::hypot(seen_sigma_px * scale_of(seen.level), row_sigma_px) / px_per_inverse_depth;
  const double sum = std::sqrt(sigma * sigma + seed.sigma * seed.sigma);
  if (std::abs(rho - seed.inverse_depth) > gate_sigmas * sum) return false;
  const double gain = seed.sigma * seed.sigma / (sum * sum);
  seed.inverse_depth = std::max(least_inverse_depth, seed.inverse_depth + gain * (rho - seed.inverse_depth));
  seed.sigma *= std::sqrt(1 - gain);
  seed.sigma = std::max(seed.sigma, least_share_of_sigma * sigma);
  return true;
}

}  // namespace huetrack::keyframes
