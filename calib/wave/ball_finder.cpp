#include "calib/wave/ball_finder.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

namespace huetrack {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Light (0 is black) and chroma (0 is grey), in grey values.
Vector3d light_at(const Image& image, int u, int v) {
  if (image.format == PixelFormat::bgr) {
    const Bgr p = bgr_at(image, u, v);
    const double y = 0.299 * p.r + 0.587 * p.g + 0.114 * p.b;
    return {y, 0.564 * (p.b - y), 0.713 * (p.r - y)};
  }
  const Yuv p = yuv_at(image, u, v);
  const bool limited = image.range == ColorRange::limited;
  return {limited ? (p.y - 16.0) * 255 / 219 : p.y, (p.u - 128.0) * (limited ? 255.0 / 224 : 1),
          (p.v - 128.0) * (limited ? 255.0 / 224 : 1)};
}

// The same region, not by counting the pixels that match but by how much of each pixel the object covers: a pixel is
// light of the object's chroma, as bright as the object's shading makes it, over the background's light. What of the
// background's light is missing is covered. Halves the noise of the centre, and does not care for the shading. Left as
// it is where object and background have much the same chroma, or the background is too dark to miss any of it.
ColorRegion soft_region(const Image& image, MatchBits& matches, const ColorRegion& region) {
  constexpr double rim_px = 1, ring_from_px = 2.5, ring_to_px = 4.5, noise = 4;
  const Eigen::Matrix2d shape = region.spread.inverse() / 4;  // 1 at the edge
  const double radius = 2 * std::pow(region.spread.determinant(), 0.25);
  const double reach_u = 2 * std::sqrt(region.spread(0, 0)), reach_v = 2 * std::sqrt(region.spread(1, 1));
  const int u_min = std::max(0, static_cast<int>(std::floor(region.centre.x() - reach_u - ring_to_px)));
  const int v_min = std::max(0, static_cast<int>(std::floor(region.centre.y() - reach_v - ring_to_px)));
  const int u_max = std::min(image.width - 1, static_cast<int>(std::ceil(region.centre.x() + reach_u + ring_to_px)));
  const int v_max = std::min(image.height - 1, static_cast<int>(std::ceil(region.centre.y() + reach_v + ring_to_px)));
  const auto beyond_edge = [&](int u, int v) {
    const Vector2d d = Vector2d(u, v) - region.centre;
    return (std::sqrt(d.dot(shape * d)) - 1) * radius;  // pixels, about
  };
  Vector3d object = Vector3d::Zero(), background = Vector3d::Zero();
  std::vector<double> light;
  double inside = 0;
  for (int v = v_min; v <= v_max; ++v) {
    for (int u = u_min; u <= u_max; ++u) {
      const double off = beyond_edge(u, v);
      const bool match = matches.at(u, v);
      if (match && off < 0) {
        object += light_at(image, u, v);
        ++inside;
      } else if (!match && off > ring_from_px && off < ring_to_px) {
        background += light_at(image, u, v);
        light.push_back(light_at(image, u, v).x());
      }
    }
  }
  if (light.size() < 8 || object.x() <= 0 || background.x() <= 0) return region;
  std::ranges::nth_element(light, light.begin() + static_cast<std::ptrdiff_t>(light.size() / 2));
  const double behind = light[light.size() / 2];
  const Vector3d of_object = object / object.x(), of_background = background / background.x();
  if ((of_object - of_background).norm() < 0.15) return region;
  Eigen::Matrix<double, 3, 2> mix;
  mix << of_object, of_background;
  const Eigen::Matrix<double, 2, 3> unmix = (mix.transpose() * mix).inverse() * mix.transpose();
  // A ball is lit from one side: the object's light as a plane over the region.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (int v = v_min; v <= v_max; ++v) {
    for (int u = u_min; u <= u_max; ++u) {
      if (beyond_edge(u, v) > -1 || !matches.at(u, v)) continue;
      const Vector3d at(1, u - region.centre.x(), v - region.centre.y());
      normal += at * at.transpose();
      right += at * (unmix * light_at(image, u, v)).x();
    }
  }
  normal.diagonal().tail<2>().array() += 0.5 * radius * radius;  // few pixels say little about it
  const Vector3d shading =
      normal(0, 0) >= 5 ? Vector3d(normal.ldlt().solve(right)) : Vector3d(object.x() / inside, 0, 0);
  if (shading[0] <= 0) return region;
  double n = 0;
  Vector2d sum = Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (int v = v_min; v <= v_max; ++v) {
    for (int u = u_min; u <= u_max; ++u) {
      if (beyond_edge(u, v) > rim_px) continue;
      const Vector2d parts = (unmix * light_at(image, u, v)).cwiseMax(0);  // light of the object, of the background
      const Vector2d d = Vector2d(u, v) - region.centre;
      const double lit = std::max(shading[0] / 4, shading[0] + shading.tail<2>().dot(d));
      const double covered = parts.x() / (parts.x() + parts.y() * lit / std::max(behind, 10.0) + noise);
      n += covered;
      sum += covered * d;
      squares += covered * d * d.transpose();
    }
  }
  if (n < 0.4 * region.area || n > 2.5 * region.area) return region;
  const Vector2d mean = sum / n;
  ColorRegion out;
  out.area = static_cast<int>(std::lround(n));
  out.centre = region.centre + mean;
  out.spread = squares / n - mean * mean.transpose();
  if (mean.norm() > 0.5 * radius || !(out.spread.determinant() > 0)) return region;
  return out;
}

}  // namespace

BallFinder::BallFinder(const CameraRig& rig, const TargetOptions& target, const BallFinderOptions& options)
    : options_(options), views_(rig, target) {}

std::optional<BallFrame> BallFinder::look(const Frame& frame) {
  FrameSet set;
  set.at = frame.captured_at;
  set.frames.resize(views_.camera_count());
  const auto camera = static_cast<std::size_t>(frame.camera);
  if (camera < set.frames.size()) set.frames[camera] = frame;
  const std::vector<TargetView>& views = views_.look_at(set);
  if (views.empty()) {
    ++unusable_;
    return std::nullopt;
  }
  MatchBits& matches = *views.front().matches;
  const int width = matches.width(), height = matches.height();
  BallFrame out{frame.camera, seconds(frame.captured_at), {}};
  for (const ColorRegion& region : finder_.find(matches, {0, 0, width - 1, height - 1}, options_.min_area_px, 0)) {
    // Of a region that is as wide as it appears, 2 standard deviations reach to its edge.
    const double reach_u = 2 * std::sqrt(region.spread(0, 0)), reach_v = 2 * std::sqrt(region.spread(1, 1));
    if (2 * std::max(reach_u, reach_v) > options_.max_extent_share * height) continue;
    const Eigen::Vector2d& c = region.centre;
    if (c.x() - reach_u < 0.5 || c.y() - reach_v < 0.5 || c.x() + reach_u > width - 1.5 ||
        c.y() + reach_v > height - 1.5) {
      continue;
    }
    if (out.regions.size() == options_.max_regions) break;
    out.regions.push_back(soft_region(frame.pixels, matches, region));
  }
  return out;
}

std::vector<int> remove_still_regions(std::vector<BallFrame>& frames, std::size_t camera_count, double share) {
  constexpr double same_px = 1.5;
  std::vector<int> places(camera_count, 0);
  for (std::size_t camera = 0; camera < camera_count; ++camera) {
    struct Place {
      Eigen::Vector2d px;
      int seen = 0;
    };
    std::map<std::pair<int, int>, std::vector<Place>> by_cell;
    const auto cell_of = [](const Eigen::Vector2d& px) {
      return std::pair(static_cast<int>(std::floor(px.x() / 4)), static_cast<int>(std::floor(px.y() / 4)));
    };
    const auto place_at = [&](const Eigen::Vector2d& px) -> Place* {
      const auto [cu, cv] = cell_of(px);
      for (int u = cu - 1; u <= cu + 1; ++u) {
        for (int v = cv - 1; v <= cv + 1; ++v) {
          const auto cell = by_cell.find({u, v});
          if (cell == by_cell.end()) continue;
          for (Place& place : cell->second) {
            if ((place.px - px).norm() <= same_px) return &place;
          }
        }
      }
      return nullptr;
    };
    int frame_count = 0;
    for (const BallFrame& frame : frames) {
      if (static_cast<std::size_t>(frame.camera) != camera) continue;
      ++frame_count;
      for (const ColorRegion& region : frame.regions) {
        Place* place = place_at(region.centre);
        if (place == nullptr) place = &by_cell[cell_of(region.centre)].emplace_back(Place{region.centre, 0});
        ++place->seen;
      }
    }
    const double limit = std::max(3.0, share * frame_count);
    for (const auto& [cell, in_cell] : by_cell) {
      places[camera] +=
          static_cast<int>(std::ranges::count_if(in_cell, [&](const Place& p) { return p.seen >= limit; }));
    }
    if (places[camera] == 0) continue;
    for (BallFrame& frame : frames) {
      if (static_cast<std::size_t>(frame.camera) != camera) continue;
      std::erase_if(frame.regions, [&](const ColorRegion& region) {
        const Place* place = place_at(region.centre);
        return place != nullptr && place->seen >= limit;
      });
    }
  }
  return places;
}

std::vector<BallFrame> one_after_the_other(std::vector<std::vector<BallFrame>> frames, std::size_t camera_count) {
  std::vector<BallFrame> out;
  double from = 0, to = 0;
  for (const auto& of_ball : frames) {
    for (const BallFrame& frame : of_ball) {
      if (from == 0 && to == 0) from = to = frame.t_s;
      from = std::min(from, frame.t_s);
      to = std::max(to, frame.t_s);
    }
  }
  constexpr double pause_s = 2;  // long enough for the path not to care
  for (std::size_t ball = 0; ball < frames.size(); ++ball) {
    remove_still_regions(frames[ball], camera_count);
    for (BallFrame& frame : frames[ball]) {
      frame.t_s += static_cast<double>(ball) * (to - from + pause_s);
      out.push_back(std::move(frame));
    }
  }
  return out;
}

}  // namespace huetrack
