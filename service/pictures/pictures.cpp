#include "pictures/pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/model/covariance_ellipse.h"
#include "drawing/axes.h"
#include "pictures/canvas_image.h"
#include "pictures/view_style.h"

namespace huetrack::pictures {

using namespace drawing;

namespace {

Color target_color(const object_tracking::TargetOptions& target) {
  return color_of(target.color, 0.75, 1);
}

// Placement of a camera's pixels on a canvas.
struct Placement {
  Point top_left;  // of the image; pixel (0,0) is the CENTRE of the top-left pixel
  double zoom;
  Point operator()(const Eigen::Vector2d& px) const { return top_left + zoom * (px + Point(0.5, 0.5)); }
};

// Radius of the target in the image, with the mean focal length.
double outline_radius_px(const calib::Camera& camera, const Eigen::Vector3d& p_world, double radius_m) {
  return radius_m / (camera.cam_from_world * p_world).norm() * 0.5 * (camera.model.fx() + camera.model.fy());
}

// The target's outline at its estimate.
void draw_outline(Canvas& canvas, const calib::Camera& camera, const Placement& placement,
                  const Eigen::Vector3d& position, double radius_m, Color color) {
  const auto pixel = camera.project_world(position);
  if (!pixel || !camera.contains(*pixel)) return;
  const double radius_px = outline_radius_px(camera, position, radius_m);
  canvas.circle(placement(pixel->px), radius_px * placement.zoom, black, 4);
  canvas.circle(placement(pixel->px), radius_px * placement.zoom, color, 2);
}

// The 95 % ellipse of its centre.
void draw_ellipse(Canvas& canvas, const calib::Camera& camera, const Placement& placement,
                  const object_tracking::ObjectEstimate& estimate) {
  const auto pixel = camera.project_world(estimate.position);
  const auto covariance = calib::projected_covariance(camera, estimate.position, estimate.covariance);
  if (!pixel || !camera.contains(*pixel) || !covariance) return;
  std::vector<Point> ring;
  for (const Eigen::Vector2d& p : calib::ellipse_95(*covariance).ring(64)) ring.push_back(placement(pixel->px + p));
  canvas.polyline(ring, black, 3, true);
  canvas.polyline(ring, white, 1.5, true);
}

// All overlays of an image, at any magnification.
void draw_findings(Canvas& canvas, const config::ServiceConfig& config, const PictureJob& job,
                   const calib::Camera& camera, const Placement& placement, double dot_radius) {
  for (std::size_t t = 0; t < config.targets.size(); ++t) {
    const Color color = target_color(config.targets[t]);
    std::vector<Point> dots;
    for (const auto& particle : job.particles[t]) {
      const auto pixel = camera.project_world(particle.cast<double>());
      if (pixel && camera.contains(*pixel)) dots.push_back(placement(pixel->px));
    }
    const auto each_of_target = [&](auto&& draw) {
      for (const auto& estimate : job.estimates)
        if (estimate.target == t && estimate.has_position()) draw(estimate);
    };
    each_of_target([&](const auto& estimate) {
      draw_outline(canvas, camera, placement, estimate.position, config.targets[t].radius_m, color);
    });
    canvas.discs(dots, dot_radius + 0.7, black);
    canvas.discs(dots, dot_radius, color);
    each_of_target([&](const auto& estimate) { draw_ellipse(canvas, camera, placement, estimate); });
  }
}

// Magnified squares around the targets, along the farther edge of the view.
void draw_magnifiers(Canvas& canvas, const config::ServiceConfig& config, const PictureJob& job,
                     const calib::Camera& camera, const cv::Mat& image) {
  constexpr double side = 168, gap = 10;
  std::vector<std::pair<std::size_t, Eigen::Vector2d>> seen;  // which of job.estimates, where
  double mean_v = 0;
  for (std::size_t t = 0; t < job.estimates.size(); ++t) {
    if (!job.estimates[t].has_position()) continue;
    const auto pixel = camera.project_world(job.estimates[t].position);
    if (!pixel || !camera.contains(*pixel)) continue;
    seen.emplace_back(t, pixel->px);
    mean_v += pixel->px.y();
  }
  if (image.empty() || seen.empty()) return;
  const bool at_bottom = mean_v / double(seen.size()) < camera.image_size.height / 2.0;
  Point at(gap, at_bottom ? canvas.height() - side - gap : gap);
  for (const auto& [e, px] : seen) {
    if (at.x() + side + gap > canvas.width()) break;  // only as many objects as fit
    const auto& target = config.targets[job.estimates[e].target];
    const double radius_px = outline_radius_px(camera, job.estimates[e].position, target.radius_m);
    const double zoom = side / (2 * std::max(6.0, 1.8 * radius_px));
    const Placement placement{Point(side / 2, side / 2) - zoom * (px + Point(0.5, 0.5)), zoom};
    // Only the visible part of the image.
    const int half = int(std::ceil(side / 2 / zoom)) + 1;
    const cv::Rect part = cv::Rect(int(px.x()) - half, int(px.y()) - half, 2 * half + 1, 2 * half + 1) &
                          cv::Rect(cv::Point(), image.size());
    Canvas glass = canvas_over(image(part), placement.top_left + zoom * Point(part.x, part.y), zoom,
                               {int(side), int(side)}, no_image);
    draw_findings(glass, config, job, camera, placement, 1.0);
    canvas.rectangle({at.x() - 2, at.y() - 2, side + 4, side + 4}, white);
    canvas.paste(at, glass);
    canvas.rimmed_text(at + Point(8, side - 9), object_tracking::object_name(target.name, job.estimates[e].object),
                       small_text_size, white, black);
    at.x() += side + gap;
  }
}

}  // namespace

Color color_of(const color::HsiRange& range, double saturation, double value) {
  const double width = range.hue_max_deg - range.hue_min_deg;
  const double middle_deg = std::fmod(range.hue_min_deg + (width < 0 ? width + 360 : width) / 2, 360);
  return drawing::color_of_hue(middle_deg, saturation, value);
}

cv::Mat bgr_of(const capture::Image& image) {
  capture::require_all(image);
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
  const auto& cameras = config.rig.cameras;
  const auto rows_below = job.estimates.size();
  const auto name_of = [&](const object_tracking::ObjectEstimate& e) {
    return object_tracking::object_name(config.targets[e.target].name, e.object);
  };

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
      int(std::ceil(title_height + rows * (cell_height + margin) + double(rows_below) * row_height + margin));
  Canvas canvas(width, height, background);
  canvas.text({margin, 29}, fmt::format("frame set {}", job.set.number), headline_size, bright, Align::left,
              Weight::bold);
  canvas.text({width - double(margin), 29}, fmt::format("t = {:.3f} s", capture::seconds(job.set.at)), headline_size,
              bright, Align::right);

  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const calib::Camera& camera = cameras[c];
    const int column = int(c) % columns, row = int(c) / columns;
    const Box area{margin + column * (cell_width + margin), title_height + row * (cell_height + margin) + name_height,
                   camera.image_size.width * zoom, camera.image_size.height * zoom};
    const auto& captured = job.set.frames.at(c);
    const capture::Image* const picture = captured ? picture_of(*captured) : nullptr;
    const cv::Mat image = picture != nullptr ? bgr_of(*picture) : cv::Mat();
    Canvas view =
        canvas_over(image, {0, 0}, zoom, {int(std::lround(area.width)), int(std::lround(area.height))}, no_image);
    draw_findings(view, config, job, camera, {{0, 0}, zoom}, 1.4);
    draw_magnifiers(view, config, job, camera, image);
    if (image.empty())
      view.rimmed_text({area.width / 2, area.height / 2}, "no frame in this set", headline_size, faint, black,
                       Align::centre);
    canvas.paste({area.x, area.y}, view);

    std::vector<std::string> seen;
    for (const auto& e : job.estimates)
      if (c < e.per_view.size() && e.per_view[c].seen) seen.push_back(name_of(e));
    canvas.text({area.x, area.y - 9}, camera.name, text_size, bright, Align::left, Weight::bold);
    canvas.text({area.x + area.width, area.y - 9},
                seen.empty() ? "sees no target" : fmt::format("sees {}", fmt::join(seen, ", ")), small_text_size, faint,
                Align::right);
  }

  double y = height - margin - double(rows_below) * row_height + 20;
  for (const object_tracking::ObjectEstimate& e : job.estimates) {
    canvas.disc({margin + 8.0, y - 5}, 7, target_color(config.targets[e.target]));
    canvas.text({margin + 24.0, y}, name_of(e), text_size, bright, Align::left, Weight::bold);
    canvas.text({margin + 130.0, y}, std::string(object_tracking::name(e.state)), text_size, state_color(e.state),
                Align::left, Weight::bold);
    std::string details;
    if (e.has_position())
      details = fmt::format("x {:+.3f}  y {:+.3f}  z {:+.3f} m   +/- {:.1f} mm   speed {:.2f} m/s   ", e.position.x(),
                            e.position.y(), e.position.z(), 1e3 * std::sqrt(std::max(0.0, e.covariance.trace())),
                            e.velocity.norm());
    details += fmt::format("{} particles, {} of {} views", e.particle_count, e.views, cameras.size());
    canvas.text({margin + 250.0, y}, details, small_text_size, bright);
    y += row_height;
  }
  return image_of(canvas);
}

PictureWriter::PictureWriter(const config::ServiceConfig& config, std::filesystem::path folder)
    : config_(config), folder_(std::move(folder)) {
  make_picture_folder(folder_);
}

void PictureWriter::write(const PictureJob& job) {
  write(fmt::format("set_{:06}.png", job.set.number), draw_views(config_, job));
  ++written_;
}

void PictureWriter::write(const std::string& file_name, const cv::Mat& picture) const {
  write_png(folder_ / file_name, picture);
}

}  // namespace huetrack::pictures
