#include "camera_tracking/papers/pupilli_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "camera_tracking/papers/mean_polish.h"
#include "camera_tracking/papers/paper_tracker_base.h"
#include "particle_filter/resample.h"

namespace huetrack::papers {
namespace {

constexpr double most_half_px = 44;  // of a correlation field

calib::Camera without_pose(calib::Camera camera) {
  camera.cam_from_world = {};
  return camera;
}

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

PupilliFilter::Result PupilliFilter::track(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid) {
  Result out;
  const camera_tracking::GreyImage& image = pyramid->levels.front();
  // Points that were mapped wrongly are never found. (Here: what was measured refers to them by their place.)
  std::erase_if(points_, [](const PupilliPoint& p) { return !p.given && p.missed > 30 && p.missed > 4 * p.found; });
  // Condensation: proportional to the weights, then the random walk of eq. (2).
  particles_.resample(rng_, options_.particle_count);
  const float wider = supported_ ? 1.0f : options_.wider_unseen;
  const float rotation = wider * options_.rotation_rad, position = wider * options_.position_m;
  particles_.walk_uniform(rotation, position, rng_);
  const std::size_t n = particles_.size();
  const calib::Rigid3d predicted = particles_.mean();

  // Active points: in view; the ones found most reliably, if there are many. Points that are not found go on being
  // sought.
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
  const std::size_t m = active_.size();
  u_.resize(std::max(u_.size(), m)), v_.resize(std::max(v_.size(), m)), fields_.resize(std::max(fields_.size(), m));
  measured_.clear();
  const auto project = [&](std::size_t k) {
    u_[k].resize(n), v_[k].resize(n);
    particles_.project(lens_, points_[active_[k]].position, u_[k], v_[k]);
  };
  // The correlation fields, eq. (3), in the regions where the particles project.
  for (std::size_t k = 0; k < m; ++k) {
    project(k);
    const camera_tracking::CloudMoments cloud = camera_tracking::cloud_moments(u_[k], v_[k], particles_.weight);
    const double left = std::max(static_cast<double>(cloud.u_min), cloud.mean.x() - most_half_px),
                 right = std::min(static_cast<double>(cloud.u_max), cloud.mean.x() + most_half_px);
    const double top = std::max(static_cast<double>(cloud.v_min), cloud.mean.y() - most_half_px),
                 bottom = std::min(static_cast<double>(cloud.v_max), cloud.mean.y() + most_half_px);
    const Eigen::Vector2d centre(0.5 * (left + right), 0.5 * (top + bottom));
    const double margin = static_cast<double>(options_.epsilon_d_px[0]);
    fields_[k].correlate(image, points_[active_[k]].templ,
                         box_around(centre, 0.5 * (right - left) + margin, 0.5 * (bottom - top) + margin));
    measured_.push_back({active_[k], cloud, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN())});
  }
  // Annealing, section 4: weigh with a tolerance, resample, walk less, weigh with a smaller tolerance.
  for (int step = 0; step < options_.annealing_steps; ++step) {
    const float epsilon_d = options_.epsilon_d_px[std::min(step, 2)];
    if (step > 0) {
      particles_.resample(rng_, options_.particle_count);
      const float narrower = std::pow(0.5f, static_cast<float>(step));
      particles_.walk_uniform(narrower * rotation, narrower * position, rng_);
    }
    log_weight_.assign(n, 0.0f);
    for (std::size_t k = 0; k < m; ++k) {
      if (step > 0) project(k);
      fields_[k].mark(options_.epsilon_rho * (step > 0 ? 0.5f : 1.0f),
                      epsilon_d);                               // after eq. (7) the values are smaller
      fields_[k].score(u_[k], v_[k], 1.0f, true, log_weight_);  // eqs. (5), (6)
    }
    particle_filter::normalize_log_weights(log_weight_, particles_.weight);
    if (step + 1 == options_.annealing_steps) break;
    // Eq. (7), from a subset that is drawn by the weights.
    std::vector<std::uint32_t> drawn(std::min(options_.reweighting_particles, n));
    particle_filter::systematic_ancestors(particles_.weight, rng_.uniform(), drawn);
    std::vector<float> su(drawn.size()), sv(drawn.size()), equal(drawn.size(), 1.0f / static_cast<float>(drawn.size()));
    for (std::size_t k = 0; k < m; ++k) {
      for (std::size_t i = 0; i < drawn.size(); ++i) su[i] = u_[k][drawn[i]], sv[i] = v_[k][drawn[i]];
      if (step == 0) fields_[k].threshold(options_.epsilon_rho);
      fields_[k].reweight(su, sv, equal, epsilon_d);
    }
  }
  out.cam_from_world = particles_.mean();
  out.active = static_cast<int>(m);
  for (std::size_t k = 0; k < m; ++k) {
    const auto px = camera_.model.project(out.cam_from_world * points_[active_[k]].position);
    if (!px) continue;
    const camera_tracking::NccPeak peak = fields_[k].strongest(
        static_cast<float>(px->px.x()), static_cast<float>(px->px.y()), 2 * options_.epsilon_d_px[2], 0.2f);
    PupilliPoint& p = points_[active_[k]];
    measured_[k].cloud = camera_tracking::cloud_moments(u_[k], v_[k], particles_.weight);
    if (peak.rho > 0) {
      ++out.matched, ++p.found;
      measured_[k].found =
          fields_[k]
              .best_match(px->px, 2 * static_cast<double>(options_.epsilon_d_px[2]), options_.epsilon_rho)
              .value_or(Eigen::Vector2d(peak.u, peak.v));
    } else {
      ++p.missed;
    }
    if (p.found + p.missed > 60) p.found /= 2, p.missed /= 2;
  }
  // A dispersed cloud finds something everywhere: it supports nothing until it has gathered.
  const auto narrow =
      std::ranges::count_if(measured_, [](const Measured& x) { return x.cloud.covariance.trace() < 2 * 6 * 6; });
  out.supported = out.matched >= 4 && 3 * out.matched >= 2 * out.active && 2 * narrow > static_cast<std::ptrdiff_t>(m);
  supported_ = out.supported;
  if (out.supported && options_.polish) {
    std::vector<camera_tracking::PoseObservation> seen;
    for (const Measured& x : measured_) {
      const PupilliPoint& p = points_[x.point];
      const double depth_m = (out.cam_from_world * p.position).norm();
      if (x.found.allFinite())
        seen.push_back({p.position, x.found, sigma_px_of(camera_.model, 0.5, p.sigma_m, depth_m)});
    }
    out.polished = polish_mean(camera_.model, particles_, out.cam_from_world, seen);
    if (out.polished) out.cam_from_world = out.polished->cam_from_world;
  }
  return out;
}

void PupilliFilter::map(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid, const Result& result) {
  if (!result.supported) return;
  const camera_tracking::GreyImage& image = pyramid->levels.front();
  const auto in_view = static_cast<std::size_t>(std::ranges::count_if(points_, [&](const PupilliPoint& p) {
    const auto px = camera_.model.project(result.cam_from_world * p.position);
    return px && camera_.contains(*px);
  }));
  std::vector<FeatureCandidate> kept;
  for (FeatureCandidate& c : candidates_) {
    ++c.attempts;
    double first = 0, last = 0, cumulative = 0;
    for (std::size_t b = 0; b < c.ray.weights().size(); ++b) {
      if (cumulative <= 0.02) first = c.ray.inverse_depth(b);
      cumulative += c.ray.weights()[b];
      if (cumulative <= 0.98) last = c.ray.inverse_depth(b);
    }
    last = std::max(last, first);
    const auto a = camera_.model.project(result.cam_from_world * (c.ray.origin() + c.ray.direction() / first));
    const auto b = camera_.model.project(result.cam_from_world * (c.ray.origin() + c.ray.direction() / last));
    bool found = false;
    if (a && b && camera_.contains(*b) && (a->px - b->px).norm() < 120) {
      const Eigen::Vector2d along =
          (b->px - a->px).norm() > 0.5 ? Eigen::Vector2d((b->px - a->px).normalized()) : Eigen::Vector2d(1, 0);
      const Eigen::Vector2d middle = 0.5 * (a->px + b->px);
      constexpr double reach = 5;
      candidate_field_.correlate(image, c.templ,
                                 box_around(middle, 0.5 * std::abs(a->px.x() - b->px.x()) + reach,
                                            0.5 * std::abs(a->px.y() - b->px.y()) + reach));
      const camera_tracking::PixelRegion& region = candidate_field_.region();
      std::vector<std::uint32_t> drawn(40);
      particle_filter::systematic_ancestors(particles_.weight, rng_.uniform(), drawn);
      c.ray.begin();
      for (int v = region.v0; v <= region.v1; ++v) {
        for (int u = region.u0; u <= region.u1; ++u) {
          const float rho =
              candidate_field_.rho()[static_cast<std::size_t>((v - region.v0) * region.width() + u - region.u0)];
          if (rho < options_.epsilon_rho) continue;
          // Section 5: re-weighted by the distance from the epipolar line.
          const Eigen::Vector2d d = Eigen::Vector2d(u, v) - a->px;
          const double off = (along.x() * d.y() - along.y() * d.x()) / 2.0;
          const auto ray = camera_.model.ray({Eigen::Vector2d(u, v)});
          if (!ray) continue;
          found = true;
          const double rho2 = static_cast<double>(rho * rho);
          for (const std::uint32_t i : drawn) {
            const calib::Rigid3d back = calib::inverse(particles_.pose(i));
            c.ray.add(back.translation, back.rotation * *ray, rho2 * rho2 * std::exp(-0.5 * off * off),
                      1.5 / camera_.model.fx());
          }
        }
      }
      if (found) c.ray.end();
    }
    c.missed += !found;
    if (const auto depth = c.ray.converged()) {
      PupilliPoint p;
      p.position = c.ray.origin() + c.ray.direction() / depth->inverse_depth;
      p.sigma_m = depth->sigma / (depth->inverse_depth * depth->inverse_depth);
      p.templ = std::move(c.templ);
      p.source = std::move(c.source);
      add(std::move(p));
    } else if (c.attempts < 60 && c.missed < 8) {
      kept.push_back(std::move(c));
    }  // else: abandoned
  }
  candidates_.swap(kept);
  if (candidates_.size() < options_.introduced_at_once && in_view < options_.wanted_in_view)
    introduce(pyramid, result.cam_from_world);
}

void PupilliFilter::introduce(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid,
                              const calib::Rigid3d& pose) {
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
  PupilliTracker(const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options)
      : PaperTrackerBase(camera, options), filter_(camera, filter_options(options), options.seed) {
    if (auto stored = take_loaded()) {
      for (const camera_tracking::MapPoint& p : stored->map.points) {
        if (!p.alive || p.look_count == 0) continue;
        const camera_tracking::Keyframe& k = stored->map.keyframes[static_cast<std::size_t>(p.looks[0].keyframe)];
        add(p.position, std::sqrt(p.covariance.trace()), {k.pyramid, k.cam_from_world, p.looks[0].px}, p.given);
      }
    }
  }

  camera_tracking::CameraTrackerView view() const override {
    camera_tracking::CameraTrackerView out;
    for (const PupilliFilter::Measured& m : filter_.measured()) {
      const PupilliPoint& p = filter_.points()[m.point];
      out.features.push_back({m.cloud.mean.cast<float>(), m.found.cast<float>(), m.cloud.covariance.cast<float>(),
                              p.position, covariance_of(p), p.given});
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(particles().size(), 300); ++i)
      out.particles.push_back(calib::inverse(particles().pose(i)));
    return out;
  }

  std::vector<camera_tracking::CameraMapPoint> map() const override {
    std::vector<camera_tracking::CameraMapPoint> out;
    for (const PupilliPoint& p : filter_.points())
      out.push_back({p.id, p.position, covariance_of(p), camera_tracking::CameraMapPoint::State::not_sought, p.given});
    for (const PupilliFilter::Measured& m : filter_.measured())
      out[m.point].state = m.found.allFinite() ? camera_tracking::CameraMapPoint::State::found
                                               : camera_tracking::CameraMapPoint::State::missed;
    return out;
  }

  void save_map(const std::filesystem::path& file) const override {
    camera_tracking::write_map(file, {scene(), {}, {camera_.image_size.width, camera_.image_size.height}});
  }

 private:
  static PupilliFilter::Options filter_options(const camera_tracking::CameraTrackerOptions& options) {
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

  void start(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid, const camera_tracking::Started& started,
             std::uint64_t) override {
    filter_.start(started.pose.cam_from_world);
    for (std::size_t i = 0; i < started.points.size(); ++i)
      add(started.points[i], started.given_sigma_m, {pyramid, started.pose.cam_from_world, started.px[i]}, true);
  }
  void restart(const calib::Rigid3d& cam_from_world) override { filter_.start(cam_from_world); }
  const camera_tracking::PoseParticles& particles() const override { return filter_.particles(); }

  camera_tracking::SceneMap scene() const override {
    camera_tracking::SceneMap out;
    for (const PupilliPoint& p : filter_.points()) {
      camera_tracking::MapPoint x;
      x.position = p.position, x.covariance = covariance_of(p), x.given = p.given;
      camera_tracking::PointLook& look = x.looks[0];
      look.keyframe = static_cast<int>(out.keyframes.size()), look.px = p.source.px;
      if (!out.keyframes.empty() && out.keyframes.back().pyramid == p.source.pyramid)
        --look.keyframe;
      else
        out.keyframes.push_back({p.source.pyramid, p.source.cam_from_world});
      const camera_tracking::GreyImage& image = p.source.pyramid->levels.front();
      look.described = image.contains(look.px.x(), look.px.y(), camera_tracking::descriptor_margin);
      if (look.described) look.descriptor = camera_tracking::describe(image, look.px);
      x.look_count = 1;
      out.points.push_back(x);
    }
    return out;
  }

  FilteredPose track(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid, std::uint64_t) override {
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

std::unique_ptr<camera_tracking::CameraTracker> make_pupilli_tracker(
    const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options) {
  return std::make_unique<PupilliTracker>(camera, options);
}

}  // namespace huetrack::papers
