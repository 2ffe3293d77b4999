#include "pictures/camera_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "calib/board/board_yaml.h"
#include "calib/model/covariance_ellipse.h"
#include "drawing/axes.h"
#include "pictures/canvas_image.h"
#include "pictures/oblique.h"
#include "pictures/pictures.h"
#include "pictures/view_style.h"

namespace huetrack::pictures {

using namespace drawing;

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Color found_color{90, 220, 120}, missed_color{255, 96, 88}, given_color{110, 180, 255},
    particle_color{255, 220, 90};

// The axes of the world, independent of the start.
struct Axis {
  Vector3d direction;
  Color in_picture, on_paper;
  const char* label;
};
const std::array<Axis, 3> world_axes{{{Vector3d::UnitX(), {235, 64, 52}, {206, 44, 44}, "x"},
                                      {Vector3d::UnitY(), {70, 200, 70}, {40, 150, 40}, "y"},
                                      {Vector3d::UnitZ(), {70, 130, 255}, {40, 90, 210}, "z"}}};
double axis_length(const StartPlane& plane) {
  return 0.5 * std::max(plane.size_x, plane.size_y);
}

// A camera's image on a canvas: pixel (0,0) is the centre of the top left pixel.
class Panel {
 public:
  Panel(const calib::Camera& camera, const cv::Mat& image, double zoom)
      : camera_(camera),
        zoom_(zoom),
        canvas_(canvas_over(
            image, {0, 0}, zoom,
            {int(std::lround(camera.image_size.width * zoom)), int(std::lround(camera.image_size.height * zoom))},
            no_image)) {}

  Point operator()(const Vector2d& px) const { return zoom_ * (px + Point(0.5, 0.5)); }
  Canvas& canvas() { return canvas_; }
  double zoom() const { return zoom_; }

  std::optional<Point> point(const calib::Rigid3d& camera_from_world, const Vector3d& p) const {
    const auto px = camera_.model.project(camera_from_world * p);
    if (!px || std::abs(px->px.x()) > 4.0 * camera_.image_size.width ||
        std::abs(px->px.y()) > 4.0 * camera_.image_size.height)
      return std::nullopt;
    return (*this)(px->px);
  }

  // In pieces, because of distortion, and because a part may be behind the camera.
  void segment(const calib::Rigid3d& camera_from_world, const Vector3d& a, const Vector3d& b, Color color,
               double width) {
    constexpr int pieces = 16;
    std::vector<Point> run;
    for (int i = 0; i <= pieces; ++i) {
      if (const auto to = point(camera_from_world, a + (b - a) * (double(i) / pieces))) {
        run.push_back(*to);
      } else {
        canvas_.polyline(run, color, width);
        run.clear();
      }
    }
    canvas_.polyline(run, color, width);
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
  if (!job.estimate.has_pose()) return;  // without a pose, features cannot be projected
  Canvas& canvas = panel.canvas();
  // Some features, projected by the particles.
  constexpr std::size_t shown = 12;
  const auto& features = job.inside.features;
  std::vector<Point> dots;
  for (std::size_t f = 0; f < features.size(); f += std::max<std::size_t>(1, features.size() / shown)) {
    for (const calib::Rigid3d& particle : job.inside.particles) {
      const auto px = camera.model.project(calib::inverse(particle) * features[f].position);
      if (px && camera.contains(*px)) dots.push_back(panel(px->px));
    }
  }
  canvas.discs(dots, 1.2, particle_color);
  const calib::Rigid3d camera_from_world = calib::inverse(job.estimate.world_from_camera);
  for (const camera_tracking::CameraMapPoint& point : job.start_map)
    if (const auto at = panel.point(camera_from_world, point.position)) canvas.circle(*at, 6, given_color, 2);
  for (const auto& f : features) {
    const Point at = panel(f.px.cast<double>());
    std::vector<Point> region;
    for (const Vector2d& p : calib::ellipse_95(f.search.cast<double>()).ring(32))
      region.push_back(at + panel.zoom() * p);
    const bool found = f.found_px.allFinite();
    const Color color = found ? found_color : missed_color;
    canvas.polyline(region, color, 1.6, true);
    if (f.given) canvas.circle(at, 6, given_color, 2);
    if (found) {
      const Point seen = panel(f.found_px.cast<double>());
      canvas.line(seen - Point(4, 0), seen + Point(4, 0), color, 1.8);
      canvas.line(seen - Point(0, 4), seen + Point(0, 4), color, 1.8);
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
  for (const double width : {4.4, 2.2})
    for (std::size_t i = 0; i < 4; ++i)
      panel.segment(camera_from_world, ground[i], ground[(i + 1) % 4], width > 2 ? black : bright, width);
  const Color house = state_color(estimate.state);
  for (const double width : {5.0, 2.6})
    for (const auto& [a, b] : house_on(plane)) panel.segment(camera_from_world, a, b, width > 3 ? black : house, width);
  for (const auto& axis : world_axes) {
    const Vector3d tip = axis_length(plane) * axis.direction;
    panel.segment(camera_from_world, Vector3d::Zero(), tip, black, 6);
    panel.segment(camera_from_world, Vector3d::Zero(), tip, axis.in_picture, 3.8);
    if (const auto at = panel.point(camera_from_world, 1.1 * tip))
      panel.canvas().rimmed_text(*at, axis.label, small_text_size, axis.in_picture, black, Align::centre);
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
  Panel left(camera, image, zoom), right(camera, image, zoom);
  draw_features(left, camera, job);
  const camera_tracking::CameraEstimate& e = job.estimate;
  if (e.has_pose()) {
    draw_augmented(right, plane, e);
  } else {
    right.canvas().rimmed_text({right.canvas().width() / 2.0, right.canvas().height() / 2.0}, "no pose", 22,
                               state_color(e.state), black, Align::centre);
  }

  const int width = 2 * left.canvas().width() + 3 * margin, height = head + names + left.canvas().height() + foot;
  Canvas canvas(width, height, background);
  canvas.text({margin, 29}, fmt::format("{}, frame {}", camera.name, e.frame_number), headline_size, bright,
              Align::left, Weight::bold);
  canvas.text({width - double(margin), 29}, fmt::format("t = {:.3f} s", capture::seconds(e.at)), headline_size, bright,
              Align::right);
  canvas.text({margin, double(head + names) - 9}, "features: found, not found; given ones ringed; particles",
              small_text_size, faint);
  canvas.text({2.0 * margin + left.canvas().width(), double(head + names) - 9},
              "the start's plane, a house on it, the world's axes", small_text_size, faint);
  canvas.paste({margin, double(head + names)}, left.canvas());
  canvas.paste({2.0 * margin + left.canvas().width(), double(head + names)}, right.canvas());
  const double y = height - 14;
  canvas.text({margin, y}, std::string(camera_tracking::name(e.state)), text_size, state_color(e.state), Align::left,
              Weight::bold);
  std::string details;
  if (e.has_pose()) {
    const Vector3d& t = e.world_from_camera.translation;
    const double sigma_mm = 1e3 * std::sqrt(std::max(0.0, e.covariance.topLeftCorner<3, 3>().trace()));
    const double sigma_deg =
        std::sqrt(std::max(0.0, e.covariance.bottomRightCorner<3, 3>().trace())) * 180 / std::numbers::pi;
    details = fmt::format("x {:+.3f}  y {:+.3f}  z {:+.3f} m   +/- {:.1f} mm, {:.2f} deg   ", t.x(), t.y(), t.z(),
                          sigma_mm, sigma_deg);
  }
  details += fmt::format("{} of {} features, map {}, {} particles, ESS {:.0f}", e.features_matched, e.features_in_view,
                         e.map_points, e.particle_count, e.effective_sample_size);
  canvas.text({margin + 120.0, y}, details, small_text_size, bright);
  return image_of(canvas);
}

// ---- The map of a tracked camera, from above.

namespace {

constexpr int map_width = 1280, map_height = 960;
constexpr Color map_paper{252, 252, 250}, soft_line{120, 126, 136}, map_point_color{40, 90, 160},
    given_point_color{206, 44, 44}, path_color{30, 140, 70}, coasting_path_color{232, 130, 0};

// Its points with their 95 % ellipsoids, those between low and high of the oblique plane.
void draw_map_points(Canvas& canvas, const Oblique& oblique, const std::vector<camera_tracking::CameraMapPoint>& map,
                     const Vector2d& wide_low, const Vector2d& wide_high) {
  for (const auto& f : map) {
    const Vector2d p = oblique.flat(f.position);
    if ((p.array() < wide_low.array() - 1e-9).any() || (p.array() > wide_high.array() + 1e-9).any()) continue;
    std::vector<Point> ring;
    for (const Vector2d& r : calib::ellipse_95(oblique.flat(f.covariance)).ring(32)) ring.push_back(oblique.at(p + r));
    const Color color = f.given ? given_point_color : map_point_color;
    canvas.polygon(ring, color.faded(0.10));
    canvas.polyline(ring, color, 1.2, true);
    canvas.disc(oblique.at(p), 2.2, color);
  }
}

void draw_path(Canvas& canvas, const Oblique& oblique, const std::vector<camera_tracking::CameraEstimate>& path) {
  const camera_tracking::CameraEstimate* before = nullptr;
  for (const auto& e : path) {
    if (e.has_pose() && before != nullptr)
      canvas.line(oblique(before->world_from_camera.translation), oblique(e.world_from_camera.translation),
                  e.state == camera_tracking::PoseState::tracking ? path_color : coasting_path_color, 2.8);
    before = e.has_pose() ? &e : nullptr;
  }
}

// The camera itself, at a dozen places of its trajectory. reach: of its corners' rays, metres
void draw_cameras(Canvas& canvas, const Oblique& oblique, const calib::Camera& camera,
                  const std::vector<camera_tracking::CameraEstimate>& path, double reach) {
  const std::size_t every = std::max<std::size_t>(1, path.size() / 12);
  for (std::size_t i = 0; i < path.size(); i += every) {
    if (!path[i].has_pose()) continue;
    const calib::Rigid3d& pose = path[i].world_from_camera;
    std::vector<Point> front;
    for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      const auto ray = camera.model.ray(
          calib::RawPixel{{u * (camera.image_size.width - 1.0), v * (camera.image_size.height - 1.0)}});
      if (ray) front.push_back(oblique(pose * (*ray * reach)));
    }
    const Point eye = oblique(pose.translation);
    canvas.polyline(front, soft_line, 1.3, true);
    for (const auto& p : front) canvas.line(eye, p, soft_line, 1.3);
    canvas.disc(eye, 2.6, path_color);
  }
}

// The scale, and what the colours mean.
void draw_map_key(Canvas& canvas, double zoom) {
  // A scale: the longest of 1, 2, 5 times a power of ten that is at most a fifth of the picture.
  const double longest = (map_width - 120) / 5.0 / zoom, power = std::pow(10, std::floor(std::log10(longest)));
  const double bar = (longest >= 5 * power ? 5 : longest >= 2 * power ? 2 : 1) * power;
  canvas.line({60, map_height - 34.0}, {60 + bar * zoom, map_height - 34.0}, ink, 2);
  canvas.text({60 + bar * zoom + 10, map_height - 29.0},
              bar < 1 ? fmt::format("{:g} cm", bar * 100) : fmt::format("{:g} m", bar), small_text_size, ink);
  double x = map_width - 36;
  for (const auto& [text, color] : {std::pair{"coasting", coasting_path_color},
                                    {"tracking", path_color},
                                    {"given points", given_point_color},
                                    {"map points", map_point_color}}) {
    canvas.text({x, map_height - 29.0}, text, small_text_size, ink, Align::right);
    x -= canvas.text_width(text, small_text_size);
    canvas.disc({x - 10, map_height - 34.0}, 4, color);
    x -= 34;
  }
}

}  // namespace

cv::Mat draw_camera_map(const calib::Camera& camera, const StartPlane& plane, const std::string& title,
                        const std::vector<camera_tracking::CameraEstimate>& path,
                        const std::vector<camera_tracking::CameraMapPoint>& map) {
  Canvas canvas(map_width, map_height, map_paper);
  Oblique oblique = Oblique::from(-60, 32);

  // Fitted into the picture: start, trajectory, and map without far outliers.
  std::vector<Vector2d> all;
  std::vector<Vector3d> ground;  // the start's corners, going round
  for (const auto& [sx, sy] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
    ground.emplace_back(plane.origin + sx * plane.size_x * plane.x + sy * plane.size_y * plane.y);
  for (const Vector3d& p : ground) all.push_back(oblique.flat(p));
  for (const auto& e : path)
    if (e.has_pose()) all.push_back(oblique.flat(e.world_from_camera.translation));
  Vector2d low = all.front(), high = low;
  for (const auto& p : all) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const Vector2d room = 1.2 * (high - low);
  std::size_t outside = 0;
  Vector2d wide_low = low, wide_high = high;
  const auto include = [&](const Vector3d& position) {
    const Vector2d p = oblique.flat(position);
    if ((p.array() < (low - room).array()).any() || (p.array() > (high + room).array()).any()) return false;
    wide_low = wide_low.cwiseMin(p), wide_high = wide_high.cwiseMax(p);
    return true;
  };
  for (const auto& point : map) outside += include(point.position) ? 0 : 1;
  const bool shows_origin = include(Vector3d::Zero());
  const Vector2d edge = 0.04 * (wide_high - wide_low);
  oblique.fit(wide_low - edge, wide_high + edge, {60, 110, map_width - 120, map_height - 170});

  canvas.text({36, 46}, title, 22, ink, Align::left, Weight::bold);
  const auto poses = std::ranges::count_if(path, &camera_tracking::CameraEstimate::has_pose);
  canvas.text({36, 76},
              fmt::format("{} frames, {} with a pose; {} map points with their 95 % ellipsoids{}{}", path.size(), poses,
                          map.size(), outside > 0 ? fmt::format(", {} of them outside the picture", outside) : "",
                          shows_origin ? "" : "; the world's origin is outside the picture"),
              text_size, ink);

  std::vector<Point> outline;
  for (const Vector3d& p : ground) outline.push_back(oblique(p));
  canvas.polygon(outline, {225, 228, 232, 0.8});
  canvas.polyline(outline, soft_line, 1.7, true);
  for (const auto& axis : world_axes) {
    if (!shows_origin) break;
    const Vector3d tip = axis_length(plane) * axis.direction;
    canvas.line(oblique(Vector3d::Zero()), oblique(tip), axis.on_paper, 2.8);
    canvas.rimmed_text(oblique(1.12 * tip), axis.label, small_text_size, axis.on_paper, map_paper, Align::centre);
  }

  draw_map_points(canvas, oblique, map, wide_low, wide_high);
  draw_path(canvas, oblique, path);
  draw_cameras(canvas, oblique, camera, path, 0.07 * (wide_high - wide_low).maxCoeff());
  draw_map_key(canvas, oblique.zoom);
  canvas.line({36, 92}, {map_width - 36.0, 92}, rule, 0.8);
  return image_of(canvas);
}

CameraPictureWriter::CameraPictureWriter(const config::ServiceConfig& config, std::filesystem::path folder)
    : camera_(config.rig.cameras.at(std::size_t(config.rig.index_of(config.camera_tracking.camera).value()))),
      plane_(start_plane(config.camera_tracking)),
      folder_(std::move(folder)) {
  make_picture_folder(folder_);
}

void CameraPictureWriter::write(const CameraPictureJob& job) {
  save(fmt::format("camera_{:06}.png", job.estimate.frame_number), draw_camera(camera_, plane_, job));
}

void CameraPictureWriter::finish(const std::string& title, const std::vector<camera_tracking::CameraEstimate>& path,
                                 const std::vector<camera_tracking::CameraMapPoint>& map) {
  save("camera_3d.png", draw_camera_map(camera_, plane_, title, path, map));
}

void CameraPictureWriter::save(const std::string& name, const cv::Mat& picture) {
  write_png(folder_ / name, picture);
  ++written_;
}

}  // namespace huetrack::pictures
