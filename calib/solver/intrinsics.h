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

  // Log of the marginal likelihood under the prior of lenses (model/usual_lens.h), up to a constant that all trials
  // share.
  double log_evidence = 0;
  std::vector<Reason> error;  // LensFault::unsolved: of the adjustment
};

// In words; empty: LensFault::none.
std::vector<Reason> reasons_of(const LensTrial& trial);

// So much more log evidence must speak for radtan5 than for radtan4, for a fisheye than for radtan5, and for radtan8 or
// a stereographic lens than for a fisheye: "very strong" by Kass and Raftery (1995), 2 ln B > 10. Nearly every webcam
// is calibrated with the first two, and what reads rigs knows the last ones least.
inline constexpr double clearly_more_evidence = 5;

struct Intrinsics {
  Adjustment adjustment;          // of one camera, which is the world
  std::vector<LensTrial> trials;  // one: that was asked for
  std::size_t chosen = 0;         // of trials
};

// Where radtan4 and radtan5 were tried: probability that k3 is not 0, by the evidence alone. Otherwise 0.
double probability_of_k3(const Intrinsics& lens);

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
