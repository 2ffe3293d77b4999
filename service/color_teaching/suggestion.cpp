#include "color_teaching/suggestion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "calib/model/median.h"
#include "color/image_color.h"

namespace huetrack::color_teaching {
namespace {

// From one camera to the next, white balance, shading and chroma subsampling move a hue by so many degrees, and a
// saturation by such a factor. The most is another colour.
constexpr double usual_hue_deg = 10, most_hue_deg = 25;
const double usual_saturation = std::log(1.5), most_saturation = std::log(2.5);
constexpr double beside_its_like = 0.5;  // of the most: for an object before wood or a wall of nearly its colour
// A half hidden or smeared ball still fills so much of its disc; with more of its colour around it than this it is a
// part of something larger.
constexpr double least_fill = 0.6, most_around = 0.4;
// Usual residuals (1 sigma) of the true candidate: gaps in its disc and colour in the ring around it, as shares;
// offset, of the slack of ray and moment; size, as a natural logarithm.
constexpr double usual_gap = 0.15, usual_aside = 0.5, usual_size = 0.25;
constexpr double settling_reach =
    1.25;  // of the expected radius: where the region is searched, as its centre is unknown
// Cheap tests before that: pixels of the colour nearby, over the radius squared (pi for a full disc); share of the
// square inside of the disc (half side 0.7 radii), less than least_fill. Steps of less than some pixels would find the
// same again.
constexpr double least_pixels = 0.5, inner_square = 0.7, least_inner_share = 0.4, least_step_px = 4;
// With light from one side the region may be a part of the object, which is larger by up to so much in another view.
constexpr std::array larger_elsewhere{1.0, 1.5};
constexpr double usual_larger = 0.35;  // its natural logarithm, 1 sigma
// Costs are squared normalised residuals: the most that a suggestion may cost, and the least lead over the next best.
constexpr double largest_cost = 12, clear_lead = 4;
constexpr double seen_elsewhere = -4,
                 unseen_elsewhere = 2;  // cost of another view, which may not see it if it is hidden
// Share of a region's pixels that moved, above which it moves, and below which it rests; between them it is unknown.
constexpr double moving_share = 0.6, still_share = 0.25;
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

struct LikePixels {
  explicit LikePixels(PixelMask like) : mask(std::move(like)), sums(mask) {}
  PixelMask mask;
  Sums sums;
};

// Of the set pixels in the box and the disc.
Eigen::Vector2d median_chroma_in_disc(const HsiImage& image, const PixelMask& pixels, const color::PixelBox& box,
                                      const Eigen::Vector2d& centre, double radius) {
  std::vector<double> x, y;
  for (int v = box.v_min; v <= box.v_max; ++v) {
    for (int u = box.u_min; u <= box.u_max; ++u) {
      if (pixels.at(u, v) == 0 || (Eigen::Vector2d(u, v) - centre).norm() > radius) continue;
      const Eigen::Vector2d c = chroma(image.at(u, v));
      x.push_back(c.x()), y.push_back(c.y());
    }
  }
  return x.empty() ? Eigen::Vector2d::Zero()
                   : Eigen::Vector2d(calib::median(std::move(x)), calib::median(std::move(y)));
}

// From one colour to another: the change of hue in degrees, and the logarithm of the saturations' ratio.
struct ColorStep {
  double hue_deg, saturation;
};

ColorStep step_of(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const double turned = std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
  return {turned * 180 / std::numbers::pi, std::log(std::max(1e-3, to.norm()) / from.norm())};
}

PixelMask like(const HsiImage& image, const Eigen::Vector2d& color, double as_like) {
  PixelMask mask(image.width, image.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const ColorStep step = step_of(color, chroma(image.pixels[i]));
    mask.pixels[i] =
        std::abs(step.hue_deg) <= as_like * most_hue_deg && std::abs(step.saturation) <= as_like * most_saturation ? 1
                                                                                                                   : 0;
  }
  return mask;
}

// Where the object would appear in a picture at one depth.
struct Expected {
  Eigen::Vector3d position;
  Eigen::Vector2d px;
  double radius_px;
  double slack_px;  // how far from there it may be
};

double radius_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_m) {
  return radius_m * camera.model.fx() / (camera.cam_from_world * position).norm();
}

// The click and the calibration have errors of some pixels, and frames of nearly one moment of a radius.
double slack_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_px, double moved_m) {
  return std::max(6.0, radius_px) + radius_px_of(camera, position, moved_m);
}

// All depths inside the volume, in steps of a pixel or so in the other picture.
std::vector<Expected> along_ray(const std::vector<PointedObject>& pointed, const calib::Camera& camera,
                                const object_tracking::Volume& volume, double moved_m) {
  const PointedObject& first = pointed.front();
  const auto ray = first.picture.camera->model.ray({first.region.centre});
  std::vector<Expected> out;
  if (!ray) return out;
  const Eigen::Vector3d from = first.picture.camera->centre();
  const Eigen::Vector3d direction = first.picture.camera->cam_from_world.rotation.conjugate() * ray->normalized();
  const Eigen::Vector3d middle = (volume.min + volume.max) / 2;
  const double reach_m = (volume.max - volume.min).norm() / 2 + 0.1;
  const double nearest_m = std::max(0.05, (middle - from).dot(direction) - reach_m);
  const double step = 1 / std::max(first.picture.camera->model.fx(), camera.model.fx());
  for (double depth = nearest_m; depth < (middle - from).dot(direction) + reach_m; depth *= 1 + step) {
    const Eigen::Vector3d position = from + depth * direction;
    if ((position.array() < volume.min.array() - 0.1).any() || (position.array() > volume.max.array() + 0.1).any())
      continue;
    const bool is_seen_by_all = std::all_of(pointed.begin() + 1, pointed.end(), [&](const PointedObject& other) {
      const calib::Camera& its = *other.picture.camera;
      const auto at = its.project_world(position);
      return at &&
             (at->px - other.region.centre).norm() < slack_px_of(its, position, other.region.radius_px(), moved_m);
    });
    const auto at = camera.project_world(position);
    if (!is_seen_by_all || !at || !camera.contains({at->px})) continue;
    const double radius_m = first.region.radius_px() * depth / first.picture.camera->model.fx();
    const double radius_px = radius_px_of(camera, position, radius_m);
    if (radius_px < least_radius_px) continue;
    if (!out.empty() && (out.back().px - at->px).norm() < 0.7) continue;
    out.push_back({position, at->px, radius_px, slack_px_of(camera, position, radius_px, moved_m)});
  }
  return out;
}

struct Candidate {
  Eigen::Vector3d position;
  MaskRegion region;
  double cost = 0;
};

// The pixels of the object's colour within the disc, where that lies best: mean shift from where it was expected.
MaskRegion settled(const PixelMask& mask, Eigen::Vector2d centre, double radius) {
  MaskRegion region;
  for (int step = 0; step < 4; ++step) {
    region = {.centre = {0, 0}, .box = {mask.width, mask.height, -1, -1}};
    for (int v = std::max(0, int(centre.y() - radius)); v <= std::min(mask.height - 1, int(centre.y() + radius) + 1);
         ++v)
      for (int u = std::max(0, int(centre.x() - radius)); u <= std::min(mask.width - 1, int(centre.x() + radius) + 1);
           ++u) {
        if (mask.at(u, v) == 0 || (Eigen::Vector2d(u, v) - centre).squaredNorm() > radius * radius) continue;
        ++region.area;
        region.centre += Eigen::Vector2d(u, v);
        region.box = {std::min(region.box.u_min, u), std::min(region.box.v_min, v), std::max(region.box.u_max, u),
                      std::max(region.box.v_max, v)};
      }
    if (region.area == 0) return region;
    region.centre /= region.area;
    if ((region.centre - centre).norm() < 0.1) break;
    centre = region.centre;
  }
  return region;
}

// How much of the disc, and of a ring around it, has the object's colour.
struct Filling {
  double inside = 0, around = 0;
};

Filling filling_of(const PixelMask& mask, const Eigen::Vector2d& centre, double radius) {
  int in = 0, in_set = 0, out = 0, out_set = 0;
  const double inner = std::max(1.0, 0.85 * radius), edge = radius + std::max(1.5, 0.3 * radius),
               outer = edge + std::max(2.0, 0.5 * radius);
  for (int v = std::max(0, int(centre.y() - outer)); v <= std::min(mask.height - 1, int(centre.y() + outer) + 1); ++v)
    for (int u = std::max(0, int(centre.x() - outer)); u <= std::min(mask.width - 1, int(centre.x() + outer) + 1);
         ++u) {
      const double d = (Eigen::Vector2d(u, v) - centre).norm();
      if (d <= inner) ++in, in_set += mask.at(u, v);
      if (d > edge && d <= outer) ++out, out_set += mask.at(u, v);
    }
  return {in > 0 ? double(in_set) / in : 0, out > 0 ? double(out_set) / out : 0};
}

double share_inside(const PixelMask& mask, const Eigen::Vector2d& centre, double radius) {
  return filling_of(mask, centre, radius).inside;
}

// nullopt: not like the object.
std::optional<Candidate> judged(const TaughtPicture& picture, const LikePixels& pixels, const Expected& expected,
                                const Eigen::Vector2d& color, const std::optional<bool>& is_moving) {
  const double radius = expected.radius_px;
  const MaskRegion region = settled(pixels.mask, expected.px, settling_reach * radius);
  if (region.area == 0) return std::nullopt;
  const Filling filling = filling_of(pixels.mask, region.centre, radius);
  const double aside = (region.centre - expected.px).norm() / expected.slack_px;
  if (filling.inside < least_fill || filling.around > most_around || aside > 1) return std::nullopt;
  if (is_moving && picture.moving != nullptr) {
    const double moved = share_inside(*picture.moving, region.centre, radius);
    if (*is_moving ? moved < still_share : moved > moving_share) return std::nullopt;
  }
  const ColorStep off =
      step_of(color, median_chroma_in_disc(*picture.image, pixels.mask, region.box, region.centre, radius));
  const double size = std::log(region.radius_px() / radius);
  const auto squared = [](double x) { return x * x; };
  Candidate out{.position = expected.position, .region = region};
  out.cost = squared((1 - filling.inside) / usual_gap) + squared(filling.around / usual_gap) +
             squared(off.hue_deg / usual_hue_deg) + squared(off.saturation / usual_saturation) +
             squared(aside / usual_aside) + squared(size / usual_size);
  return out;
}

// Local optima along the ray, one per region in the picture.
std::vector<Candidate> candidates_in(const TaughtPicture& picture, const LikePixels& pixels,
                                     const std::vector<Expected>& ray, const Eigen::Vector2d& color,
                                     const std::optional<bool>& is_moving) {
  std::vector<Candidate> out;
  const auto look = [&](const Expected& expected, double larger_cost) {
    // A cheap look first: with the frames of another moment, the object is somewhere in this square.
    const double slack = expected.slack_px;
    const auto [count, set] = pixels.sums.square(expected.px.x(), expected.px.y(), slack + expected.radius_px);
    if (count == 0 || set < least_pixels * expected.radius_px * expected.radius_px) return;
    // The ray's own steps look along it; beside it, in steps of a radius or so.
    const int steps = std::max(1, int(std::ceil(slack / std::max(least_step_px, expected.radius_px))));
    for (int i = -steps; i <= steps; ++i)
      for (int j = -steps; j <= steps; ++j) {
        const Eigen::Vector2d start = expected.px + slack / steps * Eigen::Vector2d(i, j);
        const auto [near_count, near_set] = pixels.sums.square(start.x(), start.y(), inner_square * expected.radius_px);
        if (near_count == 0 || near_set < least_inner_share * near_count) continue;
        const MaskRegion found = settled(pixels.mask, start, settling_reach * expected.radius_px);
        if (found.area == 0 || (found.centre - expected.px).norm() > slack) continue;
        Expected at = expected;
        at.px = found.centre;
        auto candidate = judged(picture, pixels, at, color, is_moving);
        if (!candidate) continue;
        const double aside = (candidate->region.centre - expected.px).norm() / slack;
        candidate->cost += aside * aside / (usual_aside * usual_aside) + larger_cost;
        const auto same = std::ranges::find_if(out, [&](const Candidate& other) {
          return (other.region.centre - candidate->region.centre).norm() < expected.radius_px;
        });
        if (same == out.end()) {
          out.push_back(*candidate);
        } else if (candidate->cost < same->cost) {
          *same = *candidate;
        }
      }
  };
  for (const Expected& expected : ray) {
    for (const double larger : larger_elsewhere) {
      Expected as = expected;
      as.radius_px *= larger;
      const double off = std::log(larger) / usual_larger;
      look(as, off * off);
    }
  }
  // Of the whole and of parts of it the likeliest remains.
  std::ranges::sort(out, {}, &Candidate::cost);
  std::vector<Candidate> apart;
  for (const Candidate& candidate : out)
    if (std::ranges::none_of(apart, [&](const Candidate& likelier) {
          return (likelier.region.centre - candidate.region.centre).norm() < likelier.region.radius_px();
        }))
      apart.push_back(candidate);
  return apart;
}

}  // namespace

Eigen::Vector2d median_chroma(const HsiImage& image, const PixelMask& pixels, const color::PixelBox& box) {
  return median_chroma_in_disc(image, pixels, box, {0, 0}, std::numeric_limits<double>::infinity());
}

PixelMask alike_pixels(const HsiImage& image, const Eigen::Vector2d& color) {
  return like(image, color, 1);
}

std::vector<std::optional<MaskRegion>> suggested_regions(const std::vector<PointedObject>& pointed,
                                                         const std::vector<TaughtPicture>& others,
                                                         const object_tracking::Volume& volume, double moved_m) {
  std::vector<std::optional<MaskRegion>> out(others.size());
  if (pointed.empty()) return out;
  const PointedObject& first = pointed.front();
  const Eigen::Vector2d color = median_chroma(*first.picture.image, first.pixels, first.region.box);
  if (color.norm() == 0) return out;
  std::optional<bool> is_moving;
  if (first.picture.moving != nullptr) {
    const double moved = share_inside(*first.picture.moving, first.region.centre, first.region.radius_px());
    if (moved > moving_share) is_moving = true;
    if (moved < still_share) is_moving = false;
  }
  std::vector<std::vector<Candidate>> candidates;
  for (const TaughtPicture& other : others) {
    const std::vector<Expected> ray = along_ray(pointed, *other.camera, volume, moved_m);
    candidates.push_back({});
    for (const double as_like : {1.0, beside_its_like})
      if (candidates.back().empty())
        candidates.back() = candidates_in(other, LikePixels(like(*other.image, color, as_like)), ray, color, is_moving);
  }
  // Whether the region in picture j lies where the candidate would be; nullopt: the candidate is not in that picture.
  const auto meets = [&](const Candidate& candidate, std::size_t j, const MaskRegion& region) -> std::optional<bool> {
    const calib::Camera& camera = *others[j].camera;
    const auto at = camera.project_world(candidate.position);
    if (!at || !camera.contains({at->px})) return std::nullopt;
    return (region.centre - at->px).norm() < 1.5 * slack_px_of(camera, candidate.position, region.radius_px(), moved_m);
  };
  struct Chosen {
    const Candidate* candidate;
    double cost;
  };
  std::vector<std::optional<Chosen>> chosen(others.size());
  for (std::size_t i = 0; i < others.size(); ++i) {
    std::vector<double> costs;
    for (const Candidate& candidate : candidates[i]) {
      double cost = candidate.cost;
      for (std::size_t j = 0; j < others.size(); ++j) {
        const auto at = j == i ? std::nullopt : others[j].camera->project_world(candidate.position);
        if (!at || !others[j].camera->contains({at->px})) continue;
        const bool is_seen = std::ranges::any_of(
            candidates[j], [&](const Candidate& other) { return meets(candidate, j, other.region) == true; });
        cost += is_seen ? seen_elsewhere : unseen_elsewhere;
      }
      costs.push_back(cost);
    }
    const auto best = std::ranges::min_element(costs);
    if (best == costs.end() || *best > largest_cost) continue;
    const bool is_clear = std::ranges::count_if(costs, [&](double cost) { return cost < *best + clear_lead; }) == 1;
    if (is_clear) chosen[i] = {&candidates[i][std::size_t(best - costs.begin())], *best};
  }
  // Of two inconsistent choices the clearly likelier one remains, or none.
  for (std::size_t i = 0; i < others.size(); ++i) {
    const bool is_inconsistent = chosen[i] && std::ranges::any_of(chosen, [&](const auto& other) {
                                   if (!other || &other == &chosen[i] || chosen[i]->cost + clear_lead < other->cost)
                                     return false;
                                   const auto j = std::size_t(&other - chosen.data());
                                   return meets(*chosen[i]->candidate, j, other->candidate->region) == false &&
                                          meets(*other->candidate, i, chosen[i]->candidate->region) == false;
                                 });
    if (chosen[i] && !is_inconsistent) out[i] = chosen[i]->candidate->region;
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
