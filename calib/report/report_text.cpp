#include <fmt/core.h>

#include <algorithm>
#include <numbers>

#include "calib/report/calibration_report.h"

namespace huetrack::report {
namespace {

// begins_a_report() recognises a report by these.
constexpr std::string_view usable_words = "USABLE: nothing speaks against it",
                           doubtful_words = "DOUBTFUL: ", failed_words = "FAILED: do not use it";

std::string verdict_line(const CalibrationReport& report) {
  if (report.verdict == Verdict::usable) return std::string(usable_words);
  if (report.verdict == Verdict::failed) return std::string(failed_words);
  const auto bad = std::ranges::count_if(report.checks, [](const Check& c) { return c.verdict != Verdict::usable; });
  return fmt::format("{}{} thing{} against it", doubtful_words, bad, bad == 1 ? " speaks" : "s speak");
}

}  // namespace

bool begins_a_report(std::string_view text) {
  const auto title_end = text.find("\n\n");
  if (title_end == std::string_view::npos) return false;
  const std::string_view verdict = text.substr(title_end + 2);
  return verdict.starts_with(usable_words) || verdict.starts_with(doubtful_words) || verdict.starts_with(failed_words);
}

std::string summary(const CalibrationReport& report) {
  std::string text = fmt::format("corners fit to {:.2f} px rms", report.rms_px);
  if (report.volume && report.volume->covered > 0)
    text += fmt::format(", expected error of points {:.2g} mm", 1000 * report.volume->median_by_calibration_m);
  const auto worst =
      std::ranges::find_if(report.checks, [](const Check& check) { return check.verdict != Verdict::usable; });
  if (worst != report.checks.end()) text += "; " + worst->finding + ": " + worst->advice;
  return text;
}

std::string to_text(const CalibrationReport& report) {
  std::string out = report.title + ", " + report.board + "\n\n" + verdict_line(report) + ".\n";
  for (const Check& check : report.checks) {
    if (check.verdict == Verdict::usable) continue;
    out += check.verdict == Verdict::failed ? "\n  ! " : "\n  ? ";
    out += check.finding + ".\n    -> " + check.advice + (check.advice.ends_with('?') ? "\n" : ".\n");
  }
  std::size_t width = 6;
  for (const CameraReport& camera : report.cameras) width = std::max(width, camera.name.size());
  const bool posed = report.cameras.front().cam_from_world.has_value();
  out += fmt::format("\n{:{}}  {:>9} {:>7} {:>9}  {:8} {:>16}", "camera", width, "rms px", "views", "coverage", "lens",
                     "focal length px");
  out += posed ? fmt::format("  {:>12} {:>14}\n", "position mm", "rotation deg") : "\n";
  for (const CameraReport& c : report.cameras) {
    out += fmt::format("{:{}}  {:9.3f} {:7} {:7.0f} %  {:8} {:8.1f} +- {:4.1f}", c.name, width, c.rms_px, c.views_used,
                       100 * c.coverage, solver::name(c.lens), c.parameters(0), c.sigma(0));
    if (posed) {
      out += fmt::format("  +- {:9.2f} +- {:11.4f}", 1000 * c.centre_sigma_m,
                         c.rotation_sigma_rad * 180 / std::numbers::pi);
    }
    out += "\n";
  }
  for (const CameraReport& camera : report.cameras) {
    if (!camera.lens_reason.empty()) out += camera.name + ": " + camera.lens_reason + "\n";
  }
  for (const CameraReport& camera : report.cameras) {
    out += fmt::format("{}: {} corners left out, {} of them at the image's edge", camera.name, camera.corners_left_out,
                       camera.left_out_at_edge);
    if (camera.rays.image_px > 0)
      out +=
          fmt::format("; direction of a pixel known to {:.2f} px where boards were, to {:.2g} px over the whole image",
                      camera.rays.covered_px, camera.rays.image_px);
    if (camera.blur_px > 0) out += fmt::format("; edges blurred by {:.1f} px", camera.blur_px);
    if (camera.motion_blurred > 0)
      out += fmt::format("; in {} of {} images motion blur is too strong to find the board", camera.motion_blurred,
                         camera.pictures);
    out += "\n";
  }
  for (const CameraReport& camera : report.cameras) {
    if (!camera.timing.empty()) out += camera.name + ": " + camera.timing + "\n";
  }
  if (!report.lens_reason.empty()) out += report.lens_reason + "\n";
  if (!report.pairs.empty()) {
    out += "\nCheck with a tape measure, lens to lens:\n";
    for (const PairReport& pair : report.pairs) {
      out += fmt::format("  {} - {}  {:.3f} m +- {:.1f} mm", report.cameras[static_cast<std::size_t>(pair.a)].name,
                         report.cameras[static_cast<std::size_t>(pair.b)].name, pair.distance_m,
                         1000 * pair.distance_sigma_m);
      out += pair.shared_sets > 0 ? fmt::format("   ({} shared views, {:.3f} px rms)\n", pair.shared_sets, pair.rms_px)
                                  : std::string("   (no shared views)\n");
    }
  }
  if (report.volume) {
    const solver::VolumeAccuracy& v = *report.volume;
    const auto size = v.box.high - v.box.low;
    out += fmt::format(
        "\nExpected accuracy in {:.2f} x {:.2f} x {:.2f} m, which is x {:.2f} to {:.2f}, y {:.2f} to {:.2f}, z {:.2f} "
        "to {:.2f} of the world: {:.2f} mm by the calibration (95 % of the volume: {:.2f} mm);\n"
        "{:.2f} mm ({:.2f} mm) for an object whose centre is seen to {:.1f} px. Two or more cameras see {:.0f} % of "
        "it.\n",
        size.x(), size.y(), size.z(), v.box.low.x(), v.box.high.x(), v.box.low.y(), v.box.high.y(), v.box.low.z(),
        v.box.high.z(), 1000 * v.median_by_calibration_m, 1000 * v.p95_by_calibration_m, 1000 * v.median_total_m,
        1000 * v.p95_total_m, v.object_noise_px, 100 * v.covered);
  }
  for (const DroppedView& view : report.dropped) {
    out += "dropped: " + view.image + " (" + report.cameras[static_cast<std::size_t>(view.camera)].name +
           "): " + view.why + "\n";
  }
  return out;
}

}  // namespace huetrack::report
