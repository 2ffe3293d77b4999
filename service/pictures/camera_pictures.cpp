#include "pictures/camera_pictures.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <stdexcept>

#include "calib/board/board_yaml.h"
#include "config/formatted.h"
#include "pictures/canvas.h"
#include "pictures/pictures.h"

namespace huetrack::pictures {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr DrawColor black{0, 0, 0}, white{255, 255, 255}, background{24, 26, 30}, faint{150, 156, 166},
    bright{238, 240, 244};
constexpr DrawColor found_color{90, 220, 120}, missed_color{255, 96, 88}, given_color{110, 180, 255},
    particle_color{255, 220, 90};
constexpr double chi2_2_95 = 5.991;

DrawColor state_color(camera_tracking::PoseState state) {
  switch (state) {
    case camera_tracking::PoseState::tracking:
      return {90, 220, 120};
    case camera_tracking::PoseState::coasting:
      return {255, 176, 40};
    case camera_tracking::PoseState::searching:
      return {150, 190, 255};
    case camera_tracking::PoseState::lost:
      return {255, 96, 88};
  }
  return white;
}

// The world's, whatever way the start lies in it.
struct Axis {
  Vector3d direction;
  DrawColor in_picture, on_paper;
  const char* label;
};
const std::array<Axis, 3> world_axes{{{Vector3d::UnitX(), {235, 64, 52}, {206, 44, 44}, "x"},
                                      {Vector3d::UnitY(), {70, 200, 70}, {40, 150, 40}, "y"},
                                      {Vector3d::UnitZ(), {70, 130, 255}, {40, 90, 210}, "z"}}};
double axis_length(const StartPlane& plane) {
  return 0.5 * std::max(plane.size_x, plane.size_y);
}

// Where the 95 % ellipse of a 2-D covariance runs.
std::vector<Vector2d> ellipse_of(const Eigen::Matrix2d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  const Eigen::Matrix2d half =
      axes.eigenvectors() * (chi2_2_95 * axes.eigenvalues().cwiseMax(0)).cwiseSqrt().asDiagonal();
  std::vector<Vector2d> ring;
  for (int i = 0; i < 32; ++i) {
    const double a = 2 * std::numbers::pi * i / 32;
    ring.emplace_back(half * Vector2d(std::cos(a), std::sin(a)));
  }
  return ring;
}

// A camera's image on a canvas: pixel (0,0) is the centre of the top left pixel.
class Panel {
 public:
  Panel(const calib::Camera& camera, double zoom)
      : camera_(camera),
        zoom_(zoom),
        canvas_(int(std::lround(camera.image_size.width * zoom)), int(std::lround(camera.image_size.height * zoom)),
                {44, 47, 53}) {}

  cv::Point2d operator()(const Vector2d& px) const { return {(px.x() + 0.5) * zoom_, (px.y() + 0.5) * zoom_}; }
  Canvas& canvas() { return canvas_; }
  double zoom() const { return zoom_; }

  std::optional<cv::Point2d> point(const calib::Rigid3d& camera_from_world, const Vector3d& p) const {
    const auto px = camera_.model.project(camera_from_world * p);
    if (!px || std::abs(px->px.x()) > 4.0 * camera_.image_size.width ||
        std::abs(px->px.y()) > 4.0 * camera_.image_size.height)
      return std::nullopt;
    return (*this)(px->px);
  }

  // In pieces: the lens bends it, and a part of it may be behind the camera.
  void segment(const calib::Rigid3d& camera_from_world, const Vector3d& a, const Vector3d& b, DrawColor color,
               double width) {
    constexpr int pieces = 16;
    auto from = point(camera_from_world, a);
    for (int i = 1; i <= pieces; ++i) {
      const auto to = point(camera_from_world, a + (b - a) * (double(i) / pieces));
      if (from && to) canvas_.line(*from, *to, color, width);
      from = to;
    }
  }

 private:
  const calib::Camera& camera_;
  double zoom_;
  Canvas canvas_;
};

using Segment = std::pair<Vector3d, Vector3d>;

// A house on the plane: floor, walls and a roof.
std::vector<Segment> house_on(const StartPlane& plane) {
  const double half_x = 0.35 * plane.size_x, half_y = 0.35 * plane.size_y, eaves = 0.8 * std::min(half_x, half_y) * 2;
  const auto at = [&](double sx, double sy, double h) {
    return Vector3d(plane.origin + sx * half_x * plane.x + sy * half_y * plane.y + h * plane.up);
  };
  const std::array<std::array<double, 2>, 4> corners{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
  std::vector<Segment> lines;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto [ax, ay] = corners[i];
    const auto [bx, by] = corners[(i + 1) % 4];
    lines.emplace_back(at(ax, ay, 0), at(bx, by, 0));
    lines.emplace_back(at(ax, ay, eaves), at(bx, by, eaves));
    lines.emplace_back(at(ax, ay, 0), at(ax, ay, eaves));
  }
  const Vector3d left = at(-1, 0, 1.5 * eaves), right = at(1, 0, 1.5 * eaves);
  lines.emplace_back(left, right);
  lines.emplace_back(left, at(-1, -1, eaves));
  lines.emplace_back(left, at(-1, 1, eaves));
  lines.emplace_back(right, at(1, -1, eaves));
  lines.emplace_back(right, at(1, 1, eaves));
  return lines;
}

void draw_features(Panel& panel, const calib::Camera& camera, const CameraPictureJob& job) {
  if (!job.estimate.has_pose()) return;  // features are where a pose projects them
  Canvas& canvas = panel.canvas();
  // Where the particles have some of the features.
  constexpr std::size_t shown = 12;
  const auto& features = job.view.features;
  for (std::size_t f = 0; f < features.size(); f += std::max<std::size_t>(1, features.size() / shown)) {
    for (const calib::Rigid3d& particle : job.view.particles) {
      const auto px = camera.model.project(calib::inverse(particle) * features[f].position);
      if (px && camera.contains(*px)) canvas.disc(panel(px->px), 1.0, particle_color);
    }
  }
  const calib::Rigid3d camera_from_world = calib::inverse(job.estimate.world_from_camera);
  for (const camera_tracking::CameraMapPoint& point : job.start_map)
    if (const auto at = panel.point(camera_from_world, point.position)) canvas.circle(*at, 6, given_color, 1.6);
  for (const auto& f : features) {
    const cv::Point2d at = panel(f.px.cast<double>());
    std::vector<cv::Point2d> region;
    for (const Vector2d& p : ellipse_of(f.search.cast<double>()))
      region.push_back(at + cv::Point2d(p.x(), p.y()) * panel.zoom());
    const bool found = f.found_px.allFinite();
    const DrawColor color = found ? found_color : missed_color;
    canvas.polyline(region, color, 1.2, true);
    if (f.given) canvas.circle(at, 6, given_color, 1.6);
    if (found) {
      const cv::Point2d seen = panel(f.found_px.cast<double>());
      canvas.line(seen - cv::Point2d(4, 0), seen + cv::Point2d(4, 0), color, 1.4);
      canvas.line(seen - cv::Point2d(0, 4), seen + cv::Point2d(0, 4), color, 1.4);
    } else {
      canvas.disc(at, 1.6, color);
    }
  }
}

void draw_augmented(Panel& panel, const StartPlane& plane, const camera_tracking::CameraEstimate& estimate) {
  const calib::Rigid3d camera_from_world = calib::inverse(estimate.world_from_camera);
  const double half_x = plane.size_x / 2, half_y = plane.size_y / 2;
  const auto corner = [&](double sx, double sy) {
    return Vector3d(plane.origin + sx * half_x * plane.x + sy * half_y * plane.y);
  };
  const std::array<Vector3d, 4> ground{corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)};
  for (const double width : {4.0, 1.8})
    for (std::size_t i = 0; i < 4; ++i)
      panel.segment(camera_from_world, ground[i], ground[(i + 1) % 4], width > 2 ? black : bright, width);
  const DrawColor house = state_color(estimate.state);
  for (const double width : {4.6, 2.2})
    for (const auto& [a, b] : house_on(plane)) panel.segment(camera_from_world, a, b, width > 3 ? black : house, width);
  for (const auto& axis : world_axes) {
    const Vector3d tip = axis_length(plane) * axis.direction;
    panel.segment(camera_from_world, Vector3d::Zero(), tip, black, 5);
    panel.segment(camera_from_world, Vector3d::Zero(), tip, axis.in_picture, 2.8);
    if (const auto at = panel.point(camera_from_world, 1.1 * tip))
      panel.canvas().rimmed_text(*at, axis.label, 10, axis.in_picture, black, Align::centre);
  }
}

}  // namespace

StartPlane start_plane(const config::CameraTrackingConfig& config) {
  StartPlane plane;
  if (config.rectangle.size() == 4) {
    const auto corner = [&](std::size_t i) { return Vector3d(config.rectangle[i].data()); };
    plane.origin = 0.25 * (corner(0) + corner(1) + corner(2) + corner(3));
    plane.size_x = (corner(1) - corner(0)).norm();
    plane.size_y = (corner(3) - corner(0)).norm();
    plane.x = (corner(1) - corner(0)).normalized();
    plane.up = plane.x.cross(corner(3) - corner(0)).normalized();
    if (plane.up.z() < 0) plane.up = -plane.up;  // a table or a floor, seen from above
    plane.y = plane.up.cross(plane.x);
    return plane;
  }
  std::vector<Vector3d> points;
  for (const auto* rows : {&config.points, &config.leds})
    for (const auto& row : *rows) points.emplace_back(row.data());
  if (!config.board.empty()) {
    const board::Board board = board::read_board(config.board);
    for (int i = 0; i < board.point_count(); ++i) {
      const Vector3d p = board.point(i);
      points.emplace_back(p.x(), -p.y(), 0);
    }
  }
  if (points.empty()) return plane;
  Vector3d low = points.front(), high = low;
  for (const Vector3d& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  plane.origin = {(low.x() + high.x()) / 2, (low.y() + high.y()) / 2, low.z()};
  plane.size_x = std::max(0.02, high.x() - low.x());
  plane.size_y = std::max(0.02, high.y() - low.y());
  return plane;
}

cv::Mat draw_camera(const calib::Camera& camera, const StartPlane& plane, const CameraPictureJob& job) {
  constexpr int margin = 14, head = 44, names = 28, foot = 40;
  const double zoom = std::min({720.0 / camera.image_size.width, 560.0 / camera.image_size.height, 3.0});
  const cv::Mat image = bgr_of(job.frame.pixels);
  Panel left(camera, zoom), right(camera, zoom);
  left.canvas().image({0, 0}, image, zoom);
  right.canvas().image({0, 0}, image, zoom);
  draw_features(left, camera, job);
  const camera_tracking::CameraEstimate& e = job.estimate;
  if (e.has_pose()) {
    draw_augmented(right, plane, e);
  } else {
    right.canvas().rimmed_text({right.canvas().width() / 2.0, right.canvas().height() / 2.0}, "no pose", 16,
                               state_color(e.state), black, Align::centre);
  }

  const int width = 2 * left.canvas().width() + 3 * margin, height = head + names + left.canvas().height() + foot;
  Canvas canvas(width, height, background);
  canvas.text({margin, 29},
              config::formatted("%s, frame %llu", camera.name.c_str(), static_cast<unsigned long long>(e.frame_number)),
              13, bright, Align::left, true);
  canvas.text({width - double(margin), 29}, config::formatted("t = %.3f s", capture::seconds(e.at)), 13, bright,
              Align::right);
  canvas.text({margin, double(head + names) - 9}, "features: found, not found; given ones ringed; particles", 10,
              faint);
  canvas.text({2.0 * margin + left.canvas().width(), double(head + names) - 9},
              "the start's plane, a house on it, the world's axes", 10, faint);
  canvas.paste({margin, double(head + names)}, left.canvas());
  canvas.paste({2.0 * margin + left.canvas().width(), double(head + names)}, right.canvas());
  const double y = height - 14;
  canvas.text({margin, y}, std::string(camera_tracking::name(e.state)), 11, state_color(e.state), Align::left, true);
  std::string details = config::formatted("%d of %d features, map %d, %d particles, ESS %.0f", e.features_matched,
                                          e.features_in_view, e.map_points, e.particle_count, e.effective_sample_size);
  if (e.has_pose()) {
    const Vector3d& t = e.world_from_camera.translation;
    const double sigma_mm = 1e3 * std::sqrt(std::max(0.0, e.covariance.topLeftCorner<3, 3>().trace()));
    const double sigma_deg =
        std::sqrt(std::max(0.0, e.covariance.bottomRightCorner<3, 3>().trace())) * 180 / std::numbers::pi;
    details = config::formatted("x %+.3f  y %+.3f  z %+.3f m   +/- %.1f mm, %.2f deg   ", t.x(), t.y(), t.z(), sigma_mm,
                                sigma_deg) +
              details;
  }
  canvas.text({margin + 120.0, y}, details, 10, bright);
  return canvas.finished();
}

cv::Mat draw_camera_map(const calib::Camera& camera, const StartPlane& plane, const std::string& title,
                        const std::vector<camera_tracking::CameraEstimate>& way,
                        const std::vector<camera_tracking::CameraMapPoint>& map) {
  constexpr int width = 1280, height = 960;
  constexpr DrawColor paper{252, 252, 250}, ink{38, 42, 48}, soft{120, 126, 136}, rule{200, 204, 210},
      map_color{40, 90, 160}, way_color{30, 140, 70}, coasting_color{232, 130, 0};
  Canvas canvas(width, height, paper);

  // An orthographic view from above and aside.
  const double azimuth = -60 * std::numbers::pi / 180, elevation = 32 * std::numbers::pi / 180;
  const Vector3d right(-std::sin(azimuth), std::cos(azimuth), 0);
  const Vector3d towards(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                         std::sin(elevation));
  const Vector3d up = towards.cross(right);
  Eigen::Matrix<double, 2, 3> flat;
  flat << right.transpose(), up.transpose();

  // What is fitted: the start, the way, and of the map what is not far out.
  std::vector<Vector2d> all;
  for (const double sx : {-0.5, 0.5})
    for (const double sy : {-0.5, 0.5})
      all.emplace_back(flat * (plane.origin + sx * plane.size_x * plane.x + sy * plane.size_y * plane.y));
  for (const auto& e : way)
    if (e.has_pose()) all.emplace_back(flat * e.world_from_camera.translation);
  Vector2d low = all.front(), high = low;
  for (const auto& p : all) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const Vector2d room = 1.2 * (high - low);
  std::size_t outside = 0;
  Vector2d wide_low = low, wide_high = high;
  const auto include = [&](const Vector3d& position) {
    const Vector2d p = flat * position;
    if ((p.array() < (low - room).array()).any() || (p.array() > (high + room).array()).any()) return false;
    wide_low = wide_low.cwiseMin(p), wide_high = wide_high.cwiseMax(p);
    return true;
  };
  for (const auto& point : map) outside += include(point.position) ? 0 : 1;
  const bool shows_origin = include(Vector3d::Zero());
  const cv::Rect2d area(60, 110, width - 120, height - 170);
  const Vector2d extent = (wide_high - wide_low).cwiseMax(1e-3);
  const double zoom = 0.92 * std::min(area.width / extent.x(), area.height / extent.y());
  const Vector2d middle = 0.5 * (wide_low + wide_high);
  const auto at = [&](const Vector2d& p) {
    return cv::Point2d(area.x + area.width / 2 + (p.x() - middle.x()) * zoom,
                       area.y + area.height / 2 - (p.y() - middle.y()) * zoom);
  };
  const auto point = [&](const Vector3d& p) { return at(flat * p); };

  canvas.text({36, 46}, title, 16, ink, Align::left, true);
  std::size_t poses = 0;
  for (const auto& e : way) poses += e.has_pose() ? 1 : 0;
  canvas.text(
      {36, 76},
      config::formatted("%zu frames, %zu with a pose; %zu map points with their 95 %% ellipsoids%s", way.size(), poses,
                        map.size(),
                        outside > 0 ? config::formatted(", %zu of them beyond the picture", outside).c_str() : "") +
          (shows_origin ? "" : "; the world's origin is beyond the picture"),
      10.5, ink);

  std::vector<cv::Point2d> ground;
  for (const auto& [sx, sy] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
    ground.push_back(point(plane.origin + sx * plane.size_x * plane.x + sy * plane.size_y * plane.y));
  canvas.polygon(ground, {225, 228, 232}, 0.8);
  canvas.polyline(ground, soft, 1.4, true);
  for (const auto& axis : world_axes) {
    if (!shows_origin) break;
    const Vector3d tip = axis_length(plane) * axis.direction;
    canvas.line(point(Vector3d::Zero()), point(tip), axis.on_paper, 2.4);
    canvas.rimmed_text(point(1.12 * tip), axis.label, 10, axis.on_paper, paper, Align::centre);
  }

  for (const auto& f : map) {
    const Vector2d p = flat * f.position;
    if ((p.array() < wide_low.array() - 1e-9).any() || (p.array() > wide_high.array() + 1e-9).any()) continue;
    std::vector<cv::Point2d> ring;
    for (const Vector2d& r : ellipse_of(flat * f.covariance * flat.transpose())) ring.push_back(at(p + r));
    const DrawColor color = f.given ? DrawColor{206, 44, 44} : map_color;
    canvas.polygon(ring, color, 0.10);
    canvas.polyline(ring, color, 0.8, true);
    canvas.disc(at(p), 2.2, color);
  }

  const camera_tracking::CameraEstimate* before = nullptr;
  for (const auto& e : way) {
    if (e.has_pose() && before != nullptr)
      canvas.line(point(before->world_from_camera.translation), point(e.world_from_camera.translation),
                  e.state == camera_tracking::PoseState::tracking ? way_color : coasting_color, 2.4);
    before = e.has_pose() ? &e : nullptr;
  }
  // The camera itself, a dozen times on its way.
  const double reach = 0.07 * std::max(extent.x(), extent.y());
  const std::size_t every = std::max<std::size_t>(1, way.size() / 12);
  for (std::size_t i = 0; i < way.size(); i += every) {
    if (!way[i].has_pose()) continue;
    const calib::Rigid3d& pose = way[i].world_from_camera;
    std::vector<cv::Point2d> front;
    for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      const auto ray = camera.model.ray(
          calib::RawPixel{{u * (camera.image_size.width - 1.0), v * (camera.image_size.height - 1.0)}});
      if (ray) front.push_back(point(pose * (*ray * reach)));
    }
    const cv::Point2d eye = point(pose.translation);
    canvas.polyline(front, soft, 1, true);
    for (const auto& p : front) canvas.line(eye, p, soft, 1);
    canvas.disc(eye, 2.6, way_color);
  }

  // A scale: the longest of 1, 2, 5 times a power of ten that is at most a fifth of the picture.
  const double longest = area.width / 5 / zoom, power = std::pow(10, std::floor(std::log10(longest)));
  const double bar = (longest >= 5 * power ? 5 : longest >= 2 * power ? 2 : 1) * power;
  canvas.line({60, height - 34.0}, {60 + bar * zoom, height - 34.0}, ink, 2);
  canvas.text({60 + bar * zoom + 10, height - 30.0},
              bar < 1 ? config::formatted("%g cm", bar * 100) : config::formatted("%g m", bar), 10, ink);
  double x = width - 36;
  for (const auto& [text, color] : {std::pair{"coasting", coasting_color},
                                    {"tracking", way_color},
                                    {"given points", DrawColor{206, 44, 44}},
                                    {"map points", map_color}}) {
    x -= Canvas::text_width(text, 9.5);
    canvas.text({x, height - 30.0}, text, 9.5, ink);
    canvas.disc({x - 10, height - 33.5}, 4, color);
    x -= 34;
  }
  canvas.line({36, 92}, {width - 36.0, 92}, rule, 0.8);
  return canvas.finished();
}

CameraPictureWriter::CameraPictureWriter(const config::ServiceConfig& config, std::filesystem::path folder)
    : camera_(config.rig.cameras.at(std::size_t(config.rig.index_of(config.camera_tracking.camera).value()))),
      plane_(start_plane(config.camera_tracking)),
      folder_(std::move(folder)) {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) throw std::runtime_error("cannot make the folder " + folder_.string() + ": " + error.message());
}

void CameraPictureWriter::write(const CameraPictureJob& job) {
  save(config::formatted("camera_%06llu.png", static_cast<unsigned long long>(job.estimate.frame_number)),
       draw_camera(camera_, plane_, job));
}

void CameraPictureWriter::finish(const std::string& title, const std::vector<camera_tracking::CameraEstimate>& way,
                                 const std::vector<camera_tracking::CameraMapPoint>& map) {
  save("camera_3d.png", draw_camera_map(camera_, plane_, title, way, map));
}

void CameraPictureWriter::save(const std::string& name, const cv::Mat& picture) {
  const auto file = folder_ / name;
  bool saved = false;
  try {
    saved = cv::imwrite(file.string(), picture, {cv::IMWRITE_PNG_COMPRESSION, 2});
  } catch (const cv::Exception& error) {
    throw std::runtime_error("cannot write " + file.string() + ": " + error.err);
  }
  if (!saved) throw std::runtime_error("cannot write " + file.string());
  ++written_;
}

}  // namespace huetrack::pictures
