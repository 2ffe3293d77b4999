// Validation of CameraTrackerOptions.
#include <algorithm>
#include <cmath>
#include <set>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::camera_tracking {
namespace {

using Problems = std::vector<std::string>;

bool in_one_line(const std::vector<Eigen::Vector3d>& points) {
  double longest = 0, widest = 0;
  Eigen::Vector3d along = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) {
    if ((p - points.front()).norm() > longest) along = p - points.front(), longest = along.norm();
  }
  for (const Eigen::Vector3d& p : points) widest = std::max(widest, (p - points.front()).cross(along).norm());
  return !(widest > 1e-6 * longest * longest);
}

void check_pixels(const std::vector<Eigen::Vector2d>& pixels, Problems& out) {
  if (!std::ranges::all_of(pixels, [](const Eigen::Vector2d& p) { return p.allFinite(); }))
    out.emplace_back("start: pixels must be finite numbers");
}

void check(const RectangleStart& start, Problems& out) {
  if (start.corners.size() != 4) {
    out.push_back("start: a rectangle has 4 corners, not " + std::to_string(start.corners.size()));
  } else {
    const auto& c = start.corners;
    const Eigen::Vector3d a = c[1] - c[0], b = c[3] - c[0];
    const double size = std::min(a.norm(), b.norm());
    if (!std::ranges::all_of(c, [](const Eigen::Vector3d& p) { return p.allFinite(); }) || !(size > 0) ||
        std::abs(a.dot(b)) > 0.02 * a.norm() * b.norm() || (c[0] + a + b - c[2]).norm() > 0.02 * size)
      out.emplace_back("start: the rectangle's corners must be those of a rectangle, in order around it, in metres");
  }
  if (!start.pixels.empty() && start.pixels.size() != 4)
    out.emplace_back("start: give the pixels of all 4 corners, or none, and they are found");
  check_pixels(start.pixels, out);
}

void check(const PointsStart& start, Problems& out) {
  if (start.points.size() < 4)
    out.push_back("start: at least 4 known points are needed, not " + std::to_string(start.points.size()));
  if (start.points.size() != start.pixels.size())
    out.push_back("start: " + std::to_string(start.points.size()) + " points, but " +
                  std::to_string(start.pixels.size()) + " pixels");
  if (!std::ranges::all_of(start.points, [](const Eigen::Vector3d& p) { return p.allFinite(); }))
    out.emplace_back("start: points must be finite numbers, in metres");
  else if (start.points.size() >= 4 && in_one_line(start.points))
    out.emplace_back("start: the known points must not lie in one line");
  check_pixels(start.pixels, out);
}

void check(const FoundStart& start, Problems& out) {
  if (!start.find) out.emplace_back("start: a board detector is missing");
}

void check(const LedStart& start, Problems& out) {
  if (start.leds.size() < 4)
    out.push_back("start: at least 4 LEDs are needed, not " + std::to_string(start.leds.size()) +
                  ": fewer leave the camera's pose open");
  if (!std::ranges::all_of(start.leds, [](const Eigen::Vector3d& p) { return p.allFinite(); }))
    out.emplace_back("start: LED positions must be finite numbers, in metres");
  else if (start.leds.size() >= 4 && in_one_line(start.leds))
    out.emplace_back("start: the LEDs must not lie in one line");
  const int n = static_cast<int>(start.leds.size());
  if (!std::ranges::all_of(start.schedule, [n](int led) { return led >= -1 && led < n; }))
    out.push_back("start: the schedule names LEDs 0 to " + std::to_string(n - 1) + ", or -1 for none");
  if (start.schedule.empty() && start.leds.size() == 4)
    out.emplace_back(
        "start: with 4 LEDs that are not identified more than one pose fits: give led_schedule, or a fifth LED");
  if (!start.schedule.empty()) {
    std::set<int> lit(start.schedule.begin(), start.schedule.end());
    lit.erase(-1);
    if (lit.size() < 4)
      out.push_back("start: the schedule lights " + std::to_string(lit.size()) +
                    " different LEDs, and at least 4 are needed");
  }
  if (!(start.slot_s >= 0) || !std::isfinite(start.slot_s)) out.emplace_back("start: slot_s must be >= 0 seconds");
  if (!start.room_min.allFinite() || !start.room_max.allFinite() ||
      !(start.room_min.array() < start.room_max.array()).all())
    out.emplace_back("start: room_min must be less than room_max on every axis");
}

}  // namespace

std::vector<std::string> CameraTrackerOptions::problems() const {
  Problems out;
  if (particle_count < 0) out.emplace_back("particle_count must be >= 0 (0: the method's default)");
  const bool leds = std::holds_alternative<LedStart>(start);
  if (method == CameraMethod::herranz && !leds)
    out.emplace_back("the method herranz needs LEDs at known positions to start from");
  if ((method == CameraMethod::pupilli || method == CameraMethod::lee) && leds)
    out.emplace_back("LEDs are for the methods huetrack and herranz; this one needs a rectangle, points or a board");
  if (as_printed && method != CameraMethod::pupilli && method != CameraMethod::lee)
    out.emplace_back("as_printed is for the methods pupilli and lee");
  if (leds && !load_map.empty()) out.emplace_back("load_map: with LEDs there is no map; their positions are given");
  std::visit([&out](const auto& s) { check(s, out); }, start);
  return out;
}

}  // namespace huetrack::camera_tracking
