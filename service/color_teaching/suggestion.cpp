#include "color_teaching/suggestion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <tuple>
#include <utility>

#include "calib/model/median.h"
#include "color/image_color.h"
#include "color_teaching/color_fit.h"
#include "color_teaching/disc_candidate.h"

namespace huetrack::color_teaching {
namespace {

// A cheap test before that: share of the square inside of the disc (half side 0.7 radii) that may have the colour.
// Steps of less than some pixels would find the same again.
constexpr double inner_square = 0.7, least_inner_share = 0.4, least_step_px = 3;
// What grew from the click may be a lit part of the object, which is larger by up to so much.
constexpr double most_larger = 4;
// Share of a region's pixels that moved, above which it moves; between still_share and that it is unknown. It is no
// proof: before what has its colour a moving object changes little.
constexpr double moving_share = 0.6;
constexpr double least_radius_px = 1.5;

// Sums over rectangles in four look-ups.
class Sums {
 public:
  Sums(const PixelMask& mask) : width_(mask.width), height_(mask.height) {
    sums_.assign(std::size_t(width_ + 1) * std::size_t(height_ + 1), 0);
    for (int v = 0; v < height_; ++v)
      for (int u = 0, row = 0; u < width_; ++u) {
        row += mask.at(u, v);
        sums_[at(u + 1, v + 1)] = sums_[at(u + 1, v)] + row;
      }
  }
  // Of the square around (u, v): its pixels inside the picture, and how many of them are set.
  std::pair<int, int> square(double u, double v, double half) const {
    const int u0 = std::clamp(int(std::lround(u - half)), 0, width_);
    const int u1 = std::clamp(int(std::lround(u + half)) + 1, u0, width_);
    const int v0 = std::clamp(int(std::lround(v - half)), 0, height_);
    const int v1 = std::clamp(int(std::lround(v + half)) + 1, v0, height_);
    return {(u1 - u0) * (v1 - v0), sums_[at(u1, v1)] - sums_[at(u0, v1)] - sums_[at(u1, v0)] + sums_[at(u0, v0)]};
  }

 private:
  std::size_t at(int u, int v) const { return std::size_t(v) * std::size_t(width_ + 1) + std::size_t(u); }
  int width_, height_;
  std::vector<int> sums_;
};

PixelMask like(const TintImage& image, const Tint& tint) {
  PixelMask mask(image.width, image.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    mask.pixels[i] = distance(image.pixels[i], tint) <= most_distance ? 1 : 0;
  return mask;
}

// A place on the click's ray.
struct Place {
  Eigen::Vector3d position;
  double m_of_px;  // metres that a pixel of the click's picture is wide there
};

// All depths inside the volume at which the other points are of the same place, in steps of a pixel or so.
std::vector<Place> along_ray(const std::vector<PointedObject>& pointed, const std::vector<TaughtPicture>& others,
                             const object_tracking::Volume& volume, double moved_m) {
  const PointedObject& first = pointed.front();
  const auto ray = first.picture.camera->model.ray({first.region.centre});
  std::vector<Place> out;
  if (!ray) return out;
  const Eigen::Vector3d from = first.picture.camera->centre();
  const Eigen::Vector3d direction = first.picture.camera->cam_from_world.rotation.conjugate() * ray->normalized();
  const Eigen::Vector3d middle = (volume.min + volume.max) / 2;
  const double reach_m = (volume.max - volume.min).norm() / 2 + around_volume_m;
  const double nearest_m = std::max(0.05, (middle - from).dot(direction) - reach_m);
  double finest = first.picture.camera->model.fx();
  for (const TaughtPicture& other : others) finest = std::max(finest, other.camera->model.fx());
  for (double depth = nearest_m; depth < (middle - from).dot(direction) + reach_m; depth *= 1 + 1 / finest) {
    const Eigen::Vector3d position = from + depth * direction;
    if ((position.array() < volume.min.array() - around_volume_m).any() ||
        (position.array() > volume.max.array() + around_volume_m).any())
      continue;
    const bool is_seen_by_all = std::all_of(pointed.begin() + 1, pointed.end(), [&](const PointedObject& other) {
      const calib::Camera& its = *other.picture.camera;
      const auto at = its.project_world(position);
      return at &&
             (at->px - other.region.centre).norm() < slack_px_of(its, position, other.region.radius_px(), moved_m);
    });
    if (is_seen_by_all) out.push_back({position, depth / first.picture.camera->model.fx()});
  }
  return out;
}

struct Searched {
  explicit Searched(const TaughtPicture& of) : picture(of), tints(*of.image) {}
  const TaughtPicture& picture;
  TintImage tints;
};

// What the click shows, in one size or another: the discs that hold the region's middle.
std::vector<Candidate> discs_of(const PointedObject& object, const Look& look) {
  const Searched in(object.picture);
  const double part_px = object.region.radius_px();
  std::vector<Candidate> out;
  for (double radius = part_px; radius < most_larger * part_px; radius *= std::exp(size_step))
    if (auto disc = settled(in.tints, in.picture.moving, {object.region.centre, radius}, look);
        disc && (disc->disc.centre - object.region.centre).norm() < radius)
      out.push_back(std::move(*disc));
  if (out.empty()) out.push_back({.disc = {object.region.centre, part_px}, .contrast = {}});
  return out;
}

// All of a picture near the ray, in each of the clicked discs' sizes.
std::vector<Candidate> candidates_in(const Searched& in, const std::vector<Place>& places,
                                     const std::vector<Candidate>& clicked, double moved_m, const Look& look) {
  const Sums alike(like(in.tints, look.tint));
  std::vector<Candidate> found;
  std::set<std::tuple<int, int, int>> seen;
  for (const Place& place : places) {
    const auto at = in.picture.camera->project_world(place.position);
    if (!at || !in.picture.camera->contains({at->px})) continue;
    for (const Candidate& as : clicked) {
      const double expected_px = radius_px_of(*in.picture.camera, place.position, as.disc.radius * place.m_of_px);
      if (expected_px < least_radius_px) continue;
      const double slack = slack_px_of(*in.picture.camera, place.position, expected_px, moved_m);
      const int size = int(std::lround(std::log(expected_px) / size_step));
      const double radius = std::exp(size_step * size);
      const double step_px = std::max(least_step_px, 0.5 * radius);
      const int steps = int(std::ceil(slack / step_px));
      const int u = int(std::lround(at->px.x() / step_px)), v = int(std::lround(at->px.y() / step_px));
      for (int j = v - steps; j <= v + steps; ++j)
        for (int i = u - steps; i <= u + steps; ++i) {
          const Eigen::Vector2d start = step_px * Eigen::Vector2d(i, j);
          if ((start - at->px).norm() > slack || !seen.insert({size, i, j}).second) continue;
          const auto [count, set] = alike.square(start.x(), start.y(), inner_square * radius);
          if (count == 0 || set < least_inner_share * count) continue;
          if (auto candidate = settled(in.tints, in.picture.moving, {start, radius}, look))
            found.push_back(std::move(*candidate));
        }
    }
  }
  // Of nearly the same the likeliest remains.
  std::ranges::sort(found, {}, &Candidate::cost);
  std::vector<Candidate> apart;
  for (const Candidate& candidate : found)
    if (std::ranges::none_of(apart, [&](const Candidate& likelier) {
          return std::abs(std::log(likelier.disc.radius / candidate.disc.radius)) < 1.5 * size_step &&
                 (likelier.disc.centre - candidate.disc.centre).norm() < likelier.disc.radius;
        }))
      apart.push_back(candidate);
  return apart;
}

// Of one view: the least cost of all views together, for each of its candidates, and for none of them.
struct Totals {
  std::vector<double> of;
  std::vector<double> radius_px;  // of the object in this view then
  double of_none = std::numeric_limits<double>::max();
};

// One place, one size and one colour: all views together, for each place on the ray and each size.
std::vector<Totals> joint_totals(const std::vector<TaughtPicture>& others,
                                 const std::vector<std::vector<Candidate>>& candidates,
                                 const std::vector<Place>& places, const std::vector<Candidate>& clicked,
                                 const Expected& expected) {
  std::vector<Totals> totals(others.size());
  for (std::size_t j = 0; j < others.size(); ++j) {
    totals[j].of.assign(candidates[j].size(), std::numeric_limits<double>::max());
    totals[j].radius_px.assign(candidates[j].size(), 0);
  }
  for (const Place& on_ray : places) {
    for (const Candidate& as : clicked) {
      const double radius_m = as.disc.radius * on_ray.m_of_px;
      std::vector<std::vector<std::pair<std::size_t, double>>> costs;
      std::vector<double> least;
      double sum = as.cost;
      if (expected.radius_m) sum += std::min(hidden_cost, cost_of_size(radius_m / *expected.radius_m));
      for (std::size_t j = 0; j < others.size(); ++j) {
        costs.push_back(costs_at(*others[j].camera, candidates[j], on_ray.position, radius_m, expected.moved_m));
        double best = hidden_cost;
        for (const auto& [i, cost] : costs[j]) best = std::min(best, cost);
        least.push_back(best);
        sum += best;
      }
      for (std::size_t j = 0; j < others.size(); ++j) {
        totals[j].of_none = std::min(totals[j].of_none, sum - least[j] + hidden_cost);
        for (const auto& [i, cost] : costs[j]) {
          const double total = sum - least[j] + cost;
          if (total >= totals[j].of[i]) continue;
          totals[j].of[i] = total;
          totals[j].radius_px[i] = radius_px_of(*others[j].camera, on_ray.position, radius_m);
        }
      }
    }
  }
  return totals;
}

}  // namespace

PixelMask alike_pixels(const HsiImage& image, const PixelMask& object) {
  return like(TintImage(image), look_of(pixels_of(image, object)).tint);
}

std::vector<std::optional<Suggestion>> suggested_regions(const std::vector<PointedObject>& pointed,
                                                         const std::vector<TaughtPicture>& others,
                                                         const Expected& expected) {
  std::vector<std::optional<Suggestion>> out(others.size());
  if (pointed.empty()) return out;
  const PointedObject& first = pointed.front();
  Look look = look_of(pixels_of(*first.picture.image, first.pixels));
  if (first.picture.moving != nullptr) {
    const double moved = share_inside(*first.picture.moving, {first.region.centre, first.region.radius_px()});
    if (moved > moving_share) look.is_moving = true;
    if (moved < still_share) look.is_moving = false;
  }
  const std::vector<Place> places = along_ray(pointed, others, expected.volume, expected.moved_m);
  const std::vector<Candidate> clicked = discs_of(first, look);
  std::vector<std::vector<Candidate>> candidates;
  std::vector<Searched> searched;
  for (const TaughtPicture& other : others) {
    searched.emplace_back(other);
    candidates.push_back(candidates_in(searched.back(), places, clicked, expected.moved_m, look));
  }
  const std::vector<Totals> totals = joint_totals(others, candidates, places, clicked, expected);
  for (std::size_t j = 0; j < others.size(); ++j) {
    const auto best = std::ranges::min_element(totals[j].of);
    if (best == totals[j].of.end() || *best > totals[j].of_none - clear_lead) continue;
    const auto index = std::size_t(best - totals[j].of.begin());
    const Candidate& chosen = candidates[j][index];
    // What touches it may be a part of it.
    const double extent_px = std::max(chosen.disc.radius, totals[j].radius_px[index]);
    const auto is_rival = [&](const Candidate& other) {
      return totals[j].of[std::size_t(&other - candidates[j].data())] < *best + clear_lead &&
             (other.disc.centre - chosen.disc.centre).norm() > extent_px + other.disc.radius;
    };
    if (std::ranges::any_of(candidates[j], is_rival)) continue;
    Suggestion suggestion{.region = {}, .pixels = PixelMask(others[j].image->width, others[j].image->height)};
    suggestion.region = region_of(searched[j].tints, chosen.disc, chosen.contrast, &suggestion.pixels);
    out[j] = std::move(suggestion);
  }
  return out;
}

std::optional<PixelMask> moving_pixels(const capture::Image& picture, const std::vector<capture::Image>& others) {
  constexpr std::size_t least_others = 4;
  if (others.size() < least_others) return std::nullopt;
  const auto channels = [](const capture::Image& image, int u, int v) {
    const color::Rgb rgb = color::rgb_at(image, u, v);
    return std::array<double, 3>{rgb.r, rgb.g, rgb.b};
  };
  const std::size_t count = std::size_t(picture.width) * std::size_t(picture.height);
  std::vector<float> differences(count);
  std::vector<double> values;
  for (int v = 0; v < picture.height; ++v) {
    for (int u = 0; u < picture.width; ++u) {
      const auto now = channels(picture, u, v);
      double most = 0;
      std::array<std::array<double, 3>, 32> then;
      const std::size_t n = std::min(others.size(), then.size());
      for (std::size_t i = 0; i < n; ++i) then[i] = channels(others[i], u, v);
      for (std::size_t k = 0; k < 3; ++k) {
        values.clear();
        for (std::size_t i = 0; i < n; ++i) values.push_back(then[i][k]);
        most = std::max(most, std::abs(now[k] - calib::median_in_place(std::span(values))));
      }
      differences[std::size_t(v) * std::size_t(picture.width) + std::size_t(u)] = float(most);
    }
  }
  // Most of a picture is at rest: its median shows how much noise, flicker and exposure change a pixel.
  std::vector<float> sorted = differences;
  const float usual = calib::median_in_place(std::span(sorted));
  const float least = std::max(0.06f, 5 * usual);
  PixelMask mask(picture.width, picture.height);
  for (std::size_t i = 0; i < count; ++i) mask.pixels[i] = differences[i] > least ? 1 : 0;
  return mask;
}

}  // namespace huetrack::color_teaching
