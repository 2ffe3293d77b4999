#include "object_tracking/region_tracker.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "particle_filter/moments.h"
#include "particle_filter/resample.h"

namespace huetrack::object_tracking {
namespace {

// White acceleration has a power density a^2 tau: an acceleration of a that lasts for about tau.
constexpr double acceleration_time_s = 0.1;
constexpr double least_acceleration_m_s2 = 3;  // nothing moves more evenly than this for long
constexpr double floor_likelihood = 1.0 / 25;  // the paper's, eqs. (5), (6): tolerates occlusion and locks nothing out
constexpr double region_gate = 16;             // chi-square, 2 degrees of freedom, 99.97 %
constexpr double least_support = 0.15;         // of a region that counts as the object
constexpr std::size_t max_candidates = 4;
constexpr double longest_confirmation_s = 0.5;  // a candidate that is older confirms nothing

// An exposure smears a moving object. Indoors, one period of the light of lamps is the shortest one without flicker,
// and the longest one before motion blurs what colour is.
constexpr double longest_exposure_s = 0.010;
// Mean squared innovation in its standard deviations; 1 is usual. The hardest acceleration does not explain it.
constexpr double usual_surprise = 3, bounce_surprise = 6;

// At usual speeds, some metres a second, this is some millimetres of way: as much as what else is not known.
constexpr double open_time_s = 2e-3;
// Slower than this, times hardly matter: 6 mm at 20 ms.
constexpr double at_rest_m_s = 0.3;

// Ten seconds of motion at 30 sets a second tell all that there is to tell of times; and a pass over them takes no
// longer than some ten milliseconds.
constexpr std::size_t most_seen_sets = 300;
constexpr int passes = 3;
constexpr std::size_t sets_of_a_start = 2;  // that say where the object is and how it moves
// Half of what is told in ten seconds is told anew.
constexpr int sets_until_again = 75;

constexpr double surely_moved_px = 1;  // by as much a region of some hundred pixels moves and changes visibly
// A view that should show the object is looked through as a whole in every so many-th set in which it does not: that
// takes longer than all else. What it finds may be the object if it covers so much of the disc that would be there.
constexpr unsigned far_looks_every = 4;
constexpr double least_far_share = 0.3, largest_far_share = 4;
constexpr double excused_share_of_speed = 0.25;
constexpr unsigned sets_until_known = 8;  // since it was found
constexpr double nowhere_px = 50;         // how far apart views are whose rays do not meet
// A candidate that two views agree on while another one shows something of its size elsewhere must be seen in so many
// sets: by chance rays meet once and again, but not for as long.
constexpr int contested_sets = 8;

constexpr auto as_good_as_the_sets_time = std::chrono::milliseconds(2);  // a line is exact enough for as long

double largest_variance(const Eigen::Matrix3d& covariance) {
  return std::max(0.0, covariance.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
}

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(largest_variance(covariance));
}

// Frames that a trigger did not start at one moment. Stamps that agree by chance, camera by camera and set by set, do
// not happen.
bool is_apart(const std::vector<TargetView>& views) {
  constexpr auto trigger_jitter = capture::Duration(50'000);
  return std::ranges::any_of(views, [&](const TargetView& view) {
    return std::chrono::abs(view.frame->captured_at - views.front().frame->captured_at) > trigger_jitter;
  });
}

SeenRegion seen_region(const TargetView& view, const Eigen::Vector2d& px, double radius_px, bool is_target) {
  return {.camera = view.index,
          .at = view.frame->row_time(px.y()),
          .px = px,
          .radius_px = radius_px,
          .below_middle = view.below_middle(px.y()),
          .is_target = is_target};
}

void sort_by_time(std::vector<Sighting>& sightings) {
  std::ranges::stable_sort(sightings, {}, [](const Sighting& s) { return s.row.at; });
}

}  // namespace

ObjectEstimate RegionTracker::update(const capture::FrameSet& set) {
  const std::vector<TargetView>& views = views_.look_at(set);
  sightings_.clear();
  seen_.clear();
  watched_.clear();
  seen_regions_.clear();
  measure_color(views, set.at);
  sets_apart_ += is_apart(views) ? 1 : 0;
  if (set.at < last_at_) forget();  // the clock was put back: what was known is of another time
  if (state_ == TrackState::tracking || state_ == TrackState::coasting) {
    sight(views, sightings_);  // colour regions near the prediction, one per view at most
    sight(views_.unused(), watched_);
    compare(views, set.at);
    const double q = learn_acceleration(set, views);
    const MotionBelief proposal = propose(set, q);  // motion and regions together, linearised
    const MotionBelief at_views =
        proposal.given_views();  // particles are positions, for views as they are believed to be
    draw_particles(at_views);
    weigh(at_views, q);  // what the linearisation and the floor change
    estimate(at_views);
    belief_.open_views_as(proposal);
    if (remember(q)) linearise_times_again();
    judge(set);
  }
  if (state_ != TrackState::tracking) search(set, views);
  last_at_ = set.at;
  return report(set, views);
}

RegionTracker::RegionTracker(const calib::CameraRig& rig, const TargetOptions& target,
                             const ObjectTrackerOptions& options, particle_filter::Rng rng)
    : target_(target),
      options_(options),
      views_(rig, target),
      rng_(rng),
      belief_(rig, options.timing == TimingMode::learn),
      begun_(belief_),
      acceleration_(options.acceleration_m_s2),
      doubts_(rig.cameras.size()),
      pose_covariance_(rig.cameras.size(), Eigen::Matrix<double, 6, 6>::Zero()),
      unseen_(rig.cameras.size()),
      color_shares_(rig.cameras.size()),
      rig_error_(rig, options.max_coast_sigma_m),
      last_regions_(rig.cameras.size()),
      finders_(rig.cameras.size()),
      regions_(rig.cameras.size()),
      search_log_(rig.cameras.size()) {
  for (const calib::Camera& camera : rig.cameras) size_in_view_.push_back(size_in(camera));
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const double largest_px = size_in_view_[c].largest_px;
    const calib::ImageSize size = rig.cameras[c].image_size;
    color_shares_[c].of_target = std::min(1.0, std::numbers::pi * largest_px * largest_px / (size.width * size.height));
  }
  scatter();
}

// How small and how large the target appears in a view anywhere in the volume: on a grid, of which only what is in the
// image counts (a corner of the volume may be beside or behind the camera).
RegionTracker::SizeInView RegionTracker::size_in(const calib::Camera& camera) const {
  constexpr int steps = 12;
  SizeInView out;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k) {
        const Eigen::Array3d share = Eigen::Array3d(i, j, k) / steps;
        const Eigen::Vector3d p =
            options_.volume.min.array() + share * (options_.volume.max - options_.volume.min).array();
        const auto at = appearance_of(camera, p, target_.radius_m);
        if (!at || !camera.contains({at->px})) continue;
        out.smallest_px = out.largest_px == 0 ? at->radius_px : std::min(out.smallest_px, at->radius_px);
        out.largest_px = std::max(out.largest_px, at->radius_px);
      }
    }
  }
  return out;
}

void RegionTracker::scatter() {
  const auto n = static_cast<std::size_t>(options_.particle_count);
  particles_.resize(n);
  unit_.resize(3 * n);
  rng_.fill_uniform(unit_);
  const Eigen::Vector3f min = options_.volume.min.cast<float>();
  const Eigen::Vector3f extent = (options_.volume.max - options_.volume.min).cast<float>();
  for (std::size_t i = 0; i < n; ++i) {
    particles_.x[i] = min.x() + extent.x() * unit_[i];
    particles_.y[i] = min.y() + extent.y() * unit_[n + i];
    particles_.z[i] = min.z() + extent.z() * unit_[2 * n + i];
  }
  weight_.assign(n, 1.0f / static_cast<float>(n));
  effective_sample_size_ = static_cast<double>(n);
}

double RegionTracker::power_density() const {
  return acceleration_ * acceleration_ * acceleration_time_s;
}

// Where a view shows the object, if it goes on as it does: at the time of the row on which it is seen, which depends on
// where it is seen. The rows run faster than any object, so that two steps find it.
std::optional<RegionTracker::ExpectedView> RegionTracker::expect(const TargetView& view) const {
  ExpectedView out;
  double row = (view.image->height - 1) / 2.0;
  for (int step = 0; step < 3; ++step) {
    out.row = row_of(view, row, belief_);
    const auto at = appearance_of(*view.camera, belief_.position_at(out.row.at), target_.radius_m);
    if (!at) return std::nullopt;
    out.at = *at;
    row = std::clamp(at->px.y(), -0.5 * view.image->height, 1.5 * view.image->height);
  }
  return out;
}

ImageMotion RegionTracker::image_motion(const TargetView& view, const Appearance& at) const {
  const double readout_s = capture::seconds(view.frame->readout) + belief_.row_shift_s(view.index, 0.5) -
                           belief_.row_shift_s(view.index, -0.5);
  return {.velocity = at.jacobian * belief_.velocity(),
          .row_s = view.image->height > 1 ? readout_s / (view.image->height - 1) : 0.0,
          .longest_exposure_s = longest_exposure_s};
}

// The regions large enough to be the object within three standard deviations of where it is expected, and its disc.
// None where that is nowhere near the image. Valid until the view's next call.
std::span<const ColorRegion> RegionTracker::regions_near(const TargetView& view, const Appearance& at,
                                                         const Eigen::Matrix2d& spread) {
  // Not beyond the image's own size around it: a box is clipped to the image anyway, and an int must hold it.
  const double limit = view.matches->width() + view.matches->height();
  if (!(std::abs(at.px.x()) < 2 * limit && std::abs(at.px.y()) < 2 * limit)) return {};
  const double reach_u = std::min(limit, 3 * std::sqrt(spread(0, 0)) + 2 * at.radius_px + 2);
  const double reach_v = std::min(limit, 3 * std::sqrt(spread(1, 1)) + 2 * at.radius_px + 2);
  const PixelBox box{
      static_cast<int>(std::floor(at.px.x() - reach_u)), static_cast<int>(std::floor(at.px.y() - reach_v)),
      static_cast<int>(std::ceil(at.px.x() + reach_u)), static_cast<int>(std::ceil(at.px.y() + reach_v))};
  const double disc = std::numbers::pi * at.radius_px * at.radius_px;
  const int min_area = std::max(2, static_cast<int>(least_support * disc));
  return finders_[static_cast<std::size_t>(view.index)].find(*view.matches, box, min_area, 1.3 * at.radius_px);
}

// Cameras, drivers and cables show a frame once more now and then, with a new stamp. No two frames have the same noise:
// one in which the region of a moving object is the same to its last pixel is the frame before, and says nothing of
// now. Twice in a row the object stands still, in pictures without noise.
bool RegionTracker::is_repeated(const TargetView& view, std::span<const ColorRegion> regions, const Appearance& at) {
  LastRegion& last = last_regions_[static_cast<std::size_t>(view.index)];
  const double moved_px =
      (at.jacobian * belief_.velocity()).norm() * capture::seconds(view.frame->captured_at - last.captured_at);
  last.is_repeated =
      !last.is_repeated && moved_px > surely_moved_px && std::ranges::any_of(regions, [&](const ColorRegion& region) {
        return region.area == last.region.area && region.centre == last.region.centre;
      });
  return last.is_repeated;
}

// In each view the region near the prediction that explains it best, if there is one.
void RegionTracker::sight(const std::vector<TargetView>& views, std::vector<Sighting>& out) {
  for (const TargetView& view : views) {
    const auto expected = expect(view);
    if (!expected) continue;
    const Appearance& at = expected->at;
    // The gate allows for twice the hardest usual acceleration, whatever the filter has learnt: a throw must not lose
    // the object.
    const double dt = capture::seconds(expected->row.at - belief_.at);
    const double reach_m = options_.acceleration_m_s2 * dt * dt;
    const Eigen::Matrix3d spread =
        belief_.seen_covariance(expected->row, power_density()) + reach_m * reach_m * Eigen::Matrix3d::Identity();
    const auto c = static_cast<std::size_t>(view.index);
    Eigen::Matrix2d s = at.jacobian * spread * at.jacobian.transpose();
    s.diagonal().array() += doubts_.variance_px2(c);
    if (has_pose_covariance_)
      s += px_covariance_of_pose(*view.camera, belief_.position_at(expected->row.at), at, pose_covariance_[c]);
    double best = -std::numeric_limits<double>::infinity();
    std::optional<Sighting> chosen;
    ColorRegion chosen_region;
    const std::span<const ColorRegion> regions = regions_near(view, at, s);
    if (is_repeated(view, regions, at)) continue;
    for (const ColorRegion& region : regions) {
      const Sighting sighting =
          sighting_of(view, region, at.radius_px, options_.pixel_noise_px, image_motion(view, at));
      const Eigen::Matrix2d total =
          s + sighting.covariance + sighting.lasting_px * sighting.lasting_px * Eigen::Matrix2d::Identity();
      const Eigen::Vector2d d = sighting.px - at.px;
      const double d2 = d.dot(total.inverse() * d);
      if (d2 > region_gate) continue;
      const double score = std::log(sighting.support) - 0.5 * d2 - 0.5 * std::log(sighting.covariance.determinant());
      if (score > best) best = score, chosen = sighting, chosen_region = region;
    }
    if (!chosen) continue;
    last_regions_[static_cast<std::size_t>(view.index)] = {chosen_region, view.frame->captured_at};
    chosen->row = row_of(view, chosen->px.y(), belief_);
    out.push_back(*chosen);
  }
  sort_by_time(out);
}

// Beside where the object would be if it had gone on as it did.
std::optional<SeenBeside> RegionTracker::beside(const Sighting& sighting) const {
  const auto at = appearance_of(*sighting.camera, belief_.position_at(sighting.row.at), target_.radius_m);
  if (!at) return std::nullopt;
  const Eigen::Vector2d px_per_s = at->jacobian * belief_.velocity();
  const double time_sigma_s = belief_.row_sigma_s(sighting.row.camera, sighting.row.below_middle);
  SeenBeside out{.camera = sighting.row.camera,
                 .at_s = capture::seconds(sighting.row.at - belief_.at),
                 .off_px = sighting.px - at->px,
                 .covariance = sighting.covariance + sighting.of_pose +
                               time_sigma_s * time_sigma_s * px_per_s * px_per_s.transpose(),
                 .jacobian = at->jacobian};
  out.covariance.diagonal().array() += sighting.lasting_px * sighting.lasting_px;
  return out;
}

// Of what a whole image shows, the only region that may be the object and is not where one was a tenth of a second ago.
// What stands still is furniture. Several that move are several objects, and tell nothing.
const ColorRegion* RegionTracker::only_moving(int camera, std::span<const ColorRegion> regions, double disc_px2,
                                              double still_px, capture::Timestamp at) {
  constexpr double least_age_s = 0.08, largest_age_s = 0.5;
  Unseen& unseen = unseen_[static_cast<std::size_t>(camera)];
  if (capture::seconds(at - unseen.newer_at) >= least_age_s) {
    std::swap(unseen.older, unseen.newer);
    unseen.older_at = unseen.newer_at;
    unseen.newer.assign(regions.begin(), regions.end());
    unseen.newer_at = at;
  }
  const double age_s = capture::seconds(at - unseen.older_at);
  if (age_s < least_age_s || age_s > largest_age_s) return nullptr;
  const ColorRegion* moved = nullptr;
  for (const ColorRegion& region : regions) {
    if (region.area < least_far_share * disc_px2) continue;
    if (region.area > largest_far_share * disc_px2) return nullptr;
    const bool was_there = std::ranges::any_of(
        unseen.older, [&](const ColorRegion& before) { return (before.centre - region.centre).norm() < still_px; });
    if (was_there) continue;
    if (moved != nullptr) return nullptr;
    moved = &region;
  }
  return moved;
}

// A view that should show the object, and does not where the others have it: shows it something like it elsewhere? Seen
// through another calibration it may be anywhere in the image.
std::optional<SeenBeside> RegionTracker::far_off(const TargetView& view, capture::Timestamp set_at) {
  Unseen& unseen = unseen_[static_cast<std::size_t>(view.index)];
  const auto expected = expect(view);
  if (!expected || !view.camera->contains({expected->at.px})) return std::nullopt;
  if (unseen.sets++ % far_looks_every != 0 && !unseen.is_suspicious) return std::nullopt;
  const Appearance& at = expected->at;
  const double disc = std::numbers::pi * at.radius_px * at.radius_px;
  const auto& regions = finders_[static_cast<std::size_t>(view.index)].search(
      *view.matches, std::max(1, static_cast<int>(at.radius_px)), static_cast<int>(std::ceil(3 * at.radius_px)) + 2,
      std::max(2, static_cast<int>(least_far_share * disc)), at.radius_px);
  note_regions(view, regions);
  const ColorRegion* moved = only_moving(view.index, regions, disc, std::max(2.0, 0.2 * at.radius_px), set_at);
  unseen.is_suspicious = moved != nullptr;
  if (moved == nullptr) return std::nullopt;
  Sighting sighting = sighting_of(view, *moved, at.radius_px, options_.pixel_noise_px, image_motion(view, at));
  sighting.row = row_of(view, sighting.px.y(), belief_);
  return beside(sighting);
}

// What the views show of an object that is not found: where each has one thing that moves, they must agree about it. So
// the views of a rig that is another one are doubted before something is found that is not there.
void RegionTracker::compare_searched(const std::vector<TargetView>& views, capture::Timestamp set_at) {
  std::vector<Sighting> moving;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const SizeInView& size = size_in_view_[static_cast<std::size_t>(views[i].index)];
    const double radius_px = std::sqrt(size.smallest_px * size.largest_px);
    const ColorRegion* moved = only_moving(views[i].index, regions_[i], std::numbers::pi * radius_px * radius_px,
                                           std::max(2.0, 0.2 * radius_px), set_at);
    if (moved == nullptr) continue;
    moving.push_back(
        sighting_of(views[i], *moved, std::sqrt(moved->area / std::numbers::pi), options_.pixel_noise_px, {}));
    moving.back().row = row_of(views[i], moving.back().px.y(), belief_);
  }
  for (std::size_t a = 0; a < moving.size(); ++a) {
    for (std::size_t b = a + 1; b < moving.size(); ++b) {
      if (const auto seen = disagreement_of(moving[a], moving[b]))
        doubts_.add(static_cast<std::size_t>(moving[a].row.camera), static_cast<std::size_t>(moving[b].row.camera),
                    *seen);
    }
  }
}

// Of two views of something of which nothing else is known; nullopt: they tell nothing.
std::optional<Disagreement> RegionTracker::disagreement_of(const Sighting& i, const Sighting& j) const {
  // Rays that do not meet before both cameras are as far apart as can be.
  Disagreement seen{.off_px = nowhere_px, .expected_px2 = 1, .share_i = 0.5, .share_j = 0.5};
  const auto p = crossing(*i.camera, {i.px}, *j.camera, {j.px});
  if (!p) return seen;
  const auto beside_p = [&](const Sighting& s) -> std::optional<SeenBeside> {
    const auto at = appearance_of(*s.camera, *p, target_.radius_m);
    if (!at) return std::nullopt;
    SeenBeside out;
    out.camera = s.row.camera;
    out.off_px = s.px - at->px;
    out.covariance = s.covariance;
    out.covariance.diagonal().array() += s.lasting_px * s.lasting_px;
    out.jacobian = at->jacobian;
    return out;
  };
  const double apart_s = std::hypot(capture::seconds(i.row.at - j.row.at),
                                    std::hypot(belief_.row_sigma_s(i.row.camera, i.row.below_middle),
                                               belief_.row_sigma_s(j.row.camera, j.row.below_middle)));
  const double way_m = options_.start_speed_m_s * apart_s;
  const auto of_i = beside_p(i), of_j = beside_p(j);
  if (!of_i || !of_j || !disagreement(*of_i, *of_j, way_m * way_m, seen)) return std::nullopt;
  return seen;
}

void RegionTracker::note_regions(const TargetView& view, std::span<const ColorRegion> regions) {
  constexpr std::size_t most = 4;  // of a view, the largest
  for (const ColorRegion& region : regions.first(std::min(most, regions.size()))) {
    seen_regions_.push_back(seen_region(view, region.centre, std::sqrt(region.area / std::numbers::pi), false));
  }
}

// One view after the other, each about once in half a second.
void RegionTracker::measure_color(const std::vector<TargetView>& views, capture::Timestamp set_at) {
  constexpr double every_s = 0.5;
  constexpr int step_px = 8;
  if (views.empty() || std::abs(capture::seconds(set_at - shared_at_)) < every_s / static_cast<double>(views.size()))
    return;
  shared_at_ = set_at;
  const TargetView& view = views[shared_next_++ % views.size()];
  hits_.clear();
  view.matches->grid(step_px, hits_);
  const double probed = std::max(1.0, std::floor((view.image->width + step_px / 2.0) / step_px) *
                                          std::floor((view.image->height + step_px / 2.0) / step_px));
  color_shares_[static_cast<std::size_t>(view.index)].of_picture =
      std::min(1.0, static_cast<double>(hits_.size()) / probed);
}

// Every view with every other one, before one of them is left out; then each is doubted by what came of it.
void RegionTracker::compare(const std::vector<TargetView>& views, capture::Timestamp set_at) {
  besides_.clear();
  doubt(sightings_);
  for (const Sighting& s : sightings_) {
    unseen_[static_cast<std::size_t>(s.row.camera)].sets = 0;
    unseen_[static_cast<std::size_t>(s.row.camera)].is_suspicious = false;
    if (const auto seen = beside(s)) besides_.push_back(*seen);
  }
  for (const TargetView& view : views) {
    const auto seen = std::ranges::find(sightings_, view.index, [](const Sighting& s) { return s.row.camera; });
    if (seen != sightings_.end()) {
      seen_regions_.push_back(seen_region(view, seen->px, seen->radius_px, true));
    } else if (!sightings_.empty()) {
      if (const auto far = far_off(view, set_at)) besides_.push_back(*far);
    }
  }
  compare_besides();
  doubt(sightings_);
  doubt(watched_);
  seen_ = sightings_;
  seen_.insert(seen_.end(), watched_.begin(), watched_.end());
}

void RegionTracker::compare_sighted() {
  besides_.clear();
  for (const Sighting& s : sightings_)
    if (const auto seen = beside(s)) besides_.push_back(*seen);
  compare_besides();
  doubt(sightings_);
}

void RegionTracker::compare_besides() {
  // A velocity that is not known any more, as the views contradict one another, is no excuse for them; one that is not
  // known yet is.
  const double excused = ++compared_sets_ > sets_until_known ? excused_share_of_speed : 1.0;
  const double velocity_sigma =
      std::min(largest_sigma(belief_.velocity_covariance()), excused * options_.start_speed_m_s);
  doubts_.compare(besides_, velocity_sigma, options_.acceleration_m_s2);
}

// How far each of them may be off in every frame alike.
void RegionTracker::doubt(std::vector<Sighting>& sightings) const {
  for (Sighting& s : sightings) {
    const auto c = static_cast<std::size_t>(s.row.camera);
    s.doubt_px2 = doubts_.variance_px2(c);
    if (!has_pose_covariance_) continue;
    const Eigen::Vector3d then = belief_.position_at(s.row.at);
    const auto at = appearance_of(*s.camera, then, target_.radius_m);
    if (at) s.of_pose = px_covariance_of_pose(*s.camera, then, *at, pose_covariance_[c]);
  }
}

void RegionTracker::trust(std::span<const CameraTrust> cameras) {
  for (const std::size_t c : views_.trust(cameras)) {
    doubts_.forget(c);
    belief_.forget_lasting(static_cast<int>(c));
    seen_sets_.clear();  // they were seen by a camera that stood elsewhere
    is_forgetting_motion_ = true;
  }
  has_pose_covariance_ = false;
  for (std::size_t c = 0; c < pose_covariance_.size(); ++c) {
    pose_covariance_[c] = c < cameras.size() ? cameras[c].pose_covariance : Eigen::Matrix<double, 6, 6>::Zero();
    has_pose_covariance_ = has_pose_covariance_ || !pose_covariance_[c].isZero(0);
  }
  std::vector<bool> posed_anew;  // what is open of those poses is said in their own covariance
  for (const CameraTrust& camera : cameras) posed_anew.push_back(camera.cam_from_world.has_value());
  rig_error_.leave_out_poses(posed_anew);
}

// The object bounced, or was hit or thrown, since the last set: it may be wherever twice its speed, or the highest
// usual one, takes it. Two views or more that see it in one such place are believed at once; one is not.
bool RegionTracker::sight_after_bounce(const std::vector<TargetView>& views, double power_density) {
  double dt = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    regions_[i].clear();
    const auto expected = expect(views[i]);
    if (!expected || last_regions_[static_cast<std::size_t>(views[i].index)].is_repeated) continue;
    dt = std::max(dt, capture::seconds(expected->row.at - belief_.at));
    const Appearance& at = expected->at;
    const Eigen::Matrix3d spread = belief_.seen_covariance(expected->row, power_density);
    const auto near = regions_near(views[i], at, at.jacobian * spread * at.jacobian.transpose());
    regions_[i].assign(near.begin(), near.end());
  }
  const Eigen::Vector3d expected = belief_.position() + dt * belief_.velocity();
  const double reach_m =
      3 * std::sqrt(power_density * dt * dt * dt / 3 + largest_variance(belief_.position_covariance()));
  for (const PositionCandidate& c :
       cross_rays(views, std::span(regions_).first(views.size()), target_, options_, belief_, max_candidates)) {
    if ((c.position - expected).norm() > reach_m || c.sightings.size() <= sightings_.size()) continue;
    sightings_ = c.sightings;
    sort_by_time(sightings_);
    doubt(sightings_);
    seen_ = sightings_;
    return true;
  }
  return false;
}

// The belief after the sightings, each at its own time. linearised_about: a motion near the object's; nullptr: as it is
// expected to go on.
MotionBelief RegionTracker::observed(const MotionBelief& from, const MotionBelief* linearised_about,
                                     double power_density) {
  MotionBelief out = from;
  linear_views_.clear();
  double surprise = 0;
  for (const Sighting& sighting : sightings_) {
    out.predict_to(sighting.row.at, power_density);
    const MotionBelief& near = linearised_about != nullptr ? *linearised_about : out;
    const Eigen::Vector3d then = near.position_at(sighting.row.at);
    const auto at = appearance_of(*sighting.camera, then, target_.radius_m);
    if (!at) continue;
    linear_views_.push_back({&sighting,
                             {.row = sighting.row,
                              .px = sighting.px,
                              .covariance = sighting.covariance,
                              .lasting_px = sighting.lasting_px,
                              .doubt = sighting.doubt(),
                              .linearised_at = then,
                              .px_expected = at->px,
                              .jacobian = at->jacobian}});
    surprise += out.observe(linear_views_.back().linear, near.velocity(), power_density);
  }
  surprise_ = linear_views_.empty() ? 1 : surprise / (2 * static_cast<double>(linear_views_.size()));
  return out;
}

bool RegionTracker::are_times_open() const {
  return std::ranges::any_of(sightings_, [&](const Sighting& s) {
    return belief_.row_sigma_s(s.row.camera, s.row.below_middle) > open_time_s;
  });
}

// Of three views or more, one that contradicts what all others agree on with the motion: it shows a frame once more, or
// something else of this colour. A bounce contradicts all of them.
void RegionTracker::leave_out_what_contradicts() {
  if (sightings_.size() < 3 || surprise_ <= usual_surprise) return;
  const std::vector<Sighting> all = sightings_;
  std::vector<Sighting> best;
  // The others must agree; and much better than all did, as a swerve surprises some views more than others.
  double least_surprise = std::min(usual_surprise, surprise_ / 3);
  for (std::size_t i = 0; i < all.size(); ++i) {
    sightings_ = all;
    sightings_.erase(sightings_.begin() + static_cast<std::ptrdiff_t>(i));
    observed(belief_, nullptr, power_density());
    if (surprise_ < least_surprise) least_surprise = surprise_, best = sightings_;
  }
  sightings_ = best.empty() ? all : best;
  observed(belief_, nullptr, power_density());
}

// Covariance matching: raise the acceleration until the innovations of all sightings together are ones that it
// explains, lower it slowly while they are smaller than they need be. Returns the power density to use for this set: a
// bounce needs one that is not learnt, as what comes after it is as calm as what went before.
double RegionTracker::learn_acceleration(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  const double before = acceleration_;
  const double ceiling = 4 * options_.acceleration_m_s2;
  if (!sightings_.empty()) observed(belief_, nullptr, power_density());
  leave_out_what_contradicts();
  while (!sightings_.empty() && surprise_ > usual_surprise && acceleration_ < ceiling) {
    acceleration_ = std::min(ceiling, 1.5 * acceleration_);
    observed(belief_, nullptr, power_density());
  }
  const double dt = capture::seconds(set.at - belief_.at);
  const bool is_unexplained = sightings_.size() >= 2 && surprise_ > bounce_surprise;
  if (dt > 0 && views.size() >= 2 && (sightings_.size() < 2 || is_unexplained)) {
    // A velocity that changes by `kick` on each axis at any moment since the last set is as good as white acceleration
    // of this power density.
    const double kick = std::max(belief_.velocity().norm(), options_.start_speed_m_s);
    const double q = kick * kick / dt;
    if (sight_after_bounce(views, q) || is_unexplained) {
      acceleration_ = before;
      return std::max(q, power_density());
    }
  }
  // While the times are open, small innovations do not tell calm motion: nearly all of what is expected of them is the
  // times'. And a motion that is taken for too calm passes for cameras that are late.
  const double usual = (belief_.velocity().norm() > at_rest_m_s ? 2 : 1) * options_.acceleration_m_s2;
  const double least = are_times_open() ? usual : least_acceleration_m_s2;
  if (!sightings_.empty())
    acceleration_ =
        std::clamp(acceleration_ * std::exp(0.05 * (std::min(surprise_, usual_surprise) - 1)), least, ceiling);
  return power_density();
}

// Linearised again where the object turns out to be, when that is not where it was expected (Bell and Cathey 1993).
// What a single view leaves open must be the ray through its pixel, to a fraction of the pixel over all of the open
// depth, or particles along the wrong line make the filter sure of a depth that nobody measured.
MotionBelief RegionTracker::observed_in_passes(const MotionBelief& from, double power_density) {
  MotionBelief out = observed(from, nullptr, power_density);
  Eigen::Vector3d before = from.position() + capture::seconds(out.at - from.at) * from.velocity();
  for (int iteration = 0; iteration < 3; ++iteration) {
    const double moved_m = (out.position() - before).norm();
    if (moved_m < (iteration == 0 ? 0.1 : 0.01) * target_.radius_m) break;
    before = out.position();
    const MotionBelief about = out;
    out = observed(from, &about, power_density);
  }
  return out;
}

// Rows of two sets may overlap in time, but positions are told in the order of time; and an object that nobody sees is
// predicted to the set's time.
void RegionTracker::predict_to_be_told(MotionBelief& belief, capture::Timestamp set_at, double power_density) const {
  if (linear_views_.empty() || belief.at <= last_reported_)
    belief.predict_to(std::max(set_at, last_reported_ + capture::Duration(1)), power_density);
}

MotionBelief RegionTracker::propose(const capture::FrameSet& set, double power_density) {
  MotionBelief out = observed_in_passes(belief_, power_density);
  predict_to_be_told(out, set.at, power_density);
  return out;
}

// Antithetic pairs, shaped to the proposal's covariance exactly: where everything is Gaussian the filter is then
// exactly the Kalman filter, and the only Monte Carlo noise left is in what is not.
void RegionTracker::draw_particles(const MotionBelief& proposal) {
  const auto n = static_cast<std::size_t>(options_.particle_count);
  const std::size_t pairs = (n + 1) / 2;
  unit_.resize(3 * pairs);
  rng_.fill_normal(unit_);
  const float *e0 = unit_.data(), *e1 = e0 + pairs, *e2 = e1 + pairs;
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  for (std::size_t i = 0; i < pairs; ++i) {
    xx += e0[i] * e0[i], xy += e0[i] * e1[i], xz += e0[i] * e2[i];
    yy += e1[i] * e1[i], yz += e1[i] * e2[i], zz += e2[i] * e2[i];
  }
  Eigen::Matrix3f drawn;
  drawn << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  const Eigen::Matrix3d sample = drawn.cast<double>() / static_cast<double>(pairs);
  const Eigen::Matrix3d root = proposal.position_covariance().llt().matrixL();
  // root * sample_root^-1 turns the draws' own covariance into the proposal's; with fewer than four pairs they have
  // none.
  const Eigen::LLT<Eigen::Matrix3d> sample_root(sample);
  Eigen::Matrix3d shape = root;
  if (pairs > 3 && sample_root.info() == Eigen::Success) {
    shape = root * Eigen::Matrix3d(sample_root.matrixL()).inverse();
  }
  const Eigen::Matrix3f a = shape.cast<float>();
  const Eigen::Vector3f m = proposal.position().cast<float>();
  particles_.resize(n);
  const auto draw = [&](std::size_t from, std::size_t count, float sign) {
    for (std::size_t i = 0; i < count; ++i) {
      particles_.x[from + i] = m(0) + sign * (a(0, 0) * e0[i] + a(0, 1) * e1[i] + a(0, 2) * e2[i]);
      particles_.y[from + i] = m(1) + sign * (a(1, 0) * e0[i] + a(1, 1) * e1[i] + a(1, 2) * e2[i]);
      particles_.z[from + i] = m(2) + sign * (a(2, 0) * e0[i] + a(2, 1) * e1[i] + a(2, 2) * e2[i]);
    }
  };
  draw(0, pairs, 1);
  draw(pairs, n - pairs, -1);
}

// Weight of a particle: prior times likelihood over proposal. The proposal is the prior times the linearised Gaussian
// likelihoods, so what is left is, per view,
//   p_m(s_i | img_m) / Gauss_m(s_i),   p_m = max(1/25, support * exp(-d^2 / 2))
// with d the distance from the particle's projection, through the whole lens and at the view's own time, to the centre
// of the colour region, in the region's covariance.
void RegionTracker::weigh(const MotionBelief& proposal, double power_density) {
  const std::size_t n = particles_.size();
  log_weight_.assign(n, 0.0f);
  u_.resize(n), v_.resize(n);
  seen_at_.resize(n);
  const float *x = particles_.x.data(), *y = particles_.y.data(), *z = particles_.z.data();
  for (const LinearView& view : linear_views_) {
    const Sighting& sighting = *view.sighting;
    const LinearSighting& linear = view.linear;
    // What is not of the position (velocity, times) is that of the regression on it, and what that leaves open counts
    // as the view's noise.
    const MotionBelief::SeenPosition seen = proposal.seen_given_position(linear.row, power_density);
    const Eigen::Matrix3f b = seen.slope.cast<float>();
    const Eigen::Vector3f c = seen.offset.cast<float>();
    float *px = seen_at_.x.data(), *py = seen_at_.y.data(), *pz = seen_at_.z.data();
    for (std::size_t i = 0; i < n; ++i) px[i] = b(0, 0) * x[i] + b(0, 1) * y[i] + b(0, 2) * z[i] + c(0);
    for (std::size_t i = 0; i < n; ++i) py[i] = b(1, 0) * x[i] + b(1, 1) * y[i] + b(1, 2) * z[i] + c(1);
    for (std::size_t i = 0; i < n; ++i) pz[i] = b(2, 0) * x[i] + b(2, 1) * y[i] + b(2, 2) * z[i] + c(2);
    sighting.projector->project(px, py, pz, n, u_.data(), v_.data());

    const Eigen::Matrix2d noise = linear.covariance + linear.jacobian * seen.covariance * linear.jacobian.transpose() +
                                  linear.lasting_px * linear.lasting_px * Eigen::Matrix2d::Identity() + linear.doubt;
    const Eigen::Vector2d measured = linear.px - proposal.lasting_error(linear.row.camera);
    const Eigen::Matrix2f information = noise.inverse().cast<float>();
    const float i_uu = information(0, 0), i_uv = 2 * information(0, 1), i_vv = information(1, 1);
    const auto d2_of = [=](float du, float dv) { return i_uu * du * du + i_uv * du * dv + i_vv * dv * dv; };
    const auto cu = static_cast<float>(measured.x()), cv = static_cast<float>(measured.y());
    const auto floor = static_cast<float>(std::log(floor_likelihood / sighting.support));
    // The linearisation: du = j p + k.
    const Eigen::Matrix<float, 2, 3> j = linear.jacobian.cast<float>();
    const Eigen::Vector2f k = (linear.px_expected - measured - linear.jacobian * linear.linearised_at).cast<float>();
    for (std::size_t i = 0; i < n; ++i) {
      const float linear_du = j(0, 0) * px[i] + j(0, 1) * py[i] + j(0, 2) * pz[i] + k(0);
      const float linear_dv = j(1, 0) * px[i] + j(1, 1) * py[i] + j(1, 2) * pz[i] + k(1);
      const float likelihood = std::max(std::min(floor, 0.0f), -0.5f * d2_of(u_[i] - cu, v_[i] - cv));
      log_weight_[i] += likelihood + 0.5f * std::min(d2_of(linear_du, linear_dv), 50.0f);
    }
  }
  weight_.resize(n);
  particle_filter::normalize_log_weights(log_weight_, weight_);
  // The floor gives the target heavier tails than the proposal has, so that a few particles far out can outweigh all
  // others; a handful of particles is a worse answer than the linearised one, which equal weights are.
  effective_sample_size_ = particle_filter::effective_sample_size(weight_);
  if (effective_sample_size_ < 0.1 * static_cast<double>(n)) weight_.assign(n, 1.0f / static_cast<float>(n));
}

// The weighted particles' mean and covariance are the position's; velocity and times follow by regression on it.
void RegionTracker::estimate(const MotionBelief& proposal) {
  const particle_filter::WeightedMoments moments =
      particle_filter::weighted_moments(particles_.x.data(), particles_.y.data(), particles_.z.data(), weight_.data(),
                                        particles_.size(), proposal.position().cast<float>());
  belief_ = proposal;
  belief_.set_position(moments.mean, moments.covariance + 1e-10 * Eigen::Matrix3d::Identity());
  map_ = Eigen::Vector3f(particles_.x[moments.best], particles_.y[moments.best], particles_.z[moments.best])
             .cast<double>();
}

// Returns whether what is remembered now tells more of the times than was made of it.
bool RegionTracker::remember(double power_density) {
  if (options_.timing != TimingMode::learn || is_forgetting_motion_ || sightings_.empty()) return false;
  if (seen_sets_.size() == most_seen_sets) {
    // What an object at rest showed told nothing of times. Without what a moving one did, less would be known.
    is_forgetting_motion_ = seen_sets_.front().velocity.norm() > at_rest_m_s;
    seen_sets_.pop_front();
    if (is_forgetting_motion_) seen_sets_.clear();
    if (is_forgetting_motion_) return false;
  }
  seen_sets_.push_back({power_density, sightings_, belief_.at, belief_.position(), belief_.velocity()});
  moving_sets_ += belief_.velocity().norm() > at_rest_m_s ? 1 : 0;
  if (moving_sets_ < sets_until_again && !belief_.are_times_far()) return false;
  moving_sets_ = 0;
  return seen_sets_.size() > sets_of_a_start;
}

// Velocities at the seen sets as the path around each of them tells them: less noisy than those of the filter, and not
// of the noise of that set's own sightings, with which they are multiplied.
std::vector<Eigen::Vector3d> RegionTracker::smooth_velocities() const {
  std::vector<Eigen::Vector3d> out;
  const auto count = std::ptrdiff_t(seen_sets_.size());
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const SeenSet& before = seen_sets_[std::size_t(std::max<std::ptrdiff_t>(0, i - 2))];
    const SeenSet& after = seen_sets_[std::size_t(std::min(count - 1, i + 2))];
    const double dt = capture::seconds(after.believed_at - before.believed_at);
    out.push_back(dt > 0 && dt < 0.3 ? Eigen::Vector3d((after.position - before.position) / dt)
                                     : seen_sets_[std::size_t(i)].velocity);
  }
  return out;
}

// All that was seen since the object was found is gone through once more, with rows' times as they are known now: an
// iterated extended Kalman filter (Bell and Cathey 1993), whose every pass begins where the one before has ended.
void RegionTracker::linearise_times_again() {
  const std::vector<Sighting> of_this_set = sightings_;
  const double surprise = surprise_;
  const double speed = options_.start_speed_m_s;
  const double anywhere_m = (options_.volume.max - options_.volume.min).norm();
  MotionBelief about = belief_;
  for (int pass = 0; pass < passes; ++pass) {
    const MotionBelief known = belief_;
    MotionBelief again = begun_;
    again.linearise_times_at(known);
    const std::vector<Eigen::Vector3d> velocities = smooth_velocities();
    for (std::size_t i = 0; i < seen_sets_.size(); ++i) {
      SeenSet& seen = seen_sets_[i];
      sightings_ = seen.sightings;
      for (Sighting& s : sightings_) {
        const double shift_s = known.row_shift_s(s.row.camera, s.row.below_middle);
        s.row.at += capture::duration_of(shift_s - s.row.shift_s);
        s.row.shift_s = shift_s;
      }
      sort_by_time(sightings_);
      if (i == 0) {
        again.begin(sightings_.front().row.at, seen.position, anywhere_m * anywhere_m, Eigen::Vector3d::Zero(),
                    speed * speed);
      }
      about.begin(seen.believed_at, seen.position, 0, velocities[i], 0);
      again = observed(again, &about, seen.power_density);
      seen.believed_at = again.at, seen.position = again.position(), seen.velocity = again.velocity();
    }
    again.predict_to(known.at, power_density());
    belief_ = again;
  }
  sightings_ = of_this_set;
  surprise_ = surprise;
}

void RegionTracker::forget() {
  if (state_ != TrackState::searching) state_ = TrackState::lost;
  candidates_.clear();
  scatter();
}

// Of what fixes the position: the belief for the views as they are believed to be, or the views of this set alone where
// they are surer (a belief that allows for anything between two sets of slow cameras is not).
double RegionTracker::judged_sigma() const {
  const double believed_m = largest_sigma(belief_.given_views().position_covariance());
  if (sightings_.size() < 2) return believed_m;
  const PositionInformation seen = information_of(sightings_, belief_.position());
  return std::min(believed_m, largest_sigma(seen.information.inverse()));
}

// What doubted views leave open of the position; 0: no view is doubted.
double RegionTracker::doubted_sigma() const {
  if (!has_pose_covariance_ && !doubts_.any()) return 0;
  const double believed_m = largest_sigma(belief_.position_covariance());
  if (sightings_.size() < 2) return believed_m;
  std::vector<Sighting> opened = sightings_;
  for (Sighting& s : opened) s.covariance += s.doubt();
  const PositionInformation seen = information_of(opened, belief_.position());
  return std::min(believed_m, largest_sigma(seen.information.inverse()));
}

// A view or more must see it, and together they must say where. What is open because nobody knows the cameras' times
// does not count here: the covariance tells it, and motion will. What is open because views contradict one another
// does: such an object is seen, and where it is nobody knows well enough.
void RegionTracker::judge(const capture::FrameSet& set) {
  const double sigma_m = judged_sigma();
  const double doubted_m = doubted_sigma();
  if (!sightings_.empty() && sigma_m <= options_.max_tracking_sigma_m && doubted_m <= options_.max_coast_sigma_m) {
    state_ = doubted_m <= options_.max_tracking_sigma_m ? TrackState::tracking : TrackState::coasting;
    last_tracking_ = set.at;
  } else if (std::max(sigma_m, doubted_m) > options_.max_coast_sigma_m ||
             capture::seconds(set.at - last_tracking_) > options_.coast_s) {
    forget();
  } else if (sightings_.empty() && !inside(options_.volume, belief_.position(), 0)) {
    forget();  // nobody sees it, and it is not expected to be where it may be
  } else {
    state_ = TrackState::coasting;
  }
}

// Two candidates in two frame sets that one object can explain are a find. One alone never is: a chance match of
// background pixels does not move like an object.
void RegionTracker::search(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  if (views.size() < 2) return;  // of cameras of different rates: such a set neither confirms nor refutes
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    const SizeInView& size = size_in_view_[static_cast<std::size_t>(view.index)];
    if (size.largest_px == 0) {  // no part of the volume is in view
      regions_[i].clear();
      continue;
    }
    const int step = std::max(1, static_cast<int>(size.smallest_px));
    const int extent = static_cast<int>(std::ceil(3 * size.largest_px)) + 2;
    const int min_area = std::max(2, static_cast<int>(0.3 * size.smallest_px * size.smallest_px));
    regions_[i] = finders_[static_cast<std::size_t>(view.index)].search(*view.matches, step, extent, min_area,
                                                                        2 * size.smallest_px);
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    const bool is_noted =
        std::ranges::any_of(seen_regions_, [&](const SeenRegion& region) { return region.camera == views[i].index; });
    if (!is_noted) note_regions(views[i], regions_[i]);
  }
  if (sightings_.empty()) compare_searched(views, set.at);
  std::vector<PositionCandidate> now =
      cross_rays(views, std::span(regions_).first(views.size()), target_, options_, belief_, max_candidates);
  if (now.empty()) {  // nor does one in which too few of these views see it
    search_log_.add(views, std::span(regions_).first(views.size()), options_.volume);
    return;
  }
  const double dt = capture::seconds(set.at - candidates_at_);
  const PositionCandidate* found = nullptr;
  const PositionCandidate* earlier = nullptr;
  double best = -1e30;
  if (dt > 0 && dt < longest_confirmation_s) {
    for (PositionCandidate& c : now) {
      for (const PositionCandidate& e : candidates_) {
        const double spread = 3 * (largest_sigma(c.covariance) + largest_sigma(e.covariance));
        if ((c.position - e.position).norm() > options_.start_speed_m_s * dt + spread) continue;
        c.sets = std::max(c.sets, e.sets + 1);
        if (c.sets < contested_sets && is_contested(c, views)) continue;
        if (c.score + e.score > best) best = c.score + e.score, found = &c, earlier = &e;
      }
    }
  }
  if (found != nullptr) {
    start_at(*earlier, *found, set.at, dt);
    compared_sets_ = 0;
    compare_sighted();  // now that it is known when they saw it
    const double doubted_m = doubted_sigma();
    if (doubted_m <= options_.max_coast_sigma_m) {
      state_ = std::max(judged_sigma(), doubted_m) <= options_.max_tracking_sigma_m ? TrackState::tracking
                                                                                    : TrackState::coasting;
      last_tracking_ = set.at;
      candidates_.clear();
      search_log_.clear();
      return;
    }
    sightings_.clear();  // views that contradict one another so much have found nothing
    seen_.clear();
    if (state_ == TrackState::coasting) forget();
  }
  candidates_ = std::move(now);
  candidates_at_ = set.at;
}

// Does a view that should show it show something of its size elsewhere? Near where it would be is not elsewhere: the
// frame is of another moment, up to a usual speed's way from the candidate's.
bool RegionTracker::is_contested(const PositionCandidate& candidate, const std::vector<TargetView>& views) const {
  for (std::size_t i = 0; i < views.size(); ++i) {
    const bool agrees =
        std::ranges::any_of(candidate.sightings, [&](const Sighting& s) { return s.row.camera == views[i].index; });
    const auto at = appearance_of(*views[i].camera, candidate.position, target_.radius_m);
    if (agrees || !at || !views[i].camera->contains({at->px})) continue;
    const double disc = std::numbers::pi * at->radius_px * at->radius_px;
    const SeenRow row = row_of(views[i], at->px.y(), belief_);
    const double apart_s = std::hypot(capture::seconds(candidate.sightings.front().row.at - row.at),
                                      belief_.row_sigma_s(row.camera, row.below_middle));
    const double slack_px = at->radius_px * (2 + options_.start_speed_m_s * apart_s / target_.radius_m);
    if (std::ranges::any_of(regions_[i], [&](const ColorRegion& region) {
          return region.area > least_far_share * disc && region.area < largest_far_share * disc &&
                 (region.centre - at->px).norm() > slack_px;
        }))
      return true;
  }
  return false;
}

// The belief that the sightings of two sets give, from nothing but what is usual.
void RegionTracker::start_at(const PositionCandidate& earlier, const PositionCandidate& found,
                             capture::Timestamp set_at, double dt) {
  acceleration_ = options_.acceleration_m_s2;
  const double anywhere_m = (options_.volume.max - options_.volume.min).norm();
  const double speed = options_.start_speed_m_s;
  MotionBelief about = belief_;
  about.begin(set_at, found.position, 0, (found.position - earlier.position) / dt, 0);
  last_reported_ = capture::Timestamp::min();
  if (!has_begun_ && sets_apart_ == 0) belief_.expect_in_step();
  has_begun_ = true;
  belief_.linearise_times_at(belief_);
  begun_ = belief_;
  seen_sets_.clear();
  is_forgetting_motion_ = false;
  moving_sets_ = 0;
  const auto row_time = [](const Sighting& s) { return s.row.at; };
  const capture::Timestamp first_at = std::ranges::min(earlier.sightings, {}, row_time).row.at;
  belief_.begin(first_at, earlier.position, anywhere_m * anywhere_m, Eigen::Vector3d::Zero(), speed * speed);
  for (const std::vector<Sighting>* sightings : {&earlier.sightings, &found.sightings}) {
    sightings_ = *sightings;
    sort_by_time(sightings_);
    doubt(sightings_);
    belief_ = observed(belief_, &about, power_density());
    predict_to_be_told(belief_, set_at, power_density());
    remember(power_density());
  }
  seen_ = sightings_;
  for (SeenSet& seen : seen_sets_)
    seen.believed_at = belief_.at, seen.position = belief_.position(), seen.velocity = belief_.velocity();
  draw_particles(belief_.given_views());
  weight_.assign(particles_.size(), 1.0f / static_cast<float>(particles_.size()));
  effective_sample_size_ = static_cast<double>(particles_.size());
  map_ = belief_.position();
}

// What one view says to the estimate. Is it seen there?
bool RegionTracker::add_support(const TargetView& view, ObjectEstimate& estimate) const {
  ViewSupport& support = estimate.per_view[static_cast<std::size_t>(view.index)];
  const auto expected = expect(view);
  if (!expected || !view.camera->contains({expected->at.px})) return false;
  const Appearance& at = expected->at;
  support.in_view = true;
  support.px = at.px.cast<float>();
  support.radius_px = static_cast<float>(at.radius_px);
  for (const Sighting& s : sightings_) {
    if (s.row.camera != view.index) continue;
    support.seen = true;
    support.support = static_cast<float>(s.support);
    support.residual_px = static_cast<float>((s.px - at.px).norm());
  }
  return support.seen;
}

ObjectEstimate RegionTracker::report(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  ObjectEstimate e;
  e.at = set.at;
  e.set_number = set.number;
  e.state = state_;
  e.particle_count = static_cast<int>(particles_.size());
  e.effective_sample_size = effective_sample_size_;
  e.per_view.resize(views_.camera_count());
  for (int c = 0; c < static_cast<int>(views_.camera_count()); ++c) e.times.push_back(belief_.timing(c));
  for (const auto* some : {&views, &views_.unused()})
    for (const TargetView& view : *some) e.per_view[static_cast<std::size_t>(view.index)].delivered = true;
  for (std::size_t c = 0; c < e.per_view.size(); ++c)
    e.per_view[c].doubt_px = static_cast<float>(std::sqrt(doubts_.variance_px2(c)));
  if (!e.has_position()) return e;
  // Frames of one moment are told at that moment, whatever a few rows' uncertain times make of it.
  const bool is_of_the_set =
      std::chrono::abs(set.at - belief_.at) <= as_good_as_the_sets_time && set.at > last_reported_;
  e.at = is_of_the_set ? set.at : std::max(belief_.at, last_reported_ + capture::Duration(1));
  last_reported_ = e.at;
  e.position = belief_.position_at(e.at);
  e.velocity = belief_.velocity();
  rig_error_.add(sightings_);
  e.covariance = belief_.position_covariance() + rig_error_.left_open(e.position, e.at);
  e.map_position = map_;
  for (const auto* some : {&views, &views_.unused()}) {
    for (const TargetView& view : *some) e.views += add_support(view, e) ? 1 : 0;
  }
  add_witnesses(e);
  // How sure we are that this is the object, not where it is (the covariance says that): that not all supports are
  // chance.
  double doubt = 1;
  for (const Sighting& s : sightings_) {
    // A view that contradicts the others by as much as its gate allows is worth half.
    const double usual_px2 = s.covariance.trace() / 2 + s.lasting_px * s.lasting_px;
    doubt *= 1 - 0.9 * s.support / (1 + s.doubt_px2 / (region_gate * usual_px2));
  }
  e.confidence = 1 - doubt;
  return e;
}

// Each view that shows the object beside what those that are in use say without it, on the path that is believed now.
void RegionTracker::add_witnesses(ObjectEstimate& estimate) const {
  if (seen_.size() < 2) return;
  const Eigen::Vector3d velocity = belief_.velocity();
  const Eigen::Matrix3d velocity_covariance = belief_.velocity_covariance();
  const double anywhere_m = (options_.volume.max - options_.volume.min).norm();
  struct OnPath {
    Appearance at;
    Eigen::Matrix2d covariance;  // of all of its errors but what is only doubted
  };
  std::vector<std::optional<OnPath>> on_path;
  const auto path = [&](const Sighting& s) -> Eigen::Vector3d {
    return belief_.position() + capture::seconds(s.row.at - belief_.at) * velocity;
  };
  for (const Sighting& s : seen_) {
    auto& out = on_path.emplace_back();
    const auto at = appearance_of(*s.camera, path(s), target_.radius_m);
    if (!at) continue;
    const Eigen::Vector2d px_per_s = at->jacobian * velocity;
    const double time_sigma_s = belief_.row_sigma_s(s.row.camera, s.row.below_middle);
    out = {*at, s.covariance + s.of_pose + time_sigma_s * time_sigma_s * px_per_s * px_per_s.transpose()};
    out->covariance.diagonal().array() += s.lasting_px * s.lasting_px;
  }
  const auto is_in_use = [&](int camera) {
    return std::ranges::any_of(sightings_, [&](const Sighting& s) { return s.row.camera == camera; });
  };
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    if (!on_path[i]) continue;
    // Along a single ray anything within the volume.
    PositionInformation others{.information = Eigen::Matrix3d::Identity() / (anywhere_m * anywhere_m)};
    ViewWitness witness;
    witness.at = seen_[i].row.at;
    witness.px = seen_[i].px;
    witness.covariance = on_path[i]->covariance;
    for (std::size_t j = 0; j < seen_.size(); ++j) {
      if (j == i || !on_path[j] || !is_in_use(seen_[j].row.camera)) continue;
      const double apart_s = capture::seconds(seen_[j].row.at - seen_[i].row.at);
      const double swerve_m = 0.5 * apart_s * apart_s * options_.acceleration_m_s2;
      const Eigen::Matrix3d way =
          apart_s * apart_s * velocity_covariance + swerve_m * swerve_m * Eigen::Matrix3d::Identity();
      const auto& jacobian = on_path[j]->at.jacobian;
      const Eigen::Matrix2d covariance = on_path[j]->covariance + jacobian * way * jacobian.transpose();
      const Eigen::Matrix<double, 3, 2> weighted = jacobian.transpose() * covariance.inverse();
      others.information += weighted * jacobian;
      others.vector += weighted * (seen_[j].px - on_path[j]->at.px);
      ++witness.others;
    }
    if (witness.others == 0) continue;
    witness.position_covariance = others.information.inverse();
    witness.position = path(seen_[i]) + witness.position_covariance * others.vector;
    witness.velocity = velocity;
    estimate.per_view[static_cast<std::size_t>(seen_[i].row.camera)].witness = witness;
  }
}

}  // namespace huetrack::object_tracking
