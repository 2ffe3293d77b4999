#include "calib/solver/intrinsics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

namespace huetrack::solver {
namespace {

std::string text_of(const char* format, auto... values) {
  std::array<char, 256> text;
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

double median_residual(const Adjustment& a) {
  std::vector<double> lengths;
  for (const ViewFit& fit : a.fits) {
    for (const auto& r : fit.residuals) lengths.push_back(r.norm());
  }
  if (lengths.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
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

// The views without the corners that the adjustment left out.
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
  AdjustedCamera camera;
  camera.name = name;
  camera.image_size = image_size;

  int done = 0;
  const auto tell = [&](const char* step, LensModel lens) {
    if (options.progress) {
      options.progress(step + std::string(solver::name(lens)), done, static_cast<int>(2 * candidates.size()));
    }
    ++done;
  };

  Intrinsics result;
  std::vector<Adjustment> fits;
  AdjustedCamera pinhole_start;
  for (const LensModel lens : candidates) {
    tell("fitting ", lens);
    camera.lens = lens;
    LensTrial trial{lens, true, 0, 0, {}};
    Adjustment fit;
    try {
      // The pinhole models start from one another.
      AdjustedCamera start =
          lens != LensModel::fisheye && !fits.empty() ? fits.back().cameras.front() : find_start(board, camera, views);
      start.lens = lens;
      start.unfold = 0;
      fit = adjust(posed(board, start, views), options.adjustment);
      // Again with the board poses that suit this lens.
      fit = adjust(posed(board, fit.cameras.front(), views), options.adjustment);
      const double free_rms = fit.rms_px;
      for (const double weight : {1.0, 10.0, 100.0, 100.0, 1000.0}) {
        if (covers_image(fit.cameras.front().model(), image_size)) break;
        fit.cameras.front().unfold = weight;
        fit = adjust(std::move(fit), options.adjustment);
      }
      trial.rms_px = fit.rms_px;
      if (!covers_image(fit.cameras.front().model(), image_size)) {
        trial.note = "its distortion turns back on itself inside the image";
      } else if (fit.rms_px > 1.01 * free_rms) {
        trial.note = "kept from turning back on itself inside the image it does not fit the views";
      } else if (!is_smooth(fit.cameras.front())) {
        trial.note = "its coefficients cancel one another: the views do not determine them";
      }
      trial.possible = trial.note.empty() || candidates.size() == 1;
    } catch (const CalibrationError& error) {
      if (candidates.size() == 1) throw;
      trial.possible = false;
      trial.note = error.what();
    }
    result.trials.push_back(trial);
    fits.push_back(std::move(fit));
  }
  std::size_t chosen = 0;
  if (options.lens) {
    result.lens_reason = std::string(solver::name(*options.lens)) + " was asked for";
  } else {
    // Cross-validation on the corners that the best fitting model calls good: a model that is too simple must not hide
    // behind calling the image's corners outliers.
    std::size_t best = fits.size();
    for (std::size_t i = 0; i < fits.size(); ++i) {
      if (!result.trials[i].possible) continue;
      if (best == fits.size() || median_residual(fits[i]) < median_residual(fits[best])) best = i;
    }
    if (best == fits.size()) {
      throw CalibrationError("camera " + name + ": no lens model fits the views: " + result.trials.front().note);
    }
    const auto good = spread_over(inliers(fits[best]), 60);
    if (good.size() < 8) {
      chosen = result.trials.front().possible ? 0 : best;
      result.lens_reason = text_of("%zu views are too few to tell lens models apart: the simplest one", good.size());
    } else {
      std::vector<std::vector<double>> errors(fits.size());
      std::size_t winner = fits.size();
      const auto mean = [](const std::vector<double>& e) {
        return std::accumulate(e.begin(), e.end(), 0.0) / static_cast<double>(e.size());
      };
      for (std::size_t i = 0; i < fits.size(); ++i) {
        LensTrial& trial = result.trials[i];
        tell("trying views that it was not fitted to: ", trial.lens);
        if (!trial.possible) continue;
        try {
          errors[i] = held_out_errors(board, fits[i].cameras.front(), good);
        } catch (const CalibrationError& error) {
          trial.possible = false;
          trial.note = error.what();
          continue;
        }
        trial.held_out_px = std::sqrt(mean(errors[i]));
        if (winner == fits.size() || mean(errors[i]) < mean(errors[winner])) winner = i;
      }
      if (winner == fits.size())
        throw CalibrationError("camera " + name + ": no lens model can be fitted to four fifths of the views");
      // The simplest model that is not clearly worse: by more than a standard error, and by more than one in a hundred.
      chosen = winner;
      for (std::size_t i = 0; i < winner; ++i) {
        if (!result.trials[i].possible) continue;
        const auto n = static_cast<double>(good.size());
        double sum = 0, squares = 0;
        for (std::size_t v = 0; v < good.size(); ++v) {
          const double worse = errors[i][v] - errors[winner][v];
          sum += worse;
          squares += worse * worse;
        }
        const double difference = sum / n;
        const double standard_error = std::sqrt(std::max(0.0, squares / n - difference * difference) / (n - 1));
        if (difference < standard_error || result.trials[i].held_out_px < 1.01 * result.trials[winner].held_out_px) {
          chosen = i;
          break;
        }
      }
      const LensTrial& c = result.trials[chosen];
      const LensTrial& w = result.trials[winner];
      result.lens_reason =
          chosen == winner
              ? text_of("%s predicts views that it was not fitted to best (%.3f px)", solver::name(c.lens).data(),
                        c.held_out_px)
              : text_of("%s predicts views that it was not fitted to as well (%.3f px) as %s (%.3f px), and is simpler",
                        solver::name(c.lens).data(), c.held_out_px, solver::name(w.lens).data(), w.held_out_px);
    }
  }
  result.adjustment = std::move(fits[chosen]);
  return result;
}

LensCheck check_lens(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views) {
  AdjustedCamera trial = camera;
  trial.lens_is_free = false;
  const AdjustmentOptions options{.with_covariance = false};
  LensCheck check;
  Adjustment given = adjust(posed(board, trial, views), options);
  check.given_px = given.rms_px;
  given.cameras.front().lens_is_free = true;
  check.refined = adjust(posed(board, given.cameras.front(), views));
  check.refined_px = check.refined.rms_px;
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
  if ((check.given_px > 1.3 * check.refined_px && check.given_px > check.refined_px + little_px) || corners_lost) {
    check.contradiction =
        text_of("the lens that was given for camera %s leaves %.2f px, one fitted to its views %.2f px",
                camera.name.c_str(), corners_lost ? median_residual(given) : check.given_px, check.refined_px);
  } else if (zoom > 0.01) {
    check.contradiction =
        text_of("the views of camera %s say that its focal length is %.1f px (+- %.1f), not %.1f px as given",
                camera.name.c_str(), l(0), sigma(0), camera.parameters(0));
  }
  return check;
}

}  // namespace huetrack::solver
