#include "object_tracking/objects/object_births.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

constexpr std::size_t most_crossings_of_many = 4 * TargetOptions::most_count;
constexpr int usual_sets = 2;

// Evidence, as logarithms of how much likelier what is seen is with an object there than by chance.
// By chance a region lies within a radius of where it should be: some regions in a picture of a thousand discs.
const double by_chance_at_place = std::log(detection_probability / 0.004);
// Two rays meet by chance: one of some regions lies within a few pixels of an epipolar line.
const double by_chance_on_line = std::log(detection_probability / 0.03);
const double not_seen = std::log(1 - detection_probability);
constexpr double size_sigma = 0.2;  // of the radius of a region's disc, as a share
constexpr double worst_size = 3;    // something hides a part: that says no more against it
// A region is as round as a disc by chance: one of seven, of furniture. And it has the size that the place lets expect,
// of all that regions are looked for in, some 2.5 on a logarithmic scale: sizes of objects have a density of 2 there.
const double by_chance_round = std::log(detection_probability / 0.15);
const double by_chance_of_size = std::log(2.5 / (size_sigma * std::sqrt(2 * std::numbers::pi)));
constexpr double right_size = 1.2;  // larger is what its colour goes on in; its edge is blurred
// Evidence that is by chance in one room of a thousand, which has so many pieces of furniture: what three views show
// alike has it.
constexpr double beyond_chance = 7;
// Times the highest usual speed: what is surely an object may just have been thrown.
constexpr double hardest_throw = 2;
constexpr double share_around = 0.5;  // of the volume's largest extent, looked_through()
// Chi-square, 3 degrees of freedom: by chance in one of 10^5; both ends have the covariance of the newest.
constexpr double surely_moved = 25;
constexpr double least_step = 0.3;  // of the mean one: slow ones are half noise
constexpr int kept_way = 6;         // sets
constexpr double as_good = 2;       // evidence that differs by less does not decide between two

double disc_area(double radius_px) {
  return std::numbers::pi * radius_px * radius_px;
}

bool share_a_region(const PositionCandidate& a, const PositionCandidate& b) {
  return std::ranges::any_of(a.sightings, [&](const Sighting& s) {
    return std::ranges::any_of(b.sightings,
                               [&](const Sighting& t) { return t.row.camera == s.row.camera && t.px == s.px; });
  });
}

// From `from` to `now` in so many sets, the last of which was `step`: it has surely moved, and goes on as it went. What
// stands and was mistaken for something beside it, once, does not.
bool moves(const Eigen::Vector3d& from, const PositionCandidate& now, const Eigen::Vector3d& step, int sets) {
  const Eigen::Vector3d way = now.position - from;
  return sets >= 2 && way.dot((2 * now.covariance).inverse() * way) > surely_moved &&
         step.dot(way) > least_step * way.squaredNorm() / sets;
}

// What the shapes say: views that show a disc as large as the object is there. Furniture has any size and any shape.
double evidence_of_discs(const PositionCandidate& c, double radius_m) {
  double evidence = 0;
  for (const Sighting& s : c.sightings) {
    const auto at = project_ball(*s.camera, c.position, radius_m);
    if (!at || !has_disc_shape(s) || s.radius_px > right_size * at->radius_px) continue;
    const double size = std::log(s.radius_px / at->radius_px) / size_sigma;
    evidence += std::max(0.0, by_chance_round + by_chance_of_size - 0.5 * size * size);
  }
  return evidence;
}

ObjectTrackerOptions looking_within(ObjectTrackerOptions options, const Volume& within) {
  options.volume = within;
  return options;
}

}  // namespace

MustMove must_move(const StaticClutterMask& still, capture::Timestamp set_at) {
  return still.is_starting(set_at) ? MustMove::unless_clear : MustMove::no;
}

Volume looked_through(const Volume& volume) {
  const double margin = share_around * (volume.max - volume.min).maxCoeff();
  return {volume.min.array() - margin, volume.max.array() + margin};
}

ObjectBirths::ObjectBirths(const TargetOptions& target, const ObjectTrackerOptions& options, const Volume& within)
    : target_(target), options_(looking_within(options, within)) {}

ObjectBirths::Candidate ObjectBirths::weighed(PositionCandidate at, const std::vector<TargetView>& views,
                                              std::span<const std::vector<color::ColorRegion>> regions,
                                              std::span<const CoveredDisc> covered,
                                              const StaticClutterMask& still) const {
  Candidate out{.at = std::move(at)};
  out.evidence = by_chance_on_line - by_chance_at_place;  // the first two views make the place
  out.evidence -= by_chance_at_place;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto in_view = project_ball(*views[v].camera, out.at.position, target_.radius_m);
    if (!in_view || !views[v].camera->contains({in_view->px})) continue;
    const auto seen =
        std::ranges::find(out.at.sightings, views[v].index, [](const Sighting& s) { return s.row.camera; });
    if (seen != out.at.sightings.end()) {
      const double size = std::log(seen->radius_px / in_view->radius_px) / size_sigma;
      out.evidence += by_chance_at_place - std::min(worst_size, 0.5 * size * size);
      continue;
    }
    const bool is_covered = std::ranges::any_of(covered, [&](const CoveredDisc& disc) {
      return disc.view == v && (disc.px - in_view->px).norm() < disc.radius_px + 0.5 * in_view->radius_px;
    });
    // A part of something larger, of several objects that nobody has told apart yet.
    const bool is_in_region = std::ranges::any_of(regions[v], [&](const color::ColorRegion& r) {
      return r.area > disc_area(in_view->radius_px) && in_view->px.x() > r.box.u_min && in_view->px.x() < r.box.u_max &&
             in_view->px.y() > r.box.v_min && in_view->px.y() < r.box.v_max;
    });
    if (is_covered || is_in_region ||
        still.may_clip(static_cast<std::size_t>(views[v].index), in_view->px, in_view->radius_px))
      continue;
    out.evidence += not_seen;
    ++out.missing;
  }
  return out;
}

// Best first; those whose regions are of better ones are left out.
std::vector<ObjectBirths::Candidate> ObjectBirths::candidates(const std::vector<TargetView>& views,
                                                              std::span<const std::vector<color::ColorRegion>> regions,
                                                              std::span<const CoveredDisc> covered,
                                                              const StaticClutterMask& still,
                                                              const MotionState& times) const {
  std::vector<Candidate> all;
  for (PositionCandidate& c : cross_rays(views, regions, target_, options_, times, most_crossings_of_many))
    all.push_back(weighed(std::move(c), views, regions, covered, still));
  std::ranges::stable_sort(all, [](const Candidate& a, const Candidate& b) { return a.evidence > b.evidence; });
  std::vector<Candidate> out;
  for (Candidate& c : all) {
    bool is_left_out = false;
    for (Candidate& better : out) {
      if (!share_a_region(better.at, c.at) && (better.at.position - c.at.position).norm() >= 1.5 * target_.radius_m)
        continue;
      if (better.evidence - c.evidence < as_good && (better.at.position - c.at.position).norm() > target_.radius_m)
        better.is_ambiguous = c.is_ambiguous = true;
      else
        is_left_out = true;
    }
    if (!is_left_out) out.push_back(std::move(c));
  }
  return out;
}

std::vector<Birth> ObjectBirths::look(const std::vector<TargetView>& views,
                                      std::span<const std::vector<color::ColorRegion>> regions,
                                      std::span<const CoveredDisc> covered, const StaticClutterMask& still,
                                      capture::Timestamp set_at, const MotionState& times) {
  std::vector<Birth> out;
  const auto with_regions = std::ranges::count_if(regions, [](const auto& some) { return !some.empty(); });
  if (with_regions < 2) return out;  // nor does a set in which too few of these views see it refute anything
  std::vector<Candidate> now = candidates(views, regions, covered, still, times);
  const double dt = capture::seconds(set_at - before_at_);
  std::vector<Candidate> kept;
  for (Candidate& c : now) {
    const bool is_clear = c.evidence + evidence_of_discs(c.at, target_.radius_m) >= beyond_chance;
    const double way_m = (is_clear ? hardest_throw : 1) * options_.start_speed_m_s * dt;
    const Candidate* earlier = nullptr;
    if (dt > 0 && dt < longest_confirmation_s) {
      for (const Candidate& e : before_) {
        const double spread = 3 * (largest_sigma(c.at.covariance) + largest_sigma(e.at.covariance));
        const double apart_m = (c.at.position - e.at.position).norm();
        if (apart_m > way_m + spread) continue;
        if (earlier == nullptr || apart_m < (c.at.position - earlier->at.position).norm()) earlier = &e;
      }
    }
    // Two views may be of two pieces of furniture, set by set. Where as many others contradict them only what moves is
    // told; a single one may have something before it that nobody knows of.
    const bool is_contested = c.missing > 0 && c.at.sightings.size() < 3;
    bool stands = (is_contested && c.missing >= std::ssize(c.at.sightings)) ||
                  (must_move_ == MustMove::unless_clear && !is_clear);
    if (earlier != nullptr) {
      c.at.sets = earlier->at.sets + 1;
      const bool is_long_ago = earlier->sets_from >= kept_way;
      c.from = is_long_ago ? earlier->at.position : earlier->from;
      c.sets_from = is_long_ago ? 1 : earlier->sets_from + 1;
      stands = stands && !moves(c.from, c.at, c.at.position - earlier->at.position, c.sets_from);
    }
    const int needed = is_contested ? contested_sets : usual_sets;
    if (earlier != nullptr && c.at.sets >= needed && !stands && !c.is_ambiguous && !earlier->is_ambiguous) {
      out.push_back({earlier->at, c.at, dt});
    } else {
      kept.push_back(std::move(c));
    }
  }
  before_ = std::move(kept);
  before_at_ = set_at;
  return out;
}

}  // namespace huetrack::objects
