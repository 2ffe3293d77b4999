#include <fmt/core.h>
#include <openssl/evp.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/report/advice.h"
#include "calib/report/calibration_report.h"
#include "calib/report/html.h"
#include "calib/report/sentences.h"
#include "calib/report/volume_pictures.h"

namespace huetrack::report {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::string html_blue(double share) {
  const drawing::Color c = blue(share);
  return fmt::format("#{:02x}{:02x}{:02x}", c.r, c.g, c.b);
}

// 1, 2 or 5 times a power of ten, at most `value`.
double round_figure(double value) {
  if (!(value > 0)) return 1;
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double digit : {5.0, 2.0}) {
    if (digit * power <= value) return digit * power;
  }
  return power;
}

std::string arrow(const Vector2d& from, const Vector2d& to, const char* color, double width) {
  const Vector2d along = to - from;
  if (along.norm() < 0.5)
    return fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='1' fill='{}'/>", from.x(), from.y(), color);
  const Vector2d a = along.normalized(), n(-a.y(), a.x());
  const Vector2d left = to - 4 * a + 2.5 * n, right = to - 4 * a - 2.5 * n;
  return fmt::format(
      "<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='{}' stroke-width='{:.1f}'/><polygon "
      "points='{:.1f},{:.1f} {:.1f},{:.1f} {:.1f},{:.1f}' fill='{}'/>",
      from.x(), from.y(), to.x(), to.y(), color, width, to.x(), to.y(), left.x(), left.y(), right.x(), right.y(),
      color);
}

// Coverage by corners, and mean residuals.
std::string image_map(const CameraReport& camera) {
  const double width = 360, height = width * camera.image_size.height / camera.image_size.width;
  const double w = width / ImageGrid::columns, h = height / ImageGrid::rows;
  int most = 1;
  double longest = 0;
  for (std::size_t cell = 0; cell < camera.grid.corners.size(); ++cell) {
    most = std::max(most, camera.grid.corners[cell]);
    if (camera.grid.corners[cell] >= 5) longest = std::max(longest, camera.grid.mean_residual[cell].norm());
  }
  const double unit_px = std::max(0.02, round_figure(longest)), zoom = 0.8 * w / std::max(unit_px, longest);
  std::string svg = fmt::format("<svg width='{:.0f}' height='{:.0f}' viewBox='0 0 {:.0f} {:.0f}' role='img'>",
                                width + 2, height + 24, width + 2, height + 24);
  for (int row = 0; row < ImageGrid::rows; ++row) {
    for (int column = 0; column < ImageGrid::columns; ++column) {
      const auto cell = static_cast<std::size_t>(row * ImageGrid::columns + column);
      const int n = camera.grid.corners[cell];
      const std::string fill =
          n == 0 ? "#ffffff" : html_blue(0.08 + 0.5 * std::log1p(n) / std::log1p(static_cast<double>(most)));
      svg += fmt::format(
          "<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='{}' stroke='#c6ced8'><title>{} corners, "
          "mean residual ({:.3f}, {:.3f}) px; {} left out; direction of its pixels known to {:.2f} px</title></rect>",
          1 + column * w, 1 + row * h, w, h, fill, n, camera.grid.mean_residual[cell].x(),
          camera.grid.mean_residual[cell].y(), camera.grid.left_out[cell], camera.rays.sigma_px[cell]);
      if (camera.rays.image_px > 0)
        svg += fmt::format("<text x='{:.1f}' y='{:.1f}' fill='#5b6673' font-size='8'>{:.2g}</text>", 3 + column * w,
                           9 + row * h, camera.rays.sigma_px[cell]);
      if (camera.grid.left_out[cell] > 0)
        svg += fmt::format("<text x='{:.1f}' y='{:.1f}' fill='#b91c1c' font-size='8' text-anchor='end'>-{}</text>",
                           (column + 1) * w - 1, (row + 1) * h - 2, camera.grid.left_out[cell]);
    }
  }
  for (int row = 0; row < ImageGrid::rows; ++row) {
    for (int column = 0; column < ImageGrid::columns; ++column) {
      const auto cell = static_cast<std::size_t>(row * ImageGrid::columns + column);
      if (camera.grid.corners[cell] < 5) continue;
      const Vector2d from(1 + (column + 0.5) * w, 1 + (row + 0.5) * h);
      svg += arrow(from, from + zoom * camera.grid.mean_residual[cell], "#c2410c", 1.6);
    }
  }
  svg += arrow({4, height + 14}, {4 + zoom * unit_px, height + 14}, "#c2410c", 1.6);
  svg += fmt::format("<text x='{:.1f}' y='{:.1f}'>{:g} px</text></svg>", 10 + zoom * unit_px, height + 18, unit_px);
  return "<figure>" + svg +
         "<figcaption>Blue: where the board's corners were (white: never). Arrows: mean residuals; " +
         "with noise alone they are short and point in all directions. Grey: uncertainty of a pixel's direction, px "
         "(standard deviation). Red: outlier corners, left out.</figcaption></figure>";
}

// Every view as a point: distance and tilt.
std::string view_scatter(const CameraReport& camera) {
  if (camera.tilt_deg.empty()) return {};
  constexpr double width = 260, height = 200, left = 34, bottom = 26;
  const double farthest = 1.1 * *std::ranges::max_element(camera.distance_m);
  const auto x = [&](double m) { return left + (width - left - 6) * m / farthest; };
  const auto y = [&](double deg) { return (height - bottom) - (height - bottom - 6) * deg / 90; };
  std::string svg = fmt::format("<svg width='{:.0f}' height='{:.0f}' viewBox='0 0 {:.0f} {:.0f}' role='img'>", width,
                                height + 8, width, height + 8);
  for (const int deg : {0, 30, 60, 90}) {
    svg += fmt::format(
        "<line x1='{:.0f}' y1='{:.1f}' x2='{:.0f}' y2='{:.1f}' stroke='#dde2e8'/><text x='{:.0f}' y='{:.1f}' "
        "text-anchor='end'>{}°</text>",
        left, y(deg), width, y(deg), left - 4, y(deg) + 4, deg);
  }
  const double step = round_figure(farthest / 2);
  for (double m = 0; m <= farthest; m += step) {
    svg += fmt::format("<text x='{:.1f}' y='{:.0f}' text-anchor='middle'>{:g} m</text>", x(m), height - 8, m);
  }
  for (std::size_t k = 0; k < camera.tilt_deg.size(); ++k) {
    svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3' fill='#2563a8' fill-opacity='0.55'/>",
                       x(camera.distance_m[k]), y(camera.tilt_deg[k]));
  }
  return "<figure>" + svg +
         "</svg><figcaption>Each view: distance of the board, and its tilt against the line of sight. Good: points "
         "everywhere, up to 50°.</figcaption></figure>";
}

std::string lens_table(const CameraReport& camera) {
  std::string out = "<table><tr><th>" + std::string(solver::name(camera.lens)) +
                    "</th><th class=n>value</th><th class=n>+-</th></tr>";
  for (int i = 0; i < solver::parameter_count(camera.lens); ++i) {
    const int digits = i < 4 ? 2 : 5;  // of pixels, of distortion coefficients
    out += fmt::format("<tr><td>{}</td><td class=n>{:.{}f}</td><td class=n>{:.{}f}</td></tr>",
                       solver::parameter_name(camera.lens, i), camera.parameters(i), digits, camera.sigma(i), digits);
  }
  return out + "</table>";
}

std::string trials_table(const CameraReport& camera) {
  if (camera.trials.size() < 2) return {};
  std::string out =
      "<table><tr><th>lens model</th><th class=n>rms of its views</th><th class=n>corners left out</th><th class=n>log "
      "evidence</th><th></th></tr>";
  const double most = std::ranges::max(camera.trials, {}, [](const solver::LensTrial& trial) {
                        return trial.possible ? trial.log_evidence : -1e300;
                      }).log_evidence;
  for (const solver::LensTrial& trial : camera.trials) {
    out += fmt::format("<tr><td>{}</td><td class=n>{:.3f}</td><td class=n>{}</td><td class=n>",
                       solver::name(trial.lens), trial.rms_px, trial.left_out);
    out += trial.possible ? fmt::format("{:.1f}", trial.log_evidence - most) : std::string("-");
    out += "</td><td>" + escaped(trial.possible ? std::string() : with_advice(solver::reasons_of(trial))) +
           (trial.lens == camera.lens ? "<b>chosen</b>" : "") + "</td></tr>";
  }
  return out + "</table>";
}

std::string picture(const solver::BoardView& view, const solver::ViewFit& fit, const CameraReport& camera,
                    const PictureOf& picture_of) {
  const EmbeddedPicture* picture = picture_of ? picture_of(view.camera, view.image) : nullptr;
  constexpr double width = 340;
  const double zoom = width / camera.image_size.width, height = zoom * camera.image_size.height;
  std::string svg = fmt::format("<svg width='{:.0f}' height='{:.0f}' viewBox='0 0 {:.0f} {:.0f}' role='img'>", width,
                                height, width, height);
  if (picture) {
    svg += fmt::format("<image width='{:.0f}' height='{:.0f}' href='", width, height) + data_uri(picture->jpeg) + "'/>";
  } else {
    svg += fmt::format("<rect width='{:.0f}' height='{:.0f}' fill='#e9edf1'/>", width, height);
  }
  constexpr double magnified = 30;
  for (std::size_t k = 0; k < view.px.size(); ++k) {
    const Vector2d at = zoom * (view.px[k] + Vector2d(0.5, 0.5));
    const Vector2d residual = fit.residuals[k].norm() < 1e5 ? fit.residuals[k] : Vector2d(0, 0);
    const Vector2d end = at + zoom * magnified * residual.normalized() * std::min(residual.norm(), 4.0);
    const char* color = fit.used[k] ? "#22c55e" : "#ef4444";
    svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='2' fill='none' stroke='{}'/>", at.x(), at.y(), color);
    if (residual.norm() > 0.01)
      svg += fmt::format("<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='#facc15' stroke-width='1.2'/>",
                         at.x(), at.y(), end.x(), end.y());
  }
  if (!view.px.empty()) {
    const Vector2d at = zoom * (view.px.front() + Vector2d(0.5, 0.5));
    svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='5' fill='none' stroke='#ec4899' stroke-width='2'/>", at.x(),
                       at.y());
  }
  return "<figure>" + svg + "</svg><figcaption>" + escaped(view.image) + ": " +
         fmt::format("{:.2f} px rms", fit.rms_px) +
         (view.blur_px > 0 ? fmt::format(", edges blurred by {:.1f} px", view.blur_px) : std::string()) +
         (fit.dropped ? "; <b>dropped</b>: " + escaped(dropped_text(*fit.dropped)) : std::string()) +
         "</figcaption></figure>";
}

// The rig from above: x to the right, y up.
std::string plan(const CalibrationReport& report) {
  Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  const auto include = [&](const Vector3d& p) {
    low = low.cwiseMin(p.head<2>());
    high = high.cwiseMax(p.head<2>());
  };
  for (const CameraReport& camera : report.cameras) include(camera.centre);
  for (const auto& [set, centre] : report.board_centres) include(centre);
  include(report.volume->box.low);
  include(report.volume->box.high);
  const double size = std::max(0.1, (high - low).maxCoeff());
  low -= Vector2d::Constant(0.14 * size);
  high += Vector2d::Constant(0.14 * size);
  const double zoom = std::min(460 / (high.x() - low.x()), 420 / (high.y() - low.y()));
  const double width = zoom * (high.x() - low.x()), height = zoom * (high.y() - low.y());
  const auto at = [&](const Vector2d& p) { return Vector2d(zoom * (p.x() - low.x()), zoom * (high.y() - p.y())); };
  std::string svg = fmt::format(
      "<svg width='{:.0f}' height='{:.0f}' viewBox='0 0 {:.0f} {:.0f}' role='img'><rect width='{:.0f}' height='{:.0f}' "
      "fill='#f6f8fa'/>",
      width, height, width, height, width, height);
  const Vector2d corner = at({report.volume->box.low.x(), report.volume->box.high.y()});
  const Vector3d extent = report.volume->box.high - report.volume->box.low;
  svg += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='#dbeafe' stroke='#93b4dd'/>",
                     corner.x(), corner.y(), zoom * extent.x(), zoom * extent.y());
  for (const auto& [set, centre] : report.board_centres) {
    const Vector2d p = at(centre.head<2>());
    svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='2.5' fill='#2563a8' fill-opacity='0.5'/>", p.x(), p.y());
  }
  for (const CameraReport& camera : report.cameras) {
    const calib::CameraModel model = solver::camera_model(camera.lens, camera.parameters);
    const Vector2d p = at(camera.centre.head<2>());
    std::string points = fmt::format("{:.1f},{:.1f}", p.x(), p.y());
    for (const double u : {0.0, camera.image_size.width - 1.0}) {
      const auto ray = model.ray({{u, camera.image_size.height / 2.0}});
      if (!ray) continue;
      const Vector3d direction = camera.cam_from_world->rotation.conjugate() * *ray;
      const Vector2d end = at(camera.centre.head<2>() + 0.3 * size * direction.head<2>());
      points += fmt::format(" {:.1f},{:.1f}", end.x(), end.y());
    }
    svg += "<polygon points='" + points + "' fill='#c2410c' fill-opacity='0.12' stroke='#c2410c'/>";
    svg += fmt::format(
        "<circle cx='{:.1f}' cy='{:.1f}' r='4' fill='#c2410c'/><text x='{:.1f}' y='{:.1f}' font-weight='600'>{}</text>",
        p.x(), p.y(), p.x() + 7, p.y() - 6, escaped(camera.name));
  }
  const Vector2d origin = at({0, 0});
  svg += arrow(origin, at({0.1 * size, 0}), "#b3261e", 2) + arrow(origin, at({0, 0.1 * size}), "#1a7f4b", 2);
  const double bar = round_figure(0.3 * size);
  svg += fmt::format(
      "<line x1='10' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='#1b2430' stroke-width='2'/><text x='10' "
      "y='{:.1f}'>{:g} m</text>",
      height - 10, 10 + zoom * bar, height - 10, height - 15, bar);
  return "<figure>" + svg +
         "</svg><figcaption>From above: cameras and what they see, the board's places, the volume of the maps, the "
         "world's origin with x (red) and y (green).</figcaption></figure>";
}

std::string slices(const solver::VolumeAccuracy& volume) {
  std::vector<double> all;
  for (const solver::PointAccuracy& point : volume.points) {
    if (point.views >= 2) all.push_back(1000 * point.total_m);
  }
  if (all.empty()) return "<p>No point of the volume is seen by two cameras.</p>";
  std::ranges::sort(all);
  const double low = all.front(), high = all[static_cast<std::size_t>(0.95 * static_cast<double>(all.size() - 1))];
  const Vector3d extent = volume.box.high - volume.box.low;
  const double zoom = 300 / std::max({extent.x(), extent.y(), 1e-6});
  const double w = std::max(4.0, zoom * extent.x() / volume.steps[0]),
               h = std::max(4.0, zoom * extent.y() / volume.steps[1]);
  std::string out = "<div class=row>";
  for (const int iz : {0, volume.steps[2] / 2, volume.steps[2] - 1}) {
    std::string svg =
        fmt::format("<svg width='{:.0f}' height='{:.0f}' role='img'>", w * volume.steps[0], h * volume.steps[1]);
    for (int iy = 0; iy < volume.steps[1]; ++iy) {
      for (int ix = 0; ix < volume.steps[0]; ++ix) {
        const solver::PointAccuracy& point = volume.at(ix, iy, iz);
        const std::string fill =
            point.views < 2 ? "#e5e7eb"
                            : html_blue((1000 * point.total_m - low) / std::max(1e-9, high - low) * 0.9 + 0.05);
        svg += fmt::format(
            "<rect x='{:.1f}' y='{:.1f}' width='{:.2f}' height='{:.2f}' fill='{}'><title>({:.2f}, {:.2f}, {:.2f}) m: ",
            ix * w, (volume.steps[1] - 1 - iy) * h, w + 0.3, h + 0.3, fill, point.p_world.x(), point.p_world.y(),
            point.p_world.z());
        svg += point.views < 2
                   ? fmt::format("{} camera</title></rect>", point.views)
                   : fmt::format("{:.2f} mm, of that {:.2f} mm by the calibration; {} cameras</title></rect>",
                                 1000 * point.total_m, 1000 * point.by_calibration_m, point.views);
      }
    }
    out += "<figure>" + svg +
           fmt::format("</svg><figcaption>z = {:.2f} m</figcaption></figure>", volume.at(0, 0, iz).p_world.z());
  }
  std::string legend = "<svg width='84' height='190' role='img'>";
  for (int i = 0; i < 40; ++i) {
    legend += fmt::format("<rect x='0' y='{:.1f}' width='18' height='4.2' fill='{}'/>", 4 + i * 4.0,
                          html_blue(0.95 - 0.9 * i / 39));
  }
  legend += fmt::format(
      "<text x='24' y='14'>{:.1f} mm</text><text x='24' y='164'>{:.1f} mm</text><rect x='0' y='172' width='18' "
      "height='12' fill='#e5e7eb'/><text x='24' y='182'>unseen</text></svg>",
      high, low);
  return out + "<figure>" + legend + "</figure></div>";
}

std::string todo(const CalibrationReport& report) {
  std::string out;
  for (const Check& check : report.checks) {
    if (check.verdict == Verdict::usable) continue;
    out += fmt::format("<li class={}><b>{}</b>.<br>", name(check.verdict), escaped(check.finding)) +
           escaped(check.advice) + (check.advice.ends_with('?') ? "</li>" : ".</li>");
  }
  return out.empty() ? out : "<ul class=todo>" + out + "</ul>";
}

std::string camera_table(const CalibrationReport& report) {
  const bool posed = report.cameras.front().cam_from_world.has_value();
  std::string out =
      "<table><tr><th>camera</th><th class=n>rms px</th><th class=n>views used</th><th class=n>board found</th><th "
      "class=n>coverage</th><th>lens</th><th class=n>f px</th>";
  if (posed) out += "<th class=n>position mm</th><th class=n>rotation °</th><th class=n>at x, y, z m</th>";
  out += "</tr>";
  for (const CameraReport& c : report.cameras) {
    out += fmt::format("<tr><td>{}</td><td class=n>{:.3f}</td><td class=n>{}</td><td class=n>", escaped(c.name),
                       c.rms_px, c.views_used);
    out += c.pictures > 0 ? fmt::format("{} of {}", c.boards, c.pictures) : std::string("-");
    if (c.motion_blurred > 0) out += fmt::format(", {} blurred by motion", c.motion_blurred);
    out += fmt::format("</td><td class=n>{:.0f} %</td><td>{}</td><td class=n>{:.1f} +- {:.1f}</td>", 100 * c.coverage,
                       solver::name(c.lens), c.parameters(0), c.sigma(0));
    if (posed) {
      out += fmt::format("<td class=n>+- {:.2f}</td><td class=n>+- {:.4f}</td>", 1000 * c.centre_sigma_m,
                         c.rotation_sigma_rad * 180 / std::numbers::pi);
      out += fmt::format("<td class=n>{:.3f}, {:.3f}, {:.3f}</td>", c.centre.x(), c.centre.y(), c.centre.z());
    }
    out += "</tr>";
  }
  return out + "</table>";
}

std::string pair_table(const CalibrationReport& report) {
  std::string out =
      "<table><tr><th>pair</th><th class=n>shared views</th><th class=n>rms px</th><th class=n>distance lens to "
      "lens</th></tr>";
  for (const PairReport& pair : report.pairs) {
    out += fmt::format("<tr><td>{} - {}</td><td class=n>{}</td><td class=n>",
                       escaped(report.cameras[static_cast<std::size_t>(pair.a)].name),
                       escaped(report.cameras[static_cast<std::size_t>(pair.b)].name), pair.shared_sets);
    out += pair.shared_sets > 0 ? fmt::format("{:.3f}", pair.rms_px) : std::string("-");
    out +=
        fmt::format("</td><td class=n>{:.3f} m +- {:.1f} mm</td></tr>", pair.distance_m, 1000 * pair.distance_sigma_m);
  }
  return out + "</table>";
}

std::string verdict_banner(const CalibrationReport& report) {
  const auto bad = std::ranges::count_if(report.checks, [](const Check& c) { return c.verdict != Verdict::usable; });
  std::string text = report.verdict == Verdict::usable     ? "<b>Usable.</b> "
                     : report.verdict == Verdict::doubtful ? "<b>Doubtful.</b> "
                                                           : "<b>Failed: do not use it.</b> ";
  if (bad > 0)
    text += fmt::format("{} of {} checks speak against it. ", static_cast<int>(bad),
                        static_cast<int>(report.checks.size()));
  text += fmt::format("Corners fit to {:.2f} px rms", report.rms_px);
  if (report.volume && report.volume->covered > 0) {
    text += fmt::format(
        "; error of points due to the calibration {:.2f} mm (95 %: {:.2f} mm), of an object seen to {:.1f} px {:.1f} "
        "mm",
        1000 * report.volume->median_by_calibration_m, 1000 * report.volume->p95_by_calibration_m,
        report.volume->object_noise_px, 1000 * report.volume->median_total_m);
  }
  return fmt::format("<div class='verdict {}'>", name(report.verdict)) + text + ".</div>";
}

}  // namespace

std::string data_uri(const std::vector<std::uint8_t>& bytes) {
  std::string base64((bytes.size() + 2) / 3 * 4 + 1, '\0');
  ::EVP_EncodeBlock(reinterpret_cast<unsigned char*>(base64.data()), bytes.data(), static_cast<int>(bytes.size()));
  base64.pop_back();  // the terminating zero
  return "data:image/jpeg;base64," + base64;
}

std::string to_html(const CalibrationReport& report, const PictureOf& picture_of) {
  std::string out = html_head(report.title) + "<h1>" + escaped(report.title) + "</h1><p class=soft>" +
                    escaped(report.board) + fmt::format("; {} moments</p>\n", report.sets);
  out += verdict_banner(report) + todo(report);
  out += "\n<h2>Cameras</h2>" + camera_table(report);
  if (!report.lens_reason.empty()) out += "<p>Lenses: " + escaped(report.lens_reason) + ".</p>";
  if (report.volume) {
    const solver::VolumeAccuracy& v = *report.volume;
    const Vector3d size = v.box.high - v.box.low;
    out +=
        "\n<h2>Does it agree with a tape measure?</h2><p>The images do not contain the board's true size. Measure "
        "between two lenses:</p>" +
        pair_table(report);
    out += fmt::format(
        "\n<h2>Expected accuracy</h2><p>In {:.2f} x {:.2f} x {:.2f} m of the world (x {:.2f} to {:.2f}, y {:.2f} to "
        "{:.2f}, z {:.2f} to {:.2f}), the calibration itself misplaces points by {:.2f} mm (median; 95 %: {:.2f} mm), "
        "after the best rigid alignment. For an object whose centre is measured to {:.1f} px it is {:.2f} mm ({:.2f} "
        "mm). Two or more cameras see {:.0f} % of the volume. The slices show the latter; standard deviation of the "
        "position.</p>",
        size.x(), size.y(), size.z(), v.box.low.x(), v.box.high.x(), v.box.low.y(), v.box.high.y(), v.box.low.z(),
        v.box.high.z(), 1000 * v.median_by_calibration_m, 1000 * v.p95_by_calibration_m, v.object_noise_px,
        1000 * v.median_total_m, 1000 * v.p95_total_m, 100 * v.covered);
    out += slices(v) + "<h3>The rig</h3>" + plan(report);
  }
  for (std::size_t c = 0; c < report.cameras.size(); ++c) {
    const CameraReport& camera = report.cameras[c];
    out += "\n<h2>" + escaped(camera.name) + "</h2>";
    if (!camera.lens_reason.empty()) out += "<p>" + escaped(camera.lens_reason) + ".</p>";
    if (!camera.timing.empty()) out += "<p>Timing: " + escaped(camera.timing) + ".</p>";
    out += "<div class=row>" + image_map(camera) + view_scatter(camera) + "<div>" + lens_table(camera) + "</div></div>";
    if (camera.trials.size() > 1)
      out += "<details><summary>Lens models that were tried</summary>" + trials_table(camera) + "</details>";
    std::string pictures;
    for (std::size_t v = 0; v < report.shown.size(); ++v) {
      if (report.shown[v].camera == static_cast<int>(c))
        pictures += picture(report.shown[v], report.shown_fits[v], camera, picture_of);
    }
    if (!pictures.empty()) {
      out +=
          "<h3>Views</h3><p class=soft>The two that fit worst, one in the middle, and dropped ones. Green: corners "
          "that are used, red: not; yellow: the residual, 30 times as long; pink: the first corner.</p><div "
          "class=row>" +
          pictures + "</div>";
    }
  }
  if (!report.dropped.empty()) {
    out += "\n<h2>Views that were dropped</h2><table>";
    for (const DroppedView& view : report.dropped) {
      out += "<tr><td>" + escaped(report.cameras[static_cast<std::size_t>(view.camera)].name) + "</td><td>" +
             escaped(view.image) + "</td><td>" + escaped(view.why) + "</td></tr>";
    }
    out += "</table>";
  }
  out += "\n<h2>All checks</h2><table>";
  for (const Check& check : report.checks) {
    out += fmt::format("<tr><td class={}>{}</td><td>", name(check.verdict), name(check.verdict)) + escaped(check.name) +
           "</td><td>" + escaped(check.finding) + "</td></tr>";
  }
  out += "</table>";
  if (!report.made_of.empty()) {
    out += "\n<h2>How it was made</h2><table>";
    for (const auto& [key, value] : report.made_of)
      out += "<tr><td>" + escaped(key) + "</td><td>" + escaped(value) + "</td></tr>";
    out += "</table>";
  }
  return out + "\n</body></html>\n";
}

}  // namespace huetrack::report
