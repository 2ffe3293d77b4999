// Lens of one camera from views of a board.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/progress.h"

namespace huetrack::solver {

struct IntrinsicsOptions {
  // nullopt: the simplest model that the views support.
  std::optional<LensModel> lens{};
  int min_views = 4;  // >= 3
  AdjustmentOptions adjustment{};
  Progress progress{};
};

enum class LensFault {
  none,
  folds,        // distortion not monotonic, or with a pole, inside the image
  fits_folded,  // fits only when it folds
  far_off,      // far larger residuals than another model on a subset of the views; not tried further
  unsolved,     // the adjustment failed
};

struct LensTrial {
  LensModel lens = LensModel::radtan4;
  bool possible = true;  // false: cannot be chosen, see fault
  LensFault fault = LensFault::none;
  double rms_px = 0;  // of the corners it was fitted to
  int left_out = 0;   // outliers

  // Cross-validation over the views: robust rms of held-out views (linear beyond 3 sigma), every part of the image with
  // the same weight; without corners that no model fits. 0: not tried.
  double held_out_px = 0;
  std::vector<Reason> error;  // LensFault::unsolved: of the adjustment
};

// In words; empty: LensFault::none.
std::vector<Reason> reasons_of(const LensTrial& trial);

// Why a lens model was chosen.
enum class LensChoice {
  asked_for,
  too_few_views,  // for cross-validation: the simplest possible one
  best,           // best cross-validation
  simpler,        // as good as the best in cross-validation, and simpler
  closer,         // as good as the best in cross-validation, and fits all corners better
  together,       // fits all cameras' views better than this camera's own choice (`alone`)
};

struct Intrinsics {
  Adjustment adjustment;  // of one camera, which is the world
  std::vector<LensTrial> trials;
  LensChoice choice = LensChoice::asked_for;
  std::size_t chosen = 0, best = 0;  // of trials; best: in cross-validation
  // Runner-up of trials: fits nearly as closely, or predicts best; other cameras' views may decide. nullopt: none.
  std::optional<std::size_t> rival;
  std::size_t alone = 0;           // LensChoice::together: of trials, the former choice
  std::size_t compared_views = 0;  // for cross-validation; asked_for: 0
};

// views: of this camera (BoardView::camera 0), each in its own set. throws CalibrationError: too few views, or views
// that do not determine a lens (all fronto-parallel, for instance).
Intrinsics calibrate_intrinsics(const board::Board& board, const std::string& camera, calib::ImageSize image_size,
                                const std::vector<BoardView>& views, const IntrinsicsOptions& options = {});

// Evidence of a camera's own views against its given lens.
struct LensContradiction {
  bool is_by_focal_length = false;          // otherwise by the residuals
  double given_px = 0, refined_px = 0;      // rms of the given lens, and of one fitted to the views
  double focal_px = 0, focal_sigma_px = 0;  // fx of the fitted lens
  double given_focal_px = 0;
  double covered = 0;  // share of the image
};

// Tests a given lens with its camera's own views; synchronisation does not matter. A given lens usually rests on more
// views: a fitted one contradicts it only if the two differ by more than its own uncertainty over the whole image, and
// by a multiple of it where a board moves before a rolling shutter, which bends any fitted lens.
struct LensCheck {
  std::optional<LensContradiction> contradiction;  // nullopt: consistent, or not significant
  // Another lens fits better, but differs by less than its uncertainty: the given one is kept.
  std::optional<LensContradiction> too_little;
  Adjustment refined;  // the fitted lens, same model
};
LensCheck check_lens(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views);

// Nearest lens of another model.
AdjustedCamera start_like(const AdjustedCamera& fitted, LensModel lens);

// Whether a lens covers its whole image, without a hidden pole.
bool is_sound(const AdjustedCamera& camera);

// Whether every pixel at the image's border has a ray.
bool covers_image(const calib::CameraModel& model, calib::ImageSize size);

}  // namespace huetrack::solver
