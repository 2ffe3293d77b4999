#include "view_watch/pair_residuals.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "calib/model/closest_approach.h"
#include "calib/model/median.h"
#include "object_tracking/sighting.h"

namespace huetrack::view_watch {
namespace {

struct PairNoiseTuning {
  double rig_px = 0.25;               // 1 sigma of a good rig and lens model
  double max_sigmas = 5;              // robust cost: farther off is as bad
  double acceleration_rad_s2 = 1.67;  // of a ray, by which interpolation errs: 5 m/s^2 at 3 m
};
constexpr PairNoiseTuning pair_noise{};

constexpr double parallel = 1e-3;  // maths: squared sine of the smallest angle of two rays

}  // namespace

double focal_px(const calib::Camera& camera) {
  calib::CameraModel::Jacobian j;
  return camera.model.project({0, 0, 1}, j) ? std::sqrt(std::abs(j(0, 0) * j(1, 1))) : 1.0;
}

double PairResiduals::usual() const {
  if (off_px.size() < pair_sampling.least_samples) return std::numeric_limits<double>::infinity();
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

// Sample k of the frames assigned to camera `slot`, through the camera that really took them.
PairComparison::Placed PairComparison::placed(const std::vector<Track>& tracks, std::size_t slot, std::size_t k,
                                              const FaultHypothesis& with) const {
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
  if (real == with.camera || with.camera == FaultHypothesis::every_camera) {
    if (with.is_mirrored || with.is_upside_down) {
      const Eigen::Vector2d from_end(camera.image_size.width - 1 - s.px.x(), camera.image_size.height - 1 - s.px.y());
      const auto ray = camera.model.ray({{from_end.x(), with.is_upside_down ? from_end.y() : s.px.y()}});
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
  if (span_s > 0 && span_s < 2 * pair_sampling.longest_gap_s)
    out.px_per_s = (track[after].px - track[before].px).norm() / span_s;
  return out;
}

PairComparison::PlacedTrack PairComparison::placed(const std::vector<Track>& tracks, std::size_t slot,
                                                   const FaultHypothesis& with) const {
  PlacedTrack out;
  out.reserve(tracks[slot].size());
  for (std::size_t k = 0; k < tracks[slot].size(); ++k) out.push_back(placed(tracks, slot, k, with));
  return out;
}

std::vector<PairComparison::PlacedTrack> PairComparison::all_placed(const std::vector<Track>& tracks,
                                                                    const FaultHypothesis& with) const {
  std::vector<PlacedTrack> out;
  for (std::size_t slot = 0; slot < tracks.size(); ++slot) out.push_back(placed(tracks, slot, with));
  return out;
}

PairResiduals PairComparison::residuals(const std::vector<Track>& tracks, std::size_t i, std::size_t j,
                                        const FaultHypothesis& with, const TimeSigmas& times) const {
  return residuals(placed(tracks, i, with), placed(tracks, j, with), i, j, with, times);
}

PairResiduals PairComparison::residuals(const PlacedTrack& of_i, const PlacedTrack& of_j, std::size_t i, std::size_t j,
                                        const FaultHypothesis& with, const TimeSigmas& times) const {
  const auto real = [&](std::size_t slot) { return with.really.empty() ? slot : with.really[slot]; };
  PairResiduals out;
  const std::vector<Moment> both = moments(of_i, of_j, i, j, times);
  const Placement placement{centres_[real(j)] - centres_[real(i)], focal_px_[real(i)], focal_px_[real(j)]};
  for (auto* of : {&out.off_px, &out.expected, &out.radius_m}) of->reserve(both.size());
  for (const Moment& moment : both) {
    const auto pass = passing(moment, placement);
    if (!pass) continue;
    out.off_px.push_back(pass->off_px);
    out.expected.push_back(pass->expected_px);
    if (pass->radius_m > 0) out.radius_m.push_back(pass->radius_m);
  }
  return out;
}

// At the samples of the camera that has fewer; the other one is interpolated.
std::vector<PairComparison::Moment> PairComparison::moments(const PlacedTrack& of_i, const PlacedTrack& of_j,
                                                            std::size_t i, std::size_t j,
                                                            const TimeSigmas& times) const {
  std::vector<Moment> out;
  const bool is_i_less_often = of_i.size() <= of_j.size();
  const PlacedTrack &at_samples = is_i_less_often ? of_i : of_j, &between = is_i_less_often ? of_j : of_i;
  if (at_samples.size() < pair_sampling.least_samples) return out;
  out.reserve(at_samples.size());
  const double time_variance_s2 = times[i] * times[i] + times[j] * times[j];
  const double focal_px = focal_px_[is_i_less_often ? j : i];
  std::size_t next = 1;
  for (const Placed& a : at_samples) {
    while (next + 1 < between.size() && between[next].t_s < a.t_s) ++next;
    const Placed &before = between[next - 1], &after = between[next];
    const double gap_s = after.t_s - before.t_s;
    // Between triggered cameras nothing is interpolated, however far apart their samples are.
    constexpr double same_time_s = object_tracking::sighting_tuning.same_time_s;
    Placed b = std::abs(a.t_s - before.t_s) < same_time_s ? before : after;
    double interpolated_px = 0;
    if (std::abs(a.t_s - b.t_s) >= same_time_s) {
      if (!(gap_s > 0 && gap_s < pair_sampling.longest_gap_s) || a.t_s < before.t_s || a.t_s > after.t_s) continue;
      const double share = (a.t_s - before.t_s) / gap_s;
      b.direction = (before.direction + share * (after.direction - before.direction)).normalized();
      b.radius_px = before.radius_px + share * (after.radius_px - before.radius_px);
      b.sigma_px = std::max(before.sigma_px, after.sigma_px);
      b.px_per_s = before.px_per_s + share * (after.px_per_s - before.px_per_s);
      // maths: largest distance of a parabola from its chord
      interpolated_px = focal_px * pair_noise.acceleration_rad_s2 * gap_s * gap_s / 8;
    }
    const double px_per_s = std::max(a.px_per_s, b.px_per_s);
    const double elsewhere_px2 = pair_noise.rig_px * pair_noise.rig_px + interpolated_px * interpolated_px +
                                 time_variance_s2 * px_per_s * px_per_s / 2;
    const Placed &in_i = is_i_less_often ? a : b, &in_j = is_i_less_often ? b : a;
    out.push_back(
        {in_i.direction, in_j.direction, in_i.radius_px, in_j.radius_px, in_i.sigma_px, in_j.sigma_px, elsewhere_px2});
  }
  return out;
}

std::optional<PairComparison::Passing> PairComparison::passing(const Moment& moment, const Placement& placement) {
  const Eigen::Vector3d& base = placement.j_from_i_m;
  const Eigen::Vector3d &di = moment.of_i, &dj = moment.of_j;
  const auto nearest = calib::closest_approach(base, di, dj, parallel);
  if (!nearest) return std::nullopt;
  const double along_i = nearest->along_0, along_j = nearest->along_1;
  // Metres per pixel where the rays pass each other.
  const double scale_i = std::abs(along_i) / placement.focal_i_px, scale_j = std::abs(along_j) / placement.focal_j_px;
  const double scale2 = scale_i * scale_i + scale_j * scale_j;
  const double by_i_m = scale_i * moment.sigma_i_px, by_j_m = scale_j * moment.sigma_j_px;
  Passing out{.off_px = object_tracking::sighting_tuning.behind_px,
              .expected_px = std::sqrt(moment.elsewhere_px2 + (by_i_m * by_i_m + by_j_m * by_j_m) / scale2),
              .radius_m = 0,
              .slope_of_i_px = Eigen::Vector3d::Zero()};
  if (along_i <= 0 || along_j <= 0) return out;
  // The distance of the rays is det(base, di, dj) / |di x dj|. Its derivative neglects the motion of the nearest
  // points, which is of second order where the rays agree.
  const double per_px = 1 / std::sqrt(nearest->sin2 * scale2);
  const Eigen::Vector3d across = dj.cross(base);
  out.off_px = di.dot(across) * per_px;
  out.slope_of_i_px = di.cross(across) * per_px;
  out.radius_m = std::sqrt(moment.radius_i_px * scale_i * moment.radius_j_px * scale_j);
  return out;
}

std::vector<PairComparison::WithOther> PairComparison::moments_of(const std::vector<Track>& tracks, std::size_t camera,
                                                                  const TimeSigmas& times) const {
  const std::vector<PlacedTrack> as_is = all_placed(tracks, {});
  std::vector<WithOther> out;
  const Eigen::Matrix3d cam_from_world = rig_.cameras[camera].cam_from_world.rotation.toRotationMatrix();
  for (std::size_t other = 0; other < tracks.size(); ++other) {
    if (other == camera) continue;
    auto both = moments(as_is[camera], as_is[other], camera, other, times);
    if (both.size() < pair_sampling.least_samples) continue;
    for (Moment& moment : both) {
      moment.of_i = cam_from_world * moment.of_i;
      moment.of_j = cam_from_world * moment.of_j;
    }
    const Eigen::Vector3d base = cam_from_world * (centres_[other] - centres_[camera]);
    out.push_back({{base, focal_px_[camera], focal_px_[other]}, std::move(both)});
  }
  return out;
}

void PairComparison::add(Agreement& agreement, const PairResiduals& pair) {
  if (pair.off_px.size() < pair_sampling.least_samples) return;
  const double usual = pair.usual();
  if (usual > agreement.worst) agreement.worst_px = pair.usual_px();
  agreement.worst = std::max(agreement.worst, usual);
  double sum = 0;
  for (std::size_t k = 0; k < pair.off_px.size(); ++k) {
    const double in_sigmas = std::min(pair_noise.max_sigmas, std::abs(pair.off_px[k]) / pair.expected[k]);
    sum += in_sigmas * in_sigmas;
  }
  const double mean = sum / double(pair.off_px.size());
  agreement.score += (mean - agreement.score) / double(++agreement.pairs);
}

template <typename Use>
PairComparison::Agreement PairComparison::agreement_over(const std::vector<Track>& tracks, const FaultHypothesis& with,
                                                         const TimeSigmas& times, Use use) const {
  Agreement out;
  const std::vector<PlacedTrack> seen = all_placed(tracks, with);
  for (std::size_t j = 1; j < tracks.size(); ++j)
    for (std::size_t i = 0; i < j; ++i)
      if (use(i, j)) add(out, residuals(seen[i], seen[j], i, j, with, times));
  return out;
}

PairComparison::Agreement PairComparison::agreement(const std::vector<Track>& tracks, const FaultHypothesis& with,
                                                    const TimeSigmas& times) const {
  return agreement_over(tracks, with, times, [](std::size_t, std::size_t) { return true; });
}

PairComparison::Agreement PairComparison::agreement_of(const std::vector<Track>& tracks, std::size_t camera,
                                                       bool with_it, const FaultHypothesis& with,
                                                       const TimeSigmas& times) const {
  return agreement_over(tracks, with, times,
                        [&](std::size_t i, std::size_t j) { return (i == camera || j == camera) == with_it; });
}

namespace {

// Minimum of the cost on a grid that is refined twice.
template <typename Cost>
double least_costly_lateness(Cost cost_of) {
  constexpr double first_s = object_tracking::time_prior.unknown_sigma_s;
  constexpr double fine_s = first_s / 5, finest_s = fine_s / 4;  // maths: nested grids
  double best_s = 0, best = std::numeric_limits<double>::infinity();
  const auto consider = [&](double late_s) {
    if (const double cost = cost_of(late_s); cost < best) best = cost, best_s = late_s;
  };
  for (int k = 0; k <= int(lateness_search.max_s / first_s); ++k) consider(k * first_s), consider(-k * first_s);
  for (const double step_s : {fine_s, finest_s}) {
    const double about_s = best_s;
    for (int k = -4; k <= 4; ++k) consider(about_s + k * step_s);
  }
  return best_s;
}

}  // namespace

double best_lateness(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                     const TimeSigmas& times) {
  FaultHypothesis with{.late_s = std::vector(tracks.size(), 0.0)};
  return least_costly_lateness([&](double late_s) {
    with.late_s[camera] = late_s;
    const auto agreement = comparison.agreement_of(tracks, camera, true, with, times);
    return agreement.pairs > 0 ? agreement.score : std::numeric_limits<double>::infinity();
  });
}

std::vector<double> best_latenesses(const PairComparison& comparison, const std::vector<Track>& tracks,
                                    const TimeSigmas& times, FaultHypothesis with) {
  with.late_s.assign(tracks.size(), 0.0);
  for (std::size_t c = 1; c < tracks.size(); ++c) {
    double& of_real = with.late_s[with.really.empty() ? c : with.really[c]];
    of_real = least_costly_lateness([&](double late_s) {
      of_real = late_s;
      PairComparison::Agreement with_earlier;
      for (std::size_t earlier = c - std::min(c, lateness_search.most_compared); earlier < c; ++earlier)
        PairComparison::add(with_earlier, comparison.residuals(tracks, earlier, c, with, times));
      return with_earlier.pairs > 0 ? with_earlier.score : std::numeric_limits<double>::infinity();
    });
  }
  return std::move(with.late_s);
}

}  // namespace huetrack::view_watch
