#include "calib/report/map_report.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/report/volume_pictures.h"

namespace huetrack::report {
namespace {

std::string in_tenths_of_mm(double metres) {
  return fmt::format("{:.1f} mm", 1e3 * metres);
}

// Per number of cameras: share of the volume, and accuracy there.
Table by_views(const solver::VolumeAccuracy& map, std::size_t cameras) {
  Table table{.head = {"seen by", "of the volume", "median", "worst tenth from"}, .rows = {}};
  for (int views = 0; views <= static_cast<int>(cameras); ++views) {
    std::vector<double> total;
    std::size_t count = 0;
    for (const solver::PointAccuracy& point : map.points) {
      if (point.views != views) continue;
      ++count;
      if (views >= 2) total.push_back(point.total_m);
    }
    if (count == 0) continue;
    std::ranges::sort(total);
    const auto at = [&](double share) {
      return total.empty()
                 ? std::string("-")
                 : in_tenths_of_mm(total[static_cast<std::size_t>(share * static_cast<double>(total.size() - 1))]);
    };
    table.rows.push_back(
        {fmt::format("{} camera{}", views, views == 1 ? "" : "s"),
         fmt::format("{:.0f} %", 100.0 * static_cast<double>(count) / static_cast<double>(map.points.size())), at(0.5),
         at(0.9)});
  }
  return table;
}

}  // namespace

MapReport map_report(const calib::CameraRig& rig, const solver::VolumeAccuracy& map,
                     const std::vector<solver::CameraPlace>& next, const MapInput& input) {
  MapReport report;
  const Eigen::Vector3d size = map.box.high - map.box.low, middle = (map.box.high + map.box.low) / 2;
  Document& document = report.document;
  document.title = "Expected error: " + input.rig_name;
  document.subtitle =
      fmt::format("{} cameras; {:.2f} x {:.2f} x {:.2f} m around ({:.2f}, {:.2f}, {:.2f}), {}", rig.cameras.size(),
                  size.x(), size.y(), size.z(), middle.x(), middle.y(), middle.z(), input.volume_is_from);
  constexpr double enough_covered = 0.5;
  report.verdict = map.covered < enough_covered ? Verdict::doubtful : Verdict::usable;
  std::string seen = fmt::format("Two or more cameras see {:.0f} % of the volume.", 100 * map.covered);
  if (map.covered > 0)
    seen += fmt::format(" There the expected error of a position from one frame set is {} (95 %: {}).",
                        in_tenths_of_mm(map.median_total_m), in_tenths_of_mm(map.p95_total_m));
  document.banner(report.verdict, report.verdict == Verdict::usable ? "Covered" : "Hardly covered", seen);
  document.paragraph(
      fmt::format("Assumes that every camera measures the object's centre to {:g} px. Figures: norm of the position's "
                  "standard deviations along three axes. A filter over time does better.",
                  map.object_noise_px));
  document.paragraph(rig.uncertainty ? fmt::format("Of that, the calibration contributes {} (95 %: {}).",
                                                   in_tenths_of_mm(map.median_by_calibration_m),
                                                   in_tenths_of_mm(map.p95_by_calibration_m))
                                     : std::string("The rig file has no uncertainty: its cameras are taken as exact, "
                                                   "and the error of the calibration is missing here."));
  if (map.covered > 0) {
    document.heading("Where in the volume");
    document.figure(slices_figure(
        values_of(map), "unseen", 0,
        "Slices from above, x to the right and y up: the expected error. Grey: fewer than two cameras see it."));
    document.table(by_views(map, rig.cameras.size()));
  }
  std::vector<PlaceOnPlan> marked;
  if (!next.empty()) {
    document.heading("Where to put the next camera");
    Table table{.head = {"place", "x, y, z (m)", "covered", "median", "95 %"}, .rows = {}};
    for (const solver::CameraPlace& place : next) {
      const Eigen::Vector3d c = calib::inverse(place.cam_from_world).translation;
      marked.push_back({std::string(1, static_cast<char>('A' + marked.size())), c});
      table.rows.push_back({marked.back().name, fmt::format("{:.2f}, {:.2f}, {:.2f}", c.x(), c.y(), c.z()),
                            fmt::format("{:.0f} %", 100 * place.covered), in_tenths_of_mm(place.median_total_m),
                            in_tenths_of_mm(place.p95_total_m)});
    }
    document.paragraph("One more with the lens of " + rig.cameras.front().name +
                       ", pointed at the middle of the volume, and exactly calibrated:");
    document.table(table);
  }
  document.figure(
      plan_figure(rig, map.box, marked, "From above: cameras and what they see, the volume, and the places above."));
  return report;
}

}  // namespace huetrack::report
