#include "calib/wave/wave_solution.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/model/usual_lens.h"
#include "calib/solver/bundle_adjustment.h"
#include "calib/wave/consistent_regions.h"
#include "calib/wave/similarity.h"

namespace huetrack::wave {
namespace {

using calib::index;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Scale of the robust loss, in standard deviations: finally, and for the first rough poses.
constexpr double robust_sigmas = 3, rough_robust_sigmas = 6;
// Association gates, in standard deviations: for the first poses, for better ones, finally.
constexpr double first_sigmas = 20, rough_sigmas = 8, final_sigmas = 4;

// Beyond it something hides a part, or adds to it. Experiment (EXPERIMENTS.md, "Waved by hand"): 2 to 4 % of the
// outlines of a free ball, 37 to 97 % of one in a hand.
constexpr double partly_misfit = 0.1;
constexpr double variance_of_radius2 = 4e-4;  // see WaveOptions::pixel_noise_px

// Log of the density of clutter: anywhere in the image, of any width on a logarithmic scale.
double log_clutter(const calib::ImageSize& image, std::size_t regions, const Vector2d& width_px) {
  const double widths = std::log(image.height);  // maths: from a pixel to the image's height
  return std::log(static_cast<double>(regions) / (image.width * image.height)) - 2 * std::log(widths) -
         width_px.array().max(1).log().sum();
}

// Widths of a region along its principal axes, minor first, as radii of a disc.
struct Shape {
  Eigen::Matrix2d axes;
  Vector2d width_px;
};

Shape shape_of(const color::ColorRegion& region) {
  const auto solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(region.spread);
  return {solver.eigenvectors(), 2 * solver.eigenvalues().cwiseMax(0).cwiseSqrt()};
}

// Whether the cameras' stamps are synchronised.
bool are_in_step(const std::vector<std::vector<double>>& times) {
  constexpr double same_s = 5e-4, most = 0.9;  // stamps are rounded to 0.1 ms; frames may be lost
  if (times.front().empty()) return false;
  for (const auto& of_camera : times) {
    const auto same = std::ranges::count_if(of_camera, [&](double t) {
      const auto after = std::ranges::lower_bound(times.front(), t - same_s);
      return after != times.front().end() && *after <= t + same_s;
    });
    if (static_cast<double>(same) < most * static_cast<double>(of_camera.size())) return false;
  }
  return true;
}

// From the rig file; otherwise webcams in general: latencies up to 45 ms, readouts up to 33 ms. Synchronised cameras
// are triggered, and mostly have a global shutter.
TimePrior time_prior(const calib::CameraTiming& timing, bool in_step) {
  const double any_latency_s = in_step ? 2e-4 : 0.05, any_readout_s = in_step ? 5e-4 : 0.03;  // standard deviations
  constexpr double noted_s = 0.005;  // of a value without its own uncertainty
  TimePrior prior;
  prior.time = {timing.latency_s.value_or(0), timing.readout_s.value_or(0)};
  prior.latency_sigma_s = timing.latency_s ? timing.latency_sigma_s.value_or(noted_s) : any_latency_s;
  prior.readout_sigma_s = timing.readout_s ? timing.readout_sigma_s.value_or(noted_s) : any_readout_s;
  // Keeps the problem well conditioned.
  constexpr double surest_s = 1e-5;
  prior.latency_sigma_s = std::max(surest_s, prior.latency_sigma_s);
  prior.readout_sigma_s = std::max(surest_s, prior.readout_sigma_s);
  return prior;
}

// The given one; otherwise rows are read within one frame, in either direction (a camera may be upside down): uniformly
// distributed.
ReadoutPrior any_readout(const calib::CameraTiming& timing, double frame_s) {
  if (timing.readout_s) {
    const TimePrior given = time_prior(timing, false);
    return {.mean_s = given.time.readout_s, .sigma_s = given.readout_sigma_s};
  }
  if (!(frame_s > 0)) return {};
  return {.mean_s = 0, .sigma_s = frame_s / std::sqrt(3.0)};
}

// 1 sigma, at 640 px of width.
struct LensTuning {
  double log_focal, centre_px, k1, k2, higher;

  LensChange sigmas(const calib::Camera& camera) const {
    const double px = centre_px * camera.image_size.width / 640;
    return LensChange{{log_focal, px, px, k1, k2, higher, higher}};
  }
};
// A given lens counts as nearly exact, with a loss: it moves positions by less than the wave's own error, or gives way.
constexpr LensTuning given_lens{.log_focal = 2e-4, .centre_px = 0.1, .k1 = 1e-3, .k2 = 3e-3, .higher = 1e-4};
// What webcams' lenses are: fields of view of 40 to 90 degrees, sensors mounted to some tenths of a millimetre.
constexpr LensTuning any_lens{
    .log_focal = calib::usual_lens.log_focal, .centre_px = 10, .k1 = 0.15, .k2 = 0.1, .higher = 1e-3};

}  // namespace

WaveSolution::WaveSolution(const calib::CameraRig& rig, const std::vector<BallFrame>& frames,
                           const WaveOptions& options)
    : given_(rig), rig_(rig), frames_(&frames), options_(options), chosen_(frames.size(), -1) {
  std::vector<std::vector<double>> times(rig.cameras.size());
  for (const BallFrame& f : *frames_) times[index(f.camera)].push_back(f.t_s);
  in_step_ = are_in_step(times);
  for (const calib::Camera& camera : rig.cameras) state_.times.push_back(time_prior(camera.timing, in_step_).time);
  step_s_ = std::numeric_limits<double>::infinity();
  for (const auto& of_camera : times) {
    std::vector<double> gaps;
    for (std::size_t i = 1; i < of_camera.size(); ++i) gaps.push_back(of_camera[i] - of_camera[i - 1]);
    const double gap = frame_s_.emplace_back(calib::median(std::move(gaps)));
    if (gap > 0) step_s_ = std::min(step_s_, gap), longest_s_ = std::max(longest_s_, gap);
  }
  // Initially the largest region.
  for (std::size_t f = 0; f < frames_->size(); ++f) chosen_[f] = (*frames_)[f].regions.empty() ? -1 : 0;
  find_span();
}

// Time span in which the ball was seen.
void WaveSolution::find_span() {
  from_s_ = std::numeric_limits<double>::infinity(), to_s_ = -from_s_;
  for (const BallFrame& f : *frames_) {
    if (f.regions.empty()) continue;
    const double t = exposed_s(f, f.regions.front());
    from_s_ = std::min(from_s_, t);
    to_s_ = std::max(to_s_, t);
  }
}

void WaveSolution::solve(const WaveStart& start, bool any_scale, bool lenses_first) {
  lenses_first_ = lenses_first;
  const int first_step = lenses_first ? WaveSteps::solved : 0;
  state_.cam_from_world = start.cam_from_world;
  for (std::size_t c = 0; c < start.later_s.size(); ++c) state_.times[c].latency_s += start.later_s[c];
  if (!any_scale) choose_consistent();
  find_span();
  constexpr double most_late_s = 0.1;  // correction of a latency still to come
  std::size_t triangulated_count = 0;
  state_.path = triangulated_path(rig_, state_.cam_from_world, tracks(), from_s_ - most_late_s, to_s_ + most_late_s,
                                  step_s_, &triangulated_count);
  if (triangulated_count < index(least_shared)) {
    const std::string times = std::to_string(triangulated_count) + " times";
    throw solver::CalibrationError(
        any_scale ? "the cameras are not connected: what they show of the ball's colour hardly ever is in one place (" +
                        times + "): set the ball's colour, or wave it where two of them see it"
                  : "the cameras' rays to the ball hardly ever meet with the poses that the rig has (" + times +
                        "): the poses are far off, the cameras' names are swapped, or they see different things");
  }
  WaveAdjustmentOptions o = adjustment_options();
  // First with wide gates and equal weights, then with each observation's own covariance.
  rough_ = true;
  o.loss = rough_robust_sigmas;
  for (int round = 0; round < 2; ++round) {
    report_progress("the poses, roughly", first_step + round);
    adjust(o);
    associate(round == 0 ? first_sigmas : rough_sigmas);
    o.loss = robust_sigmas;
    if (any_scale) Similarity{.scale = 1 / size_ratio()}.apply(state_);
  }
  learn_shapes();
  rough_ = false;
  associate(rough_sigmas);
  refine(first_step + WaveSteps::refined);
}

// By the present poses, in metres.
void WaveSolution::choose_consistent() {
  calib::CameraRig rig = rig_;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) rig.cameras[c].cam_from_world = state_.cam_from_world[c];
  ConsistencyTuning tuning;
  if (options_.guessed_radius) tuning.log_size = std::numbers::ln2;  // right to a factor of two
  chosen_ = consistent_regions(rig, *frames_, options_.radius_m, longest_s_, tuning);
}

void WaveSolution::refine(int step) {
  WaveAdjustmentOptions o = adjustment_options();
  for (int round = 0; round < WaveSteps::most_rounds; ++round) {
    report_progress("the poses and the ball's path", step + round);
    learn_shapes();
    set_prior_weights(o);
    if (round == 1 || round == 3) learn_jerk();
    o.jerk_m_s3 = jerk_m_s3_;
    adjust(o);
    const std::vector<int> before = chosen_;
    associate(final_sigmas);
    if (round >= 3 && chosen_ == before) break;
  }
}

void WaveSolution::settle() {
  WaveAdjustmentOptions o = adjustment_options();
  o.with_covariance = true;
  o.max_iterations = 100;
  adjust(o);
}

void WaveSolution::adjust(const WaveAdjustmentOptions& options) {
  fit_ = adjust_wave(given_, observations(), state_, options);
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) rig_.cameras[c].model = state_.lens(given_, c);
}

void WaveSolution::keep_half(int half) {
  const double piece = std::max(1.0, (to_s_ - from_s_) / 20);
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (static_cast<int>(std::floor(((*frames_)[f].t_s - from_s_) / piece)) % 2 != half) chosen_[f] = -1;
  }
}

double WaveSolution::misfit() const {
  double sum = lens_cost(adjustment_options(), state_.lenses);
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (const auto match = chosen_[f] < 0 ? std::nullopt : match_of(f, region(f)))
      sum -= std::max(0.0, match->log_odds);
  }
  return sum;
}

bool WaveSolution::is_possible() const {
  for (std::size_t c = 0; c < state_.times.size(); ++c)
    if (!is_possible_readout(state_.times[c].readout_s, frame_s_[c])) return false;
  return true;
}

double WaveSolution::used_share() const {
  const auto used = std::ranges::count_if(chosen_, [](int c) { return c >= 0; });
  const auto seen = std::ranges::count_if(*frames_, [](const BallFrame& f) { return !f.regions.empty(); });
  return seen == 0 ? 0 : static_cast<double>(used) / static_cast<double>(seen);
}

double WaveSolution::size_ratio() const {
  std::vector<double> ratios;
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (chosen_[f] < 0) continue;
    const auto at = appearance((*frames_)[f], region(f));
    if (at && at->radius_px > 0) ratios.push_back(2 * std::pow(region(f).spread.determinant(), 0.25) / at->radius_px);
  }
  return ratios.empty() ? 1 : calib::median(ratios);
}

double WaveSolution::partly_seen(std::size_t camera) const {
  int used = 0, partly = 0;
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (chosen_[f] < 0 || index((*frames_)[f].camera) != camera) continue;
    const auto at = appearance((*frames_)[f], region(f));
    if (!at) continue;
    ++used;
    if (width_misfit((*frames_)[f], region(f), *at).cwiseAbs().maxCoeff() > partly_misfit) ++partly;
  }
  return used == 0 ? 0 : static_cast<double>(partly) / used;
}

bool WaveSolution::is_held() const {
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c)
    if (partly_seen(c) > WaveCamera::much_partly) return true;
  return false;
}

BallTracks WaveSolution::tracks() const {
  BallTracks t;
  t.of_camera.resize(rig_.cameras.size());
  t.max_gap_s = 2.5 * longest_s_;
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (chosen_[f] >= 0)
      t.of_camera[index((*frames_)[f].camera)].push_back({exposed_s((*frames_)[f], region(f)), region(f).centre});
  }
  for (auto& track : t.of_camera) std::ranges::stable_sort(track, {}, &BallTracks::Point::t_s);
  return t;
}

std::vector<TimingDiagnostics> WaveSolution::timing() const {
  std::vector<std::vector<TimingSample>> samples(rig_.cameras.size());
  const bool held = is_held();
  for (std::size_t number = 0; number < frames_->size(); ++number) {
    const BallFrame& f = (*frames_)[number];
    const std::size_t c = index(f.camera);
    const auto predicted = [&](double t_s) {
      return outline_centre(rig_.cameras[c].model, state_.cam_from_world[c] * state_.path.at(t_s), options_.radius_m);
    };
    // Unused regions count if the ball was there within a few frames: a lag may be why they were not used. Where a hand
    // holds the ball, they are the hand, and few outlines are whole.
    std::optional<TimingSample> best;
    for (const color::ColorRegion& region : f.regions) {
      constexpr double soon_s = 1e-3, most_frames = 5, near_px = 10;
      const double t_s = exposed_s(f, region);
      const auto at = predicted(t_s), soon = predicted(t_s + soon_s);
      if (!at || !soon) continue;
      const auto look = appearance(f, region);
      constexpr double most_sigma_px = 1;  // beyond, it is partly hidden or merged
      if (!look) continue;
      const bool is_used = chosen_[number] >= 0 && &region == &f.regions[index(chosen_[number])];
      if (held ? !is_used : covariance_of(f, region, *look).trace() > 2 * most_sigma_px * most_sigma_px) continue;
      const TimingSample sample{t_s, region.centre - *at, (*soon - *at) / soon_s};
      if (sample.residual.norm() > near_px + most_frames * longest_s_ * sample.velocity.norm()) continue;
      if (!best || sample.residual.norm() < best->residual.norm()) best = sample;
    }
    if (best) samples[c].push_back(*best);
  }
  std::vector<TimingDiagnostics> out;
  for (std::size_t c = 0; c < samples.size(); ++c) out.push_back(timing_diagnostics(samples[c], frame_s_[c]));
  return out;
}

std::vector<BallObservation> WaveSolution::observations() const {
  std::vector<BallObservation> out;
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (chosen_[f] < 0) continue;
    const auto at = appearance((*frames_)[f], region(f));
    if (!at) continue;
    const BallFrame& frame = (*frames_)[f];
    out.push_back({frame.camera, frame.t_s, region(f).centre, covariance_of(frame, region(f), *at)});
  }
  return out;
}

std::vector<LinearOutline> WaveSolution::linear_outlines() const {
  return wave::linear_outlines(given_, observations(), state_, options_.radius_m);
}

void WaveSolution::report_progress(const char* step, int done) const {
  if (options_.progress && !is_silent_) options_.progress(step, done, WaveSteps::all);
}

const color::ColorRegion& WaveSolution::region(std::size_t f) const {
  return (*frames_)[f].regions[index(chosen_[f])];
}

WaveAdjustmentOptions WaveSolution::adjustment_options() const {
  WaveAdjustmentOptions o;
  o.radius_m = options_.radius_m;
  o.loss = robust_sigmas;
  o.jerk_m_s3 = jerk_m_s3_;
  // The two cameras that are furthest apart hold the scale.
  double furthest = -1;
  for (std::size_t a = 0; a < rig_.cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < rig_.cameras.size(); ++b) {
      const double d =
          (calib::inverse(state_.cam_from_world[a]).translation - calib::inverse(state_.cam_from_world[b]).translation)
              .norm();
      if (d <= furthest) continue;
      furthest = d;
      o.scale_a = static_cast<int>(a);
      o.scale_b = static_cast<int>(b);
    }
  }
  o.reference = o.scale_a;
  o.hold_poses = options_.hold_poses;
  o.wander_s = wander_s_;
  set_prior_weights(o);
  for (std::size_t c = 0; !options_.hold_poses && c < given_.cameras.size(); ++c) {
    const calib::Camera& camera = given_.cameras[c];
    o.any_lens_sigmas.push_back(any_lens.sigmas(camera));
    if ((rough_ && lenses_first_) || options_.guessed_lenses) continue;
    LensChange& sigmas = o.given_lens_sigmas.emplace_back(given_lens.sigmas(camera));
    // No real lens is without distortion: nothing is given.
    if (calib::parameters_of(camera.model).tail<8>().isZero(0)) sigmas.tail<4>() = o.any_lens_sigmas.back().tail<4>();
  }
  for (const calib::Camera& camera : rig_.cameras) o.times.push_back(time_prior(camera.timing, in_step_));
  for (std::size_t c = 0; c < o.times.size(); ++c) {
    TimePrior& prior = o.times[c];
    const calib::CameraTiming& timing = rig_.cameras[c].timing;
    // Relative to the first camera's, which is held.
    prior.latency_sigma_s = std::hypot(prior.latency_sigma_s, rig_.cameras[0].timing.latency_sigma_s.value_or(0));
    // A tight prior that is wrong would pull everything else along.
    const TimePrior any;
    if (rough_ && timing.latency_s) prior.latency_sigma_s = any.latency_sigma_s;
    if (rough_ && timing.readout_s) prior.readout_sigma_s = any.readout_sigma_s;
  }
  return o;
}

// A hand makes errors that are larger than stated, and last: priors count as much as the errors that are left show.
void WaveSolution::set_prior_weights(WaveAdjustmentOptions& o) const {
  const bool held = !rough_ && is_held();
  const double variance = held ? noise_variance(fit_.distance2, robust_sigmas) : 1;
  o.frames_as_one.clear();
  for (const double frame_s : frame_s_)
    o.frames_as_one.push_back(variance * o.correlation.frames_as_one(std::max(1e-3, frame_s)));
  o.any_readouts.clear();
  for (std::size_t c = 0; held && c < rig_.cameras.size(); ++c) {
    ReadoutPrior& prior = o.any_readouts.emplace_back(any_readout(rig_.cameras[c].timing, frame_s_[c]));
    prior.weight = o.frames_as_one[c];
  }
}

std::optional<object_tracking::BallProjection> WaveSolution::appearance(const BallFrame& frame,
                                                                        const color::ColorRegion& region) const {
  calib::Camera camera = rig_.cameras[index(frame.camera)];
  camera.cam_from_world = state_.cam_from_world[index(frame.camera)];
  const Vector3d p = state_.path.at(exposed_s(frame, region));
  auto at = object_tracking::project_ball(camera, p, options_.radius_m);
  if (!at) return at;
  if (const auto px = outline_centre(camera.model, camera.cam_from_world * p, options_.radius_m)) at->px = *px;
  return at;
}

// Jerk of the waving by maximum evidence: the smoother the path, the better it constrains the cameras.
void WaveSolution::learn_jerk() {
  const std::vector<BallObservation> seen = observations();
  const auto evidence_for = [&](double jerk) {
    WaveState trial = state_;
    WaveAdjustmentOptions o = adjustment_options();
    o.jerk_m_s3 = jerk;
    o.max_iterations = 10;
    o.with_evidence = true;
    return adjust_wave(given_, seen, trial, o).evidence;
  };
  constexpr double step = 1.8, least = 0.3, most = 1000;  // m/s^3: from a crane to a throw
  double best = evidence_for(jerk_m_s3_);
  for (const double factor : {1 / step, step}) {
    bool moved = false;
    for (double jerk = factor * jerk_m_s3_; jerk > least && jerk < most; jerk *= factor) {
      const double evidence = evidence_for(jerk);
      if (evidence <= best) break;
      best = evidence;
      jerk_m_s3_ = jerk;
      moved = true;
    }
    if (moved) break;
  }
}

// Blur and shared chroma widen a ball's outline by a constant square, per camera and axis: a quantile above the median,
// as partly hidden balls are narrow. What hides a part of it, or adds to it, moves single edges.
void WaveSolution::learn_shapes() {
  struct Seen {
    std::size_t frame;
    object_tracking::BallProjection at;
  };
  std::vector<std::vector<Seen>> seen(rig_.cameras.size());
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    if (chosen_[f] < 0) continue;
    if (const auto at = appearance((*frames_)[f], region(f))) seen[index((*frames_)[f].camera)].push_back({f, *at});
  }
  blur2_.assign(rig_.cameras.size(), Vector2d::Zero());
  edge2_.assign(rig_.cameras.size(), 0);
  for (std::size_t c = 0; c < seen.size(); ++c) {
    if (seen[c].empty()) continue;
    for (const int axis : {0, 1}) {
      std::vector<double> excess;
      for (const auto& [f, at] : seen[c]) {
        const double width = shape_of(region(f)).width_px[axis];
        excess.push_back(width * width - at.radius_px * at.radius_px);
      }
      constexpr double share = 0.6;  // quantile
      const auto at = excess.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(excess.size()));
      std::ranges::nth_element(excess, at);
      blur2_[c][axis] = *at;
    }
    for (const auto& [f, at] : seen[c]) {
      const Vector2d misfit = width_misfit((*frames_)[f], region(f), at).cwiseAbs().cwiseMin(1);  // clutter is wider
      edge2_[c] += misfit.squaredNorm() / (2 * static_cast<double>(seen[c].size()));
    }
  }
}

// Widths over those of a whole ball, less one.
Vector2d WaveSolution::width_misfit(const BallFrame& frame, const color::ColorRegion& region,
                                    const object_tracking::BallProjection& at) const {
  const double r2 = at.radius_px * at.radius_px;
  const Vector2d whole2 = (Vector2d::Constant(r2) + blur2_[index(frame.camera)]).cwiseMax(r2 / 2);
  return shape_of(region).width_px.cwiseQuotient(whole2.cwiseSqrt()) - Vector2d::Ones();
}

// The ends of an axis are moved independently of one another: then its centre is as uncertain as its width. The
// variance of a single outline is estimated from that of its camera's and its own misfit, which count alike.
Eigen::Matrix2d WaveSolution::covariance_of(const BallFrame& frame, const color::ColorRegion& region,
                                            const object_tracking::BallProjection& at) const {
  if (rough_) return Eigen::Matrix2d::Identity();
  const Vector2d misfit = width_misfit(frame, region, at);
  const double r2 = at.radius_px * at.radius_px,
               least = options_.pixel_noise_px * options_.pixel_noise_px + variance_of_radius2 * r2;
  const Vector2d variance = least + r2 * (edge2_[index(frame.camera)] + misfit.array().square()) / 2;
  const Eigen::Matrix2d axes = shape_of(region).axes;
  return axes * variance.asDiagonal() * axes.transpose();
}

// nullopt: not comparable.
std::optional<WaveSolution::Match> WaveSolution::match_of(std::size_t f, const color::ColorRegion& region) const {
  const BallFrame& frame = (*frames_)[f];
  const auto at = appearance(frame, region);
  if (!at) return std::nullopt;
  const Vector2d d = region.centre - at->px;
  const Eigen::Matrix2d covariance = covariance_of(frame, region, *at);
  Match match{.distance2 = d.dot(covariance.inverse() * d), .log_odds = 0};
  match.log_odds = -match.distance2 / 2;
  if (rough_) return match;
  // Of the centre, and of the widths: Cauchy's distribution.
  const Vector2d misfit = width_misfit(frame, region, *at);
  const double r2 = at->radius_px * at->radius_px, scale2 = options_.pixel_noise_px * options_.pixel_noise_px +
                                                            r2 * (variance_of_radius2 + edge2_[index(frame.camera)]);
  match.log_odds -= std::log(2 * std::numbers::pi) + std::log(covariance.determinant()) / 2;
  for (const int axis : {0, 1})
    match.log_odds -=
        std::log(std::numbers::pi * (1 + r2 * misfit[axis] * misfit[axis] / scale2)) + std::log(scale2) / 2;
  match.log_odds -=
      log_clutter(rig_.cameras[index(frame.camera)].image_size, frame.regions.size(), shape_of(region).width_px);
  return match;
}

// Per frame the likeliest region within the gate, unless clutter is likelier.
void WaveSolution::associate(double sigmas) {
  for (std::size_t f = 0; f < frames_->size(); ++f) {
    chosen_[f] = -1;
    double best = rough_ ? -std::numeric_limits<double>::infinity() : 0;
    for (std::size_t r = 0; r < (*frames_)[f].regions.size(); ++r) {
      const auto match = match_of(f, (*frames_)[f].regions[r]);
      if (!match || match->distance2 >= sigmas * sigmas || match->log_odds <= best) continue;
      best = match->log_odds;
      chosen_[f] = static_cast<int>(r);
    }
  }
}

}  // namespace huetrack::wave
