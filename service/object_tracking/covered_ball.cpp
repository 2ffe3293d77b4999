#include "object_tracking/covered_ball.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace huetrack::object_tracking {
namespace {

constexpr double rows_per_radius = 3;  // layout: so that a ring has 26 pixels or more, however large the ball
constexpr double reach_radii = 3;      // layout: of the pixels that are read; the centre is at most two radii away

// maths: logarithm of the density of a normal distribution at its mean, over that of 256 values that are equally
// likely.
double log_peak(double sigma) {
  constexpr double grey_values = 256;  // layout: of 8 bits
  return std::log(grey_values / (sigma * std::sqrt(2 * std::numbers::pi)));
}

color::PixelBox box_around(const color::Disc& disc, double radii, const TargetView& view) {
  const double reach = radii * disc.radius_px;
  return {std::max(0, int(std::floor(disc.px.x() - reach))), std::max(0, int(std::floor(disc.px.y() - reach))),
          std::min(view.matches->width() - 1, int(std::ceil(disc.px.x() + reach))),
          std::min(view.matches->height() - 1, int(std::ceil(disc.px.y() + reach)))};
}

bool has(const outline::Picture& picture, const color::PixelBox& box) {
  return picture.is_whole() || (box.u_min >= picture.part_u && box.v_min >= picture.part_v &&
                                box.u_max < picture.end_u() && box.v_max < picture.end_v());
}

}  // namespace

bool CoveredBall::look(const TargetView& view, const outline::Picture& picture, const KnownBackground& behind,
                       const color::PixelBox& box, int step, const color::Disc* ring_of) {
  u_.clear(), v_.clear(), sample_u_.clear(), sample_v_.clear();
  if (!has(picture, box)) return false;
  view.matches->look(box);
  for (int v = box.v_min; v <= box.v_max; v += step) {
    for (int u = box.u_min; u <= box.u_max; u += step) {
      if (ring_of != nullptr && !color::DiscFinder::is_in_ring(*ring_of, {u, v})) continue;
      u_.push_back(u), v_.push_back(v);
      sample_u_.push_back(u / picture.columns), sample_v_.push_back(v / picture.rows);
    }
  }
  const std::size_t n = u_.size();
  if (n == 0) return false;
  seen_.resize(n), known_.resize(n), light_count_.resize(n), chroma_count_.resize(n);
  evidence_.resize(n), is_other_.resize(n);
  const outline::Places pixels{u_.data(), v_.data(), int(n)};
  outline::read_light(picture, pixels, seen_.light.data());
  outline::read_chroma(picture, {sample_u_.data(), sample_v_.data(), int(n)}, seen_.blue.data(), seen_.red.data());
  behind.values->at_pixels(
      picture, pixels,
      {known_.light.data(), known_.blue.data(), known_.red.data(), light_count_.data(), chroma_count_.data()});
  const double light_sigma = behind.noise_excess * double(behind.values->light_noise());
  const double chroma_sigma = behind.noise_excess * double(behind.values->chroma_noise());
  const double light_peak = log_peak(light_sigma), chroma_peak = log_peak(chroma_sigma);
  for (std::size_t i = 0; i < n; ++i) {
    const bool is_known = light_count_[i] > 0 && chroma_count_[i] > 0;
    const double light = double(seen_.light[i] - known_.light[i]) / light_sigma;
    const double blue = double(seen_.blue[i] - known_.blue[i]) / chroma_sigma;
    const double red = double(seen_.red[i] - known_.red[i]) / chroma_sigma;
    // Natural logarithm: how much likelier the values are as the background's than as anything's.
    const double light_as_background = light_peak - 0.5 * light * light;
    const double as_background = light_as_background + 2 * chroma_peak - 0.5 * (blue * blue + red * red);
    evidence_[i] = color::RoomColors::evidence_near_object(*view.matches, u_[i], v_[i], view.matches->at(u_[i], v_[i]),
                                                           is_known ? std::max(0.0, as_background) : 0.0);
    // By its light alone: the ball's chroma spreads around it, by samples that pixels share and by JPEG.
    is_other_[i] = is_known && light_as_background <= 0 && evidence_[i] <= 0 ? 1 : 0;
  }
  return true;
}

// More of the ring than something hides of an object on average.
bool CoveredBall::is_something_around(const color::Disc& disc) const {
  int pixels = 0, other = 0;
  for (std::size_t i = 0; i < u_.size(); ++i) {
    if (color::DiscFinder::is_in_ring(disc, {u_[i], v_[i]})) ++pixels, other += is_other_[i];
  }
  return other > color::RoomColors::hidden_share() * pixels;
}

std::optional<DiscPlace> CoveredBall::measure(const TargetView& view, const outline::Picture& picture,
                                              const KnownBackground& behind, const color::Disc& region) {
  if (picture.is_grey) return std::nullopt;
  // First with some pixels around the region, which is cheap: mostly there is nothing.
  const int step = std::max(1, int(region.radius_px / rows_per_radius));
  const color::PixelBox around = box_around(region, color::DiscFinder::ring_to(), view);
  const color::PixelBox box = box_around(region, reach_radii, view);
  if (!look(view, picture, behind, around, step, &region) || !is_something_around(region) ||
      !look(view, picture, behind, box, 1, nullptr))
    return std::nullopt;
  const color::ColorRegion disc = finder_.measure(box, evidence_, region);
  if (disc.area == 0 || !is_something_around({disc.centre, region.radius_px})) return std::nullopt;
  int pixels = 0, bare = 0;
  for (std::size_t i = 0; i < u_.size(); ++i) {
    if ((Eigen::Vector2d(u_[i], v_[i]) - disc.centre).squaredNorm() >= region.radius_px * region.radius_px) continue;
    ++pixels, bare += evidence_[i] < 0 ? 1 : 0;
  }
  return DiscPlace{disc.centre, disc.of_disc, pixels > 0 ? double(bare) / pixels : 0.0};
}

}  // namespace huetrack::object_tracking
