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

// White acceleration has a power density a^2 tau: an acceleration of a that lasts for about tau.
constexpr double acceleration_time_s = 0.1;
constexpr double least_acceleration_m_s2 = 3;  // nothing moves more evenly than this for long
constexpr double floor_likelihood = 1.0 / 25;  // the paper's, eqs. (5), (6): tolerates occlusion and locks nothing out
// Mean squared innovation in its standard deviations; 1 is usual.
constexpr double usual_surprise = 3, bounce_surprise = 6;

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

// What a view adds to the logarithms of the weights.
struct ViewWeights {
  float i_uu, i_uv, i_vv;  // the information; i_uv counts twice
  float cu, cv;            // where the object is measured
  float floor;
  Affine linear_u, linear_v;  // from the measured centre, if the projection were linear
};
HUETRACK_CLONES void add_weights(const ViewWeights& by, std::size_t n, const float* __restrict x,
                                 const float* __restrict y, const float* __restrict z, const float* __restrict u,
                                 const float* __restrict v, float* __restrict log_weight) {
  constexpr float farthest = 50;
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

ObjectFilter::ObjectFilter(const calib::CameraRig& rig, double radius_m, const ObjectTrackerOptions& options,
                           particle_filter::Rng rng)
    : options_(options),
      rng_(rng),
      belief_(rig, options.timing == TimingMode::learn),
      about_(belief_),
      acceleration_(options.acceleration_m_s2),
      observer_(radius_m),
      times_(radius_m, options) {
  scatter();
}

// The linearised belief of motion and sightings together is what particles are drawn from; what the linearisation and
// the floor change, their weights say.
void ObjectFilter::update(std::span<const Sighting> sightings, capture::Timestamp set_at, capture::Timestamp told,
                          double power_density) {
  MotionState proposal = propose(sightings, set_at, told, power_density);
  proposal.cache_nuisance_part();
  // Particles are positions, for views as they are believed to be.
  MotionState at_views = proposal.conditioned_on_nuisances();
  draw_particles(at_views);
  weigh(at_views, power_density);
  estimate(std::move(at_views));
  belief_.reinflate_nuisances(proposal);
  if (times_.remember(belief_, sightings, power_density)) times_.linearise_again(belief_, this->power_density());
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
  weight_.assign(n, 1.0f / static_cast<float>(n));
  effective_sample_size_ = static_cast<double>(n);
}

double ObjectFilter::power_density() const {
  return acceleration_ * acceleration_ * acceleration_time_s;
}

void ObjectFilter::adopt_times(const ObjectFilter& other) {
  belief_ = other.belief_;
  has_begun_ = other.has_begun_;
}

void ObjectFilter::begin(const PositionCandidate& earlier, const PositionCandidate& found, capture::Timestamp set_at,
                         double dt, bool is_in_step) {
  acceleration_ = options_.acceleration_m_s2;
  const double anywhere_m = (options_.volume.max - options_.volume.min).norm();
  const double speed = options_.start_speed_m_s;
  about_ = belief_;
  about_.begin(set_at, found.position, 0, (found.position - earlier.position) / dt, 0);
  if (!has_begun_ && is_in_step) belief_.expect_synchronised();
  has_begun_ = true;
  belief_.relinearise_times_at(belief_);
  times_.begin(belief_);
  const auto row_time = [](const Sighting& s) { return s.row.at; };
  const capture::Timestamp first_at = std::ranges::min(earlier.sightings, {}, row_time).row.at;
  belief_.begin(first_at, earlier.position, anywhere_m * anywhere_m, Eigen::Vector3d::Zero(), speed * speed);
}

std::vector<Sighting> ObjectFilter::start(const PositionCandidate& earlier, const PositionCandidate& found,
                                          const ViewConsistency& agreement, capture::Timestamp set_at, double dt,
                                          bool is_in_step, capture::Timestamp told) {
  begin(earlier, found, set_at, dt, is_in_step);
  std::vector<Sighting> sightings;
  for (const std::vector<Sighting>* of_set : {&earlier.sightings, &found.sightings}) {
    sightings = *of_set;
    sort_by_time(sightings);
    agreement.inflate(belief_, sightings);
    belief_ = observer_.observed(belief_, &about_, sightings, power_density());
    predict_to_be_told(belief_, set_at, told, power_density());
    times_.remember(belief_, sightings, power_density());
  }
  times_.settle(belief_);
  draw_particles(belief_.conditioned_on_nuisances());
  weight_.assign(particles_.size(), 1.0f / static_cast<float>(particles_.size()));
  effective_sample_size_ = static_cast<double>(particles_.size());
  map_ = belief_.position();
  return sightings;
}

void ObjectFilter::forget_camera(int camera) {
  belief_.reset_bias(camera);
  times_.forget_seen();
}

void ObjectFilter::correct_times(std::span<const double> late_s) {
  belief_.correct_times(late_s);
  times_.begin(belief_);
}

// Of three views or more, one that contradicts what all others agree on with the motion: it shows a frame once more, or
// something else of this colour. A bounce contradicts all of them.
void ObjectFilter::leave_out_what_contradicts(std::vector<Sighting>& sightings) {
  if (sightings.size() < 3 || surprise() <= usual_surprise) return;
  const std::vector<Sighting> all = sightings;
  std::vector<Sighting> best;
  // The others must agree; and much better than all did, as a swerve surprises some views more than others.
  double least_surprise = std::min(usual_surprise, surprise() / 3);
  for (std::size_t i = 0; i < all.size(); ++i) {
    sightings = all;
    sightings.erase(sightings.begin() + static_cast<std::ptrdiff_t>(i));
    observer_.observed(belief_, nullptr, sightings, power_density());
    if (surprise() < least_surprise) least_surprise = surprise(), best = sightings;
  }
  sightings = best.empty() ? all : best;
  observer_.observed(belief_, nullptr, sightings, power_density());
}

void ObjectFilter::raise_acceleration(std::vector<Sighting>& sightings) {
  const double ceiling = 4 * options_.acceleration_m_s2;
  if (!sightings.empty()) observer_.observed(belief_, nullptr, sightings, power_density());
  leave_out_what_contradicts(sightings);
  while (!sightings.empty() && surprise() > usual_surprise && acceleration_ < ceiling) {
    acceleration_ = std::min(ceiling, 1.5 * acceleration_);
    observer_.observed(belief_, nullptr, sightings, power_density());
  }
}

bool ObjectFilter::is_unexplained(std::span<const Sighting> sightings) const {
  return sightings.size() >= 2 && surprise() > bounce_surprise;
}

double ObjectFilter::kick_m_s() const {
  return std::max(belief_.velocity().norm(), options_.start_speed_m_s);
}

void ObjectFilter::settle_acceleration(std::span<const Sighting> sightings) {
  if (sightings.empty()) return;
  // While the times are open, small innovations do not tell calm motion: nearly all of what is expected of them is the
  // times'. And a motion that is taken for too calm passes for cameras that are late.
  const double usual = (belief_.velocity().norm() > at_rest_m_s ? 2 : 1) * options_.acceleration_m_s2;
  const double least = are_times_open(sightings, belief_) ? usual : least_acceleration_m_s2;
  acceleration_ = std::clamp(acceleration_ * std::exp(0.05 * (std::min(surprise(), usual_surprise) - 1)), least,
                             4 * options_.acceleration_m_s2);
}

// Rows of two sets may overlap in time, but positions are told in the order of time; and an object that nobody sees is
// predicted to the set's time.
void ObjectFilter::predict_to_be_told(MotionState& belief, capture::Timestamp set_at, capture::Timestamp told,
                                      double power_density) const {
  if (observer_.views().empty() || belief.at <= told)
    belief.predict_to(std::max(set_at, told + capture::Duration(1)), power_density);
}

MotionState ObjectFilter::propose(std::span<const Sighting> sightings, capture::Timestamp set_at,
                                   capture::Timestamp told, double power_density) {
  MotionState out = observer_.observed_in_passes(belief_, sightings, power_density);
  predict_to_be_told(out, set_at, told, power_density);
  return out;
}

// Antithetic pairs, shaped to the proposal's covariance exactly: where everything is Gaussian the filter is then
// exactly the Kalman filter, and the only Monte Carlo noise left is in what is not.
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
    // What is not of the position (velocity, times) is that of the regression on it, and what that leaves open counts
    // as the view's noise.
    const MotionState::ConditionalMeasurement seen = proposal.measurement_given_position(linear.row, power_density);
    const Eigen::Matrix3f b = seen.slope.cast<float>();
    const Eigen::Vector3f c = seen.offset.cast<float>();
    float *px = seen_at_.x.data(), *py = seen_at_.y.data(), *pz = seen_at_.z.data();
    transform(row_of_affine(b, c, 0), n, x, y, z, px);
    transform(row_of_affine(b, c, 1), n, x, y, z, py);
    transform(row_of_affine(b, c, 2), n, x, y, z, pz);
    sighting.projector->project(px, py, pz, n, u_.data(), v_.data());

    const Eigen::Matrix2d noise = linear.covariance + linear.jacobian * seen.covariance * linear.jacobian.transpose() +
                                  linear.bias_sigma_px * linear.bias_sigma_px * Eigen::Matrix2d::Identity() + linear.inflation;
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
  // The floor gives the target heavier tails than the proposal has, so that a few particles far out can outweigh all
  // others; a handful of particles is a worse answer than the linearised one, which equal weights are.
  effective_sample_size_ = particle_filter::effective_sample_size(weight_);
  if (effective_sample_size_ < 0.1 * static_cast<double>(n)) weight_.assign(n, 1.0f / static_cast<float>(n));
}

// The weighted particles' mean and covariance are the position's; velocity and times follow by regression on it.
void ObjectFilter::estimate(MotionState&& proposal) {
  const particle_filter::WeightedMoments moments =
      particle_filter::weighted_moments(particles_.x.data(), particles_.y.data(), particles_.z.data(), weight_.data(),
                                        particles_.size(), proposal.position().cast<float>());
  belief_ = std::move(proposal);
  belief_.set_position(moments.mean, moments.covariance + 1e-10 * Eigen::Matrix3d::Identity());
  map_ = Eigen::Vector3f(particles_.x[moments.best], particles_.y[moments.best], particles_.z[moments.best])
             .cast<double>();
}

double judged_sigma(const MotionState& belief, std::span<const Sighting> sightings) {
  const double believed_m = largest_sigma(belief.position_covariance_conditioned());
  if (sightings.size() < 2) return believed_m;
  const PositionInformation seen = information_of(sightings, belief.position());
  return std::min(believed_m, largest_sigma(seen.information.inverse()));
}

bool is_somewhere(const ObjectTrackerOptions& options, const MotionState& belief) {
  return largest_sigma(belief.position_covariance()) <= options.max_coast_sigma_m;
}

Judged judged(const ObjectTrackerOptions& options, const MotionState& belief, std::span<const Sighting> sightings,
              double doubted_m, double unseen_s, bool may_be_tracked) {
  const double sigma_m = judged_sigma(belief, sightings);
  if (may_be_tracked && !sightings.empty() && sigma_m <= options.max_tracking_sigma_m &&
      doubted_m <= options.max_coast_sigma_m)
    return {doubted_m <= options.max_tracking_sigma_m && is_somewhere(options, belief) ? TrackState::tracking
                                                                                       : TrackState::coasting,
            true};
  // Nobody sees it, and it is not expected to be where it may be.
  const bool is_gone = sightings.empty() && !inside(options.volume, belief.position(), 0);
  const bool is_lost =
      is_gone || std::max(sigma_m, doubted_m) > options.max_coast_sigma_m || unseen_s > options.coast_s;
  return {is_lost ? TrackState::lost : TrackState::coasting, false};
}

}  // namespace huetrack::object_trackers
