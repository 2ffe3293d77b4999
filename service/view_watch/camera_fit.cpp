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

constexpr double huber = 2;

// In how many places a camera saw something: light from one side shifts what it sees by the same in all samples of one,
// and other places are half a metre away, a dozen radii of a ball.
double places_of(const Track& track) {
  constexpr double radii_apart = 12;
  double places = 1;
  for (std::size_t k = 1; k < track.size(); ++k)
    places += (track[k].px - track[k - 1].px).norm() / (radii_apart * std::max(1.0, track[k].radius_px));
  return places;
}

// One sample of each place counts.
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

// What the samples say: how far off each is, in what is expected of it, and its slope by N numbers.
template <int N>
struct Off {
  std::vector<double> in_sigmas;
  std::vector<Eigen::Matrix<double, N, 1>> slopes;

  double cost() const {
    double sum = 0;
    for (const double r : in_sigmas) sum += std::abs(r) < huber ? r * r : huber * (2 * std::abs(r) - huber);
    return sum;
  }
};

// One camera's samples with the others'; a pair is matched once, whatever is supposed of the camera.
class CameraSamples {
 public:
  CameraSamples(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                const TimeSigmas& times)
      : pairs_(comparison.moments_of(tracks, camera, times)) {
    for (const auto& pair : pairs_) size_ += pair.moments.size();
    share_ = share_of_places(tracks[camera], std::max<std::size_t>(1, size_));
  }

  std::size_t size() const { return size_; }
  double share() const { return share_; }  // of the samples that tell something of their own

  // move: of a ray in the camera's frame, unit to unit. slope: of N numbers, from the moved ray and from the slope by
  // its rotation in the camera's frame.
  template <int N, typename Move, typename Slope>
  Off<N> off(Move move, Slope slope) const {
    Off<N> out;
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

// The equations of one step of Gauss and Newton with Huber's weights; each sample counts for share of one.
template <int N>
struct Step {
  Eigen::Matrix<double, N, N> normal;
  Eigen::Matrix<double, N, 1> right;
};
template <int N>
Step<N> step_of(const Off<N>& off, double share) {
  Step<N> out{Eigen::Matrix<double, N, N>::Zero(), Eigen::Matrix<double, N, 1>::Zero()};
  for (std::size_t k = 0; k < off.in_sigmas.size(); ++k) {
    const double r = off.in_sigmas[k], weight = std::abs(r) < huber ? share : share * huber / std::abs(r);
    out.normal += weight * off.slopes[k] * off.slopes[k].transpose();
    out.right -= weight * r * off.slopes[k];
  }
  return out;
}

// Levenberg's damping: tries steps until one is better, which it then is at; false: none is.
template <int N, typename Try>
bool take_step(const Step<N>& step, double& damping, Try is_better_by) {
  constexpr int attempts = 4;
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

constexpr int iterations = 12;
constexpr double first_damping = 1e-4;

}  // namespace

// Gauss and Newton's method: three numbers, of which those that the samples hardly tell (a turn about the ray to
// something that does not move far) stay what is usual: small.
std::optional<BestTurn> best_turn(const PairComparison& comparison, const std::vector<Track>& tracks,
                                  std::size_t camera, const TimeSigmas& times) {
  constexpr double furthest_rad = 0.26, settled_rad = 2e-5;
  constexpr double usual_rad = 0.05;  // of a tripod that somebody knocked
  const CameraSamples samples(comparison, tracks, camera, times);
  if (samples.size() == 0) return std::nullopt;
  // exp(turn) * the rig's: rays go the other way.
  const auto off_at = [&](const Quaterniond& turn) {
    const Eigen::Matrix3d back = turn.conjugate().toRotationMatrix();
    return samples.off<3>([&](const Vector3d& ray) { return Vector3d(back * ray); },
                          [](const Vector3d&, const Vector3d& slope) { return Vector3d(-slope); });
  };
  const auto prior = [&](const Quaterniond& turn) {
    return rotation_vector(turn).squaredNorm() / (usual_rad * usual_rad);
  };
  Quaterniond turn = Quaterniond::Identity();
  Off<3> off = off_at(turn);
  const double without = samples.share() * off.cost();
  double cost = without, damping = first_damping, moved_rad = 0;
  bool is_too_far = false;
  const auto try_step = [&](const Vector3d& by) {
    const Quaterniond there = turn * turn_by(by);
    is_too_far = rotation_vector(there).norm() > furthest_rad;
    if (is_too_far) return false;
    Off<3> off_there = off_at(there);
    const double cost_there = samples.share() * off_there.cost() + prior(there);
    if (cost_there >= cost) return false;
    turn = there, off = std::move(off_there), cost = cost_there, moved_rad = by.norm();
    return true;
  };
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Step<3> step = step_of(off, samples.share());
    step.normal += Eigen::Matrix3d::Identity() / (usual_rad * usual_rad);
    step.right -= rotation_vector(turn) / (usual_rad * usual_rad);
    const bool is_better = take_step(step, damping, try_step);
    if (is_too_far) return std::nullopt;
    if (!is_better || moved_rad < settled_rad) break;
  }
  // What is expected of a good rig is what may be in it. What is left when the turn is undone shows how much really is,
  // but for light from one side, which lasts.
  constexpr double least_noise2 = 0.2;
  const double noise2 = std::clamp(off.cost() / double(samples.size()), least_noise2, 1.0);
  return BestTurn{rotation_vector(turn), (without - cost) / noise2};
}

// From the best of a few, by Gauss and Newton's method in its logarithm.
BestZoom best_zoom(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                   const TimeSigmas& times) {
  constexpr double coarse = 1.15, shortest = 0.6, longest = 1.6, settled = 1e-4;
  constexpr int coarse_steps = 3;
  const CameraSamples samples(comparison, tracks, camera, times);
  if (samples.size() == 0) return {1, 0};
  const auto off_at = [&](double zoom) {
    return samples.off<1>([&](const Vector3d& ray) { return Vector3d(ray.x(), ray.y(), zoom * ray.z()).normalized(); },
                          [](const Vector3d& ray, const Vector3d& slope) {
                            // The rotation that turns the ray as a longer focal length does: towards the axis.
                            return Eigen::Matrix<double, 1, 1>(slope.dot(ray.cross(Vector3d(0, 0, ray.z()))));
                          });
  };
  double zoom = 1, damping = first_damping, moved = 0;
  Off<1> off = off_at(zoom);
  const double without = off.cost();
  double cost = without;
  const auto consider = [&](double there) {
    if (there < shortest || there > longest) return false;
    Off<1> off_there = off_at(there);
    const double cost_there = off_there.cost();
    if (cost_there >= cost) return false;
    moved = std::abs(there - zoom);
    zoom = there, off = std::move(off_there), cost = cost_there;
    return true;
  };
  for (int k = 1; k <= coarse_steps; ++k) consider(std::pow(coarse, k)), consider(std::pow(coarse, -k));
  for (int iteration = 0; iteration < iterations; ++iteration)
    if (!take_step(step_of(off, 1), damping,
                   [&](const Eigen::Matrix<double, 1, 1>& by) { return consider(zoom * std::exp(by(0))); }) ||
        moved < settled)
      break;
  return {zoom, samples.share() * (without - cost)};
}

}  // namespace huetrack::view_watch
