#include "camera_tracking/relocalizer.h"

#include <algorithm>

namespace huetrack::camera_tracking {

std::optional<PoseFit> relocalize(const calib::Camera& camera, const Pyramid& pyramid, const SceneMap& map,
                                  std::uint64_t seed, double max_error_px) {
  constexpr std::size_t corners_per_level = 600;
  constexpr int max_distance = 72, min_inliers = 10;
  struct View {
    const Descriptor* descriptor;
    int point;
  };
  std::vector<View> views;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const MapPoint& p = map.points[i];
    if (!p.alive) continue;
    for (int k = 0; k < p.view_count; ++k) {
      const PointView& l = p.view(k);
      if (l.has_descriptor) views.push_back({&l.descriptor, static_cast<int>(i)});
    }
  }
  struct Match {
    int distance = 257;
    PoseObservation observation{};
  };
  std::vector<Match> best_of_point(map.points.size());
  for (int level = 0; level < std::min(3, pyramid.count()); ++level) {
    const GreyImage& image = pyramid.level(level);
    std::vector<Corner> corners = detect_corners(image, 12, descriptor_margin + 1, 40);
    if (corners.size() > corners_per_level) corners.resize(corners_per_level);
    for (const Corner& c : corners) {
      const Descriptor d = describe(image, c.px);
      int best = 257, second = 257, point = -1;
      for (const View& l : views) {
        const int x = distance(d, *l.descriptor);
        if (x < best) {
          if (l.point != point) second = best;
          best = x, point = l.point;
        } else if (x < second && l.point != point) {
          second = x;
        }
      }
      if (point < 0 || best > max_distance || best * 10 > second * 9) continue;
      Match& m = best_of_point[static_cast<std::size_t>(point)];
      if (best < m.distance) m = {best, {map.point(point).position, from_level(c.px, level), scale_of(level)}};
    }
  }
  std::vector<PoseObservation> observations;
  for (const Match& m : best_of_point) {
    if (m.distance <= max_distance) observations.push_back(m.observation);
  }
  return solve_pose_ransac(camera.model, observations, max_error_px, min_inliers, seed);
}

}  // namespace huetrack::camera_tracking
