#include "calib/wave/ball_finder.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace huetrack::wave {
namespace {

constexpr int least_area_px = 6;              // smaller regions are noise
constexpr double largest_extent_share = 0.3;  // of the image's height; wider regions are background
constexpr std::size_t most_regions = 24;      // per frame

}  // namespace

std::optional<BallFrame> BallFinder::detect(const capture::Frame& frame) {
  capture::FrameSet set;
  set.at = frame.captured_at;
  set.frames.resize(views_.camera_count());
  const auto camera = static_cast<std::size_t>(frame.camera);
  if (camera < set.frames.size()) set.frames[camera] = frame;
  const std::vector<object_tracking::TargetView>& views = views_.look_at(set);
  if (views.empty()) {
    ++unusable_;
    return std::nullopt;
  }
  color::MatchBits& matches = *views.front().matches;
  const int width = matches.width(), height = matches.height();
  BallFrame out{frame.camera, capture::seconds(frame.captured_at + frame.latency), {}, {}};
  for (const color::ColorRegion& region : finder_.find(matches, {0, 0, width - 1, height - 1}, least_area_px, 0)) {
    // The edge of a disc is at 2 standard deviations.
    const double reach_u = 2 * std::sqrt(region.spread(0, 0)), reach_v = 2 * std::sqrt(region.spread(1, 1));
    if (2 * std::max(reach_u, reach_v) > largest_extent_share * height) continue;
    const Eigen::Vector2d& c = region.centre;
    if (c.x() - reach_u < 0.5 || c.y() - reach_v < 0.5 || c.x() + reach_u > width - 1.5 ||
        c.y() + reach_v > height - 1.5) {
      continue;
    }
    if (out.regions.size() == most_regions) break;
    out.patches.push_back(patch_around(frame.pixels, matches, region));
    out.regions.push_back(outline_over_ring(out.patches.back(), region));
  }
  return out;
}

namespace {

// Image of a small ball at this pixel: px per radian along two directions across the ray.
Eigen::Matrix2d shape_at(const calib::CameraModel& model, const Eigen::Vector2d& px) {
  const auto ray = model.ray(calib::RawPixel{px});
  if (!ray) return Eigen::Matrix2d::Identity();
  const Eigen::Vector3d across = ray->cross(Eigen::Vector3d::UnitY()).normalized();
  calib::CameraModel::Jacobian by_point;
  if (!model.project(*ray, by_point)) return Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 3, 2> axes;
  axes << across, ray->cross(across);
  return by_point * axes;
}

// Pixels that have the target's colour in most of a camera's frames: static clutter. Only pixels in patches count.
class StillPixels {
 public:
  StillPixels(calib::ImageSize size, const std::vector<BallFrame>& frames, int camera)
      : width_(size.width), seen_(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height)) {
    std::vector<int> last(seen_.size(), -1);  // frame, as patches overlap
    for (const BallFrame& frame : frames) {
      if (frame.camera != camera) continue;
      ++frames_;
      for (const BallPatch& patch : frame.patches) {
        for_each_match(patch, [&](std::size_t at) {
          if (last[at] != frames_) last[at] = frames_, ++seen_[at];
        });
      }
    }
  }
  // Most of its pixels are.
  bool cover(const BallPatch& patch) const {
    int all = 0, still = 0;
    for_each_match(patch, [&](std::size_t at) { ++all, still += 2 * seen_[at] > frames_ ? 1 : 0; });
    return 2 * still > all;
  }

 private:
  void for_each_match(const BallPatch& patch, auto&& visit) const {
    for (int v = patch.v_min; v < patch.v_min + patch.height; ++v) {
      for (int u = patch.u_min; u < patch.u_min + patch.width; ++u)
        if (patch.at(u, v).match) visit(static_cast<std::size_t>(v * width_ + u));
    }
  }

  int width_, frames_ = 0;
  std::vector<int> seen_;  // frames, row by row
};

}  // namespace

void refine_outlines(std::vector<BallFrame>& frames, const BackgroundSamples& background, const calib::CameraRig& rig,
                     const solver::Progress& progress) {
  int done = 0;
  for (std::size_t camera = 0; camera < rig.cameras.size(); ++camera) {
    const std::optional<BackgroundImage> behind = background.of(camera);
    const StillPixels still(rig.cameras[camera].image_size, frames, static_cast<int>(camera));
    for (BallFrame& frame : frames) {
      if (static_cast<std::size_t>(frame.camera) != camera) continue;
      if (progress && done % 16 == 0) progress("the ball's outlines", done, static_cast<int>(frames.size()));
      ++done;
      for (std::size_t r = frame.patches.size(); r-- > 0;) {
        if (!still.cover(frame.patches[r])) continue;
        frame.patches.erase(frame.patches.begin() + static_cast<std::ptrdiff_t>(r));
        frame.regions.erase(frame.regions.begin() + static_cast<std::ptrdiff_t>(r));
      }
      for (std::size_t r = 0; behind && r < frame.patches.size(); ++r) {
        frame.regions[r] = outline_over_background(frame.patches[r], frame.regions[r], *behind,
                                                   shape_at(rig.cameras[camera].model, frame.regions[r].centre));
      }
      frame.patches.clear();
      frame.patches.shrink_to_fit();
    }
  }
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
      for (const color::ColorRegion& region : frame.regions) {
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
      std::erase_if(frame.regions, [&](const color::ColorRegion& region) {
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
  constexpr double pause_s = 2;  // gap of the path
  for (std::size_t ball = 0; ball < frames.size(); ++ball) {
    remove_still_regions(frames[ball], camera_count);
    for (BallFrame& frame : frames[ball]) {
      frame.t_s += static_cast<double>(ball) * (to - from + pause_s);
      out.push_back(std::move(frame));
    }
  }
  return out;
}

}  // namespace huetrack::wave
