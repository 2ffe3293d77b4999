#include "calib/wave/wave.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <stdexcept>

#include "calib/model/closest_approach.h"
#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/model/usual_lens.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/wave/scale.h"
#include "calib/wave/shape_errors.h"
#include "calib/wave/similarity.h"
#include "calib/wave/wave_solution.h"

namespace huetrack::wave {
namespace {

using calib::index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// throws CalibrationError: names the cameras that are not connected, and the pair that lacks least.
void require_connected(const calib::CameraRig& rig, const std::vector<WavePair>& pairs) {
  std::vector<std::size_t> group(rig.cameras.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  for (const WavePair& p : pairs) {
    if (p.shared < least_shared) continue;
    const std::size_t from = std::max(group[index(p.a)], group[index(p.b)]),
                      to = std::min(group[index(p.a)], group[index(p.b)]);
    std::ranges::replace(group, from, to);
  }
  if (std::ranges::all_of(group, [](std::size_t g) { return g == 0; })) return;
  std::vector<std::string_view> alone;
  std::string most;
  int shared = -1;
  for (std::size_t c = 0; c < group.size(); ++c) {
    if (group[c] != 0) alone.emplace_back(rig.cameras[c].name);
  }
  for (const WavePair& p : pairs) {
    if ((group[index(p.a)] == 0) == (group[index(p.b)] == 0) || p.shared <= shared) continue;
    shared = p.shared;
    most = rig.cameras[index(p.a)].name + " and " + rig.cameras[index(p.b)].name;
  }
  throw solver::CalibrationError(
      fmt::format("the cameras are not connected: {} and the others hardly saw the ball at the same time; {} share {} "
                  "frames, {} are needed",
                  fmt::to_string(fmt::join(alone, ", ")), most, shared, least_shared),
      solver::Fault::unconnected_cameras);
}

std::vector<WavePair> pairs_of(const calib::CameraRig& rig, const BallTracks& tracks) {
  std::vector<WavePair> pairs;
  for (std::size_t a = 0; a < rig.cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < rig.cameras.size(); ++b)
      pairs.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(tracks.shared(a, b).size())});
  }
  return pairs;
}

// Counts sightings, and removes static clutter. throws CalibrationError: a camera saw too little.
void count_sightings(WaveResult& result, std::vector<BallFrame>& frames) {
  const std::size_t n = result.cameras.size();
  std::vector<int> seen_anything(n, 0);
  for (const BallFrame& f : frames) {
    ++result.cameras[index(f.camera)].frames;
    seen_anything[index(f.camera)] += f.regions.empty() ? 0 : 1;
  }
  const std::vector<int> still = remove_still_regions(frames, n);
  for (const BallFrame& f : frames) result.cameras[index(f.camera)].seen += f.regions.empty() ? 0 : 1;
  for (std::size_t c = 0; c < n; ++c) {
    WaveCamera& camera = result.cameras[c];
    camera.has_static_clutter = still[c] > 0;
    const std::string& name = result.rig.cameras[c].name;
    if (camera.frames == 0) throw solver::CalibrationError(name + " gave no frame");
    if (seen_anything[c] == 0) {
      throw solver::CalibrationError(name + " never saw the target: none of its " + std::to_string(camera.frames) +
                                         " frames has a region of the colour",
                                     solver::Fault::target_unseen);
    }
    if (camera.seen < least_shared) {
      throw solver::CalibrationError(
          name + (camera.has_static_clutter ? " saw the target's colour only where it never moves: too little motion, "
                                              "or something else of that colour"
                                            : " saw the target in only " + std::to_string(camera.seen) + " frames, " +
                                                  std::to_string(least_shared) + " are needed"),
          solver::Fault::too_little_motion);
    }
  }
}

struct Found {
  std::unique_ptr<WaveSolution> solution;
  bool rejected_rig_poses = false;  // see WaveResult
};

// The solution with the least misfit, of those that are possible if there are any.
class BestSolution {
 public:
  // Of solve(), which may throw CalibrationError.
  template <typename Solve>
  void consider(Solve solve) {
    try {
      std::unique_ptr<WaveSolution> solution = solve();
      const auto rank = [](const WaveSolution& s) { return std::pair(!s.is_possible(), s.misfit()); };
      if (!best_ || rank(*solution) < rank(*best_)) best_ = std::move(solution);
    } catch (const solver::CalibrationError& error) {
      if (!refused_) refused_ = error;
    }
  }
  bool fits() const {
    constexpr double most_agree = 0.7;  // share of the frames, from a start that was good enough
    return best_ && best_->used_share() >= most_agree;
  }
  const std::unique_ptr<WaveSolution>& found() const { return best_; }
  // throws CalibrationError, the first one: there is none
  std::unique_ptr<WaveSolution> take() {
    if (!best_) throw solver::CalibrationError(*refused_);
    return std::move(best_);
  }

 private:
  std::unique_ptr<WaveSolution> best_;
  std::optional<solver::CalibrationError> refused_;
};

// A given lens is right, or wrong and would pull everything else along: the better solution of both. throws
// CalibrationError
BestSolution solved(const WaveSolution& unsolved, const WaveStart& start, bool any_scale, const WaveOptions& options) {
  BestSolution best;
  for (const bool lenses_first : {false, true}) {
    if (lenses_first && (options.hold_poses || options.guessed_lenses)) break;
    best.consider([&] {
      auto solution = std::make_unique<WaveSolution>(unsolved);
      solution->solve(start, any_scale, lenses_first);
      if (!options.hold_poses) require_connected(solution->rig(), pairs_of(solution->rig(), solution->tracks()));
      return solution;
    });
  }
  return best;
}

WaveStart start_of(const calib::CameraRig& rig) {
  WaveStart start;
  for (const calib::Camera& camera : rig.cameras) start.cam_from_world.push_back(camera.cam_from_world);
  return start;
}

// Without poses. With guessed lenses, other focal lengths are tried until most of the frames agree. throws
// CalibrationError
std::unique_ptr<WaveSolution> from_nothing(calib::CameraRig rig, const std::vector<BallFrame>& frames,
                                           const WaveOptions& options) {
  BestSolution best;
  for (const int sigmas : {0, -2, 2, -4, 4}) {  // an adjustment corrects two: from 60 degrees 87, 39, 115 and 24
    calib::CameraRig tried = rig;
    LensChange change = LensChange::Zero();
    change[0] = sigmas * calib::usual_lens.log_focal;
    for (calib::Camera& camera : tried.cameras) camera.model = changed(camera.model, change);
    best.consider([&] {
      const WaveSolution unsolved(tried, frames, options);
      return solved(unsolved, start_from_nothing(tried, unsolved.tracks()), true, options).take();
    });
    if (!options.guessed_lenses || best.fits()) break;
  }
  return best.take();
}

// From the rig's poses; from nothing where there are none, or where they do not fit. throws CalibrationError
Found with_free_poses(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, const WaveOptions& options) {
  if (!options.has_poses) return {from_nothing(rig, frames, options), false};
  BestSolution best = solved(WaveSolution(rig, frames, options), start_of(rig), false, options);
  if (best.fits()) return {best.take(), false};
  const WaveSolution* const of_rig = best.found().get();
  best.consider([&] { return from_nothing(rig, frames, options); });
  const bool is_of_rig = of_rig != nullptr && best.found().get() == of_rig;
  return {best.take(), !is_of_rig};
}

// Likelihood ratio of other poses and lenses to these. Clutter, and a ball that a hand hides, agree with none.
bool other_poses_fit_better(const calib::CameraRig& rig, const std::vector<BallFrame>& frames,
                            const WaveOptions& options, const WaveSolution& held) {
  WaveOptions with_free = options;
  with_free.hold_poses = false;
  try {
    const Found other = with_free_poses(rig, frames, with_free);
    constexpr double sure_sigmas = 4;  // of a chi-square distribution, about normal
    const auto n = static_cast<double>(rig.cameras.size());
    const double freedom = 6 * (n - 1) + lens_freedom * n;
    const double most = (freedom + sure_sigmas * std::sqrt(2 * freedom)) / 2;
    return held.misfit() - other.solution->misfit() > OutlineCorrelation{}.frames_as_one(held.step_s()) * most;
  } catch (const solver::CalibrationError&) {
    return true;  // no poses explain the views: the held ones, which most frames contradict, are not accepted
  }
}

// throws CalibrationError
Found find_solution(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, const WaveOptions& options) {
  const WaveSolution unsolved(rig, frames, options);
  require_connected(rig, pairs_of(rig, unsolved.tracks()));
  if (!options.hold_poses) return with_free_poses(rig, frames, options);
  BestSolution best = solved(unsolved, start_of(rig), false, options);
  const bool fits = best.fits();
  Found found{best.take(), false};
  if (fits || !other_poses_fit_better(rig, frames, options, *found.solution)) return found;
  throw solver::CalibrationError(
      fmt::format("only {:.0f} % of the frames with the target's colour agree with the poses that the rig has: {}they "
                  "are not right, or the cameras' names are swapped",
                  1e2 * found.solution->used_share(),
                  found.solution->is_held() ? "a hand hides too much of the ball (wave it on a thin stick, or throw "
                                              "it), "
                                            : ""),
      solver::Fault::wrong_poses);
}

// Sets how the lens that was found differs from the given one.
void compare_lens(WaveCamera& camera, const calib::Camera& given, const calib::CameraModel& found) {
  constexpr int columns = 8, rows = 6;
  camera.longer = found.fx() / given.model.fx() - 1;
  double sum = 0;
  int count = 0;
  for (int i = 0; i < columns * rows; ++i) {
    const int column = i % columns, row = i / columns;
    const Vector2d share((column + 0.5) / columns, (row + 0.5) / rows);
    const Vector2d px = share.cwiseProduct(Vector2d(given.image_size.width, given.image_size.height));
    const auto ray = given.model.ray({px});
    const auto there = ray ? found.project(*ray) : std::nullopt;
    if (there) sum += (there->px - px).squaredNorm(), ++count;
  }
  camera.lens_px = std::sqrt(sum / std::max(1, count));
}

// Sets poses, residuals and coverage.
void set_fit(WaveResult& result, const WaveSolution& wave, const std::vector<BallObservation>& observations) {
  const std::size_t n = result.cameras.size();
  for (std::size_t c = 0; c < n; ++c) {
    result.rig.cameras[c].cam_from_world = wave.state().cam_from_world[c];
    compare_lens(result.cameras[c], result.rig.cameras[c], wave.lens(c));
    result.rig.cameras[c].model = wave.lens(c);
  }
  result.size_ratio = wave.size_ratio();
  result.jerk_m_s3 = wave.jerk_m_s3();
  result.duration_s = wave.to_s() - wave.from_s();
  constexpr int columns = 8, rows = 6;
  double sum = 0;
  std::vector<double> sums(n, 0);
  std::vector<std::set<int>> cells(n);
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const std::size_t c = index(observations[i].camera);
    sums[c] += wave.fit().residuals[i].squaredNorm();
    sum += wave.fit().residuals[i].squaredNorm();
    ++result.cameras[c].used;
    const calib::ImageSize size = result.rig.cameras[c].image_size;
    const Vector2d& px = observations[i].px;
    cells[c].insert(static_cast<int>(columns * (px.x() + 0.5) / size.width) +
                    columns * static_cast<int>(rows * (px.y() + 0.5) / size.height));
  }
  result.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, observations.size())));
  for (std::size_t c = 0; c < n; ++c) {
    result.cameras[c].partly_seen = wave.partly_seen(c);
    result.cameras[c].rms_px = std::sqrt(sums[c] / std::max(1, result.cameras[c].used));
    result.cameras[c].coverage = static_cast<double>(cells[c].size()) / (columns * rows);
  }
}

// Sets path_min, path_max, extent_m and camera_distance_m.
void measure_path(WaveResult& result, const WaveSolution& wave, const std::vector<BallObservation>& observations) {
  const BallPath& path = wave.state().path;
  Vector3d mean = Vector3d::Zero();
  Matrix3d scatter = Matrix3d::Zero();
  const auto count = static_cast<double>(observations.size());
  const auto place = [&](const BallObservation& o) {
    return path.at(wave.state().exposed_s(result.rig, o.camera, o.t_s, o.px));
  };
  for (const BallObservation& o : observations) mean += place(o) / count;
  if (!observations.empty()) result.path_min = result.path_max = place(observations.front());
  for (const BallObservation& o : observations) {
    result.path_min = result.path_min.cwiseMin(place(o)), result.path_max = result.path_max.cwiseMax(place(o));
    const Vector3d d = place(o) - mean;
    scatter += d * d.transpose() / count;
  }
  const Vector3d variance = Eigen::SelfAdjointEigenSolver<Matrix3d>(scatter).eigenvalues();
  for (int i = 0; i < 3; ++i)
    result.extent_m[i] = std::sqrt(12 * std::max(0.0, variance[2 - i]));  // length of a uniform distribution
  const std::size_t n = result.cameras.size();
  result.camera_distance_m = 0;
  for (std::size_t c = 0; c < n; ++c)
    result.camera_distance_m += (wave.centre(static_cast<int>(c)) - mean).norm() / static_cast<double>(n);
}

// Poses, path and latencies absorb a part of a camera's time errors; residuals show the rest. Measures that rest: its
// frames are shifted by +-2 ms, at random from second to second, and the adjustment is repeated.
double residual_share(const WaveSolution& wave, const std::vector<BallFrame>& frames, int camera,
                      const TimingDiagnostics& timing) {
  constexpr double by_s = 2e-3, least_share = 0.1;
  std::mt19937_64 random(1);
  std::map<int, double> late_s;
  std::vector<BallFrame> moved = frames;
  for (BallFrame& f : moved) {
    if (f.camera != camera) continue;
    const auto [second, is_new] = late_s.try_emplace(static_cast<int>(std::floor(f.t_s)), by_s);
    if (is_new && random() % 2 == 0) second->second = -by_s;
    f.t_s += second->second;
  }
  WaveSolution trial = wave;
  trial.retime(moved);
  trial.settle();
  const TimingDiagnostics shown = trial.timing()[index(camera)];
  double along = 0, put = 0;
  for (const auto& [second, lag_s] : shown.lag_s) {
    const auto before = timing.lag_s.find(second);
    const auto by = late_s.find(second);
    if (before == timing.lag_s.end() || by == late_s.end()) continue;
    along += (lag_s - before->second) * by->second, put += by->second * by->second;
  }
  return put > 0 ? std::clamp(std::abs(along / put), least_share, 1.0) : 1.0;
}

// Timing errors beyond the model; they widen the covariance.
void set_timing_diagnostics(WaveResult& result, WaveSolution& wave, const std::vector<BallFrame>& frames) {
  std::vector<TimingDiagnostics> timing = wave.timing();
  constexpr double sure_sigmas = 2;  // experiment: noise alone makes 0.5 to 1.3
  for (std::size_t c = 0; c < timing.size(); ++c)
    if (timing[c].wander_s > 0 && timing[c].wander_sigmas > sure_sigmas)
      timing[c].wander_s /= residual_share(wave, frames, static_cast<int>(c), timing[c]);
  std::vector<double> wander_s;
  for (std::size_t c = 0; c < timing.size(); ++c) {
    WaveCamera& camera = result.cameras[c];
    camera.frame_s = wave.frame_s(c);
    camera.wander_s = timing[c].wander_s;
    camera.wander_sigmas = timing[c].wander_sigmas;
    camera.scatter_s = timing[c].scatter_s;
    camera.repeated = timing[c].repeated;
    wander_s.push_back(timing[c].wander_s);
  }
  wave.set_wander(std::move(wander_s));
}

// throws CalibrationError: the path does not determine the poses.
void require_motion(const WaveResult& result) {
  if (result.extent_m[0] < WaveResult::least_length * result.camera_distance_m) {
    throw solver::CalibrationError(
        fmt::format("too little motion: the ball moved within {:.0f} cm, at {:.1f} m from the cameras",
                    1e2 * result.extent_m[0], result.camera_distance_m),
        solver::Fault::too_little_motion);
  }
  if (result.extent_m[1] < WaveResult::least_extent * result.camera_distance_m) {
    throw solver::CalibrationError(
        fmt::format("the ball moved along one line ({:.2f} m long, {:.0f} mm wide), which leaves the cameras free to "
                    "turn around it",
                    result.extent_m[0], 1e3 * result.extent_m[1]),
        solver::Fault::too_little_motion);
  }
  if (result.is_in_a_plane() && !result.had_poses) throw solver::CalibrationError({motion_in_a_plane(result.extent_m)});
}

// Difference of the poses estimated from each half of the recording, and its covariance.
struct Halves {
  Eigen::VectorXd difference;  // as WaveFit::covariance
  Eigen::MatrixXd covariance;
};

// b less a, as WaveFit::covariance.
Eigen::VectorXd difference_of(const WaveState& a, const WaveState& b) {
  const auto n = static_cast<Eigen::Index>(a.cam_from_world.size());
  Eigen::VectorXd difference((6 + lens_freedom) * n);
  for (Eigen::Index c = 0; c < n; ++c) {
    const calib::Rigid3d &of_a = a.cam_from_world[static_cast<std::size_t>(c)],
                         &of_b = b.cam_from_world[static_cast<std::size_t>(c)];
    const Eigen::AngleAxisd turn(of_a.rotation.conjugate() * of_b.rotation);
    difference.segment<3>(6 * c) = calib::inverse(of_b).translation - calib::inverse(of_a).translation;
    difference.segment<3>(6 * c + 3) = turn.angle() * turn.axis();
    difference.segment<lens_freedom>(6 * n + lens_freedom * c) =
        b.lenses[static_cast<std::size_t>(c)] - a.lenses[static_cast<std::size_t>(c)];
  }
  return difference;
}

Halves compare_halves(const WaveSolution& whole, std::size_t cameras, const solver::Progress& progress) {
  const auto n = static_cast<Eigen::Index>(cameras);
  const Eigen::Index size = (6 + lens_freedom) * n;
  std::array<WaveState, 2> states{whole.state(), whole.state()};
  Halves halves{Eigen::VectorXd(size), Eigen::MatrixXd::Zero(size, size)};
  for (const int half : {0, 1}) {
    if (progress) progress("one half of it", WaveSteps::halves + half, WaveSteps::all);
    WaveSolution part = whole;
    part.keep_half(half);
    part.settle();
    states[index(half)] = part.state();
    halves.covariance += part.fit().covariance;
  }
  halves.difference = difference_of(states[0], states[1]);
  return halves;
}

// What another start changes.
struct OtherStart {
  Eigen::VectorXd difference;     // as WaveFit::covariance
  std::vector<CameraTime> times;  // differences
};

// Of a start that is a little wrong. Where a hand hides the ball, the start decides which regions are associated with
// it. throws CalibrationError: nothing is found from there
OtherStart compare_starts(const WaveSolution& whole) {
  constexpr double turned_rad = 0.035, aside_m = 0.05;
  WaveStart start{whole.state().cam_from_world};
  for (std::size_t c = 0; c < start.cam_from_world.size(); ++c) {
    const Vector3d axis = Vector3d::Unit(static_cast<Eigen::Index>(c % 2));  // the image's
    const calib::Rigid3d wrong{Eigen::Quaterniond(Eigen::AngleAxisd(turned_rad, axis)), aside_m * axis};
    start.cam_from_world[c] = wrong * start.cam_from_world[c];
  }
  WaveSolution other = whole;
  other.silence();
  try {
    other.solve(start, false, false);
  } catch (const solver::CalibrationError&) {
    throw solver::CalibrationError(
        fmt::format("the camera poses are not determined: from a start that is {:.0f} cm and {:.0f} degrees aside "
                    "nothing is found, as a hand hides too much of the ball",
                    1e2 * aside_m, turned_rad * 180 / std::numbers::pi),
        solver::Fault::hidden_ball);
  }
  const auto size_of = [](const WaveSolution& s) {
    double sum = 0;
    for (std::size_t c = 1; c < s.rig().cameras.size(); ++c)
      sum += (s.centre(static_cast<int>(c)) - s.centre(0)).norm();
    return sum;
  };
  Similarity{.scale = size_of(whole) / size_of(other)}.apply(other.state());
  // Both in one world: differences are propagated linearly, which removes only small motions of the whole.
  const calib::Rigid3d motion =
      calib::inverse(other.state().cam_from_world.front()) * whole.state().cam_from_world.front();
  for (calib::Rigid3d& pose : other.state().cam_from_world) pose = pose * motion;
  OtherStart out{.difference = difference_of(whole.state(), other.state()), .times = other.state().times};
  for (std::size_t c = 0; c < out.times.size(); ++c) {
    out.times[c].latency_s -= whole.state().times[c].latency_s;
    out.times[c].readout_s -= whole.state().times[c].readout_s;
  }
  return out;
}

struct PlacesErrors {
  ShapeErrors along_path;
  std::optional<ShapeErrors> in_volume;  // nullopt: no volume was given

  bool has_volume() const { return in_volume && in_volume->places > 0; }
};

// widen: factor on standard deviations. by_start: see OtherStart.
void set_timing(WaveResult& result, const WaveSolution& wave, double widen, const std::vector<CameraTime>& by_start) {
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const CameraTime& time = wave.state().times[c];
    const auto at = 2 * static_cast<Eigen::Index>(c);
    const CameraTime& off = by_start[c];
    const auto sigma = [&](Eigen::Index i, double least, double by_start_s) {
      const double variance = wave.fit().time_covariance(i, i);
      return variance > 0 ? std::hypot(widen * std::sqrt(variance), least, by_start_s) : 0;
    };
    // Flicker and uneven light move the effective moment of an exposure off its middle. For the readout that counts
    // three times: the ball's rows have an rms of a third of the image.
    constexpr double moment_s = 3e-4, over_rows_s = 3 * moment_s;
    result.rig.cameras[c].timing = {time.latency_s, sigma(at, moment_s, off.latency_s), time.readout_s,
                                    sigma(at + 1, over_rows_s, off.readout_s)};
  }
}

// Sets the uncertainty of positions and poses, without the scale's. Returns the poses' covariance (see WaveFit).
Eigen::MatrixXd set_uncertainties(WaveResult& result, const WaveSolution& wave, const calib::CameraRig& start,
                                  const PlacesErrors& errors, const solver::Progress& progress) {
  const std::size_t n = result.cameras.size();
  const Halves halves = compare_halves(wave, n, progress);
  result.halves_m = errors.along_path.rms(halves.difference * halves.difference.transpose());
  result.halves_sigma_m = errors.along_path.rms(halves.covariance);
  // Inflation where they differ by more than their covariance predicts.
  const double widen = result.halves_sigma_m > 0 ? std::max(1.0, result.halves_m / result.halves_sigma_m) : 1;
  const double sigma_m = errors.along_path.rms(wave.fit().covariance);
  OtherStart other{.difference = {}, .times = std::vector<CameraTime>(n)};
  double widen_poses = widen;
  if (wave.is_held() && sigma_m > 0) {
    other = compare_starts(wave);
    widen_poses = std::max(widen, errors.along_path.rms(other.difference * other.difference.transpose()) / sigma_m);
  }
  set_timing(result, wave, widen, other.times);
  const Eigen::MatrixXd covariance = widen_poses * widen_poses * wave.fit().covariance;
  for (std::size_t c = 0; c < n; ++c) {
    WaveCamera& camera = result.cameras[c];
    const Eigen::MatrixXd by_poses = (errors.has_volume() ? *errors.in_volume : errors.along_path)
                                         .of_camera(static_cast<Eigen::Index>(c), wave.centre(static_cast<int>(c)));
    const Eigen::VectorXd own_variance = (by_poses * covariance * by_poses.transpose()).diagonal().cwiseMax(0);
    camera.centre_sigma_m = own_variance.head<3>().cwiseSqrt();
    camera.rotation_sigma_rad = own_variance.tail<3>().cwiseSqrt();
    const auto focal = static_cast<Eigen::Index>(6 * n + lens_freedom * c);
    camera.longer_sigma = std::sqrt(std::max(0.0, covariance(focal, focal)));
    if (!result.had_poses) continue;
    camera.moved_m = (result.rig.cameras[c].centre() - start.cameras[c].centre()).norm();
    camera.turned_rad =
        result.rig.cameras[c].cam_from_world.rotation.angularDistance(start.cameras[c].cam_from_world.rotation);
  }
  result.expected_m = errors.along_path.rms(covariance);
  if (errors.has_volume()) result.expected_in_volume_m = errors.in_volume->rms(covariance);
  return covariance;
}

// throws CalibrationError: a camera is hardly ever consistent with the others.
void require_agreement(const WaveResult& result) {
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const WaveCamera& camera = result.cameras[c];
    if (camera.used >= least_shared) continue;
    throw solver::CalibrationError(
        fmt::format("{}: only {} of its {} frames with the target's colour agree with the other cameras; {} are needed",
                    result.rig.cameras[c].name, camera.used, camera.seen, least_shared));
  }
}

}  // namespace

std::vector<std::string> WaveOptions::problems(const calib::CameraRig& rig) const {
  std::vector<std::string> out;
  constexpr int furthest_m = 200;  // more is in centimetres, by mistake
  const auto is_camera = [&](int c) { return c >= 0 && index(c) < rig.cameras.size(); };
  if (!(radius_m > 0)) out.emplace_back("radius_m must be > 0");
  if (!(pixel_noise_px > 0)) out.emplace_back("pixel_noise_px must be > 0");
  if (rig.cameras.size() < 2) out.emplace_back("two or more cameras are needed");
  if (camera_distance) {
    if (!is_camera(camera_distance->a) || !is_camera(camera_distance->b) || camera_distance->a == camera_distance->b)
      out.emplace_back("camera_distance must name two different cameras of the rig");
    if (!(camera_distance->metres > 0 && camera_distance->metres <= furthest_m))
      out.push_back(fmt::format("camera_distance must be > 0 and at most {} metres", furthest_m));
  }
  if (rest_distance_m && !(*rest_distance_m > 0)) out.emplace_back("rest_distance_m must be > 0");
  if (hold_poses && (!has_poses || camera_distance || rest_distance_m || !marks.empty()))
    out.emplace_back("poses that are held have their scale: has_poses, and nothing else that sets it");
  if (g_m_s2 && !(*g_m_s2 > 0)) out.emplace_back("g_m_s2 must be > 0");
  if (latitude_deg && !(std::abs(*latitude_deg) <= 90)) out.emplace_back("latitude_deg must be -90 to 90");
  if (ball_kg && !(*ball_kg > 0)) out.emplace_back("ball_kg must be > 0");
  if (marks.size() == 1) out.emplace_back("one marked point sets no scale: give two, or three for the world's frame");
  return out;
}

solver::Reason motion_in_a_plane(const Eigen::Vector3d& extent_m) {
  return {fmt::format("the ball moved in one plane ({:.2f} x {:.2f} m, {:.0f} mm thick)", extent_m[0], extent_m[1],
                      1e3 * extent_m[2]),
          solver::Fault::motion_in_a_plane};
}

namespace {

bool is_far_from_one(double ratio) {
  constexpr double far = 1.3;  // beyond the effects of colour thresholds and pose errors
  return ratio > far || ratio < 1 / far;
}

// Median radius of what has the ball's colour, triangulated with the rig's poses; nullopt: rays hardly ever meet, or
// some of it has the given radius, and the rest may be something else. Frames by time.
std::optional<double> radius_by_rays(const calib::CameraRig& rig, const std::vector<BallFrame>& frames,
                                     double given_m) {
  // For poses with errors of some centimetres, and the ball's motion between unsynchronised frames.
  constexpr double furthest_apart_s = 0.05;
  constexpr double furthest_apart = 0.1;  // over the distance
  constexpr std::size_t least_meetings = 20;
  std::vector<std::optional<std::size_t>> latest(rig.cameras.size());  // frame with a region
  std::vector<double> radii_m;
  const auto ray_of = [&](const BallFrame& f) -> std::optional<Vector3d> {
    const calib::Camera& camera = rig.cameras[index(f.camera)];
    const auto ray = camera.model.ray({f.regions.front().centre});
    if (!ray) return std::nullopt;
    return camera.cam_from_world.rotation.conjugate() * ray->normalized();
  };
  const auto radius_px = [](const BallFrame& f) {
    return 2 * std::pow(f.regions.front().spread.determinant(), 0.25);  // of a disc
  };
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const BallFrame& a = frames[k];
    if (a.regions.empty()) continue;
    latest[index(a.camera)] = k;
    for (const auto& other : latest) {
      if (!other || *other == k || a.t_s - frames[*other].t_s > furthest_apart_s) continue;
      const BallFrame& b = frames[*other];
      const auto da = ray_of(a), db = ray_of(b);
      if (!da || !db) continue;
      const calib::Camera &of_a = rig.cameras[index(a.camera)], &of_b = rig.cameras[index(b.camera)];
      const Vector3d base = of_b.centre() - of_a.centre();
      const auto nearest = calib::closest_approach(base, *da, *db, 1e-3);
      if (!nearest || nearest->along_0 <= 0 || nearest->along_1 <= 0) continue;
      const double along_a = nearest->along_0, along_b = nearest->along_1;
      const double gap_m = std::abs(base.dot(da->cross(*db))) / std::sqrt(nearest->sin2);
      if (gap_m > furthest_apart * std::min(along_a, along_b)) continue;
      radii_m.push_back(std::sqrt(radius_px(a) * along_a / of_a.model.fx() * radius_px(b) * along_b / of_b.model.fx()));
    }
  }
  if (radii_m.size() < least_meetings) return std::nullopt;
  constexpr double most_as_given = 0.1;  // share: skin or clutter of the colour may be in view longer than the ball
  const auto as_given = std::ranges::count_if(radii_m, [&](double r) { return !is_far_from_one(r / given_m); });
  if (static_cast<double>(as_given) > most_as_given * static_cast<double>(radii_m.size())) return std::nullopt;
  return calib::median(std::move(radii_m));
}

// A given radius or distance that contradicts the images: more likely the cause of a failure than the motion. Empty:
// none does. looks: apparent over given radius at the measured scale.
std::vector<solver::Reason> contradicting_sizes(const calib::CameraRig& rig, const std::vector<BallFrame>& frames,
                                                const WaveOptions& options, std::optional<double> looks) {
  std::vector<solver::Reason> found;
  if (options.has_poses) {
    if (options.camera_distance) {
      const auto [a, b, metres] = *options.camera_distance;
      const std::string &name_a = rig.cameras[index(a)].name, &name_b = rig.cameras[index(b)].name;
      const double of_rig = (rig.cameras[index(a)].centre() - rig.cameras[index(b)].centre()).norm();
      if (is_far_from_one(metres / of_rig))
        found.push_back({fmt::format("the distance between {} and {} was given as {:.3g} m, and is {:.3g} m by the rig",
                                     name_a, name_b, metres, of_rig),
                         solver::Fault::wrong_distance});
    }
    const auto radius_m = radius_by_rays(rig, frames, options.radius_m);
    if (radius_m && is_far_from_one(*radius_m / options.radius_m))
      found.push_back({fmt::format("{}by the rig the ball has a radius of about {:.0f} mm, and {:.3g} mm was given",
                                   found.empty() ? "" : "; and ", 1e3 * *radius_m, 1e3 * options.radius_m),
                       solver::Fault::wrong_radius});
  } else if (looks && !options.guessed_radius && is_far_from_one(*looks)) {
    found.push_back(
        {fmt::format("at the scale that was given the ball has a radius of {:.3g} mm, and {:.3g} mm was given",
                     1e3 * *looks * options.radius_m, 1e3 * options.radius_m),
         solver::Fault::wrong_scale});
  }
  return found;
}

// throws CalibrationError: what was found is not of the ball's size, and the given sizes are why
void require_size(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, const WaveOptions& options,
                  double looks) {
  if (options.guessed_radius || !is_far_from_one(looks)) return;
  std::vector<solver::Reason> why = contradicting_sizes(rig, frames, options, looks);
  if (why.empty()) return;
  if (!options.has_poses) throw solver::CalibrationError(std::move(why));
  throw solver::CalibrationError(
      fmt::format("in what was found the ball has a radius of {:.3g} mm", 1e3 * looks * options.radius_m));
}

// Scales the solution to metres. Returns the throws. Without a covariance of the fit poses and lenses count as exact.
std::optional<Throws> set_scale(WaveSolution& wave, const calib::CameraRig& rig, const WaveOptions& options) {
  std::optional<Throws> throws = find_throws(wave, options);
  const auto size = (6 + lens_freedom) * static_cast<Eigen::Index>(rig.cameras.size());
  const Eigen::MatrixXd covariance =
      wave.fit().covariance.size() > 0 ? wave.fit().covariance : Eigen::MatrixXd(Eigen::MatrixXd::Zero(size, size));
  Similarity{.scale = weigh_scale(wave, rig, options, throws, covariance).factor}.apply(wave.state());
  return throws;
}

// Sets scale, vertical, and what they add to the errors. covariance: without the scale's, see WaveFit.
void set_scale_errors(WaveResult& result, const WaveSolution& wave, const calib::CameraRig& rig,
                      const WaveOptions& options, const PlacesErrors& errors, const Eigen::MatrixXd& covariance) {
  const std::optional<Throws> throws = find_throws(wave, options);
  const WeighedScale weighed = weigh_scale(wave, rig, options, throws, covariance);
  result.scale = weighed.scale;
  const ShapeErrors& places = errors.has_volume() ? *errors.in_volume : errors.along_path;
  if (throws) result.vertical = vertical_of(*throws, places.alignment.bottomRows<3>(), covariance);
  const Eigen::MatrixXd in_metres = weighed.of_metres(covariance, wave.state());
  result.rig.uncertainty = places.uncertainty(result.rig, wave.state(), in_metres, weighed.own_sigma);
  result.expected_m = errors.along_path.rms(in_metres);
  result.by_scale_m = weighed.own_sigma * errors.along_path.reach_m;
  if (!errors.in_volume) return;
  if (errors.has_volume()) result.expected_in_volume_m = errors.in_volume->rms(in_metres);
  result.by_scale_in_volume_m = weighed.own_sigma * errors.in_volume->reach_m;
}

// looks: see contradicting_sizes(). frames: by time.
WaveResult calibrated(const calib::CameraRig& rig, std::vector<BallFrame>& frames, WaveOptions options,
                      std::optional<double>& looks) {
  WaveResult result;
  result.rig = rig;
  result.cameras.resize(rig.cameras.size());
  result.guessed_radius = options.guessed_radius;
  result.had_poses = options.has_poses;
  result.held_poses = options.hold_poses;
  result.guessed_lenses = options.guessed_lenses;
  count_sightings(result, frames);

  const Found found = find_solution(rig, frames, options);
  result.rejected_rig_poses = found.rejected_rig_poses;
  WaveSolution& wave = *found.solution;
  result.pairs = pairs_of(rig, wave.tracks());
  require_connected(rig, result.pairs);

  // The expected size and the smoothness depend on the scale: refined again.
  if (!options.hold_poses) set_scale(wave, rig, options);
  looks = wave.size_ratio();
  require_size(rig, frames, options, *looks);
  // Outlines of another size than expected count less. The solution refers to these options.
  if (options.guessed_radius) options.radius_m *= *looks;
  result.radius_m = options.radius_m;
  wave.refine(WaveSteps::refined_again);
  measure_path(result, wave, wave.observations());
  require_motion(result);
  if (!options.hold_poses) {
    wave.settle();
    set_world(result, wave, rig, options, set_scale(wave, rig, options));
  }

  if (options.progress) options.progress("the uncertainties", WaveSteps::settled, WaveSteps::all);
  set_timing_diagnostics(result, wave, frames);
  wave.settle();
  const std::vector<BallObservation> observations = wave.observations();
  set_fit(result, wave, observations);
  measure_path(result, wave, observations);

  PlacesErrors errors{
      shape_errors(result.rig, wave.state(), places_along(wave.state().path, wave.from_s(), wave.to_s())),
      std::nullopt};
  if (options.volume) errors.in_volume = shape_errors(result.rig, wave.state(), places_in(*options.volume));
  const Eigen::MatrixXd covariance = set_uncertainties(result, wave, rig, errors, options.progress);
  if (!options.hold_poses) set_scale_errors(result, wave, rig, options, errors, covariance);
  require_agreement(result);
  return result;
}

}  // namespace

WaveResult calibrate_wave(const calib::CameraRig& rig, std::vector<BallFrame> frames, const WaveOptions& options) {
  for (const auto& problem : options.problems(rig)) throw std::invalid_argument(problem);
  std::ranges::sort(frames, [](const BallFrame& a, const BallFrame& b) {
    return std::pair(a.t_s, a.camera) < std::pair(b.t_s, b.camera);
  });
  std::optional<double> looks;
  try {
    return calibrated(rig, frames, options, looks);
  } catch (const solver::CalibrationError& error) {
    if (error.fault() == solver::Fault::wrong_scale) throw;
    // A wrong size contracts path and cameras, and looks like a lack of motion.
    std::vector<solver::Reason> why = contradicting_sizes(rig, frames, options, looks);
    if (why.empty()) throw;
    std::ranges::move(solver::after(". As it was given, no rig was found: ", error.reasons()), std::back_inserter(why));
    throw solver::CalibrationError(std::move(why));
  }
}

}  // namespace huetrack::wave
