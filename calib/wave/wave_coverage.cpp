#include "calib/wave/wave_coverage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/model/missing_links.h"

namespace huetrack::wave {
namespace {

constexpr double moved_px = 1.5;     // as in remove_still_regions()
constexpr double together_s = 0.05;  // frames of one moment: latencies are not known yet
constexpr double now_s = 0.3;
constexpr std::size_t most_radii = 3000;

}  // namespace

double WaveCoverage::OfCamera::image_share() const {
  return double(std::ranges::count_if(parts, [](int n) { return n > 0; })) / double(parts.size());
}

double WaveCoverage::OfCamera::depth() const {
  return smallest_px > 0 ? largest_px / smallest_px : 1;
}

WaveCoverage::WaveCoverage(const calib::CameraRig& rig)
    : cameras_(rig.cameras.size()), shared_(rig.cameras.size() * rig.cameras.size(), 0) {
  for (const calib::Camera& camera : rig.cameras) {
    names_.push_back(camera.name);
    sizes_.push_back(camera.image_size);
  }
}

void WaveCoverage::add(const BallFrame& frame, std::size_t ball_number) {
  const auto c = std::size_t(frame.camera);
  PerCamera& camera = cameras_[c];
  if (camera.before.size() <= ball_number) camera.before.resize(ball_number + 1);
  std::vector<Eigen::Vector2d>& before = camera.before[ball_number];
  ++camera.counted.frames;
  camera.newest_s = frame.t_s;
  const auto has_moved = [&](const color::ColorRegion& region) {
    return std::ranges::none_of(before,
                                [&](const Eigen::Vector2d& px) { return (px - region.centre).norm() < moved_px; });
  };
  const auto ball = std::ranges::find_if(frame.regions, has_moved);  // the largest comes first
  if (ball != frame.regions.end() && camera.counted.frames > 1) {
    const auto part = [](double px, int size, int parts) {
      return std::clamp(int((px + 0.5) / size * parts), 0, parts - 1);
    };
    ++camera.counted.sightings;
    ++camera.counted.parts[std::size_t(part(ball->centre.y(), sizes_[c].height, rows) * columns +
                                       part(ball->centre.x(), sizes_[c].width, columns))];
    if (camera.radii_px.size() < most_radii) camera.radii_px.push_back(float(std::sqrt(ball->area / std::numbers::pi)));
    camera.seen_at_s = frame.t_s;
    for (std::size_t o = 0; o < cameras_.size(); ++o)
      if (o != c && std::abs(frame.t_s - cameras_[o].seen_at_s) < together_s)
        ++shared_[std::min(o, c) * cameras_.size() + std::max(o, c)];
  }
  before.clear();
  for (const auto& region : frame.regions) before.push_back(region.centre);
}

std::vector<WaveCoverage::OfCamera> WaveCoverage::cameras() const {
  std::vector<OfCamera> out;
  for (const PerCamera& camera : cameras_) {
    OfCamera& one = out.emplace_back(camera.counted);
    one.is_seen_now = camera.newest_s - camera.seen_at_s < now_s;
    if (camera.radii_px.empty()) continue;
    std::vector<float> radii = camera.radii_px;
    std::ranges::sort(radii);
    one.smallest_px = double(radii[radii.size() / 10]);
    one.largest_px = double(radii[radii.size() - 1 - radii.size() / 10]);
  }
  return out;
}

std::vector<std::string> WaveCoverage::needs() const {
  std::vector<std::string> needs;
  const std::vector<OfCamera> of = cameras();
  for (std::size_t c = 0; c < of.size(); ++c)
    if (of[c].sightings == 0) needs.push_back(names_[c] + " has not seen it move yet");
  const auto shared_of = [this](std::size_t a, std::size_t b) { return shared(a, b); };
  for (const auto& [a, b, together] : calib::missing_links(of.size(), shared_of, enough_shared)) {
    if (of[a].sightings == 0 && of[b].sightings == 0) continue;  // already reported above
    needs.push_back(fmt::format("wave it where {} and {} see it together: {} of {} moments", names_[a], names_[b],
                                together, enough_shared));
  }
  for (std::size_t c = 0; c < of.size(); ++c) {
    if (of[c].sightings == 0) continue;
    if (of[c].image_share() < enough_image) {
      // The quarter of the image with the fewest parts seen.
      std::array<int, 4> missing{};
      for (int i = 0; i < columns * rows; ++i)
        if (of[c].parts[std::size_t(i)] == 0)
          ++missing[std::size_t((i / columns) * 2 / rows * 2 + (i % columns) * 2 / columns)];
      constexpr std::array places{"top left", "top right", "bottom left", "bottom right"};
      const auto worst = std::size_t(std::ranges::max_element(missing) - missing.begin());
      needs.push_back(fmt::format("{}: through the {} of its picture ({:.0f} % of it seen)", names_[c], places[worst],
                                  100 * of[c].image_share()));
    }
    if (of[c].depth() < enough_deep) needs.push_back(fmt::format("{}: nearer to it, and farther away", names_[c]));
    if (of[c].sightings < enough_sightings)
      needs.push_back(fmt::format("{}: {} of {} pictures of it moving", names_[c], of[c].sightings, enough_sightings));
  }
  return needs;
}

std::string WaveCoverage::text() const {
  std::string out = "in view:", lacking;
  const std::vector<OfCamera> of = cameras();
  for (std::size_t c = 0; c < of.size(); ++c) out += fmt::format(" {} {:.0f}%", names_[c], 100 * of[c].image_share());
  for (std::size_t a = 0; a < of.size(); ++a)
    for (std::size_t b = a + 1; b < of.size(); ++b)
      if (shared(a, b) < enough_shared) lacking += " " + names_[a] + "+" + names_[b];
  return out + (lacking.empty() ? "" : "; hardly together yet:" + lacking);
}

}  // namespace huetrack::wave
