#include "object_tracking/trackers/object_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "particle_filter/moments.h"
#include "particle_filter/resample.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

// Normalised innovation squared (NIS) here is per degree of freedom: its mean is 1.
struct ObjectFilterTuning {
  double acceleration_time_s = 0.1;        // an acceleration a lasts about this long: power density a^2 tau
  double least_acceleration_m_s2 = 3;      // nothing moves more evenly than this for long
  double highest_acceleration_factor = 4;  // of the configured acceleration
  double acceleration_growth = 1.5;        // of one step of covariance matching
  double acceleration_settling = 0.05;     // logarithm of its change per unit of NIS and set (experiment)
  // Above it the acceleration is raised, and leaving out one inconsistent view must reduce it by as much; twice that at
  // the highest acceleration is a bounce, hit or throw.
  double usual_nis = 3;
  float farthest_d2 = 50;  // of the linearised likelihood: a view that is farther off counts alike for all particles
  double least_ess_share = 0.1;  // of the particles; below it their weights are not used
};
constexpr ObjectFilterTuning object_filter{};

constexpr double floor_likelihood = 1.0 / window_pixels;  // the paper's, eqs. (5), (6): no view can veto

// out = a0 x + a1 y + a2 z + m
struct Affine {
  float a0, a1, a2, m;
};
template <typename Matrix, typename Vector>
Affine row_of_affine(const Matrix& a, const Vector& m, int row) {
  return {a(row, 0), a(row, 1), a(row, 2), m(row)};
}
HUETRACK_CLONES void transform(const Affine& by, std::size_t n, const float* __restrict x, const float* __restrict y,
                               const float* __restrict z, float* __restrict out) {
  const float a0 = by.a0, a1 = by.a1, a2 = by.a2, m = by.m;
  for (std::size_t i = 0; i < n; ++i) out[i] = a0 * x[i] + a1 * y[i] + a2 * z[i] + m;
}

// One view's contribution to the logarithms of the weights.
struct ViewWeights {
  float i_uu, i_uv, i_vv;  // the information; i_uv counts twice
  float cu, cv;            // where the object is measured
  float floor;
  Affine linear_u, linear_v;  // from the measured centre, if the projection were linear
};
HUETRACK_CLONES void add_weights(const ViewWeights& by, std::size_t n, const float* __restrict x,
                                 const float* __restrict y, const float* __restrict z, const float* __restrict u,
                                 const float* __restrict v, float* __restrict log_weight) {
  constexpr float farthest = object_filter.farthest_d2;
  const ViewWeights w = by;
  const auto d2_of = [=](float du, float dv) __attribute__((always_inline)) {
    return w.i_uu * du * du + w.i_uv * du * dv + w.i_vv * dv * dv;
  };
  for (std::size_t i = 0; i < n; ++i) {
    const float du = w.linear_u.a0 * x[i] + w.linear_u.a1 * y[i] + w.linear_u.a2 * z[i] + w.linear_u.m;
    const float dv = w.linear_v.a0 * x[i] + w.linear_v.a1 * y[i] + w.linear_v.a2 * z[i] + w.linear_v.m;
    const float seen = -0.5f * d2_of(u[i] - w.cu, v[i] - w.cv), linear = d2_of(du, dv);
    const float likelihood = w.floor < seen ? seen : w.floor;
    log_weight[i] += likelihood + 0.5f * (farthest < linear ? farthest : linear);
  }
}

}  // namespace

ObjectFilter::ObjectFilter(const calib::CameraRig& rig, const TargetOptions& target,
                           const ObjectTrackerOptions& options, particle_filter::Rng rng)
    : options_(options),
      rng_(rng),
      motion_(rig, options.timing == TimingMode::learn),
      about_(motion_),
      acceleration_(options.acceleration_m_s2),
      observer_(target.radius_m, target.shape != TargetShape::blob),
      times_(rig.cameras.size(), target, options) {
  scatter();
}

// Particles are drawn from the linearised posterior of motion and measurements; their weights correct for the
// linearisation and the floor.
void ObjectFilter::update(std::span<const Sighting> sightings, capture::Timestamp set_at,
                          capture::Timestamp last_published, double power_density) {
  MotionState proposal = observer_.observed_in_passes(motion_, sightings, power_density);
  note_size(sightings);
  predict_to_output(proposal, set_at, last_published, power_density);
  proposal.cache_nuisance_part();
  // Particles are positions, conditioned on the nuisance states.
  MotionState at_views = proposal.conditioned_on_nuisances();
  draw_particles(at_views);
  weigh(at_views, power_density);
  estimate(std::move(at_views));
  motion_.reinflate_nuisances(proposal);
  if (times_.remember(motion_, sightings, power_density)) times_.linearise_again(motion_, this->power_density());
}

void ObjectFilter::reset_weights() {
  weight_.assign(particles_.size(), 1.0f / static_cast<float>(particles_.size()));
  effective_sample_size_ = static_cast<double>(particles_.size());
}

void ObjectFilter::scatter() {
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
  reset_weights();
}

double ObjectFilter::power_density() const {
  return acceleration_ * acceleration_ * object_filter.acceleration_time_s;
}

void ObjectFilter::adopt_times(const ObjectFilter& other) {
  motion_ = other.motion_;
  has_begun_ = other.has_begun_;
}

void ObjectFilter::adopt_shared(const ObjectFilter& other, const TimesInformation& shown) {
  has_begun_ = has_begun_ || other.has_begun_;
  motion_.adopt_time_assumptions(other.motion_);
  motion_.add_times(shown);
  times_.add_times(shown);
}

void ObjectFilter::begin(const PositionCandidate& earlier, const PositionCandidate& found, capture::Timestamp set_at,
                         double dt, bool is_in_step) {
  acceleration_ = options_.acceleration_m_s2;
  const double anywhere_m = (options_.volume.max - options_.volume.min).norm();
  const double speed = options_.start_speed_m_s;
  about_ = motion_;
  about_.begin(set_at, found.position, 0, (found.position - earlier.position) / dt, 0);
  if (!has_begun_ && is_in_step) motion_.expect_synchronised();
  has_begun_ = true;
  motion_.relinearise_times_at(motion_);
  times_.begin(motion_);
  const auto row_time = [](const Sighting& s) { return s.row.at; };
  const capture::Timestamp first_at = std::ranges::min(earlier.sightings, {}, row_time).row.at;
  motion_.begin(first_at, earlier.position, anywhere_m * anywhere_m, Eigen::Vector3d::Zero(), speed * speed);
}

std::vector<Sighting> ObjectFilter::start(const PositionCandidate& earlier, const PositionCandidate& found,
                                          const ViewConsistency& agreement, capture::Timestamp set_at, double dt,
                                          bool is_in_step, capture::Timestamp last_published) {
  begin(earlier, found, set_at, dt, is_in_step);
  std::vector<Sighting> sightings;
  for (const std::vector<Sighting>* of_set : {&earlier.sightings, &found.sightings}) {
    sightings = *of_set;
    sort_by_time(sightings);
    agreement.inflate(motion_, sightings);
    motion_ = observer_.observed(motion_, motion_.has_size() ? nullptr : &about_, sightings, power_density());
    predict_to_output(motion_, set_at, last_published, power_density());
    times_.remember(motion_, sightings, power_density());
  }
  times_.settle(motion_);
  note_size(sightings);
  draw_particles(motion_.conditioned_on_nuisances());
  reset_weights();
  map_ = motion_.position();
  return sightings;
}

void ObjectFilter::note_size(std::span<const Sighting> sightings) {
  if (observer_.is_size_consistent())
    sizing_camera_ = *observer_.is_size_consistent() ? sightings.front().camera : nullptr;
}

std::optional<Eigen::Vector3d> ObjectFilter::ray() const {
  if (sizing_camera_ == nullptr) return std::nullopt;
  return motion_.position() - sizing_camera_->centre();
}

void ObjectFilter::forget_camera(int camera) {
  motion_.reset_bias(camera);
  times_.forget_seen();
}

void ObjectFilter::correct_times(std::span<const double> late_s) {
  motion_.correct_times(late_s);
  times_.begin(motion_);
}

double ObjectFilter::highest_acceleration() const {
  return object_filter.highest_acceleration_factor * options_.acceleration_m_s2;
}

// Of three or more views, one may be inconsistent with the motion and all others: it repeats a frame, or shows
// something else of this colour. With a bounce or a swerve all of them are inconsistent with the motion.
void ObjectFilter::remove_inconsistent_view(std::vector<Sighting>& sightings) {
  if (sightings.size() < 3 || mean_nis() <= object_filter.usual_nis) return;
  const double before = std::exchange(acceleration_, highest_acceleration());
  observer_.observed(motion_, nullptr, sightings, power_density());
  const bool do_all_swerve = mean_nis() <= object_filter.usual_nis;
  acceleration_ = before;
  observer_.observed(motion_, nullptr, sightings, power_density());
  if (do_all_swerve) return;
  const std::vector<Sighting> all = sightings;
  std::vector<Sighting> best;
  // The others must be consistent, and much more so than with it: a swerve affects some views more than others.
  double least_nis = std::min(object_filter.usual_nis, mean_nis() / object_filter.usual_nis);
  for (std::size_t i = 0; i < all.size(); ++i) {
    sightings = all;
    sightings.erase(sightings.begin() + static_cast<std::ptrdiff_t>(i));
    observer_.observed(motion_, nullptr, sightings, power_density());
    if (mean_nis() < least_nis) least_nis = mean_nis(), best = sightings;
  }
  sightings = best.empty() ? all : best;
  observer_.observed(motion_, nullptr, sightings, power_density());
}

void ObjectFilter::raise_acceleration(std::vector<Sighting>& sightings) {
  const double ceiling = highest_acceleration();
  if (!sightings.empty()) observer_.observed(motion_, nullptr, sightings, power_density());
  remove_inconsistent_view(sightings);
  while (!sightings.empty() && mean_nis() > object_filter.usual_nis && acceleration_ < ceiling) {
    acceleration_ = std::min(ceiling, object_filter.acceleration_growth * acceleration_);
    observer_.observed(motion_, nullptr, sightings, power_density());
  }
}

bool ObjectFilter::is_unexplained(std::span<const Sighting> sightings) const {
  return sightings.size() >= 2 && mean_nis() > 2 * object_filter.usual_nis;
}

double ObjectFilter::kick_m_s() const {
  return std::max(motion_.velocity().norm(), options_.start_speed_m_s);
}

void ObjectFilter::settle_acceleration(std::span<const Sighting> sightings) {
  if (sightings.empty()) return;
  // While the timing is uncertain it explains nearly all of the innovations, so that small ones do not show a calm
  // motion; and with too low an acceleration a motion would be explained by late cameras.
  const double usual = (motion_.velocity().norm() > timing_tuning.at_rest_m_s ? 2 : 1) * options_.acceleration_m_s2;
  const double least = are_times_open(sightings, motion_) ? usual : object_filter.least_acceleration_m_s2;
  acceleration_ = std::clamp(acceleration_ * std::exp(object_filter.acceleration_settling *
                                                      (std::min(mean_nis(), object_filter.usual_nis) - 1)),
                             least, highest_acceleration());
}

// Rows of two sets may overlap in time, but output stamps strictly increase. Without measurements the state is
// predicted to the set's time.
void ObjectFilter::predict_to_output(MotionState& motion, capture::Timestamp set_at, capture::Timestamp last_published,
                                     double power_density) const {
  if (observer_.views().empty() || motion.at <= last_published)
    motion.predict_to(std::max(set_at, last_published + capture::Duration(1)), power_density);
}

// Antithetic pairs, transformed so that their covariance is exactly the proposal's: in the Gaussian case the filter is
// then exactly the Kalman filter, without Monte Carlo noise.
void ObjectFilter::draw_particles(const MotionState& proposal) {
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
  for (const auto& [row, out] :
       {std::pair{0, particles_.x.data()}, {1, particles_.y.data()}, {2, particles_.z.data()}}) {
    const Affine by = row_of_affine(a, m, row);
    transform(by, pairs, e0, e1, e2, out);
    transform({-by.a0, -by.a1, -by.a2, by.m}, n - pairs, e0, e1, e2, out + pairs);  // each one's mirror image
  }
}

// Weight of a particle: prior times likelihood over proposal. The proposal is the prior times the linearised Gaussian
// likelihoods, so what is left is, per view,
//   p_m(s_i | img_m) / Gauss_m(s_i),   p_m = max(1/25, support * exp(-d^2 / 2))
// with d the distance from the particle's projection, through the whole lens and at the view's own time, to the centre
// of the colour region, in the region's covariance.
void ObjectFilter::weigh(const MotionState& proposal, double power_density) {
  const std::size_t n = particles_.size();
  log_weight_.assign(n, 0.0f);
  u_.resize(n), v_.resize(n);
  seen_at_.resize(n);
  const float *x = particles_.x.data(), *y = particles_.y.data(), *z = particles_.z.data();
  for (const LinearView& view : observer_.views()) {
    const Sighting& sighting = *view.sighting;
    const LinearSighting& linear = view.linear;
    // Velocity and timing follow by regression on the position; the remaining variance counts as the view's noise.
    const MotionState::ConditionalMeasurement seen = proposal.measurement_given_position(linear.row, power_density);
    const Eigen::Matrix3f b = seen.slope.cast<float>();
    const Eigen::Vector3f c = seen.offset.cast<float>();
    float *px = seen_at_.x.data(), *py = seen_at_.y.data(), *pz = seen_at_.z.data();
    transform(row_of_affine(b, c, 0), n, x, y, z, px);
    transform(row_of_affine(b, c, 1), n, x, y, z, py);
    transform(row_of_affine(b, c, 2), n, x, y, z, pz);
    sighting.projector->project(px, py, pz, n, u_.data(), v_.data());

    const Eigen::Matrix2d noise = linear.covariance + linear.jacobian * seen.covariance * linear.jacobian.transpose() +
                                  linear.bias_sigma_px * linear.bias_sigma_px * Eigen::Matrix2d::Identity() +
                                  linear.inflation;
    const Eigen::Vector2d measured = linear.px - proposal.bias(linear.row.camera);
    const Eigen::Matrix2f information = noise.inverse().cast<float>();
    const auto floor = static_cast<float>(std::log(floor_likelihood / sighting.support));
    // The linearisation: du = j p + k.
    const Eigen::Matrix<float, 2, 3> j = linear.jacobian.cast<float>();
    const Eigen::Vector2f k = (linear.px_expected - measured - linear.jacobian * linear.linearised_at).cast<float>();
    const ViewWeights by{information(0, 0),
                         2 * information(0, 1),
                         information(1, 1),
                         static_cast<float>(measured.x()),
                         static_cast<float>(measured.y()),
                         std::min(floor, 0.0f),
                         row_of_affine(j, k, 0),
                         row_of_affine(j, k, 1)};
    add_weights(by, n, px, py, pz, u_.data(), v_.data(), log_weight_.data());
  }
  weight_.resize(n);
  particle_filter::normalize_log_weights(log_weight_, weight_);
  // The floor gives the posterior heavier tails than the proposal, so that a few far particles can outweigh all others.
  // A handful of particles is a worse estimate than the linearised one, which equal weights give.
  effective_sample_size_ = particle_filter::effective_sample_size(weight_);
  if (effective_sample_size_ < object_filter.least_ess_share * static_cast<double>(n))
    weight_.assign(n, 1.0f / static_cast<float>(n));
}

// Mean and covariance of the weighted particles; velocity and timing follow by regression on the position.
void ObjectFilter::estimate(MotionState&& proposal) {
  const particle_filter::WeightedMoments moments =
      particle_filter::weighted_moments(particles_.x.data(), particles_.y.data(), particles_.z.data(), weight_.data(),
                                        particles_.size(), proposal.position().cast<float>());
  motion_ = std::move(proposal);
  // 1e-10 m^2 keep it invertible.
  motion_.set_position(moments.mean, moments.covariance + 1e-10 * Eigen::Matrix3d::Identity());
  map_ = Eigen::Vector3f(particles_.x[moments.best], particles_.y[moments.best], particles_.z[moments.best])
             .cast<double>();
}

namespace {

// Largest sigma, the one along `ray` scaled as judged_sigma() says. There the uncertain size counts, too: `all`.
double scaled_sigma(const ObjectTrackerOptions& options, const std::optional<Eigen::Vector3d>& ray,
                    const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& all) {
  if (!ray) return largest_sigma(covariance);
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - *ray * ray->transpose() / ray->squaredNorm();
  const double share_along = std::sqrt(ray->dot(all * *ray)) / ray->squaredNorm();
  return std::max(largest_sigma(across * covariance * across),
                  options.max_tracking_sigma_m * share_along / options.max_tracking_share_along);
}

}  // namespace

double judged_sigma(const ObjectTrackerOptions& options, const ObjectFilter& filter,
                    std::span<const Sighting> sightings) {
  const MotionState& motion = filter.motion();
  const double estimated_m =
      scaled_sigma(options, filter.ray(), motion.position_covariance_conditioned(), motion.position_covariance());
  if (sightings.size() < 2) return estimated_m;
  const PositionInformation seen = information_of(sightings, motion.position());
  return std::min(estimated_m, largest_sigma(seen.information.inverse()));
}

bool is_localized(const ObjectTrackerOptions& options, const ObjectFilter& filter) {
  return scaled_sigma(options, filter.ray(), filter.motion().position_covariance(),
                      filter.motion().position_covariance()) <= options.max_coast_sigma_m;
}

Judged judged(const ObjectTrackerOptions& options, const ObjectFilter& filter, std::span<const Sighting> sightings,
              double inconsistency_m, double unseen_s, bool may_be_tracked) {
  const MotionState& motion = filter.motion();
  const double sigma_m = judged_sigma(options, filter, sightings);
  if (may_be_tracked && !sightings.empty() && sigma_m <= options.max_tracking_sigma_m &&
      inconsistency_m <= options.max_coast_sigma_m)
    return {inconsistency_m <= options.max_tracking_sigma_m && is_localized(options, filter) ? TrackState::tracking
                                                                                             : TrackState::coasting,
            true};
  // No view sees it, and its prediction has left the volume.
  const bool is_gone = sightings.empty() && !inside(options.volume, motion.position(), 0);
  const bool is_lost =
      is_gone || std::max(sigma_m, inconsistency_m) > options.max_coast_sigma_m || unseen_s > options.coast_s;
  return {is_lost ? TrackState::lost : TrackState::coasting, false};
}

TrackState judged_at_start(const ObjectTrackerOptions& options, const ObjectFilter& filter,
                           std::span<const Sighting> sightings, double inconsistency_m, bool may_be_tracked) {
  if (inconsistency_m > options.max_coast_sigma_m) return TrackState::lost;
  const double sigma_m = std::max(judged_sigma(options, filter, sightings), inconsistency_m);
  return may_be_tracked && sigma_m <= options.max_tracking_sigma_m && is_localized(options, filter)
             ? TrackState::tracking
             : TrackState::coasting;
}

}  // namespace huetrack::object_trackers
