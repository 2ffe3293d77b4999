#include "object_tracking/trackers/paper_tracker.h"

#include <algorithm>
#include <cmath>

#include "particle_filter/moments.h"
#include "particle_filter/resample.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

struct PaperTrackerTuning {
  double population_step = 0.2;  // of the population, per set, that it grows or shrinks by; the paper gives no rate
};
constexpr PaperTrackerTuning paper_tracker{};

// weight *= k, eqs. (5) and (6) times 25: k at least 1, and 1 outside the image.
HUETRACK_CLONES void multiply(const std::uint8_t* __restrict k, std::size_t n, float* __restrict weight) {
  for (std::size_t i = 0; i < n; ++i) {
    const int inside = k[i] < 1 ? 1 : k[i];
    weight[i] *= static_cast<float>(k[i] == color::MatchBits::outside ? 1 : inside);
  }
}

// Eqs. (1)-(3), one axis.
HUETRACK_CLONES void walk(const float* __restrict noise, std::size_t n, float sigma_m, float* __restrict position) {
  for (std::size_t i = 0; i < n; ++i) position[i] += sigma_m * noise[i];
}

}  // namespace

// One iteration of CONDENSATION (section 2): prediction, update, estimate, resampling.
ObjectEstimate PaperTracker::update(const capture::FrameSet& set) {
  const std::vector<TargetView>& views = views_.look_at(set);
  predict();                                       // eqs. (1)-(3)
  observation_.weigh(particles_, views, weight_);  // eqs. (4)-(6)
  particle_filter::normalize_weights(weight_);
  const ObjectEstimate result = estimate(set, views);  // weighted mean (MMSE) and the best particle (MAP)
  resample();                                          // a larger population while the object is not seen
  return result;
}

PaperTracker::PaperTracker(const calib::CameraRig& rig, const TargetOptions& target,
                           const ObjectTrackerOptions& options, particle_filter::Rng rng)
    : options_(options), views_(rig, target), rng_(rng) {
  particles_.resize(static_cast<std::size_t>(options_.particle_count));
  scatter(0);  // section 3: uniform in the volume
}

void PaperTracker::begin_anew() {
  state_ = TrackState::searching;
  seen_ = false;
  scatter(0);
}

// Uniform in the volume, from particle `from` on.
void PaperTracker::scatter(std::size_t from) {
  noise_.resize(3 * (particles_.size() - from));
  rng_.fill_uniform(noise_);
  const Eigen::Vector3f min = options_.volume.min.cast<float>();
  const Eigen::Vector3f extent = (options_.volume.max - options_.volume.min).cast<float>();
  for (std::size_t i = from, j = 0; i < particles_.size(); ++i, j += 3) {
    particles_.x[i] = min.x() + extent.x() * noise_[j];
    particles_.y[i] = min.y() + extent.y() * noise_[j + 1];
    particles_.z[i] = min.z() + extent.z() * noise_[j + 2];
  }
}

void PaperTracker::predict() {
  const std::size_t n = particles_.size();
  noise_.resize(3 * n);
  rng_.fill_normal(noise_);
  const auto sigma_m = static_cast<float>(options_.position_noise_m);
  walk(noise_.data(), n, sigma_m, particles_.x.data());
  walk(noise_.data() + n, n, sigma_m, particles_.y.data());
  walk(noise_.data() + 2 * n, n, sigma_m, particles_.z.data());
}

void PaperObservation::weigh(const PositionParticles& particles, const std::vector<TargetView>& views,
                             std::vector<float>& weight) {
  const std::size_t n = particle_count_ = particles.size();
  u_.resize(n * views.size()), v_.resize(n * views.size()), k_.resize(n * views.size());
  weight.assign(n, 1.0f);
  for (std::size_t m = 0; m < views.size(); ++m) {
    float *const u = &u_[m * n], *const v = &v_[m * n];
    std::uint8_t* const k = &k_[m * n];
    views[m].projector->project(particles.x.data(), particles.y.data(), particles.z.data(), n, u, v);
    views[m].matches->count_5x5(u, v, n, k);
    multiply(k, n, weight.data());
  }
}

void PaperTracker::resample() {
  // "When the system cannot see the object in the images it grows the particle population to widen the search area
  // until it finds the object again" (section 3). Here: a fifth more per frame set, drawn as at the start, uniform in
  // the volume; at the largest population they replace a fifth of it, or a cloud that sits on something else would
  // never search again. When the object is found, the population shrinks by a fifth per set.
  constexpr double grown = 1 + paper_tracker.population_step, shrunk = 1 - paper_tracker.population_step;
  const auto n = static_cast<double>(particles_.size());
  const auto wanted =
      static_cast<std::size_t>(seen_ ? std::max(options_.particle_count, static_cast<int>(shrunk * n))
                                     : std::min(options_.max_particle_count, static_cast<int>(std::ceil(grown * n))));
  const std::size_t survivors =
      seen_ ? wanted : std::min(particles_.size(), static_cast<std::size_t>(shrunk * static_cast<double>(wanted)));
  resampled_.resize(survivors + particle_filter::spread_beyond);
  particle_filter::systematic_resample(weight_, rng_.uniform(), survivors,
                                       {particles_.x.data(), particles_.y.data(), particles_.z.data()},
                                       {resampled_.x.data(), resampled_.y.data(), resampled_.z.data()});
  resampled_.resize(survivors);
  std::swap(particles_, resampled_);
  if (wanted > survivors) {
    particles_.resize(wanted);
    scatter(survivors);
  }
}

ObjectEstimate PaperTracker::estimate(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  const std::size_t n = particles_.size();
  const particle_filter::WeightedMoments moments =
      particle_filter::weighted_moments(particles_.x.data(), particles_.y.data(), particles_.z.data(), weight_.data(),
                                        n, {particles_.x[0], particles_.y[0], particles_.z[0]});
  const std::size_t best = moments.best;

  ObjectEstimate e;
  e.at = set.at;
  e.set_number = set.number;
  e.particle_count = static_cast<int>(n);
  e.effective_sample_size = particle_filter::effective_sample_size(weight_);
  e.per_view.resize(views_.camera_count());

  // Seen: more than half of the window around the best particle has the target's colour, in two views or the only one.
  for (std::size_t m = 0; m < views.size(); ++m) {
    ViewSupport& support = e.per_view[static_cast<std::size_t>(views[m].index)];
    const PaperObservation::Window window = observation_.window(m, best);
    support.delivered = true;
    support.in_view = window.k != color::MatchBits::outside;
    if (!support.in_view) continue;
    support.px = window.px;
    support.support = static_cast<float>(window.k) / window_pixels;
    support.seen = 2 * window.k > window_pixels;
    support.radius_px = std::sqrt(static_cast<float>(window_pixels)) / 2;
    e.views += support.seen ? 1 : 0;
    e.confidence += static_cast<double>(support.support) / static_cast<double>(views.size());
  }
  seen_ = !views.empty() && e.views >= std::min<int>(2, static_cast<int>(views.size()));
  if (seen_) {
    state_ = TrackState::tracking;
    last_seen_ = set.at;
  } else if (state_ == TrackState::tracking || state_ == TrackState::coasting) {
    const double unseen_s = capture::seconds(set.at - last_seen_);  // negative: the clock was set back
    state_ = unseen_s < 0 || unseen_s > options_.coast_s ? TrackState::lost : TrackState::coasting;
  }
  e.state = state_;
  if (!e.has_position()) return e;
  e.position = moments.mean;
  e.covariance = moments.covariance;
  e.velocity.setZero();  // the random walk has none: its expectation
  e.map_position = {static_cast<double>(particles_.x[best]), static_cast<double>(particles_.y[best]),
                    static_cast<double>(particles_.z[best])};
  return e;
}

}  // namespace huetrack::object_trackers
