#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "drawing/axes.h"
#include "pictures/canvas_image.h"
#include "pictures/oblique.h"
#include "pictures/pictures.h"

namespace huetrack::pictures {

using namespace drawing;

namespace {

using Eigen::Vector3d;
using object_tracking::ObjectEstimate;

constexpr Color paper{252, 252, 250}, floor_color{243, 245, 248}, shadow_color{214, 217, 222}, glass{96, 120, 170};
constexpr Color truth_color{70, 76, 86}, coasting_color{232, 130, 0}, bad_color{206, 44, 44};
constexpr double name_size = 14, figures_size = 12.5, label_size = 11;
constexpr double page_margin = 36;

// Drawing data of one target.
struct Target {
  std::string name;
  Color color;
  std::span<const ObjectEstimate> track;
  std::span<const tracks::Truth::Sample> truth;
  std::vector<Point> errors;  // seconds, millimetres
  double rms_mm = 0;          // after lock; 0: never
  std::string figures;        // in words
};

Target target_of(const object_tracking::TargetOptions& options, std::span<const ObjectEstimate> track,
                 const tracks::Truth* truth) {
  Target target{options.name, color_of(options.color, 0.85, 0.72), track, {}, {}, 0, ""};
  const auto share = [&](object_tracking::TrackState state) {
    const auto count = std::ranges::count(track, state, &ObjectEstimate::state);
    return track.empty() ? 0.0 : 100.0 * double(count) / double(track.size());
  };
  // With several objects, each has an estimate per frame set.
  target.figures =
      fmt::format("{} {}: tracking {:.0f} %, coasting {:.0f} %", track.size(),
                  options.count > 1 ? "estimates of its objects" : "frame sets",
                  share(object_tracking::TrackState::tracking), share(object_tracking::TrackState::coasting));
  if (truth == nullptr || !truth->targets().contains(options.name)) return target;
  target.truth = truth->targets().find(options.name)->second;
  tracks::TruthComparison comparison(*truth, options.name);
  for (const ObjectEstimate& e : track)
    if (const auto error_m = comparison.add(e)) target.errors.emplace_back(capture::seconds(e.at), 1e3 * *error_m);
  const tracks::TruthFigures f = comparison.figures();
  target.rms_mm = 1e3 * f.rms_m;
  target.figures += f.lock_set ? fmt::format("; locked in set {}; error after it {:.1f} mm rms, {:.1f} mm at most",
                                             *f.lock_set, 1e3 * f.rms_m, 1e3 * f.max_m)
                               : "; never locked";
  return target;
}

// The track in the colours of its states. at: maps an estimate to a point.
template <typename At>
void draw_track(Canvas& canvas, const Target& target, double width, At&& at) {
  std::vector<Point> run;
  Color color = target.color;
  const auto finish = [&] {
    if (run.size() > 1) canvas.polyline(run, color, width);
    run.clear();
  };
  const ObjectEstimate* before = nullptr;
  for (const ObjectEstimate& e : target.track) {
    const Color next = e.state == object_tracking::TrackState::tracking ? target.color : coasting_color;
    if (before != nullptr && before->object != e.object) finish(), before = nullptr;  // the track of another object
    if (!e.has_position() || before == nullptr || next != color) finish();
    if (e.has_position() && before != nullptr && run.empty()) run.push_back(at(*before));
    if (e.has_position()) run.push_back(at(e));
    color = next;
    before = e.has_position() ? &e : nullptr;
  }
  finish();
}

// ---------------------------------------------------------------------------------------------------------------------
// The scene in 3-D

class World {
 public:
  World(Canvas& canvas, const config::ServiceConfig& config, std::span<const Target> targets, const Box& area)
      : canvas_(canvas), rig_(config.rig), box_(config.object_tracking.volume), oblique_(from_behind_the_cameras()) {
    Eigen::Vector2d low = oblique_.flat(corner(0)), high = low;
    const auto include = [&](const Vector3d& p) {
      low = low.cwiseMin(oblique_.flat(p));
      high = high.cwiseMax(oblique_.flat(p));
    };
    for (int i = 0; i < 8; ++i) include(corner(i));
    for (const auto& camera : rig_.cameras) {
      include(camera.centre());
      for (const Vector3d& p : frustum(camera)) include(p);
    }
    oblique_.fit(low, high, {area.x + 60, area.y + 30, area.width - 120, area.height - 90});
    draw_volume();
    draw_labels();
    for (const auto& camera : rig_.cameras) draw_camera(camera);
    for (const Target& target : targets) draw_shadow(target);  // on the floor, shows the depth
    for (const Target& target : targets) draw_target(target);
  }

 private:
  static constexpr double frustum_m = 0.32;  // depth of drawn cameras

  // From the side opposite to the cameras, turned so that neither horizontal axis is seen end on.
  Oblique from_behind_the_cameras() const {
    Vector3d cameras_at = Vector3d::Zero();
    for (const auto& camera : rig_.cameras) cameras_at += (camera.centre() - (box_.min + box_.max) / 2).normalized();
    const double camera_azimuth_deg = std::atan2(cameras_at.y(), cameras_at.x()) * 180 / std::numbers::pi;
    return Oblique::from(std::floor((camera_azimuth_deg + 180) / 90) * 90 + 33, 24);
  }

  static std::vector<Vector3d> frustum(const calib::Camera& camera) {
    std::vector<Vector3d> corners;
    const calib::Rigid3d world_from_cam = calib::inverse(camera.cam_from_world);
    const double w = camera.image_size.width - 0.5, h = camera.image_size.height - 0.5;
    for (const auto& px : {Point(-0.5, -0.5), Point(w, -0.5), Point(w, h), Point(-0.5, h)}) {
      if (const auto ray = camera.model.ray(calib::RawPixel{px}))
        corners.push_back(world_from_cam * (*ray * (frustum_m / std::max(ray->z(), 0.2))));
    }
    return corners;
  }

  Vector3d corner(int i) const {  // bits: x, y, z
    return {(i & 1) ? box_.max.x() : box_.min.x(), (i & 2) ? box_.max.y() : box_.min.y(),
            (i & 4) ? box_.max.z() : box_.min.z()};
  }
  Point on_floor(double x, double y) const { return oblique_(Vector3d(x, y, box_.min.z())); }
  double floor_step() const { return drawing::tick_step((box_.max - box_.min).head<2>().maxCoeff(), 8); }

  void draw_volume() {
    canvas_.polygon(std::vector{oblique_(corner(0)), oblique_(corner(1)), oblique_(corner(3)), oblique_(corner(2))},
                    floor_color);
    drawing::for_each_tick({box_.min.x(), box_.max.x()}, floor_step(), [&](double x) {
      canvas_.line(on_floor(x, box_.min.y()), on_floor(x, box_.max.y()), grid, 1);
    });
    drawing::for_each_tick({box_.min.y(), box_.max.y()}, floor_step(), [&](double y) {
      canvas_.line(on_floor(box_.min.x(), y), on_floor(box_.max.x(), y), grid, 1);
    });
    for (int i = 0; i < 8; ++i)
      for (const int bit : {1, 2, 4})
        if ((i & bit) == 0) canvas_.line(oblique_(corner(i)), oblique_(corner(i | bit)), rule, 1.2);
  }

  // Ticks are on the three edges nearest to the viewer; z on the leftmost vertical edge.
  void draw_labels() {
    const bool far_x_is_near = oblique_.towards.x() > 0, far_y_is_near = oblique_.towards.y() > 0;
    const double near_x = far_x_is_near ? box_.max.x() : box_.min.x(),
                 near_y = far_y_is_near ? box_.max.y() : box_.min.y();
    const Point away_from_y = outward({0, far_y_is_near ? 1.0 : -1.0, 0}),
                away_from_x = outward({far_x_is_near ? 1.0 : -1.0, 0, 0});
    int left_edge = 0;
    for (int i = 1; i < 4; ++i)
      if (oblique_(corner(i)).x() < oblique_(corner(left_edge)).x()) left_edge = i;
    const Vector3d foot = corner(left_edge);
    const auto is_foot = [&](const Point& p) { return (p - oblique_(foot)).norm() < 1; };  // it has a z label

    const double step = floor_step(), z_step = drawing::tick_step(box_.max.z() - box_.min.z(), 8);
    drawing::for_each_tick({box_.min.x(), box_.max.x()}, step, [&](double x) {
      if (const Point p = on_floor(x, near_y); !is_foot(p)) tick(p, away_from_y, drawing::tick_label(x, step));
    });
    drawing::for_each_tick({box_.min.y(), box_.max.y()}, step, [&](double y) {
      if (const Point p = on_floor(near_x, y); !is_foot(p)) tick(p, away_from_x, drawing::tick_label(y, step));
    });
    drawing::for_each_tick({box_.min.z(), box_.max.z()}, z_step, [&](double z) {
      tick(oblique_({foot.x(), foot.y(), z}), {-1, 0}, drawing::tick_label(z, z_step));
    });
    const auto title = [&](const Point& at, const char* text) {
      canvas_.text(at, text, name_size, ink, Align::centre, Weight::bold);
    };
    title(on_floor((box_.min.x() + box_.max.x()) / 2, near_y) + 62 * away_from_y, "x, m");
    title(on_floor(near_x, (box_.min.y() + box_.max.y()) / 2) + 62 * away_from_x, "y, m");
    title(oblique_(corner(left_edge | 4)) + Point(-12, -12), "z, m");
  }

  void tick(const Point& p, const Point& away, const std::string& label) {
    canvas_.line(p, p + 5 * away, muted, 1);
    canvas_.text(p + 13 * away + Point(0, 4), label, label_size, muted,
                 away.x() < -0.3  ? Align::right
                 : away.x() > 0.3 ? Align::left
                                  : Align::centre);
  }

  // In the picture, away from the box.
  Point outward(const Vector3d& direction) const {
    const Point d = oblique_(direction) - oblique_(Vector3d::Zero());
    return d / std::max(1e-9, d.norm());
  }

  void draw_camera(const calib::Camera& camera) {
    std::vector<Point> front;
    for (const Vector3d& p : frustum(camera)) front.push_back(oblique_(p));
    const Point centre = oblique_(camera.centre());
    if (front.size() == 4) canvas_.polygon(front, glass.faded(0.18));
    canvas_.polyline(front, glass, 1.4, true);
    for (const Point& p : front) canvas_.line(centre, p, glass, 1.4);
    canvas_.disc(centre, 3.2, glass);
    canvas_.text(centre + Point(0, -14), camera.name, name_size, glass, Align::centre, Weight::bold);
  }

  void draw_shadow(const Target& target) {
    std::vector<Point> run;
    for (const ObjectEstimate& e : target.track) {
      if (e.has_position()) {
        run.push_back(on_floor(e.position.x(), e.position.y()));
      } else if (!run.empty()) {
        canvas_.polyline(run, shadow_color, 2);
        run.clear();
      }
    }
    canvas_.polyline(run, shadow_color, 2);
  }

  void draw_target(const Target& target) {
    draw_track(canvas_, target, 3.4, [&](const ObjectEstimate& e) { return oblique_(e.position); });
    std::vector<Point> truth;
    for (const auto& sample : target.truth) truth.push_back(oblique_(sample.position));
    canvas_.polyline(truth, truth_color, 1.2);
    const auto first = std::ranges::find_if(target.track, &ObjectEstimate::has_position);
    if (first == target.track.end()) return;
    const auto last = std::ranges::find_if(target.track.rbegin(), target.track.rend(), &ObjectEstimate::has_position);
    const Point start = oblique_(first->position), end = oblique_(last->position);
    canvas_.disc(start, 5.5, target.color);
    canvas_.disc(start, 3.2, white);
    canvas_.disc(end, 5.5, target.color);
    canvas_.rimmed_text(start + Point(9, 18), "start", figures_size, ink, white);
    canvas_.rimmed_text(end + Point(9, -10), "end", figures_size, ink, white);
  }

  Canvas& canvas_;
  const calib::CameraRig& rig_;
  const object_tracking::Volume& box_;
  Oblique oblique_;
};

// ---------------------------------------------------------------------------------------------------------------------
// Over time

constexpr double plot_left = 1180, plot_gap = 36, error_height = 210;

void draw_coordinate(Canvas& canvas, const Axes& axes, std::span<const Target> targets, int axis, bool has_x_labels) {
  draw_axes(canvas, axes, {fmt::format("{}, m", "xyz"[axis]), has_x_labels, has_x_labels ? "t, s" : ""});
  const drawing::Canvas::Clip clip(canvas, axes.box);
  for (const Target& target : targets) {
    draw_track(canvas, target, 3,
               [&](const ObjectEstimate& e) { return axes(capture::seconds(e.at), e.position[axis]); });
    std::vector<Point> truth;
    for (const auto& sample : target.truth) truth.push_back(axes(capture::seconds(sample.at), sample.position[axis]));
    canvas.polyline(truth, truth_color, 1.2);
  }
}

void draw_errors(Canvas& canvas, const Box& box, const drawing::Span& time, std::span<const Target> targets) {
  constexpr double longest_gap_s = 0.2;
  // Up to nearly all errors; the few larger ones are clipped and marked.
  std::vector<double> all;
  for (const Target& target : targets)
    for (const Point& error : target.errors) all.push_back(error.y());
  std::ranges::sort(all);
  const double high = std::max(5.0, 1.25 * all[std::size_t(0.98 * double(all.size() - 1))]);
  const Axes axes{box, time, {0, high}};
  draw_axes(canvas, axes, {"error, mm", true, "t, s"});
  for (const Target& target : targets) {
    std::vector<Point> inside, beyond, run;
    for (std::size_t k = 0; k < target.errors.size(); ++k) {
      const Point& error = target.errors[k];
      const Point at = axes(error.x(), std::min(high, error.y()));
      (error.y() > high ? beyond : inside).push_back(at);
      if (k > 0 && error.x() - target.errors[k - 1].x() >= longest_gap_s) {
        canvas.polyline(run, target.color, 1.4);
        run.clear();
      }
      run.push_back(at);
    }
    canvas.polyline(run, target.color, 1.4);
    canvas.discs(inside, 2.2, target.color);
    canvas.discs(beyond, 3.4, bad_color);
  }
  double labels = 0;
  for (const Target& target : targets) {
    if (!(target.rms_mm > 0 && target.rms_mm < high)) continue;
    canvas.dashed(axes(time.low, target.rms_mm), axes(time.high, target.rms_mm), ink, 1.3);
    canvas.rimmed_text(axes(time.high, target.rms_mm) + Point(-6 - 90 * labels++, -6),
                       fmt::format("rms {:.1f}", target.rms_mm), figures_size, ink, white, Align::right);
  }
  if (all.back() > high)
    canvas.text({box.x + box.width, box.y - 8}, fmt::format("red: outside the scale, up to {:.0f} mm", all.back()),
                label_size, bad_color, Align::right);
}

void draw_over_time(Canvas& canvas, const object_tracking::Volume& volume, std::span<const Target> targets,
                    double top) {
  drawing::Span time;
  for (const Target& target : targets)
    for (const ObjectEstimate& e : target.track) time.add(capture::seconds(e.at));
  if (!(time.high > time.low)) time = {0, 1};
  const bool has_error = std::ranges::any_of(targets, [](const Target& t) { return !t.errors.empty(); });
  const double width = canvas.width() - page_margin - plot_left;
  const double height = (canvas.height() - top - 70 - (has_error ? error_height + 66 : 0)) / 3 - plot_gap;
  double y = top + 26;
  for (int axis = 0; axis < 3; ++axis, y += height + plot_gap)
    draw_coordinate(canvas, {{plot_left, y, width, height}, time, {volume.min[axis], volume.max[axis]}}, targets, axis,
                    axis == 2 && !has_error);
  if (has_error) draw_errors(canvas, {plot_left, y + 16, width, error_height}, time, targets);
}

void draw_keys(Canvas& canvas, std::span<const Target> targets) {
  double x = canvas.width() - page_margin;
  const auto key = [&](const std::string& text, Color color, double width) {
    canvas.text({x, 50}, text, figures_size, ink, Align::right);
    x -= canvas.text_width(text, figures_size);
    canvas.line({x - 34, 46}, {x - 8, 46}, color, width);
    x -= 54;
  };
  if (std::ranges::any_of(targets, [](const Target& t) { return !t.truth.empty(); })) key("truth", truth_color, 1.4);
  key("coasting", coasting_color, 3.5);
  key("tracking: the target's colour", targets.front().color, 3.5);
}

}  // namespace

cv::Mat draw_track_3d(const config::ServiceConfig& config, const std::string& title,
                      const std::vector<std::vector<ObjectEstimate>>& tracks, const tracks::Truth* truth) {
  std::vector<Target> targets;
  for (std::size_t i = 0; i < tracks.size(); ++i) targets.push_back(target_of(config.targets[i], tracks[i], truth));
  Canvas canvas(1760, 1120, paper);
  canvas.text({page_margin, 50}, title, 23, ink, Align::left, Weight::bold);
  draw_keys(canvas, targets);
  double y = 84;
  for (const Target& target : targets) {
    canvas.line({page_margin + 2, y - 5}, {page_margin + 26, y - 5}, target.color, 4);
    canvas.text({page_margin + 36, y}, target.name, name_size, ink, Align::left, Weight::bold);
    canvas.text({page_margin + 50 + canvas.text_width(target.name, name_size, Weight::bold), y}, target.figures,
                name_size, ink);
    y += 26;
  }
  const double top = y + 6;
  World(canvas, config, targets, {page_margin, top, 1060, canvas.height() - top - 20});
  draw_over_time(canvas, config.object_tracking.volume, targets, top);
  return image_of(canvas);
}

}  // namespace huetrack::pictures
