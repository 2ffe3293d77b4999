#include "color_teaching/disc_candidate.h"

#include <algorithm>
#include <cmath>

#include "calib/model/median.h"

namespace huetrack::color_teaching {
namespace {

// A half hidden or smeared ball still fills so much of its disc; with more of its colour around it than this it is a
// part of something larger.
constexpr double least_fill = 0.6, most_around = 0.4;
// Usual residuals (1 sigma) of the true candidate: offset, of the slack of ray and moment; size, as a natural
// logarithm.
constexpr double usual_aside = 0.5, usual_size = 0.25;
constexpr double other_motion = 6;  // cost of what rests, for an object that moves

double squared(double x) {
  return x * x;
}

}  // namespace

Look look_of(const std::vector<color::Hsi>& object) {
  std::vector<double> x, y, apart;
  for (const color::Hsi& pixel : object) {
    const Eigen::Vector2d c = chroma(pixel);
    x.push_back(c.x()), y.push_back(c.y());
  }
  Look look{.tint = tint_of({calib::median(x), calib::median(y)}), .spread = 0, .is_moving = {}};
  for (std::size_t i = 0; i < x.size(); ++i) apart.push_back(distance(tint_of({x[i], y[i]}), look.tint));
  look.spread = calib::median(std::move(apart));
  return look;
}

double share_inside(const PixelMask& mask, const TintDisc& disc) {
  int in = 0, set = 0;
  visit_disc(mask.width, mask.height, disc, [&](int u, int v, double) { ++in, set += mask.at(u, v); });
  return in > 0 ? double(set) / in : 0;
}

double cost_of_size(double ratio) {
  return squared(std::log(ratio) / usual_size);
}

double radius_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_m) {
  return radius_m * camera.model.fx() / (camera.cam_from_world * position).norm();
}

double slack_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_px, double moved_m) {
  return std::max(6.0, radius_px) + radius_px_of(camera, position, moved_m);
}

std::optional<Candidate> settled(const TintImage& image, const PixelMask* moving, TintDisc disc, const Look& look) {
  std::optional<DiscContrast> contrast;
  for (int step = 0; step < 4; ++step) {
    contrast = contrast_of(image, disc, look.spread);
    if (!contrast) return std::nullopt;
    const MaskRegion region = region_of(image, disc, *contrast);
    if (region.area == 0) return std::nullopt;
    const double moved = (region.centre - disc.centre).norm();
    if (moved < 0.3) break;
    disc.centre = region.centre;
  }
  const double off = distance(look.tint, contrast->tint);
  if (contrast->inside < least_fill || contrast->around > most_around || off > most_distance) return std::nullopt;
  Candidate out{.disc = disc, .contrast = *contrast, .cost = contrast->cost + squared(off)};
  if (look.is_moving && moving != nullptr) {
    const double moved = share_inside(*moving, disc);
    if (*look.is_moving && moved < still_share) out.cost += other_motion;
  }
  return out;
}

std::vector<std::pair<std::size_t, double>> costs_at(const calib::Camera& camera,
                                                     const std::vector<Candidate>& candidates,
                                                     const Eigen::Vector3d& position, double radius_m, double moved_m) {
  std::vector<std::pair<std::size_t, double>> out;
  const auto at = camera.project_world(position);
  if (!at || !camera.contains({at->px})) return out;
  const double expected_px = radius_px_of(camera, position, radius_m);
  const double slack = slack_px_of(camera, position, expected_px, moved_m);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const double aside = (candidates[i].disc.centre - at->px).norm() / slack;
    if (aside > 1) continue;
    const double cost =
        candidates[i].cost + squared(aside / usual_aside) + cost_of_size(candidates[i].disc.radius / expected_px);
    if (cost < hidden_cost) out.emplace_back(i, cost);
  }
  return out;
}

}  // namespace huetrack::color_teaching
