#include "calib/solver/intrinsics.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <tuple>

#include "calib/model/median.h"
#include "calib/model/nearest_lens.h"
#include "calib/solver/adjustment_steps.h"
#include "calib/solver/ray_uncertainty.h"

namespace huetrack::solver {
namespace {

double median_residual(const Adjustment& a) {
  std::vector<double> lengths;
  for (const ViewFit& fit : a.fits) {
    for (const auto& r : fit.residuals) lengths.push_back(r.norm());
  }
  return calib::median(std::move(lengths), std::numeric_limits<double>::infinity());
}

// Adjustment of one camera, each view in its own set, with the best board poses for these intrinsics.
Adjustment posed(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views) {
  Adjustment a;
  a.board = board;
  a.cameras = {camera};
  a.cameras.front().pose_is_free = false;
  for (const BoardView& view : views) {
    const auto poses = board_poses(board, view, camera.lens, camera.parameters);
    if (poses.empty()) continue;
    BoardView own = view;
    own.camera = 0;
    own.set = static_cast<int>(a.views.size());
    a.views.push_back(std::move(own));
    a.world_from_board.push_back(poses.front().cam_from_board);
  }
  return a;
}

std::vector<BoardView> spread_over(const std::vector<BoardView>& views, std::size_t count) {
  if (views.size() <= count) return views;
  std::vector<BoardView> some;
  for (std::size_t k = 0; k < count; ++k) some.push_back(views[k * views.size() / count]);
  return some;
}

// Initial lens: tries focal lengths from wide to tele.
AdjustedCamera find_start(const board::Board& board, const AdjustedCamera& camera,
                          const std::vector<BoardView>& views) {
  const bool fisheye = camera.lens == LensModel::fisheye;
  const auto some = spread_over(views, 12);
  const double size = std::max(camera.image_size.width, camera.image_size.height);
  // Residuals of board poses preselect focal lengths; short adjustments decide.
  std::vector<std::pair<double, AdjustedCamera>> trials;
  for (const double factor : {0.3, 0.45, 0.65, 0.9, 1.3, 1.9, 2.8}) {
    AdjustedCamera trial = camera;
    trial.lens = fisheye ? LensModel::fisheye : LensModel::radtan4;
    trial.parameters.setZero();
    trial.parameters.head<4>() << factor * size, factor * size, (camera.image_size.width - 1) / 2.0,
        (camera.image_size.height - 1) / 2.0;
    double sum = 0;
    for (const BoardView& view : some) {
      const auto poses = board_poses(board, view, trial.lens, trial.parameters);
      sum += poses.empty() ? size : std::min(poses.front().rms_px, 0.05 * size);
    }
    trials.emplace_back(sum, trial);
  }
  std::ranges::stable_sort(trials, {}, [](const auto& t) { return t.first; });
  AdjustedCamera best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < 3; ++t) {
    try {
      Adjustment fit = adjust(posed(board, trials[t].second, some), {.max_iterations = 25, .with_covariance = false});
      // Again with the poses for this lens: the first ones may be mirrored.
      fit = adjust(posed(board, fit.cameras.front(), some), {.max_iterations = 25, .with_covariance = false});
      const LensParameters& l = fit.cameras.front().parameters;
      const bool sane = l(0) > 0.05 * size && l(1) > 0.05 * size && l(0) < 50 * size && l(1) < 50 * size;
      if (const double middle = median_residual(fit); sane && middle < least) {
        least = middle;
        best = fit.cameras.front();
      }
    } catch (const CalibrationError&) {  // another start may succeed
    }
  }
  if (!std::isfinite(least)) {
    throw CalibrationError("camera " + camera.name + ": no lens fits the views of the board", Fault::no_lens_fits);
  }
  best.lens = camera.lens;
  return best;
}

// Robust square: linear beyond three standard deviations, constant beyond gross errors.
constexpr double gross_sigmas = 100;
double robust_square(double length, double sigma) {
  constexpr double sigmas = 3;
  const double from = sigmas * sigma, l = std::min(length, gross_sigmas * sigma);
  return l < from ? l * l : from * (2 * l - from);
}

// Standard deviation of a corner, by the fit with the smallest median.
double sigma_of(const std::vector<LensTrial>& trials, const std::vector<Adjustment>& fits) {
  constexpr double median_length_of_sigma = 1.18, least_px = 0.02;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (trials[i].possible) least = std::min(least, median_residual(fits[i]) / median_length_of_sigma);
  }
  return std::max(least, least_px);
}

// The rational model can hide a pole behind a zero, and fit noise with the remaining ripple.
bool has_pole(const AdjustedCamera& camera) {
  if (camera.lens != LensModel::radtan8) return false;
  const LensParameters& l = camera.parameters;
  const double reach = reach_of(camera);
  for (int i = 1; i <= 32; ++i) {
    const double r = reach * i / 32, s = r * r;
    if (1 + s * (l(9) + s * (l(10) + s * l(11))) < least_denominator) return true;
  }
  return false;
}

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

int corners_in(const std::vector<BoardView>& views) {
  int count = 0;
  for (const BoardView& view : views) count += static_cast<int>(view.ids.size());
  return count;
}

struct TrialFit {
  LensTrial trial;
  Adjustment fit;
};

// Short fit to a subset of the views, without the fold penalty; nullopt: failed.
std::optional<Adjustment> glance_at(const board::Board& board, AdjustedCamera start,
                                    const std::vector<BoardView>& views) {
  constexpr AdjustmentOptions quick{.max_iterations = 20, .with_covariance = false};
  start.unfold = 0;
  try {
    const Adjustment fit = adjust(posed(board, start, views), quick);
    return adjust(posed(board, fit.cameras.front(), views), quick);
  } catch (const CalibrationError&) {
    return std::nullopt;
  }
}

// Fits one lens model with the fold penalty. is_near: the start fits a subset of the views.
// throws CalibrationError
TrialFit try_lens(const board::Board& board, AdjustedCamera start, const std::vector<BoardView>& views,
                  const AdjustmentOptions& options, bool is_near) {
  start.unfold = 0;
  AdjustmentOptions first = options;
  first.with_covariance = false;
  if (!is_near) start = adjust(posed(board, start, views), first).cameras.front();
  // Again with the board poses for this lens.
  Adjustment fit = adjust(posed(board, start, views), options);
  const auto folds = [&] { return !is_sound(fit.cameras.front()); };
  const double free_rms = fit.rms_px;
  for (const double weight : {1.0, 10.0, 100.0, 100.0, 1000.0, 1000.0, 1e4}) {
    if (!folds()) break;
    fit.cameras.front().unfold = weight;
    fit = adjust(std::move(fit), options);
  }
  constexpr double as_well = 1.01;  // ratio to the fit without the penalty; tolerance of the solver
  LensTrial trial{.lens = start.lens, .rms_px = fit.rms_px, .error = {}};
  trial.left_out = corners_in(fit.views) - fit.corners_used;
  trial.fault = folds() ? LensFault::folds : fit.rms_px > as_well * free_rms ? LensFault::fits_folded : LensFault::none;
  return {trial, std::move(fit)};
}

// Robust sum of squares over all `corners` of all given views, also of those without a board pose for this lens.
double all_corners(const Adjustment& fitted, double sigma, int corners) {
  double squares = (corners - corners_in(fitted.views)) * robust_square(gross_sigmas * sigma, sigma);
  for (const ViewFit& fit : fitted.fits) {
    for (const auto& r : fit.residuals) squares += robust_square(r.norm(), sigma);
  }
  return squares;
}

// The same as a mean over the `views`, without the worst tenth: a single mirrored or failed pose must not decide.
double without_worst_views(const Adjustment& fitted, double sigma, std::size_t views) {
  constexpr double share = 0.9;
  std::vector<double> left(views - fitted.views.size(), robust_square(gross_sigmas * sigma, sigma));
  for (const ViewFit& fit : fitted.fits) {
    left.push_back(0);
    for (const auto& r : fit.residuals)
      left.back() += robust_square(r.norm(), sigma) / static_cast<double>(fit.residuals.size());
  }
  std::ranges::sort(left);
  left.resize(static_cast<std::size_t>(std::ceil(share * static_cast<double>(views))));
  return sum(left);
}

// Index of the possible trial with the least residuals over all corners; trials.size(): none.
std::size_t closest_fit(const std::vector<LensTrial>& trials, const std::vector<Adjustment>& fits, double sigma,
                        int corners) {
  std::size_t best = fits.size();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (!trials[i].possible) continue;
    const double sum = all_corners(fits[i], sigma, corners);
    if (sum < least) {
      least = sum;
      best = i;
    }
  }
  return best;
}

struct TrialInput {
  const board::Board& board;
  const AdjustedCamera& camera;  // its name and image
  const std::vector<BoardView>& views;
  const AdjustmentOptions& options;
};

// Starts from the best fit so far, from the initial lens, and, for a requested model, from another model.
// LensFault::unsolved: all failed.
TrialFit try_from_all_starts(const TrialInput& in, LensModel lens, const std::vector<Adjustment>& fits,
                             const std::vector<LensTrial>& trials, const AdjustedCamera* glanced) {
  TrialFit tried;
  tried.trial.lens = lens;
  tried.trial.fault = LensFault::unsolved;
  const auto try_start = [&](const auto& make_start, bool is_near = false) {
    if (tried.trial.fault == LensFault::none) return;
    try {
      AdjustedCamera start = make_start();
      start.lens = lens;
      TrialFit fitted = try_lens(in.board, std::move(start), in.views, in.options, is_near);
      if (tried.trial.fault == LensFault::unsolved || fitted.trial.fault == LensFault::none) tried = std::move(fitted);
    } catch (const CalibrationError& error) {
      if (tried.trial.error.empty()) tried.trial.error = error.reasons();
    }
  };
  if (glanced != nullptr) try_start([&] { return *glanced; }, true);
  AdjustedCamera empty = in.camera;
  empty.lens = lens;
  const bool from_nothing = lens != LensModel::stereographic;
  if (lens == LensModel::fisheye && glanced == nullptr)
    try_start([&] { return find_start(in.board, empty, in.views); });
  if (!fits.empty()) {
    // Coefficients of another pinhole, or the nearest lens to the best model so far.
    const std::size_t closest = closest_fit(trials, fits, sigma_of(trials, fits), corners_in(in.views));
    if (closest < fits.size()) try_start([&] { return start_like(fits[closest].cameras.front(), lens); });
  }
  if (from_nothing && lens != LensModel::fisheye) try_start([&] { return find_start(in.board, empty, in.views); });
  if (tried.trial.fault == LensFault::none || !fits.empty()) return tried;
  for (const LensModel other : {LensModel::radtan4, LensModel::fisheye}) {
    if (other == lens) continue;
    try_start([&] {
      AdjustedCamera first = in.camera;
      first.lens = other;
      first = find_start(in.board, first, in.views);
      const Adjustment fit = adjust(posed(in.board, first, in.views), in.options);
      return start_like(fit.cameras.front(), lens);
    });
  }
  return tried;
}

// From the best model so far, or the initial lens. trials: as many as fits, or more. nullopt: failed.
std::optional<Adjustment> first_glance(const board::Board& board, const AdjustedCamera& camera, LensModel lens,
                                       const std::vector<BoardView>& views, const std::vector<LensTrial>& trials,
                                       const std::vector<Adjustment>& fits) {
  AdjustedCamera start = camera;
  start.lens = lens;
  const std::size_t closest = fits.empty() ? 0 : closest_fit(trials, fits, sigma_of(trials, fits), corners_in(views));
  const bool has_start = closest < fits.size();
  if (has_start && lens != LensModel::fisheye) {
    start = start_like(fits[closest].cameras.front(), lens);
  } else {
    try {
      start = find_start(board, start, views);
    } catch (const CalibrationError&) {
      return std::nullopt;
    }
  }
  start.lens = lens;
  return glance_at(board, start, views);
}

using ReportLens = std::function<void(const char* step, LensModel lens)>;

// Log of the marginal likelihood of all corners (Laplace's approximation), but for what all models have in common: the
// likelihood at the maximum, the prior there, and how much smaller the posterior's volume is than the prior's.
// Decentring and prism do not count in the volume: real lenses have decentring, and a model without it neglects it.
double log_evidence(const Adjustment& fit, double sigma, int corners) {
  const AdjustedCamera& camera = fit.cameras.front();
  const LensPrior prior = lens_prior(camera);
  std::vector<Eigen::Index> counted;
  for (int i = 0; i < parameter_count(camera.lens); ++i) {
    if (!is_sideways(camera.lens, i)) counted.push_back(i);
  }
  const Eigen::MatrixXd whiten = prior.information.llt().matrixU(), whiten_counted = whiten(counted, counted);
  const Eigen::VectorXd off = whiten * (camera.parameters - prior.mean).head(whiten.cols());
  const Eigen::MatrixXd posterior =
      whiten_counted * Eigen::MatrixXd(fit.covariance(counted, counted)) * whiten_counted.transpose();
  const double log_volume = posterior.selfadjointView<Eigen::Lower>().eigenvalues().array().max(1e-300).log().sum() / 2;
  return -all_corners(fit, sigma, corners) / (2 * sigma * sigma) - off.squaredNorm() / 2 + log_volume;
}

// Log odds of a model after the views, but for a constant.
double odds_of(const LensTrial& trial) {
  const auto place = std::ranges::find(all_lens_models, trial.lens) - all_lens_models.begin();
  const auto steps = static_cast<double>(std::min<std::ptrdiff_t>(place, 3));  // radtan8 and stereographic: alike
  return trial.log_evidence - steps * clearly_more_evidence;
}

// Sets log_evidence of the trials, and chosen.
void choose_lens(Intrinsics& result, const std::string& camera, const std::vector<Adjustment>& fits, int corners) {
  std::vector<LensTrial>& trials = result.trials;
  const double sigma = sigma_of(trials, fits);
  result.chosen = fits.size();
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (!trials[i].possible) continue;
    trials[i].log_evidence = log_evidence(fits[i], sigma, corners);
    if (result.chosen == fits.size() || odds_of(trials[i]) > odds_of(trials[result.chosen])) result.chosen = i;
  }
  if (result.chosen == fits.size())
    throw CalibrationError(after("camera " + camera + ": no lens model fits the views: ", reasons_of(trials.front())));
}

}  // namespace

double probability_of_k3(const Intrinsics& lens) {
  const auto tried = [&](LensModel model) {
    const auto trial = std::ranges::find(lens.trials, model, &LensTrial::lens);
    return trial == lens.trials.end() || !trial->possible ? nullptr : &*trial;
  };
  const LensTrial *without = tried(LensModel::radtan4), *with = tried(LensModel::radtan5);
  if (without == nullptr || with == nullptr) return 0;
  return 1 / (1 + std::exp(without->log_evidence - with->log_evidence));
}

AdjustedCamera start_like(const AdjustedCamera& fitted, LensModel lens) {
  AdjustedCamera start = fitted;
  start.lens = lens;
  start.unfold = 0;
  // Truncated coefficients are another lens.
  const bool holds_all = parameter_count(lens) >= parameter_count(fitted.lens);
  if (is_pinhole(fitted.lens) && is_pinhole(lens) && holds_all) return start;
  LensParameters plain = LensParameters::Zero();
  plain.head<2>().setOnes();
  start.parameters = parameters_of(
      calib::nearest_lens(fitted.model(), fitted.image_size, camera_model(lens, plain), parameter_count(lens)).model);
  return start;
}

bool is_sound(const AdjustedCamera& camera) {
  return covers_image(camera.model(), camera.image_size) && !has_pole(camera);
}

bool covers_image(const calib::CameraModel& model, calib::ImageSize size) {
  for (int k = 0; k <= 16; ++k) {
    const double u = (size.width - 1) * k / 16.0, v = (size.height - 1) * k / 16.0;
    for (const calib::RawPixel& p : {calib::RawPixel{{u, 0}}, calib::RawPixel{{u, size.height - 1.0}},
                                     calib::RawPixel{{0, v}}, calib::RawPixel{{size.width - 1.0, v}}}) {
      if (!model.ray(p)) return false;
    }
  }
  return true;
}

std::vector<Reason> reasons_of(const LensTrial& trial) {
  switch (trial.fault) {
    case LensFault::none:
      return {};
    case LensFault::folds:
      return {{.fact = "its distortion turns back on itself, or has a pole, inside the image"}};
    case LensFault::fits_folded:
      return {{.fact = "kept from turning back on itself inside the image it does not fit the views"}};
    case LensFault::far_off:
      return {{.fact = "it leaves far more than another model does"}};
    case LensFault::unsolved:
      break;
  }
  return trial.error;
}

Intrinsics calibrate_intrinsics(const board::Board& board, const std::string& name, calib::ImageSize image_size,
                                const std::vector<BoardView>& given, const IntrinsicsOptions& options) {
  std::vector<BoardView> views = given;
  std::ranges::sort(views, {}, [](const BoardView& v) { return std::tie(v.set, v.image); });
  if (static_cast<int>(views.size()) < options.min_views) {
    throw CalibrationError("camera " + name + ": only " + std::to_string(views.size()) +
                               (views.size() == 1 ? " view" : " views") + " of the board; at least " +
                               std::to_string(options.min_views) + " are needed",
                           Fault::too_few_views);
  }
  std::vector<LensModel> candidates(all_lens_models.begin(), all_lens_models.end());
  if (options.lens) candidates = {*options.lens};
  const bool is_only = candidates.size() == 1;

  int done = 0;
  const ReportLens report_progress = [&](const char* step, LensModel lens) {
    if (options.progress) {
      options.progress(step + std::string(solver::name(lens)), done, static_cast<int>(2 * candidates.size()));
    }
    ++done;
  };

  Intrinsics result;
  std::vector<Adjustment> fits;
  AdjustedCamera camera;
  camera.name = name;
  camera.image_size = image_size;
  // A subset of the views rejects most models.
  std::vector<LensTrial> glances;
  std::vector<Adjustment> glanced;
  constexpr std::size_t some_views = 24;
  const std::vector<BoardView> some = spread_over(views, some_views);
  for (const LensModel lens : candidates) {
    report_progress("screening ", lens);
    glances.emplace_back();
    glances.back().lens = lens;
    const auto fit = is_only ? std::nullopt : first_glance(board, camera, lens, some, glances, glanced);
    glances.back().possible = fit.has_value();
    glanced.push_back(fit.value_or(Adjustment{}));
  }
  const double sigma = is_only ? 0 : sigma_of(glances, glanced);
  double least = std::numeric_limits<double>::infinity(), least_without_worst = least;
  for (std::size_t i = 0; i < glanced.size(); ++i) {
    if (!glances[i].possible) continue;
    least = std::min(least, all_corners(glanced[i], sigma, corners_in(some)));
    least_without_worst = std::min(least_without_worst, without_worst_views(glanced[i], sigma, some.size()));
  }
  const auto is_far_off = [&](const Adjustment& glance) {
    constexpr double far = 3, as_close = 1.05;
    return all_corners(glance, sigma, corners_in(some)) > far * least &&
           without_worst_views(glance, sigma, some.size()) > as_close * least_without_worst;
  };
  const TrialInput input{board, camera, views, options.adjustment};
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const LensModel lens = candidates[i];
    report_progress("fitting ", lens);
    TrialFit tried;
    if (!is_only && glances[i].possible && is_far_off(glanced[i])) {
      tried.trial = glances[i];
      tried.trial.fault = LensFault::far_off;
      tried.trial.rms_px = glanced[i].rms_px;
      tried.fit = glanced[i];
    } else {
      tried = try_from_all_starts(input, lens, fits, result.trials,
                                  glances[i].possible ? &glanced[i].cameras.front() : nullptr);
    }
    tried.trial.possible =
        tried.trial.fault == LensFault::none || (is_only && tried.trial.fault != LensFault::unsolved);
    if (is_only && !tried.trial.possible) {
      // The adjustment's own reason in brackets.
      std::vector<Reason> why =
          after("camera " + name + ": " + std::string(solver::name(lens)) + " cannot be fitted to its views (",
                tried.trial.error);
      why.push_back({.fact = ")", .fault = Fault::lens_does_not_fit});
      throw CalibrationError(std::move(why));
    }
    result.trials.push_back(tried.trial);
    fits.push_back(std::move(tried.fit));
  }
  if (!options.lens) choose_lens(result, name, fits, corners_in(views));
  result.adjustment = std::move(fits[result.chosen]);
  return result;
}

namespace {

// Difference from a given lens, in standard deviations over the image, at which a fitted one contradicts it; and where
// boards move before a rolling shutter, whose effect is systematic.
constexpr double clearly_other = 3, clearly_other_moving = 10;

// Residuals over another model's at which a model is rejected; and absolute, for corners without noise.
bool is_hopeless(double given_px, double refined_px) {
  constexpr double hopeless_px = 2, hopeless_share = 5;
  return given_px > hopeless_px && given_px > hopeless_share * refined_px;
}

// A given lens is contradicted by residuals so much larger than those of the lens fitted to these views; 0.1 px is not
// enough, as the given one usually rests on more views.
constexpr double clearly_more = 1.3, little_px = 0.1;
// Or by corners that only the fitted lens accepts.
constexpr double most_corners = 0.8;
// Or by its focal length (zoomed or refocused).
constexpr double zoomed_by = 0.01, zoomed_sigmas = 4;

}  // namespace

LensCheck check_lens(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views) {
  AdjustedCamera trial = camera;
  trial.lens_is_free = false;
  const AdjustmentOptions options{.with_covariance = false};
  LensCheck check;
  Adjustment given = adjust(posed(board, trial, views), options);
  given.cameras.front().lens_is_free = true;
  check.refined = adjust(posed(board, given.cameras.front(), views));
  const LensParameters& l = check.refined.cameras.front().parameters;
  const LensParameters sigma = check.refined.lens_sigma(0);
  double zoom = 0;
  for (const int i : {0, 1}) {
    const double change = l(i) - camera.parameters(i);
    if (std::abs(change) > zoomed_sigmas * sigma(i)) zoom = std::max(zoom, std::abs(change) / camera.parameters(i));
  }
  const bool corners_lost = given.corners_used < most_corners * check.refined.corners_used;
  const double given_px = given.rms_px, refined_px = check.refined.rms_px;
  std::optional<LensContradiction> found;
  if ((given_px > clearly_more * refined_px && given_px > refined_px + little_px) || corners_lost) {
    found = LensContradiction{.given_px = corners_lost ? median_residual(given) : given_px, .refined_px = refined_px};
  } else if (zoom > zoomed_by) {
    found = LensContradiction{.is_by_focal_length = true,
                              .focal_px = l(0),
                              .focal_sigma_px = sigma(0),
                              .given_focal_px = camera.parameters(0)};
  }
  if (!found) return check;
  const RayUncertainty rays = ray_uncertainty(check.refined, 0);
  found->covered = static_cast<double>(std::ranges::count(rays.covered, true)) / ImageStations::count;
  const double bar = determine_motion(views) ? clearly_other_moving : clearly_other;
  const double differs_px = difference(camera, check.refined.cameras.front(), rays.covered).image_px;
  const bool is_better_known = differs_px > bar * rays.image_px;
  (is_better_known || is_hopeless(found->given_px, refined_px) ? check.contradiction : check.too_little) = found;
  return check;
}

}  // namespace huetrack::solver
