#include "camera_tracking/camera_starter.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "camera_tracking/rectangle_finder.h"

namespace huetrack {
namespace {

Eigen::Vector3d plane_normal(const std::vector<Eigen::Vector3d>& points, const Rigid3d& cam_from_world) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  if (axes.eigenvalues()[0] > 1e-6 * axes.eigenvalues()[2]) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d normal = axes.eigenvectors().col(0);
  return normal.dot(inverse(cam_from_world).translation - mean) < 0 ? Eigen::Vector3d(-normal) : normal;
}

std::optional<Started> from_points(const Camera& camera, const PointsStart& known) {
  constexpr double sigma_px = 0.5;
  std::vector<PoseObservation> observations;
  for (std::size_t i = 0; i < known.points.size(); ++i)
    observations.push_back({known.points[i], known.pixels[i], sigma_px});
  const auto pose = solve_pose(camera.model, observations);
  if (!pose || pose->inliers < 4) return std::nullopt;
  Started out{*pose, {}, {}, sigma_px, 1e-4, Eigen::Vector3d::Zero(), false, false};
  std::vector<double> depth;
  for (std::size_t i = 0; i < known.points.size(); ++i) {
    if (!(pose->weight[i] > 0)) continue;  // a wrong one among the others
    out.points.push_back(known.points[i]);
    out.px.push_back(known.pixels[i]);
    depth.push_back((pose->cam_from_world * known.points[i]).norm());
  }
  std::ranges::sort(depth);
  // With few points the residuals say little; with many, a scale well above 1 says that the points are not where they
  // are said to be, by so many pixels at their distance.
  if (observations.size() >= 6 && pose->scale > 2)
    out.given_sigma_m =
        std::max(out.given_sigma_m, pose->scale * sigma_px / camera.model.fx() * depth[depth.size() / 2]);
  out.normal = plane_normal(out.points, pose->cam_from_world);
  return out;
}

}  // namespace

std::optional<Started> CameraStarter::find(const Image& image, const GreyImage& grey) {
  const bool first = frames_++ == 0;
  if (const auto* rectangle = std::get_if<RectangleStart>(&start_)) {
    std::optional<FoundRectangle> found;
    if (rectangle->pixels.empty()) {
      found = find_rectangle(grey, camera_.model, rectangle->corners);
    } else if (first) {
      found = rectangle_at(grey, camera_.model, rectangle->corners,
                           {rectangle->pixels[0], rectangle->pixels[1], rectangle->pixels[2], rectangle->pixels[3]});
    }
    if (!found) return std::nullopt;
    Started out{found->pose, rectangle->corners, {}, 0.1, 1e-4, Eigen::Vector3d::Zero(), true, found->dark};
    out.px.assign(found->corners.px.begin(), found->corners.px.end());
    out.normal = plane_normal(out.points, found->pose.cam_from_world);
    return out;
  }
  if (const auto* points = std::get_if<PointsStart>(&start_))
    return first ? from_points(camera_, *points) : std::nullopt;
  if (const auto* board = std::get_if<FoundStart>(&start_)) {
    if (const auto known = board->find(image);
        known && known->points.size() >= 4 && known->points.size() == known->pixels.size())
      return from_points(camera_, *known);
  }
  return std::nullopt;
}

}  // namespace huetrack
