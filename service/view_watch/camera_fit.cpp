#include "view_watch/camera_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace huetrack::view_watch {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

struct CameraFitTuning {
  double huber_sigmas = 2;       // robust loss: farther away a sample counts by its distance
  double radii_apart = 12;       // of the target, between independent samples: shade shifts all of one place alike
  double usual_turn_rad = 0.05;  // prior of a turn, 1 sigma: a tripod that was knocked
  double max_zoom = 1.6;         // focal length over the rig's, or the rig's over it
};
constexpr CameraFitTuning camera_fit{};

// maths: Levenberg-Marquardt; these change how soon a fit ends.
constexpr int iterations = 12, attempts = 4;
constexpr double first_damping = 1e-4, settled_rad = 2e-5, settled_zoom = 1e-4, zoom_grid = 1.15;
constexpr int zoom_grid_steps = 3;

// Number of independent places in which a camera saw the target.
double places_of(const Track& track) {
  double places = 1;
  for (std::size_t k = 1; k < track.size(); ++k)
    places += (track[k].px - track[k - 1].px).norm() / (camera_fit.radii_apart * std::max(1.0, track[k].radius_px));
  return places;
}

// Weight of a sample: one per place.
double share_of_places(const Track& track, std::size_t samples) {
  return std::min(1.0, places_of(track) / double(samples));
}

Quaterniond turn_by(const Vector3d& rad) {
  const double angle = rad.norm();
  return angle > 0 ? Quaterniond(Eigen::AngleAxisd(angle, rad / angle)) : Quaterniond::Identity();
}

Vector3d rotation_vector(const Quaterniond& turn) {
  const Eigen::AngleAxisd about(turn);
  return about.angle() * about.axis();
}

// Residuals in standard deviations, and their derivatives by N parameters.
template <int N>
struct Residuals {
  std::vector<double> in_sigmas;
  std::vector<Eigen::Matrix<double, N, 1>> slopes;

  double cost() const {
    double sum = 0;
    const double huber = camera_fit.huber_sigmas;
    for (const double r : in_sigmas) sum += std::abs(r) < huber ? r * r : huber * (2 * std::abs(r) - huber);
    return sum;
  }
};

// One camera's samples with the others', matched once.
class CameraSamples {
 public:
  CameraSamples(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                const TimeSigmas& times)
      : pairs_(comparison.moments_of(tracks, camera, times)) {
    for (const auto& pair : pairs_) size_ += pair.moments.size();
    share_ = share_of_places(tracks[camera], std::max<std::size_t>(1, size_));
  }

  std::size_t size() const { return size_; }
  double share() const { return share_; }  // weight of a sample

  // move: maps a ray of the camera, unit to unit. slope: derivatives by N parameters from the moved ray and the
  // derivative by its rotation.
  template <int N, typename Move, typename Slope>
  Residuals<N> residuals(Move move, Slope slope) const {
    Residuals<N> out;
    out.in_sigmas.reserve(size_);
    out.slopes.reserve(size_);
    for (const auto& [placement, moments] : pairs_) {
      for (PairComparison::Moment moment : moments) {
        moment.of_i = move(moment.of_i);
        const auto pass = PairComparison::passing(moment, placement);
        out.in_sigmas.push_back(pass ? pass->off_px / pass->expected_px : 0);
        out.slopes.push_back(pass ? slope(moment.of_i, Vector3d(pass->slope_of_i_px / pass->expected_px))
                                  : Eigen::Matrix<double, N, 1>::Zero().eval());
      }
    }
    return out;
  }

 private:
  const std::vector<PairComparison::WithOther> pairs_;
  std::size_t size_ = 0;
  double share_ = 0;
};

// Normal equations of a Gauss-Newton step with Huber's weights times `share`.
template <int N>
struct Step {
  Eigen::Matrix<double, N, N> normal;
  Eigen::Matrix<double, N, 1> right;
};
template <int N>
Step<N> step_of(const Residuals<N>& residuals, double share) {
  const double huber = camera_fit.huber_sigmas;
  Step<N> out{Eigen::Matrix<double, N, N>::Zero(), Eigen::Matrix<double, N, 1>::Zero()};
  for (std::size_t k = 0; k < residuals.in_sigmas.size(); ++k) {
    const double r = residuals.in_sigmas[k], weight = std::abs(r) < huber ? share : share * huber / std::abs(r);
    out.normal += weight * residuals.slopes[k] * residuals.slopes[k].transpose();
    out.right -= weight * r * residuals.slopes[k];
  }
  return out;
}

// Increases the damping until a step is better; is_better_by() takes it then. False: none is.
template <int N, typename Try>
bool take_step(const Step<N>& step, double& damping, Try is_better_by) {
  for (int attempt = 0; attempt < attempts; ++attempt) {
    Eigen::Matrix<double, N, N> damped = step.normal;
    damped.diagonal().array() += damping * step.normal.trace() / N;
    const Eigen::Matrix<double, N, 1> by = damped.ldlt().solve(step.right);
    const bool is_better = by.allFinite() && is_better_by(by);
    damping = is_better ? damping / 10 : damping * 30;
    if (is_better) return true;
  }
  return false;
}

}  // namespace

// With a prior: a turn about the ray to a target that moves little is hardly observable and stays small.
std::optional<BestTurn> best_turn(const PairComparison& comparison, const std::vector<Track>& tracks,
                                  std::size_t camera, const TimeSigmas& times) {
  constexpr double prior_variance = camera_fit.usual_turn_rad * camera_fit.usual_turn_rad;
  const CameraSamples samples(comparison, tracks, camera, times);
  if (samples.size() == 0) return std::nullopt;
  // Rays turn the other way.
  const auto residuals_at = [&](const Quaterniond& turn) {
    const Eigen::Matrix3d back = turn.conjugate().toRotationMatrix();
    return samples.residuals<3>([&](const Vector3d& ray) { return Vector3d(back * ray); },
                                [](const Vector3d&, const Vector3d& slope) { return Vector3d(-slope); });
  };
  const auto prior = [&](const Quaterniond& turn) { return rotation_vector(turn).squaredNorm() / prior_variance; };
  Quaterniond turn = Quaterniond::Identity();
  Residuals<3> off = residuals_at(turn);
  const double without = samples.share() * off.cost();
  double cost = without, damping = first_damping, moved_rad = 0;
  const auto try_step = [&](const Vector3d& by) {
    const Quaterniond there = turn * turn_by(by);
    Residuals<3> off_there = residuals_at(there);
    const double cost_there = samples.share() * off_there.cost() + prior(there);
    if (cost_there >= cost) return false;
    turn = there, off = std::move(off_there), cost = cost_there, moved_rad = by.norm();
    return true;
  };
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Step<3> step = step_of(off, samples.share());
    step.normal += Eigen::Matrix3d::Identity() / prior_variance;
    step.right -= rotation_vector(turn) / prior_variance;
    const bool is_better = take_step(step, damping, try_step);
    if (!is_better || moved_rad < settled_rad) break;
  }
  // The expected variances are upper limits: the noise is estimated from what the turn leaves.
  const double noise2 = std::clamp(off.cost() / double(samples.size()), pair_sampling.least_noise2, 1.0);
  return BestTurn{rotation_vector(turn), (without - cost) / noise2};
}

// Starts from the best of a grid; the parameter is the logarithm.
BestZoom best_zoom(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                   const TimeSigmas& times) {
  const CameraSamples samples(comparison, tracks, camera, times);
  if (samples.size() == 0) return {1, 0};
  const auto residuals_at = [&](double zoom) {
    return samples.residuals<1>(
        [&](const Vector3d& ray) { return Vector3d(ray.x(), ray.y(), zoom * ray.z()).normalized(); },
        [](const Vector3d& ray, const Vector3d& slope) {
          // A longer focal length rotates the ray towards the axis.
          return Eigen::Matrix<double, 1, 1>(slope.dot(ray.cross(Vector3d(0, 0, ray.z()))));
        });
  };
  double zoom = 1, damping = first_damping, moved = 0;
  Residuals<1> off = residuals_at(zoom);
  const double without = off.cost();
  double cost = without;
  const auto consider = [&](double there) {
    if (there * camera_fit.max_zoom < 1 || there > camera_fit.max_zoom) return false;
    Residuals<1> off_there = residuals_at(there);
    const double cost_there = off_there.cost();
    if (cost_there >= cost) return false;
    moved = std::abs(there - zoom);
    zoom = there, off = std::move(off_there), cost = cost_there;
    return true;
  };
  for (int k = 1; k <= zoom_grid_steps; ++k) consider(std::pow(zoom_grid, k)), consider(std::pow(zoom_grid, -k));
  for (int iteration = 0; iteration < iterations; ++iteration)
    if (!take_step(step_of(off, 1), damping,
                   [&](const Eigen::Matrix<double, 1, 1>& by) { return consider(zoom * std::exp(by(0))); }) ||
        moved < settled_zoom)
      break;
  return {zoom, samples.share() * (without - cost)};
}

}  // namespace huetrack::view_watch
