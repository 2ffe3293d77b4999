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
#include "color_teaching/disc_contrast.h"

namespace huetrack::color_teaching {
namespace {

// A half hidden or smeared ball still fills so much of its disc; with more of its colour around it than this it is a
// part of something larger.
constexpr double least_fill = 0.6, most_around = 0.4;
// Usual residuals (1 sigma) of the true candidate: offset, of the slack of ray and moment; size, as a natural
// logarithm.
constexpr double usual_aside = 0.5, usual_size = 0.25;
// A cheap test before that: share of the square inside of the disc (half side 0.7 radii) that may have the colour.
// Steps of less than some pixels would find the same again.
constexpr double inner_square = 0.7, least_inner_share = 0.4, least_step_px = 3;
// What grew from the click may be a lit part of the object, which is larger by up to so much. Sizes are tried in steps
// of a natural logarithm.
constexpr double most_larger = 4, size_step = 0.2;
// Costs are squared normalised residuals: the most that a suggestion may cost, and the least lead over the next best.
constexpr double largest_cost = 12, clear_lead = 4;
// Cost of a view in which the object is hidden. The most that a candidate may cost leads over that.
constexpr double hidden_cost = largest_cost + clear_lead;
// Share of a region's pixels that moved, above which it moves, and below which it rests; between them it is unknown.
// It is no proof: before what has its colour a moving object changes little.
constexpr double moving_share = 0.6, still_share = 0.25, other_motion = 6;
constexpr double least_radius_px = 1.5;
constexpr double around_volume_m = 0.1;

double squared(double x) {
  return x * x;
}

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

double radius_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_m) {
  return radius_m * camera.model.fx() / (camera.cam_from_world * position).norm();
}

// The click and the calibration have errors of some pixels, and frames of nearly one moment of a radius.
double slack_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_px, double moved_m) {
  return std::max(6.0, radius_px) + radius_px_of(camera, position, moved_m);
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

// Something round of the object's colour in a picture, wherever it is along the ray.
struct Candidate {
  TintDisc disc;
  DiscContrast contrast;
  double cost = 0;  // without that of its place and size
};

// The object's colour, how much that differs within it, and whether it moves.
struct Look {
  Tint tint;
  double spread;
  std::optional<bool> is_moving;
};

// Of its pixels.
Look look_of(const HsiImage& image, const PixelMask& object) {
  std::vector<double> x, y, apart;
  for (std::size_t i = 0; i < object.pixels.size(); ++i) {
    if (object.pixels[i] == 0) continue;
    const Eigen::Vector2d c = chroma(image.pixels[i]);
    x.push_back(c.x()), y.push_back(c.y());
  }
  Look look{.tint = tint_of({calib::median(x), calib::median(y)}), .spread = 0, .is_moving = {}};
  for (std::size_t i = 0; i < x.size(); ++i) apart.push_back(distance(tint_of({x[i], y[i]}), look.tint));
  look.spread = calib::median(std::move(apart));
  return look;
}

struct Searched {
  explicit Searched(const TaughtPicture& of) : picture(of), tints(*of.image) {}
  const TaughtPicture& picture;
  TintImage tints;
};

double share_inside(const PixelMask& mask, const TintDisc& disc) {
  int in = 0, set = 0;
  visit_disc(mask.width, mask.height, disc, [&](int u, int v, double) { ++in, set += mask.at(u, v); });
  return in > 0 ? double(set) / in : 0;
}

// Where the disc's colour lies best, from there: mean shift. nullopt: not like the object.
std::optional<Candidate> settled(const Searched& in, TintDisc disc, const Look& look) {
  std::optional<DiscContrast> contrast;
  for (int step = 0; step < 4; ++step) {
    contrast = contrast_of(in.tints, disc, look.spread);
    if (!contrast) return std::nullopt;
    const MaskRegion region = region_of(in.tints, disc, *contrast);
    if (region.area == 0) return std::nullopt;
    const double moved = (region.centre - disc.centre).norm();
    if (moved < 0.3) break;
    disc.centre = region.centre;
  }
  const double off = distance(look.tint, contrast->tint);
  if (contrast->inside < least_fill || contrast->around > most_around || off > most_distance) return std::nullopt;
  Candidate out{.disc = disc, .contrast = *contrast, .cost = contrast->cost + squared(off)};
  if (look.is_moving && in.picture.moving != nullptr) {
    const double moved = share_inside(*in.picture.moving, disc);
    if (*look.is_moving && moved < still_share) out.cost += other_motion;
  }
  return out;
}

// What the click shows, in one size or another: the discs that hold the region's middle.
std::vector<Candidate> discs_of(const PointedObject& object, const Look& look) {
  const Searched in(object.picture);
  const double part_px = object.region.radius_px();
  std::vector<Candidate> out;
  for (double radius = part_px; radius < most_larger * part_px; radius *= std::exp(size_step))
    if (auto disc = settled(in, {object.region.centre, radius}, look);
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
          if (auto candidate = settled(in, {start, radius}, look)) found.push_back(std::move(*candidate));
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

// The costs of a view's candidates if the object is there, each below hidden_cost.
std::vector<std::pair<std::size_t, double>> costs_at(const TaughtPicture& picture,
                                                     const std::vector<Candidate>& candidates,
                                                     const Eigen::Vector3d& position, double radius_m, double moved_m) {
  std::vector<std::pair<std::size_t, double>> out;
  const auto at = picture.camera->project_world(position);
  if (!at || !picture.camera->contains({at->px})) return out;
  const double expected_px = radius_px_of(*picture.camera, position, radius_m);
  const double slack = slack_px_of(*picture.camera, position, expected_px, moved_m);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const double aside = (candidates[i].disc.centre - at->px).norm() / slack;
    if (aside > 1) continue;
    const double cost = candidates[i].cost + squared(aside / usual_aside) +
                        squared(std::log(candidates[i].disc.radius / expected_px) / usual_size);
    if (cost < hidden_cost) out.emplace_back(i, cost);
  }
  return out;
}

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
      if (expected.radius_m)
        sum += std::min(hidden_cost, squared(std::log(radius_m / *expected.radius_m) / usual_size));
      for (std::size_t j = 0; j < others.size(); ++j) {
        costs.push_back(costs_at(others[j], candidates[j], on_ray.position, radius_m, expected.moved_m));
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
  return like(TintImage(image), look_of(image, object).tint);
}

std::vector<std::optional<Suggestion>> suggested_regions(const std::vector<PointedObject>& pointed,
                                                         const std::vector<TaughtPicture>& others,
                                                         const Expected& expected) {
  std::vector<std::optional<Suggestion>> out(others.size());
  if (pointed.empty()) return out;
  const PointedObject& first = pointed.front();
  Look look = look_of(*first.picture.image, first.pixels);
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
