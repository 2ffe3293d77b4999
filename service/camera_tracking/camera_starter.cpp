#include "camera_tracking/camera_starter.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>

#include "calib/model/median.h"
#include "camera_tracking/rectangle_finder.h"

namespace huetrack::camera_tracking {
namespace {

Eigen::Vector3d plane_normal(const std::vector<Eigen::Vector3d>& points, const calib::Rigid3d& cam_from_world) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  if (axes.eigenvalues()[0] > 1e-6 * axes.eigenvalues()[2]) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d normal = axes.eigenvectors().col(0);
  return normal.dot(calib::inverse(cam_from_world).translation - mean) < 0 ? Eigen::Vector3d(-normal) : normal;
}

constexpr double points_sigma_px = 0.5;

// Without a test of its quality: see rejection_reason().
std::optional<StartResult> from_points(const calib::Camera& camera, const PointsStart& known) {
  std::vector<PoseObservation> observations;
  for (std::size_t i = 0; i < known.points.size(); ++i)
    observations.push_back({known.points[i], known.pixels[i], points_sigma_px});
  const auto pose = solve_pose(camera.model, observations);
  if (!pose) return std::nullopt;
  StartResult out{*pose, {}, {}, points_sigma_px, 1e-4, Eigen::Vector3d::Zero(), false, false};
  std::vector<double> depth;
  for (std::size_t i = 0; i < known.points.size(); ++i) {
    if (!(pose->weight[i] > 0)) continue;  // outlier
    out.points.push_back(known.points[i]);
    out.px.push_back(known.pixels[i]);
    depth.push_back((pose->cam_from_world * known.points[i]).norm());
  }
  if (out.points.empty()) return std::nullopt;
  // Large residuals of many points: their given positions have an error of so many pixels at their distance.
  if (observations.size() >= 6 && pose->scale > 2)
    out.given_sigma_m = std::max(out.given_sigma_m,
                                 pose->scale * points_sigma_px / camera.model.fx() * calib::median(std::move(depth)));
  out.normal = plane_normal(out.points, pose->cam_from_world);
  return out;
}

std::optional<PointsStart> detect(const FoundStart& board, const capture::Image& image) {
  auto known = board.find(image);
  if (known && (known->points.size() < 4 || known->points.size() != known->pixels.size())) known.reset();
  return known;
}

StartResult from_rectangle(const FoundRectangle& found, const std::vector<Eigen::Vector3d>& corners) {
  StartResult out{found.pose, corners, {}, 0.1, 1e-4, Eigen::Vector3d::Zero(), true, found.dark};
  out.px.assign(found.corners.px.begin(), found.corners.px.end());
  out.normal = plane_normal(out.points, found.pose.cam_from_world);
  return out;
}

double distance_m(const StartResult& started) {
  double sum = 0;
  for (const Eigen::Vector3d& p : started.points) sum += (started.pose.cam_from_world * p).norm();
  return sum / static_cast<double>(started.points.size());
}

// Empty: accepted. A wrong start would define a wrong world.
std::string rejection_reason(const std::optional<StartResult>& started, std::size_t given) {
  constexpr double least_share = 0.6, most_sigma = 0.03;  // of the given points; of the distance
  if (!started) return "no pose of the camera fits them";
  const int agree = started->pose.inliers;
  if (agree < 4 || agree < least_share * static_cast<double>(given))
    return fmt::format("only {} of {} points fit one pose of the camera", agree, given);
  const double distance = distance_m(*started), sigma = position_sigma_m(started->pose);
  if (!(sigma < most_sigma * distance))
    return fmt::format(
        "the camera's position is uncertain by {:.0f} mm from {:.2f} m away, more than {:.0f} % of that: go nearer, or "
        "view it from another side",
        1e3 * sigma, distance, 100 * most_sigma);
  return {};
}

}  // namespace

std::optional<StartResult> CameraStarter::find(const capture::Image& image, const GreyImage& grey) {
  const bool is_first = frames_++ == 0;
  if (const auto* points = std::get_if<PointsStart>(&start_)) {  // the reason of the first frame stays
    if (!is_first) return std::nullopt;
    return accepted(from_points(camera_, *points), points->points.size(), "the known points in the first frame");
  }
  why_not_.clear();
  if (const auto* rectangle = std::get_if<RectangleStart>(&start_)) {
    const auto& corners = rectangle->corners;
    if (is_first && !rectangle->pixels.empty()) {
      const auto& px = rectangle->pixels;
      if (const auto found = rectangle_at(grey, camera_.model, corners, {px[0], px[1], px[2], px[3]}))
        return accepted(from_rectangle(*found, corners), 4, "the rectangle");
    }
    const auto found = find_rectangle(grey, camera_.model, corners, last_found_ ? &*last_found_ : nullptr);
    if (found) return confirmed(accepted(from_rectangle(*found, corners), 4, "what looks like the rectangle"));
    why_not_ = "no rectangle of the given proportions is seen whole, clear and over 1 % of the image";
  } else if (const auto* board = std::get_if<FoundStart>(&start_)) {
    if (const auto known = detect(*board, image))
      return confirmed(accepted(from_points(camera_, *known), known->points.size(), "what looks like the board"));
    why_not_ = "the board is not seen";
  }
  return confirmed(std::nullopt);
}

// Rejects false detections, which seldom repeat with consistent poses.
std::optional<StartResult> CameraStarter::confirmed(std::optional<StartResult> started) {
  constexpr int frames_in_a_row = 3;
  constexpr double sure = 0.005;                    // position sigma below which one frame is enough; of the distance
  constexpr double moved = 0.1, turned_rad = 0.15;  // from frame to frame; of the distance
  if (!started) {
    last_found_.reset();
    return std::nullopt;
  }
  const calib::Rigid3d& pose = started->pose.cam_from_world;
  const bool goes_on = last_found_ && last_found_->rotation.angularDistance(pose.rotation) < turned_rad &&
                       (calib::inverse(*last_found_).translation - calib::inverse(pose).translation).norm() <
                           moved * distance_m(*started);
  last_found_ = pose;
  found_in_a_row_ = goes_on ? found_in_a_row_ + 1 : 1;
  if (found_in_a_row_ >= frames_in_a_row || position_sigma_m(started->pose) < sure * distance_m(*started))
    return started;
  why_not_ = "the start must be seen in some frames in a row; keep it in view";
  return std::nullopt;
}

std::optional<StartResult> CameraStarter::accepted(std::optional<StartResult> started, std::size_t given,
                                                   const std::string& what) {
  if (const std::string why = rejection_reason(started, given); !why.empty()) {
    why_not_ = what + ": " + why;
    started.reset();
  }
  return started;
}

std::optional<calib::Rigid3d> CameraStarter::find_again(const capture::Image& image, const GreyImage& grey,
                                                        const calib::Rigid3d& near) const {
  if (const auto* rectangle = std::get_if<RectangleStart>(&start_)) {
    if (const auto found = find_rectangle(grey, camera_.model, rectangle->corners, &near))
      return found->pose.cam_from_world;
  } else if (const auto* board = std::get_if<FoundStart>(&start_)) {
    const auto known = detect(*board, image);
    if (!known) return std::nullopt;
    const auto started = from_points(camera_, *known);
    if (rejection_reason(started, known->points.size()).empty()) return started->pose.cam_from_world;
  }
  return std::nullopt;
}

}  // namespace huetrack::camera_tracking
