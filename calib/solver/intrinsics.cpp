#include "calib/solver/intrinsics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "calib/model/median.h"

namespace huetrack::solver {
namespace {

double median_residual(const Adjustment& a) {
  std::vector<double> lengths;
  for (const ViewFit& fit : a.fits) {
    for (const auto& r : fit.residuals) lengths.push_back(r.norm());
  }
  return calib::median(std::move(lengths), std::numeric_limits<double>::infinity());
}

// One camera, the views each in their own set, numbered from 0, with the best board pose for these intrinsics.
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

// From nothing: tries focal lengths from wide to tele, and keeps what fits best.
AdjustedCamera find_start(const board::Board& board, const AdjustedCamera& camera,
                          const std::vector<BoardView>& views) {
  const bool fisheye = camera.lens == LensModel::fisheye;
  const auto some = spread_over(views, 12);
  const double size = std::max(camera.image_size.width, camera.image_size.height);
  // Board poses alone tell the plausible focal lengths; a short adjustment tells the best of them.
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
      // Once more with the poses that suit this lens: the first ones may be the mirrored twins.
      fit = adjust(posed(board, fit.cameras.front(), some), {.max_iterations = 25, .with_covariance = false});
      const LensParameters& l = fit.cameras.front().parameters;
      const bool sane = l(0) > 0.05 * size && l(1) > 0.05 * size && l(0) < 50 * size && l(1) < 50 * size;
      if (const double middle = median_residual(fit); sane && middle < least) {
        least = middle;
        best = fit.cameras.front();
      }
    } catch (const CalibrationError&) {  // this start leads nowhere; another may
    }
  }
  if (!std::isfinite(least)) {
    throw CalibrationError(
        "camera " + camera.name +
        ": no lens fits the views of the board: are all images of this camera, and not cropped or zoomed?");
  }
  best.lens = camera.lens;
  return best;
}

// Mean squared reprojection error of every view, each under a lens that was fitted to other views.
std::vector<double> held_out_errors(const board::Board& board, const AdjustedCamera& camera,
                                    const std::vector<BoardView>& views) {
  constexpr std::size_t folds = 5;
  std::vector<double> errors(views.size());
  for (std::size_t fold = 0; fold < folds; ++fold) {
    std::vector<BoardView> training;
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (v % folds != fold) training.push_back(views[v]);
    }
    const Adjustment fit = adjust(posed(board, camera, training),
                                  {.find_outliers = false, .max_iterations = 50, .with_covariance = false});
    for (std::size_t v = fold; v < views.size(); v += folds) {
      const auto poses = board_poses(board, views[v], camera.lens, fit.cameras.front().parameters);
      errors[v] = poses.empty() ? 1e6 : poses.front().rms_px * poses.front().rms_px;
    }
  }
  return errors;
}

// The rational model can hide a pole behind a zero, and fit noise with the ripple that they leave.
bool is_smooth(const AdjustedCamera& camera) {
  if (camera.lens != LensModel::radtan8) return true;
  const LensParameters& l = camera.parameters;
  const auto corner = camera.model().ray({{0, 0}});
  if (!corner || corner->z() <= 0) return false;
  const double end = corner->head<2>().squaredNorm() / (corner->z() * corner->z());
  for (int i = 1; i <= 32; ++i) {
    const double s = end * i / 32;
    const double n = 1 + s * (l(4) + s * (l(5) + s * l(8))), d = 1 + s * (l(9) + s * (l(10) + s * l(11)));
    if (n < 0.2 || d < 0.2 || n > 20 || d > 20) return false;
  }
  return true;
}

// What a trial is judged by, beside the lens that was fitted.
struct TrialFit {
  LensTrial trial;
  Adjustment fit;
};

// Fits one lens model, kept from folding inside the image. throws CalibrationError
TrialFit try_lens(const board::Board& board, AdjustedCamera start, const std::vector<BoardView>& views,
                  const AdjustmentOptions& options) {
  start.unfold = 0;
  Adjustment fit = adjust(posed(board, start, views), options);
  // Again with the board poses that suit this lens.
  fit = adjust(posed(board, fit.cameras.front(), views), options);
  const auto folds = [&] { return !covers_image(fit.cameras.front().model(), fit.cameras.front().image_size); };
  const double free_rms = fit.rms_px;
  for (const double weight : {1.0, 10.0, 100.0, 100.0, 1000.0}) {
    if (!folds()) break;
    fit.cameras.front().unfold = weight;
    fit = adjust(std::move(fit), options);
  }
  constexpr double as_well = 1.01;  // as without the constraint, but for what the last iterations leave
  LensTrial trial{start.lens, true, LensFault::none, fit.rms_px, 0, {}};
  trial.fault = folds()                           ? LensFault::folds
                : fit.rms_px > as_well * free_rms ? LensFault::fits_folded
                : !is_smooth(fit.cameras.front()) ? LensFault::cancels
                                                  : LensFault::none;
  return {trial, std::move(fit)};
}

// The fit that leaves the least, of the trials that are possible; their count: none is.
std::size_t closest_fit(const std::vector<LensTrial>& trials, const std::vector<Adjustment>& fits) {
  std::size_t best = fits.size();
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (!trials[i].possible) continue;
    if (best == fits.size() || median_residual(fits[i]) < median_residual(fits[best])) best = i;
  }
  return best;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// By more than a standard error of the views' differences. errors: squared, beside one another.
bool is_clearly_worse(const std::vector<double>& errors, const std::vector<double>& than) {
  const auto n = static_cast<double>(errors.size());
  double sum = 0, squares = 0;
  for (std::size_t v = 0; v < errors.size(); ++v) {
    const double worse = errors[v] - than[v];
    sum += worse;
    squares += worse * worse;
  }
  const double difference = sum / n;
  const double standard_error = std::sqrt(std::max(0.0, squares / n - difference * difference) / (n - 1));
  return !(difference < standard_error);
}

using TellLens = std::function<void(const char* step, LensModel lens)>;

// Chooses among the trials by cross-validation, on the corners that the best fitting model calls good: a model that is
// too simple must not hide behind calling the image's corners outliers. Sets choice, chosen, best, compared_views.
void choose_lens(Intrinsics& result, const board::Board& board, const std::string& camera,
                 const std::vector<Adjustment>& fits, const TellLens& tell) {
  std::vector<LensTrial>& trials = result.trials;
  const std::size_t closest = closest_fit(trials, fits);
  if (closest == fits.size())
    throw CalibrationError("camera " + camera + ": no lens model fits the views: " + fault_text(trials.front()));
  constexpr std::size_t most_views = 60, least_views = 8;
  const auto good = spread_over(inliers(fits[closest]), most_views);
  result.compared_views = good.size();
  if (good.size() < least_views) {
    result.choice = LensChoice::too_few_views;
    result.chosen = result.best = trials.front().possible ? 0 : closest;
    return;
  }
  std::vector<std::vector<double>> errors(fits.size());
  std::size_t best = fits.size();
  for (std::size_t i = 0; i < fits.size(); ++i) {
    tell("trying views that it was not fitted to: ", trials[i].lens);
    if (!trials[i].possible) continue;
    try {
      errors[i] = held_out_errors(board, fits[i].cameras.front(), good);
    } catch (const CalibrationError& error) {
      trials[i].possible = false;
      trials[i].fault = LensFault::unsolved;
      trials[i].error = error.what();
      continue;
    }
    trials[i].held_out_px = std::sqrt(mean(errors[i]));
    if (best == fits.size() || mean(errors[i]) < mean(errors[best])) best = i;
  }
  if (best == fits.size())
    throw CalibrationError("camera " + camera + ": no lens model can be fitted to four fifths of the views");
  // The simplest model that is not clearly worse, or worse by less than one in a hundred.
  result.chosen = result.best = best;
  for (std::size_t i = 0; i < best; ++i) {
    if (!trials[i].possible) continue;
    if (!is_clearly_worse(errors[i], errors[best]) || trials[i].held_out_px < 1.01 * trials[best].held_out_px) {
      result.chosen = i;
      break;
    }
  }
  result.choice = result.chosen == best ? LensChoice::best : LensChoice::simpler;
}

}  // namespace

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

std::string fault_text(const LensTrial& trial) {
  switch (trial.fault) {
    case LensFault::none:
      return {};
    case LensFault::folds:
      return "its distortion turns back on itself inside the image";
    case LensFault::fits_folded:
      return "kept from turning back on itself inside the image it does not fit the views";
    case LensFault::cancels:
      return "its coefficients cancel one another: the views do not determine them";
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
                           std::to_string(options.min_views) +
                           " are needed, some 15 with the board tilted and in all parts of the image are good");
  }
  std::vector<LensModel> candidates(all_lens_models.begin(), all_lens_models.end());
  if (options.lens) candidates = {*options.lens};
  const bool is_only = candidates.size() == 1;

  int done = 0;
  const TellLens tell = [&](const char* step, LensModel lens) {
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
  for (const LensModel lens : candidates) {
    tell("fitting ", lens);
    camera.lens = lens;
    TrialFit tried;
    tried.trial.lens = lens;
    try {
      // The pinhole models start from one another.
      const bool has_start = lens != LensModel::fisheye && !fits.empty() && !fits.back().cameras.empty();
      AdjustedCamera start = has_start ? fits.back().cameras.front() : find_start(board, camera, views);
      start.lens = lens;
      tried = try_lens(board, std::move(start), views, options.adjustment);
      tried.trial.possible = tried.trial.fault == LensFault::none || is_only;
    } catch (const CalibrationError& error) {
      if (is_only) throw;
      tried.trial.possible = false;
      tried.trial.fault = LensFault::unsolved;
      tried.trial.error = error.what();
    }
    result.trials.push_back(tried.trial);
    fits.push_back(std::move(tried.fit));
  }
  if (!options.lens) choose_lens(result, board, name, fits, tell);
  result.adjustment = std::move(fits[result.chosen]);
  return result;
}

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
    if (std::abs(change) > 4 * sigma(i)) zoom = std::max(zoom, std::abs(change) / camera.parameters(i));
  }
  const bool corners_lost = given.corners_used < 0.8 * check.refined.corners_used;
  // A tenth of a pixel is no reason to throw away a lens that was calibrated with more views than these.
  constexpr double little_px = 0.1;
  const double given_px = given.rms_px, refined_px = check.refined.rms_px;
  if ((given_px > 1.3 * refined_px && given_px > refined_px + little_px) || corners_lost) {
    check.contradiction =
        LensContradiction{.given_px = corners_lost ? median_residual(given) : given_px, .refined_px = refined_px};
  } else if (zoom > 0.01) {
    check.contradiction = LensContradiction{.is_by_focal_length = true,
                                            .focal_px = l(0),
                                            .focal_sigma_px = sigma(0),
                                            .given_focal_px = camera.parameters(0)};
  }
  return check;
}

}  // namespace huetrack::solver
