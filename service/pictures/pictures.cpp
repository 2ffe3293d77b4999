#include "pictures/pictures.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "config/formatted.h"

namespace huetrack::pictures {
namespace {

constexpr DrawColor black{0, 0, 0}, white{255, 255, 255};
constexpr double chi2_2_95 = 5.991;  // 95 % quantile of chi-squared with 2 degrees of freedom

double middle_hue_deg(const object_tracking::HsiRange& color) {
  const double width = color.hue_max_deg - color.hue_min_deg;
  return std::fmod(color.hue_min_deg + (width < 0 ? width + 360 : width) / 2, 360);
}

DrawColor state_color(object_tracking::TrackState state) {
  switch (state) {
    case object_tracking::TrackState::tracking:
      return {90, 220, 120};
    case object_tracking::TrackState::coasting:
      return {255, 176, 40};
    case object_tracking::TrackState::searching:
      return {150, 190, 255};
    case object_tracking::TrackState::lost:
      return {255, 96, 88};
  }
  return white;
}

// ---------------------------------------------------------------------------------------------------------------------
// The views

struct ViewFrame {     // how a camera's pixels lie on a canvas
  cv::Point2d origin;  // of the image's top left corner; pixel (0,0) is the CENTRE of the top-left pixel
  double zoom;
  cv::Point2d operator()(const Eigen::Vector2d& px) const {
    return origin + cv::Point2d(px.x() + 0.5, px.y() + 0.5) * zoom;
  }
};

// Of the target's outline, by its distance; both axes of the lens taken as one.
double outline_radius_px(const calib::Camera& camera, const Eigen::Vector3d& p_world, double radius_m) {
  return radius_m / (camera.cam_from_world * p_world).norm() * 0.5 * (camera.model.fx() + camera.model.fy());
}

// The target's outline where it is thought to be.
void draw_outline(Canvas& canvas, const calib::Camera& camera, const ViewFrame& frame, const Eigen::Vector3d& position,
                  double radius_m, DrawColor color) {
  const auto pixel = camera.project_world(position);
  if (!pixel || !camera.contains(*pixel)) return;
  const double radius_px = outline_radius_px(camera, position, radius_m);
  canvas.circle(frame(pixel->px), radius_px * frame.zoom, black, 3.5);
  canvas.circle(frame(pixel->px), radius_px * frame.zoom, color, 1.8);
}

// The 95 % ellipse of where its centre is.
void draw_ellipse(Canvas& canvas, const calib::Camera& camera, const ViewFrame& frame,
                  const object_tracking::ObjectEstimate& estimate) {
  calib::CameraModel::Jacobian px_per_cam;
  const auto pixel = camera.model.project(camera.cam_from_world * estimate.position, px_per_cam);
  if (!pixel || !camera.contains(*pixel)) return;
  const Eigen::Matrix<double, 2, 3> px_per_world = px_per_cam * camera.cam_from_world.rotation.toRotationMatrix();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(px_per_world * estimate.covariance *
                                                            px_per_world.transpose());
  const Eigen::Matrix2d half_axes =
      axes.eigenvectors() * (chi2_2_95 * axes.eigenvalues().cwiseMax(0)).cwiseSqrt().asDiagonal();
  std::vector<cv::Point2d> ellipse;
  for (int i = 0; i < 64; ++i) {
    const double angle = 2 * std::numbers::pi * i / 64;
    ellipse.push_back(frame(pixel->px + half_axes * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
  }
  canvas.polyline(ellipse, black, 2.4, true);
  canvas.polyline(ellipse, white, 1.3, true);
}

// The image with everything that is drawn into it, at any magnification.
void draw_view(Canvas& canvas, const config::ServiceConfig& config, const PictureJob& job, const calib::Camera& camera,
               const cv::Mat& image, const ViewFrame& frame, double dot_radius) {
  if (!image.empty()) canvas.image(frame.origin, image, frame.zoom);
  for (std::size_t t = 0; t < config.targets.size(); ++t) {
    const DrawColor color = color_of_hue(middle_hue_deg(config.targets[t].color), 0.75, 1);
    std::vector<cv::Point2d> dots;
    for (const auto& particle : job.particles[t]) {
      const auto pixel = camera.project_world(particle.cast<double>());
      if (pixel && camera.contains(*pixel)) dots.push_back(frame(pixel->px));
    }
    const object_tracking::ObjectEstimate& estimate = job.estimates[t];
    if (estimate.has_position()) {
      draw_outline(canvas, camera, frame, estimate.position, config.targets[t].radius_m, color);
    }
    for (const auto& dot : dots) canvas.disc(dot, dot_radius + 0.7, black);
    for (const auto& dot : dots) canvas.disc(dot, dot_radius, color);
    if (estimate.has_position()) draw_ellipse(canvas, camera, frame, estimate);
  }
}

// Magnified squares around the targets, along the edge of the view that they are farther from.
void draw_magnifiers(Canvas& view, const config::ServiceConfig& config, const PictureJob& job,
                     const calib::Camera& camera, const cv::Mat& image) {
  constexpr double side = 168, gap = 10;
  std::vector<std::pair<std::size_t, Eigen::Vector2d>> seen;  // target, where
  double mean_v = 0;
  for (std::size_t t = 0; t < config.targets.size(); ++t) {
    if (!job.estimates[t].has_position()) continue;
    const auto pixel = camera.project_world(job.estimates[t].position);
    if (!pixel || !camera.contains(*pixel)) continue;
    seen.emplace_back(t, pixel->px);
    mean_v += pixel->px.y();
  }
  if (image.empty() || seen.empty()) return;
  const bool at_bottom = mean_v / double(seen.size()) < camera.image_size.height / 2.0;
  cv::Point2d at(gap, at_bottom ? view.height() - side - gap : gap);
  for (const auto& [t, px] : seen) {
    const double radius_px = outline_radius_px(camera, job.estimates[t].position, config.targets[t].radius_m);
    const double zoom = side / (2 * std::max(6.0, 1.8 * radius_px));
    Canvas glass{int(side), int(side), {44, 47, 53}};
    const ViewFrame frame{cv::Point2d(side / 2, side / 2) - cv::Point2d(px.x() + 0.5, px.y() + 0.5) * zoom, zoom};
    // Only the part of the image that shows: magnified whole it would be huge.
    const int half = int(std::ceil(side / 2 / zoom)) + 1;
    const cv::Rect part = cv::Rect(int(px.x()) - half, int(px.y()) - half, 2 * half + 1, 2 * half + 1) &
                          cv::Rect(cv::Point(), image.size());
    glass.image(frame.origin + cv::Point2d(part.x, part.y) * zoom, image(part), zoom);
    draw_view(glass, config, job, camera, {}, frame, 1.0);
    view.rectangle({at.x - 2, at.y - 2, side + 4, side + 4}, white);
    view.paste(at, glass);
    view.rimmed_text({at.x + 8, at.y + side - 9}, config.targets[t].name, 9.5, white, black);
    at.x += side + gap;
  }
}

}  // namespace

cv::Mat bgr_of(const capture::Image& image) {
  cv::Mat out(image.height, image.width, CV_8UC3);
  const bool full = image.range == capture::ColorRange::full;
  const double luma = full ? 1.0 : 255.0 / 219, chroma = full ? 1.0 : 255.0 / 224, foot = full ? 0 : 16;
  for (int v = 0; v < image.height; ++v) {
    auto* row = out.ptr<cv::Vec3b>(v);
    for (int u = 0; u < image.width; ++u) {
      if (image.format == capture::PixelFormat::bgr) {
        const capture::Bgr p = capture::bgr_at(image, u, v);
        row[u] = {p.b, p.g, p.r};
      } else {
        const capture::Yuv p = capture::yuv_at(image, u, v);
        const double y = luma * (p.y - foot), cb = chroma * (p.u - 128), cr = chroma * (p.v - 128);
        row[u] = {cv::saturate_cast<uchar>(y + 1.772 * cb), cv::saturate_cast<uchar>(y - 0.344136 * cb - 0.714136 * cr),
                  cv::saturate_cast<uchar>(y + 1.402 * cr)};
      }
    }
  }
  return out;
}

cv::Mat draw_views(const config::ServiceConfig& config, const PictureJob& job) {
  constexpr int margin = 14, title_height = 44, name_height = 30, row_height = 30;
  constexpr double view_width = 760, view_height = 620;
  constexpr DrawColor background{24, 26, 30}, faint{150, 156, 166}, bright{238, 240, 244};
  const auto& cameras = config.rig.cameras;
  const auto targets = config.targets.size();

  // As many columns as make the picture about as wide as a screen.
  const int columns =
      std::max(1, cameras.size() <= 3 ? int(cameras.size()) : int(std::ceil(std::sqrt(double(cameras.size())))));
  const int rows = (int(cameras.size()) + columns - 1) / columns;
  double zoom = 1e9;
  int largest_width = 1, largest_height = 1;
  for (const auto& camera : cameras) {
    zoom = std::min({zoom, view_width / camera.image_size.width, view_height / camera.image_size.height});
    largest_width = std::max(largest_width, camera.image_size.width);
    largest_height = std::max(largest_height, camera.image_size.height);
  }
  if (columns >= 3) zoom *= 0.75;
  const double cell_width = largest_width * zoom, cell_height = largest_height * zoom + name_height;
  const int width = int(std::ceil(columns * (cell_width + margin) + margin));
  const int height =
      int(std::ceil(title_height + rows * (cell_height + margin) + double(targets) * row_height + margin));
  Canvas canvas(width, height, background);
  canvas.text({margin, 29}, config::formatted("frame set %llu", static_cast<unsigned long long>(job.set.number)), 13,
              bright, Align::left, true);
  canvas.text({width - double(margin), 29}, config::formatted("t = %.3f s", capture::seconds(job.set.at)), 13, bright,
              Align::right);

  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const calib::Camera& camera = cameras[c];
    const cv::Rect2d area(margin + double(int(c) % columns) * (cell_width + margin),
                          title_height + double(int(c) / columns) * (cell_height + margin) + name_height,
                          camera.image_size.width * zoom, camera.image_size.height * zoom);
    const auto& captured = job.set.frames.at(c);
    const cv::Mat image = captured ? bgr_of(captured->pixels) : cv::Mat();
    Canvas view(int(std::lround(area.width)), int(std::lround(area.height)), {44, 47, 53});
    draw_view(view, config, job, camera, image, {{0, 0}, zoom}, 1.4);
    draw_magnifiers(view, config, job, camera, image);
    if (image.empty()) {
      view.rimmed_text({area.width / 2, area.height / 2}, "no frame in this set", 13, faint, black, Align::centre);
    }
    canvas.paste(area.tl(), view);

    std::string seen;
    for (std::size_t t = 0; t < targets; ++t) {
      const auto& views = job.estimates[t].per_view;
      if (c < views.size() && views[c].seen) seen += (seen.empty() ? "sees " : ", ") + config.targets[t].name;
    }
    canvas.text({area.x, area.y - 9}, camera.name, 11, bright, Align::left, true);
    canvas.text({area.x + area.width, area.y - 9}, seen.empty() ? "sees no target" : seen, 10, faint, Align::right);
  }

  double y = height - margin - double(targets) * row_height + 20;
  for (std::size_t t = 0; t < targets; ++t, y += row_height) {
    const object_tracking::ObjectEstimate& e = job.estimates[t];
    canvas.disc({margin + 8.0, y - 5}, 7, color_of_hue(middle_hue_deg(config.targets[t].color), 0.75, 1));
    canvas.text({margin + 24.0, y}, config.targets[t].name, 11, bright, Align::left, true);
    canvas.text({margin + 130.0, y}, std::string(object_tracking::name(e.state)), 11, state_color(e.state), Align::left,
                true);
    std::string details = config::formatted("%d particles, %d of %zu views", e.particle_count, e.views, cameras.size());
    if (e.has_position()) {
      const double sigma_mm = 1e3 * std::sqrt(std::max(0.0, e.covariance.trace()));
      details = config::formatted("x %+.3f  y %+.3f  z %+.3f m   +/- %.1f mm   speed %.2f m/s   ", e.position.x(),
                                  e.position.y(), e.position.z(), sigma_mm, e.velocity.norm()) +
                details;
    }
    canvas.text({margin + 250.0, y}, details, 10, bright);
  }
  return canvas.finished();
}

// ---------------------------------------------------------------------------------------------------------------------
// The track

namespace {

constexpr DrawColor paper{252, 252, 250}, ink{38, 42, 48}, soft{120, 126, 136}, hairline{218, 221, 226},
    rule{190, 194, 200};
constexpr DrawColor truth_color{70, 76, 86}, coasting_color{232, 130, 0}, bad_color{206, 44, 44};

DrawColor track_color(const object_tracking::TargetOptions& target) {
  return color_of_hue(middle_hue_deg(target.color), 0.85, 0.72);
}

// A step of 1, 2 or 5 times a power of ten that gives at most `most` steps in the range.
double nice_step(double range, int most) {
  const double raw = range / most, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10 * power;
}

std::string tick_label(double value, double step) {
  const int decimals = std::max(0, int(std::ceil(-std::log10(step) - 1e-9)));
  return config::formatted("%.*f", decimals, std::abs(value) < step / 2 ? 0.0 : value);
}

// A rectangle of the picture with linear axes.
struct Plot {
  cv::Rect2d area;
  double x_min, x_max, y_min, y_max;

  cv::Point2d operator()(double x, double y) const {
    return {area.x + (x - x_min) / (x_max - x_min) * area.width,
            area.y + area.height - (y - y_min) / (y_max - y_min) * area.height};
  }
  void axes(Canvas& canvas, const std::string& title, const std::string& x_label, int x_ticks, int y_ticks) const {
    canvas.rectangle(area, {255, 255, 255});
    const double dx = nice_step(x_max - x_min, x_ticks), dy = nice_step(y_max - y_min, y_ticks);
    for (double x = std::ceil(x_min / dx - 1e-9) * dx; x <= x_max + 1e-9 * dx; x += dx) {
      canvas.line((*this)(x, y_min), (*this)(x, y_max), hairline, 0.6);
      if (!x_label.empty())
        canvas.text((*this)(x, y_min) + cv::Point2d(0, 17), tick_label(x, dx), 8, soft, Align::centre);
    }
    for (double y = std::ceil(y_min / dy - 1e-9) * dy; y <= y_max + 1e-9 * dy; y += dy) {
      canvas.line((*this)(x_min, y), (*this)(x_max, y), hairline, 0.6);
      canvas.text((*this)(x_min, y) + cv::Point2d(-7, 3.5), tick_label(y, dy), 8, soft, Align::right);
    }
    const std::vector<cv::Point2d> frame{(*this)(x_min, y_min), (*this)(x_max, y_min), (*this)(x_max, y_max),
                                         (*this)(x_min, y_max)};
    canvas.polyline(frame, rule, 0.8, true);
    canvas.text({area.x, area.y - 9}, title, 9.5, ink, Align::left, true);
    if (!x_label.empty())
      canvas.text({area.x + area.width, area.y + area.height + 33}, x_label, 8.5, soft, Align::right);
  }
};

// An orthographic view from above and aside.
struct Oblique {
  Eigen::Vector3d right, up, towards;  // unit, world; towards: to the viewer
  cv::Point2d centre{0, 0};
  double zoom = 1;  // pixels per metre

  static Oblique from(double azimuth_deg, double elevation_deg) {
    const double a = azimuth_deg * std::numbers::pi / 180, e = elevation_deg * std::numbers::pi / 180;
    Oblique view;
    view.right = {-std::sin(a), std::cos(a), 0};
    view.towards = {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
    view.up = view.towards.cross(view.right);
    return view;
  }
  void fit(const std::vector<Eigen::Vector3d>& points, cv::Rect2d area) {
    Eigen::Vector2d low(1e300, 1e300), high(-1e300, -1e300);
    for (const auto& p : points) {
      const Eigen::Vector2d q(right.dot(p), up.dot(p));
      low = low.cwiseMin(q);
      high = high.cwiseMax(q);
    }
    zoom = std::min(area.width / (high - low).x(), area.height / (high - low).y());
    const Eigen::Vector2d middle = (low + high) / 2;
    centre = {area.x + area.width / 2 - zoom * middle.x(), area.y + area.height / 2 + zoom * middle.y()};
  }
  cv::Point2d operator()(const Eigen::Vector3d& p) const {
    return centre + cv::Point2d(right.dot(p), -up.dot(p)) * zoom;
  }
};

// The track as runs of one state that has a position.
template <typename F>
void for_each_piece(const std::vector<object_tracking::ObjectEstimate>& track, F&& f) {
  for (std::size_t i = 1; i < track.size(); ++i) {
    if (track[i - 1].has_position() && track[i].has_position()) f(track[i - 1], track[i]);
  }
}

DrawColor piece_color(const object_tracking::ObjectEstimate& to, DrawColor tracking) {
  return to.state == object_tracking::TrackState::tracking ? tracking : coasting_color;
}

void draw_world(Canvas& canvas, const config::ServiceConfig& config,
                const std::vector<std::vector<object_tracking::ObjectEstimate>>& tracks, const tracks::Truth* truth,
                cv::Rect2d area) {
  const object_tracking::Box& box = config.object_tracking.volume;
  // From the side where no camera stands before the volume: opposite to where the cameras are, turned a little so that
  // neither horizontal axis is seen end on.
  Eigen::Vector3d cameras_at = Eigen::Vector3d::Zero();
  for (const auto& camera : config.rig.cameras) cameras_at += (camera.centre() - (box.min + box.max) / 2).normalized();
  const double camera_azimuth_deg = std::atan2(cameras_at.y(), cameras_at.x()) * 180 / std::numbers::pi;
  double azimuth_deg = std::floor((camera_azimuth_deg + 180) / 90) * 90 + 33;
  Oblique view = Oblique::from(azimuth_deg, 24);

  constexpr double frustum_m = 0.32;
  const auto frustum = [&](const calib::Camera& camera) {
    std::vector<Eigen::Vector3d> corners;
    const calib::Rigid3d world_from_cam = calib::inverse(camera.cam_from_world);
    const double w = camera.image_size.width - 0.5, h = camera.image_size.height - 0.5;
    for (const auto& px :
         {Eigen::Vector2d(-0.5, -0.5), Eigen::Vector2d(w, -0.5), Eigen::Vector2d(w, h), Eigen::Vector2d(-0.5, h)}) {
      if (const auto ray = camera.model.ray(calib::RawPixel{px})) {
        const double depth = std::max(ray->z(), 0.2);
        corners.push_back(world_from_cam * (*ray * (frustum_m / depth)));
      }
    }
    return corners;
  };
  std::vector<Eigen::Vector3d> everything{box.min, box.max};
  const auto corner = [&](int i) {
    return Eigen::Vector3d((i & 1) ? box.max.x() : box.min.x(), (i & 2) ? box.max.y() : box.min.y(),
                           (i & 4) ? box.max.z() : box.min.z());
  };
  for (int i = 0; i < 8; ++i) everything.push_back(corner(i));
  for (const auto& camera : config.rig.cameras) {
    everything.push_back(camera.centre());
    for (const auto& p : frustum(camera)) everything.push_back(p);
  }
  view.fit(everything, {area.x + 60, area.y + 30, area.width - 120, area.height - 90});

  // Floor grid, then the box; the three edges nearest to the viewer carry the ticks.
  const Eigen::Vector3d size = box.max - box.min;
  const double step = nice_step(std::max(size.x(), size.y()), 8);
  const auto floor_at = [&](double x, double y) { return Eigen::Vector3d(x, y, box.min.z()); };
  const std::vector<cv::Point2d> floor{view(corner(0)), view(corner(1)), view(corner(3)), view(corner(2))};
  canvas.polygon(floor, {243, 245, 248});
  for (double x = std::ceil(box.min.x() / step - 1e-9) * step; x <= box.max.x() + 1e-9; x += step)
    canvas.line(view(floor_at(x, box.min.y())), view(floor_at(x, box.max.y())), hairline, 0.7);
  for (double y = std::ceil(box.min.y() / step - 1e-9) * step; y <= box.max.y() + 1e-9; y += step)
    canvas.line(view(floor_at(box.min.x(), y)), view(floor_at(box.max.x(), y)), hairline, 0.7);
  for (int i = 0; i < 8; ++i) {
    for (const int bit : {1, 2, 4}) {
      if ((i & bit) == 0) canvas.line(view(corner(i)), view(corner(i | bit)), rule, 0.8);
    }
  }
  const double near_x = view.towards.x() > 0 ? box.max.x() : box.min.x(),
               near_y = view.towards.y() > 0 ? box.max.y() : box.min.y();
  // z: on the vertical edge that is leftmost in the picture.
  int left_edge = 0;
  for (int i = 1; i < 4; ++i) {
    if (view(corner(i)).x < view(corner(left_edge)).x) left_edge = i;
  }
  const auto free_of_z = [&](const Eigen::Vector3d& at) {  // the foot of the z axis has a label already
    return (at - corner(left_edge)).norm() > 1e-6;
  };
  const auto tick = [&](const Eigen::Vector3d& at, const cv::Point2d& away, const std::string& label) {
    const cv::Point2d p = view(at);
    canvas.line(p, p + away * 5, soft, 1);
    canvas.text(p + away * 13 + cv::Point2d(0, 3.5), label, 8, soft,
                away.x < -0.3  ? Align::right
                : away.x > 0.3 ? Align::left
                               : Align::centre);
  };
  const auto outward = [&](const Eigen::Vector3d& direction) {  // on the picture, away from the box along this axis
    const cv::Point2d d = view(direction) - view(Eigen::Vector3d::Zero());
    return d * (1 / std::max(1e-9, std::hypot(d.x, d.y)));
  };
  const Eigen::Vector3d away_y(0, near_y == box.max.y() ? 1 : -1, 0), away_x(near_x == box.max.x() ? 1 : -1, 0, 0);
  for (double x = std::ceil(box.min.x() / step - 1e-9) * step; x <= box.max.x() + 1e-9; x += step)
    if (free_of_z(floor_at(x, near_y))) tick(floor_at(x, near_y), outward(away_y), tick_label(x, step));
  for (double y = std::ceil(box.min.y() / step - 1e-9) * step; y <= box.max.y() + 1e-9; y += step)
    if (free_of_z(floor_at(near_x, y))) tick(floor_at(near_x, y), outward(away_x), tick_label(y, step));
  const double z_step = nice_step(size.z(), 8);
  for (double z = std::ceil(box.min.z() / z_step - 1e-9) * z_step; z <= box.max.z() + 1e-9; z += z_step)
    tick({corner(left_edge).x(), corner(left_edge).y(), z}, {-1, 0}, tick_label(z, z_step));
  canvas.text(view(floor_at((box.min.x() + box.max.x()) / 2, near_y)) + outward(away_y) * 62, "x [m]", 10, ink,
              Align::centre, true);
  canvas.text(view(floor_at(near_x, (box.min.y() + box.max.y()) / 2)) + outward(away_x) * 62, "y [m]", 10, ink,
              Align::centre, true);
  canvas.text(view(corner(left_edge | 4)) + cv::Point2d(-12, -12), "z [m]", 10, ink, Align::centre, true);

  for (const auto& camera : config.rig.cameras) {
    constexpr DrawColor glass{96, 120, 170};
    std::vector<cv::Point2d> front;
    for (const auto& p : frustum(camera)) front.push_back(view(p));
    const cv::Point2d centre = view(camera.centre());
    if (front.size() == 4) canvas.polygon(front, glass, 0.18);
    canvas.polyline(front, glass, 1.1, true);
    for (const auto& p : front) canvas.line(centre, p, glass, 1.1);
    canvas.disc(centre, 3.2, glass);
    canvas.text(centre + cv::Point2d(0, -14), camera.name, 10, glass, Align::centre, true);
  }

  // Shadows on the floor give the eye the depth.
  const auto shadow = [&](const Eigen::Vector3d& p) { return view(floor_at(p.x(), p.y())); };
  for (const auto& track : tracks)
    for_each_piece(track, [&](const auto& a, const auto& b) {
      canvas.line(shadow(a.position), shadow(b.position), {214, 217, 222}, 2);
    });
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const DrawColor color = track_color(config.targets[t]);
    for_each_piece(tracks[t], [&](const auto& a, const auto& b) {
      canvas.line(view(a.position), view(b.position), piece_color(b, color), 3);
    });
    if (truth != nullptr) {
      if (const auto it = truth->targets().find(config.targets[t].name); it != truth->targets().end()) {
        for (std::size_t i = 1; i < it->second.size(); ++i)
          canvas.line(view(it->second[i - 1].position), view(it->second[i].position), truth_color, 0.9);
      }
    }
    const auto first = std::ranges::find_if(tracks[t], &object_tracking::ObjectEstimate::has_position);
    if (first == tracks[t].end()) continue;
    const auto last =
        std::ranges::find_if(tracks[t].rbegin(), tracks[t].rend(), &object_tracking::ObjectEstimate::has_position);
    canvas.disc(view(first->position), 5.5, color);
    canvas.disc(view(first->position), 3.2, white);
    canvas.disc(view(last->position), 5.5, color);
    canvas.rimmed_text(view(first->position) + cv::Point2d(9, 18), "start", 9, ink, white);
    canvas.rimmed_text(view(last->position) + cv::Point2d(9, -10), "end", 9, ink, white);
  }
}

}  // namespace

cv::Mat draw_track_3d(const config::ServiceConfig& config, const std::string& title,
                      const std::vector<std::vector<object_tracking::ObjectEstimate>>& tracks,
                      const tracks::Truth* truth) {
  constexpr int width = 1760, height = 1120;
  Canvas canvas(width, height, paper);
  canvas.text({36, 50}, title, 17, ink, Align::left, true);

  // The legend: per target one line, with its figures.
  double y = 84;
  std::vector<std::vector<std::pair<double, double>>> errors(tracks.size());  // (t, mm)
  std::vector<double> rms_mm(tracks.size(), 0);
  double t_min = 1e300, t_max = -1e300;
  for (std::size_t i = 0; i < tracks.size(); ++i, y += 26) {
    std::size_t tracking = 0, coasting = 0;
    std::optional<tracks::TruthComparison> comparison;
    if (truth != nullptr && truth->targets().contains(config.targets[i].name))
      comparison.emplace(*truth, config.targets[i].name);
    for (const auto& e : tracks[i]) {
      t_min = std::min(t_min, capture::seconds(e.at));
      t_max = std::max(t_max, capture::seconds(e.at));
      tracking += e.state == object_tracking::TrackState::tracking ? 1 : 0;
      coasting += e.state == object_tracking::TrackState::coasting ? 1 : 0;
      if (!comparison) continue;
      if (const auto error = comparison->add(e)) errors[i].emplace_back(capture::seconds(e.at), 1e3 * *error);
    }
    const double per_cent = tracks[i].empty() ? 0 : 100.0 / double(tracks[i].size());
    std::string text = config::formatted("%zu frame sets: tracking %.0f %%, coasting %.0f %%", tracks[i].size(),
                                         per_cent * double(tracking), per_cent * double(coasting));
    if (comparison) {
      const tracks::TruthFigures f = comparison->figures();
      rms_mm[i] = 1e3 * f.rms_m;
      text += f.lock_set ? config::formatted("; locked in set %zu; error after it %.1f mm rms, %.1f mm at most",
                                             *f.lock_set, 1e3 * f.rms_m, 1e3 * f.max_m)
                         : "; never near the truth";
    }
    canvas.line({38, y - 4}, {62, y - 4}, track_color(config.targets[i]), 4);
    canvas.text({72, y}, config.targets[i].name, 10.5, ink, Align::left, true);
    canvas.text({72 + Canvas::text_width(config.targets[i].name, 10.5, true) + 14, y}, text, 10.5, ink);
  }
  if (!(t_max > t_min)) {
    t_min = 0;
    t_max = 1;
  }
  double key_x = width - 36;
  const auto key = [&](const std::string& text, DrawColor color, double stroke) {
    key_x -= Canvas::text_width(text, 9.5);
    canvas.text({key_x, 50}, text, 9.5, ink);
    canvas.line({key_x - 34, 46.5}, {key_x - 8, 46.5}, color, stroke);
    key_x -= 54;
  };
  const auto has_truth = [&](const object_tracking::TargetOptions& target) {
    return truth->targets().contains(target.name);
  };
  if (truth != nullptr && std::ranges::any_of(config.targets, has_truth)) key("truth", truth_color, 1);
  key("coasting", coasting_color, 3.5);
  key("tracking: the target's colour", track_color(config.targets.front()), 3.5);

  const double top = y + 6;
  draw_world(canvas, config, tracks, truth, {36, top, 1060, height - top - 20});

  const double left = 1180, right = width - 36, plot_width = right - left;
  const object_tracking::Box& box = config.object_tracking.volume;
  const bool has_error = std::ranges::any_of(errors, [](const auto& e) { return !e.empty(); });
  const double error_height = has_error ? 210 : 0;
  const double coordinate_height = (height - top - 70 - error_height - (has_error ? 66 : 0)) / 3 - 34;
  double at_y = top + 26;
  for (int axis = 0; axis < 3; ++axis, at_y += coordinate_height + 34) {
    const bool last = axis == 2;
    const Plot plot{{left, at_y, plot_width, coordinate_height}, t_min, t_max, box.min[axis], box.max[axis]};
    plot.axes(canvas, std::string(1, "xyz"[axis]) + " [m]", last && !has_error ? "t [s]" : "", 10, 5);
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      const DrawColor color = track_color(config.targets[i]);
      for_each_piece(tracks[i], [&](const auto& a, const auto& b) {
        canvas.line(plot(capture::seconds(a.at), std::clamp(a.position[axis], plot.y_min, plot.y_max)),
                    plot(capture::seconds(b.at), std::clamp(b.position[axis], plot.y_min, plot.y_max)),
                    piece_color(b, color), 2.6);
      });
      if (truth == nullptr) continue;
      const auto it = truth->targets().find(config.targets[i].name);
      if (it == truth->targets().end()) continue;
      for (std::size_t k = 1; k < it->second.size(); ++k) {
        const auto &a = it->second[k - 1], &b = it->second[k];
        if (capture::seconds(a.at) < t_min || capture::seconds(b.at) > t_max + 1e-3) continue;
        canvas.line(plot(capture::seconds(a.at), std::clamp(a.position[axis], plot.y_min, plot.y_max)),
                    plot(std::min(t_max, capture::seconds(b.at)), std::clamp(b.position[axis], plot.y_min, plot.y_max)),
                    truth_color, 0.9);
      }
    }
  }
  if (has_error) {
    // Up to what nearly all errors are; the few beyond are clipped and marked.
    std::vector<double> all;
    for (const auto& e : errors)
      for (const auto& [_, mm] : e) all.push_back(mm);
    std::ranges::sort(all);
    const double high = std::max(5.0, 1.25 * all[std::size_t(0.98 * double(all.size() - 1))]);
    at_y += 16;
    const Plot plot{{left, at_y, plot_width, error_height}, t_min, t_max, 0, high};
    plot.axes(canvas, "distance to the truth [mm]", "t [s]", 10, 6);
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const DrawColor color = track_color(config.targets[i]);
      for (std::size_t k = 0; k < errors[i].size(); ++k) {
        const auto [t, mm] = errors[i][k];
        if (mm > high) {
          canvas.disc(plot(t, high), 3.4, bad_color);
        } else {
          canvas.disc(plot(t, mm), 2.2, color);
        }
        if (k > 0 && t - errors[i][k - 1].first < 0.2)
          canvas.line(plot(errors[i][k - 1].first, std::min(high, errors[i][k - 1].second)),
                      plot(t, std::min(high, mm)), color, 1.1);
      }
    }
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (!(rms_mm[i] > 0 && rms_mm[i] < high)) continue;
      canvas.dashed(plot(t_min, rms_mm[i]), plot(t_max, rms_mm[i]), ink, 1.1);
      canvas.rimmed_text(plot(t_max, rms_mm[i]) + cv::Point2d(-6 - 90.0 * double(i), -6),
                         config::formatted("rms %.1f", rms_mm[i]), 9, ink, white, Align::right);
    }
    if (all.back() > high)
      canvas.text({right, at_y - 9}, config::formatted("red: beyond the scale, up to %.0f mm", all.back()), 8.5,
                  bad_color, Align::right);
  }
  return canvas.finished();
}

PictureWriter::PictureWriter(const config::ServiceConfig& config, std::filesystem::path folder)
    : config_(config), folder_(std::move(folder)) {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) throw std::runtime_error("cannot make the folder " + folder_.string() + ": " + error.message());
}

void PictureWriter::write(const PictureJob& job) {
  write(config::formatted("set_%06llu.png", static_cast<unsigned long long>(job.set.number)), draw_views(config_, job));
  ++written_;
}

void PictureWriter::write(const std::string& file_name, const cv::Mat& picture) const {
  const auto file = folder_ / file_name;
  bool written = false;
  std::string why;
  try {
    written = cv::imwrite(file.string(), picture, {cv::IMWRITE_PNG_COMPRESSION, 2});
  } catch (const cv::Exception& error) {
    why = ": " + std::string(error.err);
  }
  if (!written) throw std::runtime_error("cannot write " + file.string() + why);
}

}  // namespace huetrack::pictures
