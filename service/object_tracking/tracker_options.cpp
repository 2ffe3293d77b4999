#include "object_tracking/tracker_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace huetrack::object_tracking {

const color::HsiRange& TargetOptions::color_in(std::string_view camera) const {
  const auto own = std::ranges::find(camera_colors, camera, &std::pair<std::string, color::HsiRange>::first);
  return own == camera_colors.end() ? color : own->second;
}

std::vector<std::string> TargetOptions::problems() const {
  std::vector<std::string> out;
  if (name.empty()) out.emplace_back("a target must have a name");
  if (count < 1 || count > most_count) out.push_back(fmt::format("count must be 1 to {}, got {}", most_count, count));
  if (!(radius_m > 0) || !std::isfinite(radius_m)) out.emplace_back("radius_m must be > 0");
  for (const std::string& p : color.problems()) out.push_back("color: " + p);
  for (const auto& [camera, own] : camera_colors) {
    for (const std::string& p : own.problems()) out.push_back(fmt::format("camera_colors.{}: {}", camera, p));
  }
  return out;
}

std::vector<std::string> ObjectTrackerOptions::problems() const {
  std::vector<std::string> out;
  const auto positive = [&out](double value, const char* what) {
    if (!(value > 0) || !std::isfinite(value)) out.push_back(fmt::format("{} must be > 0", what));
  };
  if (!volume.min.allFinite() || !volume.max.allFinite() || !(volume.min.array() < volume.max.array()).all())
    out.emplace_back("volume.min must be less than volume.max on every axis");
  if (particle_count < 1) out.emplace_back("particle_count must be >= 1");
  if (max_particle_count < particle_count) out.emplace_back("max_particle_count must be >= particle_count");
  positive(position_noise_m, "position_noise_m");
  positive(acceleration_m_s2, "acceleration_m_s2");
  positive(start_speed_m_s, "start_speed_m_s");
  positive(pixel_noise_px, "pixel_noise_px");
  positive(max_tracking_sigma_m, "max_tracking_sigma_m");
  positive(max_tracking_share_along, "max_tracking_share_along");
  positive(coast_s, "coast_s");
  positive(max_coast_sigma_m, "max_coast_sigma_m");
  return out;
}

}  // namespace huetrack::object_tracking
