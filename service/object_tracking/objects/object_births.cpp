#include "object_tracking/objects/object_births.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

// Probabilities under clutter are of one view; ratios of likelihoods are natural logarithms.
struct BirthTuning {
  double clutter_round = 0.15;     // a region of the static scene is as round as a disc
  double clutter_log_sizes = 2.5;  // range of the logarithms of the radii that regions are searched in
  double max_size_cost = 3;        // a wrong size counts no more against it: it may be occluded
};
constexpr BirthTuning birth_tuning{};

double llr_missed() {
  return std::log(1 - detection.probability);
}
double llr_round() {
  return std::log(detection.probability / birth_tuning.clutter_round);
}
double llr_of_size() {
  return std::log(birth_tuning.clutter_log_sizes /
                  (sighting_tuning.region_size_sigma * std::sqrt(2 * std::numbers::pi)));
}

bool share_a_region(const PositionCandidate& a, const PositionCandidate& b) {
  return std::ranges::any_of(a.sightings, [&](const Sighting& s) {
    return std::ranges::any_of(b.sightings,
                               [&](const Sighting& t) { return t.row.camera == s.row.camera && t.px == s.px; });
  });
}

// Log-likelihood ratio of discs of the object's size; static regions have any size and shape.
double evidence_of_discs(const PositionCandidate& c, double radius_m) {
  double evidence = 0;
  for (const Sighting& s : c.sightings) {
    const auto at = project_ball(*s.camera, c.position, radius_m);
    if (!at || !has_disc_shape(s) || is_too_large_alone(s.radius_px, at->radius_px)) continue;
    const double size = std::log(s.radius_px / at->radius_px) / sighting_tuning.region_size_sigma;
    evidence += std::max(0.0, llr_round() + llr_of_size() - 0.5 * size * size);
  }
  return evidence;
}

ObjectTrackerOptions looking_within(ObjectTrackerOptions options, const Volume& within) {
  options.volume = within;
  return options;
}

}  // namespace

Volume looked_through(const ObjectTrackerOptions& options) {
  const double margin_m = options.start_speed_m_s * sighting_tuning.confirmation_s;
  return {options.volume.min.array() - margin_m, options.volume.max.array() + margin_m};
}

void add_covered(const std::vector<TargetView>& views, std::span<const Sighting> sightings,
                 const Eigen::Vector3d& position, double radius_m, std::vector<CoveredDisc>& out) {
  for (const Sighting& s : sightings) {
    const auto view = std::ranges::find(views, s.row.camera, &TargetView::index);
    const auto at = project_ball(*s.camera, position, radius_m);
    if (view != views.end() && at) out.push_back({std::size_t(view - views.begin()), s.px, at->radius_px});
  }
}

ObjectBirths::ObjectBirths(const TargetOptions& target, const ObjectTrackerOptions& options, const Volume& within)
    : target_(target), options_(looking_within(options, within)) {}

ObjectBirths::Candidate ObjectBirths::weighed(PositionCandidate at, const std::vector<TargetView>& views,
                                              std::span<const std::vector<color::ColorRegion>> regions,
                                              std::span<const CoveredDisc> covered, const ClutterMap& clutter,
                                              const StaticClutterMask& still) const {
  Candidate out{.at = std::move(at)};
  // The first view makes a ray, the second one a place on it: clutter that lies along the epipolar line would do.
  std::size_t nth = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto in_view = project_ball(*views[v].camera, out.at.position, target_.radius_m);
    if (!in_view || !views[v].camera->contains({in_view->px})) continue;
    const auto seen =
        std::ranges::find(out.at.sightings, views[v].index, [](const Sighting& s) { return s.row.camera; });
    if (seen != out.at.sightings.end()) {
      const double size = std::log(seen->radius_px / in_view->radius_px) / sighting_tuning.region_size_sigma;
      const double reach_px = nth == 1 ? views[v].image->width : in_view->radius_px;
      const auto camera = std::size_t(views[v].index);
      if (nth++ > 0)
        out.evidence += std::log(
            detection.probability /
            (2 * in_view->radius_px * reach_px *
             (clutter.density(camera, seen->px, near_radii(still) * in_view->radius_px) + clutter.unjudged(camera))));
      out.evidence += clutter.log_ratio(camera, seen->evidence);
      out.evidence -= std::min(birth_tuning.max_size_cost, 0.5 * size * size);
      continue;
    }
    const bool is_covered = std::ranges::any_of(covered, [&](const CoveredDisc& disc) {
      return disc.view == v && (disc.px - in_view->px).norm() < disc.radius_px + 0.5 * in_view->radius_px;
    });
    // Part of a larger region: of several objects that are not separated yet.
    const bool is_in_region = std::ranges::any_of(regions[v], [&](const color::ColorRegion& r) {
      return r.area > disc_area(in_view->radius_px) && in_view->px.x() > r.box.u_min && in_view->px.x() < r.box.u_max &&
             in_view->px.y() > r.box.v_min && in_view->px.y() < r.box.v_max;
    });
    if (is_covered || is_in_region || still.may_clip(std::size_t(views[v].index), in_view->px, in_view->radius_px))
      continue;
    out.evidence += llr_missed();
  }
  return out;
}

// Best first, without candidates whose regions belong to better ones; in a room that shares the colour, of one object,
// without all that are less likely.
std::vector<ObjectBirths::Candidate> ObjectBirths::candidates(const std::vector<TargetView>& views,
                                                              std::span<const std::vector<color::ColorRegion>> regions,
                                                              std::span<const CoveredDisc> covered,
                                                              const ClutterMap& clutter, const StaticClutterMask& still,
                                                              const MotionState& times) const {
  std::vector<Candidate> all;
  for (PositionCandidate& c :
       cross_rays(views, regions, target_, options_, times, sighting_tuning.max_crossings * TargetOptions::most_count))
    all.push_back(weighed(std::move(c), views, regions, covered, clutter, still));
  std::ranges::stable_sort(all, [](const Candidate& a, const Candidate& b) { return a.evidence > b.evidence; });
  const bool is_only_one = target_.count == 1 && still.is_room_shared();
  std::vector<Candidate> out;
  for (Candidate& c : all) {
    bool is_left_out = false;
    for (Candidate& better : out) {
      const double apart_m = (better.at.position - c.at.position).norm();
      if (!is_only_one && !share_a_region(better.at, c.at) &&
          apart_m >= sighting_tuning.same_object_radii * target_.radius_m)
        continue;
      const bool is_as_good = better.evidence - c.evidence < -llr_missed();  // less than one view counts
      if (is_as_good && apart_m > target_.radius_m)
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
                                      std::span<const CoveredDisc> covered, const ClutterMap& clutter,
                                      const StaticClutterMask& still, capture::Timestamp set_at,
                                      const MotionState& times) {
  std::vector<Birth> out;
  now_.clear();
  const auto with_regions = std::ranges::count_if(regions, [](const auto& some) { return !some.empty(); });
  if (with_regions < std::min<std::ptrdiff_t>(2, std::ssize(views)))
    return out;  // no evidence against the candidates either
  now_ = candidates(views, regions, covered, clutter, still, times);
  const double dt = capture::seconds(set_at - before_at_);
  std::vector<Candidate> kept;
  for (const Candidate& c : now_) {
    const double travel_m = options_.start_speed_m_s * dt;
    const Candidate* earlier = nullptr;
    if (dt > 0 && dt < sighting_tuning.confirmation_s) {
      for (const Candidate& e : before_) {
        const double sigma_m = std::hypot(largest_sigma(c.at.covariance), largest_sigma(e.at.covariance), travel_m);
        const double apart_m = (c.at.position - e.at.position).norm();
        if (apart_m > sighting_tuning.prediction_sigmas * sigma_m) continue;
        if (earlier == nullptr || apart_m < (c.at.position - earlier->at.position).norm()) earlier = &e;
      }
    }
    if (earlier != nullptr && !c.is_ambiguous && !earlier->is_ambiguous) {
      out.push_back({earlier->at, c.at, dt, evidence_of_discs(c.at, target_.radius_m)});
    } else {
      kept.push_back(c);
    }
  }
  before_ = std::move(kept);
  before_at_ = set_at;
  return out;
}

double ObjectBirths::best_evidence_besides(const Eigen::Vector3d& position) const {
  double best = 0;
  for (const Candidate& c : now_)
    if ((c.at.position - position).norm() > sighting_tuning.extent_radii * target_.radius_m)
      best = std::max(best, c.evidence);
  return best;
}

// Of one object at most one is right.
void ObjectBirths::claim(ClutterMap& clutter) const {
  double all = 1;
  if (target_.count == 1)
    for (const Candidate& c : now_) all += std::exp(c.evidence);
  for (const Candidate& c : now_)
    clutter.claim(c.at.sightings, target_.count == 1 ? std::exp(c.evidence) / all : 1 / (1 + std::exp(-c.evidence)));
}

}  // namespace huetrack::objects
