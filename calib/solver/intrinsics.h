// One camera's lens from views of a board.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/progress.h"

namespace huetrack::solver {

struct IntrinsicsOptions {
  // The lens model to use; nullopt: the simplest one that the views support.
  std::optional<LensModel> lens{};
  int min_views = 4;  // >= 3
  AdjustmentOptions adjustment{};
  Progress progress{};
};

// What is wrong with a lens as it was fitted.
enum class LensFault {
  none,
  folds,        // its distortion turns back on itself, or has a pole, inside the image
  fits_folded,  // only so does it fit the views: kept from folding it does not
  far_off,      // on some of the views it leaves far more than another model: it was not tried any further
  unsolved,     // the adjustment failed
};

// How well one lens model does.
struct LensTrial {
  LensModel lens = LensModel::radtan4;
  bool possible = true;  // false: for its fault it cannot be chosen
  LensFault fault = LensFault::none;
  double rms_px = 0;  // of the corners that it was fitted to
  int left_out = 0;   // corners that do not fit it, and were not used
  // Of views that it was not fitted to (cross-validation over the views), wherever in the image their corners are: only
  // those that no model fits are left out, and every part of the image counts the same. Robustly: a corner that is off
  // by more than three standard deviations counts linearly. 0: not tried
  double held_out_px = 0;
  std::vector<Reason> error;  // LensFault::unsolved: what the adjustment said
};

// What is wrong with it; empty: LensFault::none.
std::vector<Reason> reasons_of(const LensTrial& trial);

// Why a lens model was taken.
enum class LensChoice {
  asked_for,
  too_few_views,  // to tell models apart: the simplest one that is possible
  best,           // it predicts views that it was not fitted to best
  simpler,        // it predicts them as well as the best one, and is simpler
  closer,         // it predicts them as well as the best one, and fits all corners better
  together,       // it fits what all cameras saw better than what this camera's own views spoke for (`alone`)
};

struct Intrinsics {
  Adjustment adjustment;          // with one camera, which is the world
  std::vector<LensTrial> trials;  // those that were tried
  LensChoice choice = LensChoice::asked_for;
  std::size_t chosen = 0, best = 0;  // of trials; best: at views that it was not fitted to
  // Of trials: beside the chosen one these views speak for it most: it fits them nearly as closely, or predicts best.
  // Other cameras' views may tell the two apart. nullopt: none does.
  std::optional<std::size_t> rival;
  std::size_t alone = 0;           // LensChoice::together: of trials, what was chosen before
  std::size_t compared_views = 0;  // that models were, or were to be, told apart by; asked_for: 0
};

// views: of this camera (BoardView::camera 0), every one in its own set. start: nullopt: found from the views.
// throws CalibrationError: too few views, or views that do not determine a lens (all fronto-parallel, say).
Intrinsics calibrate_intrinsics(const board::Board& board, const std::string& camera, calib::ImageSize image_size,
                                const std::vector<BoardView>& views, const IntrinsicsOptions& options = {});

// What a camera's own views say against a lens that was known before.
struct LensContradiction {
  bool is_by_focal_length = false;          // otherwise by how the lens fits
  double given_px = 0, refined_px = 0;      // by the fit: what the given lens leaves, and one fitted to the views
  double focal_px = 0, focal_sigma_px = 0;  // by the focal length (fx): as these views say, and
  double given_focal_px = 0;                // as it was given
  double covered = 0;                       // share of the image that the views cover
};

// Whether a camera's own views bear out a lens that was known before. It takes no other camera, so it holds for cameras
// that are not in step. A lens that was given was found from more views than these, and all over its image: one that is
// fitted here takes its place only if it is better known, over the whole image, than the two differ; and where the
// board moves before a camera that reads its rows one after the other, by much: those views bend any lens.
struct LensCheck {
  std::optional<LensContradiction> contradiction;  // nullopt: they bear it out, or cannot tell a better one
  // They fit another lens better, but leave more open of it than it differs from the given one: which stays.
  std::optional<LensContradiction> too_little;
  Adjustment refined;  // with a lens that is fitted to the views, of the same model
};
LensCheck check_lens(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views);

// The lens of another model that is nearest to this camera's.
AdjustedCamera start_like(const AdjustedCamera& fitted, LensModel lens);

// Whether a lens is one as it stands: it covers its whole image, and hides no pole.
bool is_sound(const AdjustedCamera& camera);

// Whether a lens covers its whole image: every pixel at the image's border has a ray.
bool covers_image(const calib::CameraModel& model, calib::ImageSize size);

}  // namespace huetrack::solver
