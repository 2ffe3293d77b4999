#include "camera_tracking/papers/pupilli_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "camera_tracking/papers/mean_polish.h"
#include "camera_tracking/papers/paper_tracker_base.h"
#include "particle_filter/resample.h"

namespace huetrack::papers {

namespace {

constexpr double most_field_half_px = 44;  // of a correlation field
constexpr double narrow_cloud_px = 6;      // largest sigma of a converged cloud's projection
// A point with more misses than this, and than this multiple of its matches, is removed; both counts are halved after
// counted_frames.
constexpr int wrong_after = 30, wrong_missed_of_found = 4, counted_frames = 60;
constexpr float least_weighted_rho = 0.2f;  // after eq. (7)'s weights
// Candidates: most frames, most frames without a match, and search width on either side of the epipolar line.
constexpr int most_tries = 60, most_failed = 8;
constexpr double epipolar_reach_px = 5, epipolar_sigma_px = 2, ray_sigma_px = 1.5;
constexpr std::size_t drawn_rays = 40;  // of particles

}  // namespace

PupilliFilter::PupilliFilter(const calib::Camera& camera, const Options& options, std::uint64_t seed)
    : camera_(camera), options_(options), lens_(without_pose(camera)), rng_(seed, 21) {}

void PupilliFilter::start(const calib::Rigid3d& cam_from_world) {
  particles_.reset(options_.particle_count, cam_from_world);
  supported_ = true;
}

void PupilliFilter::add(PupilliPoint point) {
  point.id = next_id_++;
  points_.push_back(std::move(point));
}

PupilliFilter::Result PupilliFilter::track(const std::shared_ptr<const Pyramid>& pyramid) {
  // Before measured_ is filled, which has indices into points_.
  std::erase_if(points_, [](const PupilliPoint& p) {
    return !p.given && p.missed > wrong_after && p.missed > wrong_missed_of_found * p.found;
  });
  // Condensation: proportional to the weights, then the random walk of eq. (2).
  particles_.resample(rng_, options_.particle_count);
  const float wider = supported_ ? 1.0f : options_.wider_unseen;
  const float rotation = wider * options_.rotation_rad, position = wider * options_.position_m;
  particles_.walk_uniform(rotation, position, rng_);
  choose_active(particles_.mean());
  correlate(pyramid->levels.front());
  anneal(rotation, position);

  Result out;
  out.cam_from_world = particles_.mean();
  out.active = static_cast<int>(active_.size());
  out.matched = measure(out.cam_from_world);
  // A dispersed cloud matches anything.
  const auto narrow = std::ranges::count_if(
      measured_, [](const Measured& x) { return x.cloud.covariance.trace() < 2 * narrow_cloud_px * narrow_cloud_px; });
  out.supported = out.matched >= 4 && 3 * out.matched >= 2 * out.active && 2 * narrow > out.active;
  supported_ = out.supported;
  if (out.supported && options_.polish) {
    out.polished = polished(out.cam_from_world);
    if (out.polished) out.cam_from_world = out.polished->cam_from_world;
  }
  return out;
}

// Active points: those in view, or of many the ones with the best detection rates.
void PupilliFilter::choose_active(const calib::Rigid3d& predicted) {
  active_.clear();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const auto px = camera_.model.project(predicted * points_[i].position);
    if (px && camera_.contains(*px)) active_.push_back(i);
  }
  if (active_.size() > options_.max_active) {
    const auto worth = [this](std::size_t i) {
      const PupilliPoint& p = points_[i];
      return (p.found + 1.0) / (p.found + p.missed + 2.0) + (p.given ? 0.2 : 0.0);
    };
    std::ranges::stable_sort(active_, [&](std::size_t a, std::size_t b) { return worth(a) > worth(b); });
    active_.resize(options_.max_active);
    std::ranges::sort(active_);
  }
}

// An active point's projection for each particle: u_, v_.
void PupilliFilter::project(std::size_t active) {
  u_[active].resize(particles_.size()), v_[active].resize(particles_.size());
  particles_.project(lens_, points_[active_[active]].position, u_[active], v_[active]);
}

// The correlation fields, eq. (3), in the regions where the particles project.
void PupilliFilter::correlate(const GreyImage& image) {
  const std::size_t m = active_.size();
  u_.resize(std::max(u_.size(), m)), v_.resize(std::max(v_.size(), m)), fields_.resize(std::max(fields_.size(), m));
  measured_.clear();
  for (std::size_t k = 0; k < m; ++k) {
    project(k);
    const CloudMoments cloud = cloud_moments(u_[k], v_[k], particles_.weight);
    const double left = std::max(static_cast<double>(cloud.u_min), cloud.mean.x() - most_field_half_px),
                 right = std::min(static_cast<double>(cloud.u_max), cloud.mean.x() + most_field_half_px);
    const double top = std::max(static_cast<double>(cloud.v_min), cloud.mean.y() - most_field_half_px),
                 bottom = std::min(static_cast<double>(cloud.v_max), cloud.mean.y() + most_field_half_px);
    const Eigen::Vector2d centre(0.5 * (left + right), 0.5 * (top + bottom));
    const double margin = static_cast<double>(options_.epsilon_d_px[0]);
    fields_[k].correlate(image, points_[active_[k]].templ,
                         box_around(centre, 0.5 * (right - left) + margin, 0.5 * (bottom - top) + margin));
    measured_.push_back({active_[k], cloud, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN())});
  }
}

// Section 4: weigh with a tolerance, resample, walk less, weigh with a smaller tolerance.
void PupilliFilter::anneal(float rotation_rad, float position_m) {
  const std::size_t n = particles_.size();
  for (int step = 0; step < options_.annealing_steps; ++step) {
    const float epsilon_d = options_.epsilon_d_px[std::min(step, 2)];
    if (step > 0) {
      particles_.resample(rng_, options_.particle_count);
      const float narrower = std::pow(0.5f, static_cast<float>(step));
      particles_.walk_uniform(narrower * rotation_rad, narrower * position_m, rng_);
    }
    // After eq. (7) the fields' values are smaller.
    const float epsilon_rho = options_.epsilon_rho * (step > 0 ? 0.5f : 1.0f);
    log_weight_.assign(n, 0.0f);
    for (std::size_t k = 0; k < active_.size(); ++k) {
      if (step > 0) project(k);
      fields_[k].mark(epsilon_rho, epsilon_d);
      fields_[k].score(u_[k], v_[k], true, log_weight_);  // eqs. (5), (6)
    }
    particle_filter::normalize_log_weights(log_weight_, particles_.weight);
    if (step + 1 == options_.annealing_steps) break;
    // Eq. (7), from a subset drawn by the weights.
    std::vector<std::uint32_t> drawn(std::min(options_.reweighting_particles, n));
    particle_filter::systematic_ancestors(particles_.weight, rng_.uniform(), drawn);
    std::vector<float> su(drawn.size()), sv(drawn.size()), equal(drawn.size(), 1.0f / static_cast<float>(drawn.size()));
    for (std::size_t k = 0; k < active_.size(); ++k) {
      for (std::size_t i = 0; i < drawn.size(); ++i) su[i] = u_[k][drawn[i]], sv[i] = v_[k][drawn[i]];
      if (step == 0) fields_[k].threshold(options_.epsilon_rho);
      fields_[k].reweight(su, sv, equal, epsilon_d);
    }
  }
}

// Measures the active points near their projections; returns the number of matches.
int PupilliFilter::measure(const calib::Rigid3d& cam_from_world) {
  int matched = 0;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    PupilliPoint& p = points_[active_[k]];
    const auto px = camera_.model.project(cam_from_world * p.position);
    if (!px) continue;
    const NccPeak peak = fields_[k].strongest(static_cast<float>(px->px.x()), static_cast<float>(px->px.y()),
                                              2 * options_.epsilon_d_px[2], least_weighted_rho);
    measured_[k].cloud = cloud_moments(u_[k], v_[k], particles_.weight);
    if (peak.rho > 0) {
      ++matched, ++p.found;
      measured_[k].found =
          fields_[k]
              .best_match(px->px, 2 * static_cast<double>(options_.epsilon_d_px[2]), options_.epsilon_rho)
              .value_or(Eigen::Vector2d(peak.u, peak.v));
    } else {
      ++p.missed;
    }
    if (p.found + p.missed > counted_frames) p.found /= 2, p.missed /= 2;
  }
  return matched;
}

std::optional<PoseFit> PupilliFilter::polished(const calib::Rigid3d& mean) const {
  std::vector<PoseObservation> seen;
  for (const Measured& x : measured_) {
    const PupilliPoint& p = points_[x.point];
    const double depth_m = (mean * p.position).norm();
    if (x.found.allFinite()) seen.push_back({p.position, x.found, sigma_px_of(camera_.model, 0.5, p.sigma_m, depth_m)});
  }
  return polish_mean(camera_.model, particles_, mean, seen);
}

void PupilliFilter::map(const std::shared_ptr<const Pyramid>& pyramid, const Result& result) {
  if (!result.supported) return;
  const auto in_view = static_cast<std::size_t>(std::ranges::count_if(points_, [&](const PupilliPoint& p) {
    const auto px = camera_.model.project(result.cam_from_world * p.position);
    return px && camera_.contains(*px);
  }));
  std::vector<FeatureCandidate> kept;
  for (FeatureCandidate& c : candidates_) {
    ++c.attempts;
    c.missed += !sharpen(c, pyramid->levels.front(), result.cam_from_world);
    if (const auto depth = c.ray.converged()) {
      PupilliPoint p;
      p.position = c.ray.origin() + c.ray.direction() / depth->inverse_depth;
      p.sigma_m = depth->sigma / (depth->inverse_depth * depth->inverse_depth);
      p.templ = std::move(c.templ);
      p.source = std::move(c.source);
      add(std::move(p));
    } else if (c.attempts < most_tries && c.missed < most_failed) {
      kept.push_back(std::move(c));
    }
  }
  candidates_.swap(kept);
  if (candidates_.size() < options_.introduced_at_once && in_view < options_.wanted_in_view)
    introduce(pyramid, result.cam_from_world);
}

// Section 5: as LeeMapping::sharpen().
bool PupilliFilter::sharpen(FeatureCandidate& c, const GreyImage& image, const calib::Rigid3d& pose) {
  const auto segment = project_ray(camera_.model, c.ray, pose, epipolar_reach_px);
  if (!segment || !camera_.contains(segment->b)) return false;
  candidate_field_.correlate(image, c.templ, segment->box);
  const PixelRegion& region = candidate_field_.region();
  std::vector<std::uint32_t> drawn(drawn_rays);
  particle_filter::systematic_ancestors(particles_.weight, rng_.uniform(), drawn);
  bool found = false;
  c.ray.begin();
  for (int v = region.v0; v <= region.v1; ++v) {
    for (int u = region.u0; u <= region.u1; ++u) {
      const float rho = candidate_field_.rho()[region.index(u, v)];
      if (rho < options_.epsilon_rho) continue;
      const double distance = segment->distance(Eigen::Vector2d(u, v)) / epipolar_sigma_px;
      const auto ray = camera_.model.ray({Eigen::Vector2d(u, v)});
      if (!ray) continue;
      found = true;
      const double rho2 = static_cast<double>(rho * rho);
      for (const std::uint32_t i : drawn) {
        const calib::Rigid3d back = calib::inverse(particles_.pose(i));
        c.ray.add(back.translation, back.rotation * *ray, rho2 * rho2 * std::exp(-0.5 * distance * distance),
                  ray_sigma_px / camera_.model.fx());
      }
    }
  }
  if (found) c.ray.end();
  return found;
}

void PupilliFilter::introduce(const std::shared_ptr<const Pyramid>& pyramid, const calib::Rigid3d& pose) {
  std::vector<Eigen::Vector2d> seen;
  double depth = 0;
  for (const Measured& m : measured_) {
    seen.push_back(m.cloud.mean);
    depth += (pose * points_[m.point].position).norm() / static_cast<double>(measured_.size());
  }
  if (depth > 0) depth_m_ = depth;
  const auto px = corner_in_random_box(pyramid->levels.front(), seen, 40, rng_);
  if (!px) return;
  auto t = cut_template(pyramid->levels.front(), *px);
  const auto ray = camera_.model.ray({*px});
  if (!t || !ray) return;
  const calib::Rigid3d back = calib::inverse(pose);
  candidates_.push_back({{pyramid, pose, *px},
                         std::move(*t),
                         DepthRay(back.translation, back.rotation * *ray, 0.25 * depth_m_, 8 * depth_m_)});
}

namespace {

class PupilliTracker final : public PaperTrackerBase {
 public:
  PupilliTracker(const calib::Camera& camera, const CameraTrackerOptions& options)
      : PaperTrackerBase(camera, options), filter_(camera, filter_options(options), options.seed) {
    if (auto stored = take_loaded()) {
      for (const MapPoint& p : stored->map.points) {
        if (!p.alive || p.view_count == 0) continue;
        const Keyframe& k = stored->map.keyframe(p.views[0].keyframe);
        add(p.position, std::sqrt(p.covariance.trace()), {k.pyramid, k.cam_from_world, p.views[0].px}, p.given);
      }
    }
  }

  CameraTrackerInside inside() const override {
    CameraTrackerInside out;
    for (const PupilliFilter::Measured& m : filter_.measured()) {
      const PupilliPoint& p = filter_.points()[m.point];
      out.features.push_back({m.cloud.mean.cast<float>(), m.found.cast<float>(), m.cloud.covariance.cast<float>(),
                              p.position, covariance_of(p), p.given});
    }
    out.particles = particles().world_from_cameras(300);
    return out;
  }

  std::vector<CameraMapPoint> map() const override {
    std::vector<CameraMapPoint> out;
    for (const PupilliPoint& p : filter_.points())
      out.push_back({p.id, p.position, covariance_of(p), CameraMapPoint::State::not_sought, p.given});
    for (const PupilliFilter::Measured& m : filter_.measured())
      out[m.point].state = m.found.allFinite() ? CameraMapPoint::State::found : CameraMapPoint::State::missed;
    return out;
  }

 private:
  static PupilliFilter::Options filter_options(const CameraTrackerOptions& options) {
    PupilliFilter::Options o;
    if (options.particle_count > 0) o.particle_count = static_cast<std::size_t>(options.particle_count);
    if (options.as_printed) o.polish = false, o.wider_unseen = 1, o.introduced_at_once = 1;
    return o;
  }
  static Eigen::Matrix3d covariance_of(const PupilliPoint& p) {
    const Eigen::Vector3d ray = (p.position - calib::inverse(p.source.cam_from_world).translation).normalized();
    return p.sigma_m * p.sigma_m * ray * ray.transpose() + 1e-6 * Eigen::Matrix3d::Identity();
  }
  void add(const Eigen::Vector3d& position, double sigma_m, const FeatureSource& source, bool given) {
    PupilliPoint p;
    const auto t = cut_template(source.pyramid->levels.front(), source.px);
    if (!t) return;
    p.position = position, p.sigma_m = sigma_m, p.templ = *t, p.source = source, p.given = given;
    filter_.add(p);
  }

  void start(const std::shared_ptr<const Pyramid>& pyramid, const StartResult& started, std::uint64_t) override {
    filter_.start(started.pose.cam_from_world);
    for (std::size_t i = 0; i < started.points.size(); ++i)
      add(started.points[i], started.given_sigma_m, {pyramid, started.pose.cam_from_world, started.px[i]}, true);
  }
  void restart(const calib::Rigid3d& cam_from_world) override { filter_.start(cam_from_world); }
  const PoseParticles& particles() const override { return filter_.particles(); }

  SceneMap scene() const override {
    SceneMap out;
    for (const PupilliPoint& p : filter_.points()) {
      MapPoint x;
      x.position = p.position, x.covariance = covariance_of(p), x.given = p.given;
      if (out.keyframes.empty() || out.keyframes.back().pyramid != p.source.pyramid)
        out.keyframes.push_back({p.source.pyramid, p.source.cam_from_world});
      x.views[0].keyframe = static_cast<int>(out.keyframes.size()) - 1, x.views[0].px = p.source.px;
      describe(x.views[0], *p.source.pyramid);
      x.view_count = 1;
      out.points.push_back(x);
    }
    return out;
  }

  FilteredPose track(const std::shared_ptr<const Pyramid>& pyramid, std::uint64_t) override {
    const PupilliFilter::Result r = filter_.track(pyramid);
    if (may_map()) filter_.map(pyramid, r);
    FilteredPose out{
        r.supported, r.cam_from_world, r.active, r.matched, static_cast<int>(filter_.points().size()), 0, 1,
        {},          r.polished};
    for (const PupilliFilter::Measured& m : filter_.measured()) {
      const PupilliPoint& p = filter_.points()[m.point];
      out.map_sigma_m =
          std::hypot(out.map_sigma_m, p.sigma_m / std::sqrt(static_cast<double>(filter_.measured().size())));
      out.depth_m = (r.cam_from_world * p.position).norm();
      if (m.found.allFinite()) out.seen.push_back({p.position, m.found, 1});
    }
    return out;
  }

  PupilliFilter filter_;
};

}  // namespace

std::unique_ptr<CameraTracker> make_pupilli_tracker(const calib::Camera& camera, const CameraTrackerOptions& options) {
  return std::make_unique<PupilliTracker>(camera, options);
}

}  // namespace huetrack::papers
