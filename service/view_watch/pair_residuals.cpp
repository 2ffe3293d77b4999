#include "view_watch/pair_residuals.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "calib/model/median.h"

namespace huetrack::view_watch {
namespace {

// What a good rig and a lens leave: a fraction of a pixel.
constexpr double sigma_of_rig_px = 0.25;
constexpr double longest_gap_s = 0.15;  // between two samples, to tell what was between them
constexpr double largest_off = 5;       // in standard deviations: further off is as bad
constexpr double nowhere_px = 60;       // rays that meet behind a camera

}  // namespace

double focal_px(const calib::Camera& camera) {
  calib::CameraModel::Jacobian j;
  return camera.model.project({0, 0, 1}, j) ? std::sqrt(std::abs(j(0, 0) * j(1, 1))) : 1.0;
}

double sigma_of_region_px(double radius_px) {
  constexpr double of_edge_px = 0.25, of_radius = 0.06;
  return std::hypot(of_edge_px, of_radius * radius_px);
}

double PairResiduals::usual() const {
  if (off_px.size() < PairComparison::least_samples) return std::numeric_limits<double>::infinity();
  std::vector<double> in_sigmas(off_px.size());
  std::ranges::transform(off_px, expected, in_sigmas.begin(),
                         [](double off, double sigma) { return std::abs(off) / sigma; });
  return calib::median(std::move(in_sigmas));
}

double PairResiduals::usual_px() const {
  std::vector<double> sizes(off_px.size());
  std::ranges::transform(off_px, sizes.begin(), [](double off) { return std::abs(off); });
  return calib::median(std::move(sizes));
}

PairComparison::PairComparison(const calib::CameraRig& rig) : rig_(rig) {
  for (const calib::Camera& camera : rig.cameras)
    focal_px_.push_back(focal_px(camera)), centres_.push_back(camera.centre());
}

// The sample k of the frames that are taken for camera `slot`'s, as the camera sees it that really took them.
PairComparison::Placed PairComparison::placed(const std::vector<Track>& tracks, std::size_t slot, std::size_t k,
                                              const Supposition& with) const {
  const Track& track = tracks[slot];
  const SeenPoint& s = track[k];
  const std::size_t real = with.really.empty() ? slot : with.really[slot];
  const calib::Camera& camera = rig_.cameras[real];
  Placed out{.direction = s.ray, .t_s = s.t_s, .radius_px = s.radius_px, .sigma_px = s.sigma_px, .px_per_s = 0};
  if (real != slot) {
    const auto ray = camera.model.ray({s.px});
    out.direction = ray ? ray->normalized() : Eigen::Vector3d(0, 0, 1);
    const calib::CameraTiming &of_slot = rig_.cameras[slot].timing, &of_real = camera.timing;
    out.t_s += of_slot.latency_s.value_or(0) - of_real.latency_s.value_or(0) +
               s.below_middle * (of_real.readout_s.value_or(0) - of_slot.readout_s.value_or(0));
  }
  if (!with.late_s.empty()) out.t_s -= with.late_s[real];
  if (real == with.camera) {
    if (with.is_mirrored) {
      const auto ray = camera.model.ray({{camera.image_size.width - 1 - s.px.x(), s.px.y()}});
      out.direction = ray ? ray->normalized() : Eigen::Vector3d(0, 0, 1);
    }
    if (with.zoom != 1)
      out.direction = Eigen::Vector3d(out.direction.x(), out.direction.y(), with.zoom * out.direction.z()).normalized();
    if (!with.turn_rad.isZero(0)) {
      const double angle = with.turn_rad.norm();
      out.direction = Eigen::AngleAxisd(-angle, with.turn_rad / angle) * out.direction;
    }
  }
  out.direction = camera.cam_from_world.rotation.conjugate() * out.direction;
  const std::size_t before = k > 0 ? k - 1 : k, after = k + 1 < track.size() ? k + 1 : k;
  const double span_s = track[after].t_s - track[before].t_s;
  if (span_s > 0 && span_s < 2 * longest_gap_s) out.px_per_s = (track[after].px - track[before].px).norm() / span_s;
  return out;
}

PairComparison::PlacedTrack PairComparison::placed(const std::vector<Track>& tracks, std::size_t slot,
                                                   const Supposition& with) const {
  PlacedTrack out;
  out.reserve(tracks[slot].size());
  for (std::size_t k = 0; k < tracks[slot].size(); ++k) out.push_back(placed(tracks, slot, k, with));
  return out;
}

std::vector<PairComparison::PlacedTrack> PairComparison::all_placed(const std::vector<Track>& tracks,
                                                                    const Supposition& with) const {
  std::vector<PlacedTrack> out;
  for (std::size_t slot = 0; slot < tracks.size(); ++slot) out.push_back(placed(tracks, slot, with));
  return out;
}

PairResiduals PairComparison::residuals(const std::vector<Track>& tracks, std::size_t i, std::size_t j,
                                        const Supposition& with, const TimeSigmas& times) const {
  return residuals(placed(tracks, i, with), placed(tracks, j, with), i, j, with, times);
}

PairResiduals PairComparison::residuals(const PlacedTrack& of_i, const PlacedTrack& of_j, std::size_t i, std::size_t j,
                                        const Supposition& with, const TimeSigmas& times) const {
  // The one that is seen less often says when, the other one is told between its samples.
  if (of_i.size() > of_j.size()) return residuals(of_j, of_i, j, i, with, times);
  PairResiduals out;
  if (of_i.size() < least_samples) return out;
  for (auto* of : {&out.off_px, &out.expected, &out.radius_m}) of->reserve(of_i.size());
  const auto real = [&](std::size_t slot) { return with.really.empty() ? slot : with.really[slot]; };
  const Eigen::Vector3d base = centres_[real(j)] - centres_[real(i)];
  const double fi = focal_px_[real(i)], fj = focal_px_[real(j)];
  const double time_sigma_s = std::hypot(times[i], times[j]);
  std::size_t next = 1;
  for (const Placed& a : of_i) {
    while (next + 1 < of_j.size() && of_j[next].t_s < a.t_s) ++next;
    const Placed &before = of_j[next - 1], &after = of_j[next];
    const double gap_s = after.t_s - before.t_s;
    // In-step cameras have the same moments: nothing is to be told between samples, however far apart they are.
    constexpr double same_s = 0.002;
    Eigen::Vector3d direction;
    double radius_px = 0, sigma_px = 0, interpolated_px = 0, px_per_s = 0;
    if (std::abs(a.t_s - before.t_s) < same_s) {
      direction = before.direction, radius_px = before.radius_px, sigma_px = before.sigma_px,
      px_per_s = before.px_per_s;
    } else if (std::abs(a.t_s - after.t_s) < same_s) {
      direction = after.direction, radius_px = after.radius_px, sigma_px = after.sigma_px, px_per_s = after.px_per_s;
    } else {
      if (!(gap_s > 0 && gap_s < longest_gap_s) || a.t_s < before.t_s || a.t_s > after.t_s) continue;
      const double share = (a.t_s - before.t_s) / gap_s;
      direction = (before.direction + share * (after.direction - before.direction)).normalized();
      radius_px = before.radius_px + share * (after.radius_px - before.radius_px);
      sigma_px = std::max(before.sigma_px, after.sigma_px);
      px_per_s = before.px_per_s + share * (after.px_per_s - before.px_per_s);
      // A curve between two samples: of some 5 m/s^2 at some 3 m.
      constexpr double acceleration_m_s2 = 5, distance_m = 3;
      interpolated_px = fj * acceleration_m_s2 / distance_m * gap_s * gap_s / 8;
    }
    const Eigen::Vector3d &di = a.direction, &dj = direction;
    const double cosine = di.dot(dj), denominator = 1 - cosine * cosine;
    if (denominator < 1e-3) continue;
    const double along_i = (base.dot(di) - cosine * base.dot(dj)) / denominator;
    const double along_j = (cosine * base.dot(di) - base.dot(dj)) / denominator;
    // Metres a pixel where both rays pass each other; a view counts by them.
    const double scale_i = std::abs(along_i) / fi, scale_j = std::abs(along_j) / fj;
    const double seen_px = std::hypot(scale_i * a.sigma_px, scale_j * sigma_px) / std::hypot(scale_i, scale_j);
    const double still_px = std::hypot(sigma_of_rig_px, seen_px, interpolated_px);
    const double moving_px = time_sigma_s * std::max(a.px_per_s, px_per_s) * std::numbers::sqrt2 / 2;
    out.expected.push_back(std::hypot(still_px, moving_px));
    if (along_i <= 0.05 || along_j <= 0.05) {
      out.off_px.push_back(nowhere_px);
      continue;
    }
    const double gap_m = base.dot(di.cross(dj)) / std::sqrt(denominator);
    out.off_px.push_back(gap_m / std::hypot(scale_i, scale_j));
    const double ri = a.radius_px * scale_i, rj = radius_px * scale_j;
    out.radius_m.push_back(std::sqrt(ri * rj));
  }
  return out;
}

std::vector<double> PairComparison::off_in_sigmas(const std::vector<Track>& tracks,
                                                  const std::vector<PlacedTrack>& as_is, const Supposition& with,
                                                  const TimeSigmas& times) const {
  const PlacedTrack of_camera = placed(tracks, with.camera, with);
  std::vector<double> in_sigmas;
  in_sigmas.reserve(tracks.size() * of_camera.size());
  for (std::size_t other = 0; other < tracks.size(); ++other) {
    if (other == with.camera) continue;
    const PairResiduals pair = residuals(of_camera, as_is[other], with.camera, other, with, times);
    if (pair.off_px.size() < least_samples) continue;
    for (std::size_t k = 0; k < pair.off_px.size(); ++k) in_sigmas.push_back(pair.off_px[k] / pair.expected[k]);
  }
  return in_sigmas;
}

void PairComparison::add(Agreement& agreement, const PairResiduals& pair) {
  if (pair.off_px.size() < least_samples) return;
  const double usual = pair.usual();
  if (usual > agreement.worst) agreement.worst_px = pair.usual_px();
  agreement.worst = std::max(agreement.worst, usual);
  double sum = 0;
  for (std::size_t k = 0; k < pair.off_px.size(); ++k) {
    const double in_sigmas = std::min(largest_off, std::abs(pair.off_px[k]) / pair.expected[k]);
    sum += in_sigmas * in_sigmas;
  }
  const double mean = sum / double(pair.off_px.size());
  agreement.score += (mean - agreement.score) / double(++agreement.pairs);
}

PairComparison::Agreement PairComparison::agreement(const std::vector<Track>& tracks, const Supposition& with,
                                                    const TimeSigmas& times) const {
  Agreement out;
  const std::vector<PlacedTrack> seen = all_placed(tracks, with);
  for (std::size_t j = 1; j < tracks.size(); ++j)
    for (std::size_t i = 0; i < j; ++i) add(out, residuals(seen[i], seen[j], i, j, with, times));
  return out;
}

PairComparison::Agreement PairComparison::agreement_of(const std::vector<Track>& tracks, std::size_t camera,
                                                       bool with_it, const Supposition& with,
                                                       const TimeSigmas& times) const {
  Agreement out;
  const std::vector<PlacedTrack> seen = all_placed(tracks, with);
  for (std::size_t j = 1; j < tracks.size(); ++j)
    for (std::size_t i = 0; i < j; ++i)
      if ((i == camera || j == camera) == with_it) add(out, residuals(seen[i], seen[j], i, j, with, times));
  return out;
}

namespace {

// In how many places a camera saw something: light from one side shifts what it sees by the same in all samples of one,
// and other places are half a metre away, a dozen radii of a ball.
double places_of(const Track& track) {
  constexpr double radii_apart = 12;
  double places = 1;
  for (std::size_t k = 1; k < track.size(); ++k)
    places += (track[k].px - track[k - 1].px).norm() / (radii_apart * std::max(1.0, track[k].radius_px));
  return places;
}

constexpr double huber = 2;
double huber_cost(const std::vector<double>& off) {
  double sum = 0;
  for (const double r : off) sum += std::abs(r) < huber ? r * r : huber * (2 * std::abs(r) - huber);
  return sum;
}

// One sample of each place counts.
double share_of_places(const Track& track, std::size_t samples) {
  return std::min(1.0, places_of(track) / double(samples));
}

}  // namespace

// Gauss and Newton's method with Levenberg's damping and Huber's weights, by differences: three numbers, of which those
// that the samples hardly tell (a turn about the ray to something that does not move far) stay what is usual: small.
std::optional<BestTurn> best_turn(const PairComparison& comparison, const std::vector<Track>& tracks,
                                  std::size_t camera, const TimeSigmas& times) {
  constexpr double furthest_rad = 0.26, step_rad = 1e-4, settled_rad = 2e-5;
  constexpr double usual_rad = 0.05;  // of a tripod that somebody knocked
  constexpr int iterations = 12;
  const std::vector<PairComparison::PlacedTrack> as_is = comparison.all_placed(tracks, {});
  const auto off_at = [&](const Eigen::Vector3d& turn) {
    return comparison.off_in_sigmas(tracks, as_is, {.camera = camera, .turn_rad = turn}, times);
  };
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  std::vector<double> off = off_at(turn);
  if (off.empty()) return std::nullopt;
  const double share = share_of_places(tracks[camera], off.size());
  const auto total = [&](const std::vector<double>& of, const Eigen::Vector3d& at) {
    return share * huber_cost(of) + at.squaredNorm() / (usual_rad * usual_rad);
  };
  const double without = total(off, turn);
  double cost = without, damping = 1e-4;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::array<std::vector<double>, 3> moved;
    for (int k = 0; k < 3; ++k) moved[std::size_t(k)] = off_at(turn + step_rad * Eigen::Vector3d::Unit(k));
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < off.size(); ++n) {
      const Eigen::Vector3d slope =
          Eigen::Vector3d(moved[0][n] - off[n], moved[1][n] - off[n], moved[2][n] - off[n]) / step_rad;
      const double weight = std::abs(off[n]) < huber ? 1 : huber / std::abs(off[n]);
      normal += weight * slope * slope.transpose();
      right -= weight * off[n] * slope;
    }
    normal = share * normal + Eigen::Matrix3d::Identity() / (usual_rad * usual_rad);
    right = share * right - turn / (usual_rad * usual_rad);
    bool is_better = false;
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    for (int attempt = 0; attempt < 4 && !is_better; ++attempt) {
      Eigen::Matrix3d damped = normal;
      damped.diagonal().array() += damping * normal.trace() / 3;
      step = damped.ldlt().solve(right);
      if (!step.allFinite() || (turn + step).norm() > furthest_rad) return std::nullopt;
      std::vector<double> there = off_at(turn + step);
      is_better = there.size() == off.size() && total(there, turn + step) < cost;
      damping = is_better ? damping / 10 : damping * 30;
      if (is_better) turn += step, cost = total(there, turn), off = std::move(there);
    }
    if (!is_better || step.norm() < settled_rad) break;
  }
  // What is expected of a good rig is what may be in it. What is left when the turn is undone shows how much really is,
  // but for light from one side, which lasts.
  constexpr double least_noise2 = 0.2;
  const double noise2 = std::clamp(huber_cost(off) / double(off.size()), least_noise2, 1.0);
  return BestTurn{turn, (without - cost) / noise2};
}

BestZoom best_zoom(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                   const TimeSigmas& times) {
  constexpr double coarse = 1.04, fine = 1.005;
  constexpr int coarse_steps = 12, fine_steps = 7;
  const std::vector<PairComparison::PlacedTrack> as_is = comparison.all_placed(tracks, {});
  const auto off_at = [&](double zoom) {
    return comparison.off_in_sigmas(tracks, as_is, {.camera = camera, .zoom = zoom}, times);
  };
  const std::vector<double> off = off_at(1);
  const double without = huber_cost(off);
  double best_zoom = 1, best = without;
  const auto consider = [&](double zoom) {
    if (const double cost = huber_cost(off_at(zoom)); cost < best) best = cost, best_zoom = zoom;
  };
  for (int k = 1; k <= coarse_steps; ++k) consider(std::pow(coarse, k)), consider(std::pow(coarse, -k));
  const double about = best_zoom;
  for (int k = 1; k <= fine_steps; ++k) consider(about * std::pow(fine, k)), consider(about * std::pow(fine, -k));
  return {best_zoom, off.empty() ? 0 : share_of_places(tracks[camera], off.size()) * (without - best)};
}

namespace {

// Of -0.6..0.6 s and of the best of these: the one of the least cost.
template <typename Cost>
double least_costly_lateness(Cost cost_of) {
  constexpr double furthest_s = 0.6, coarse_s = 0.02, fine_s = 0.004, finest_s = 0.001;
  double best_s = 0, best = std::numeric_limits<double>::infinity();
  const auto consider = [&](double late_s) {
    if (const double cost = cost_of(late_s); cost < best) best = cost, best_s = late_s;
  };
  for (int k = 0; k <= int(furthest_s / coarse_s); ++k) consider(k * coarse_s), consider(-k * coarse_s);
  for (const double step_s : {fine_s, finest_s}) {
    const double about_s = best_s;
    for (int k = -4; k <= 4; ++k) consider(about_s + k * step_s);
  }
  return best_s;
}

}  // namespace

double best_lateness(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                     const TimeSigmas& times) {
  Supposition with{.late_s = std::vector(tracks.size(), 0.0)};
  return least_costly_lateness([&](double late_s) {
    with.late_s[camera] = late_s;
    const auto agreement = comparison.agreement_of(tracks, camera, true, with, times);
    return agreement.pairs > 0 ? agreement.score : std::numeric_limits<double>::infinity();
  });
}

std::vector<double> best_latenesses(const PairComparison& comparison, const std::vector<Track>& tracks,
                                    const TimeSigmas& times) {
  constexpr std::size_t most_compared = 4;  // that were fitted before it: of many cameras all pairs would take too long
  Supposition with{.late_s = std::vector(tracks.size(), 0.0)};
  for (std::size_t c = 1; c < tracks.size(); ++c) {
    with.late_s[c] = least_costly_lateness([&](double late_s) {
      with.late_s[c] = late_s;
      PairComparison::Agreement with_earlier;
      for (std::size_t earlier = c - std::min(c, most_compared); earlier < c; ++earlier)
        PairComparison::add(with_earlier, comparison.residuals(tracks, earlier, c, with, times));
      return with_earlier.pairs > 0 ? with_earlier.score : std::numeric_limits<double>::infinity();
    });
  }
  return std::move(with.late_s);
}

}  // namespace huetrack::view_watch
