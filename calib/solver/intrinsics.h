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
  folds,        // its distortion turns back on itself inside the image
  fits_folded,  // only so does it fit the views: kept from folding it does not
  cancels,      // its coefficients cancel one another: the views do not determine them
  unsolved,     // the adjustment failed
};

// How well one lens model does.
struct LensTrial {
  LensModel lens = LensModel::radtan4;
  bool possible = true;  // false: for its fault it cannot be chosen
  LensFault fault = LensFault::none;
  double rms_px = 0;       // of the views that it was fitted to
  double held_out_px = 0;  // of views that it was not fitted to (cross-validation over the views); 0: not tried
  std::string error;       // LensFault::unsolved: what the adjustment said
};

// One clause; empty: LensFault::none.
std::string fault_text(const LensTrial& trial);

// Why a lens model was taken.
enum class LensChoice {
  asked_for,
  too_few_views,  // to tell models apart: the simplest one that is possible
  best,           // it predicts views that it was not fitted to best
  simpler,        // it predicts them as well as the best one, and is simpler
};

struct Intrinsics {
  Adjustment adjustment;          // with one camera, which is the world
  std::vector<LensTrial> trials;  // those that were tried
  LensChoice choice = LensChoice::asked_for;
  std::size_t chosen = 0, best = 0;  // of trials; best: at views that it was not fitted to
  std::size_t compared_views = 0;    // that models were, or were to be, told apart by; asked_for: 0
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
};

// Whether a camera's own views bear out a lens that was known before. It takes no other camera, so it holds for cameras
// that are not in step.
struct LensCheck {
  std::optional<LensContradiction> contradiction;  // nullopt: they bear it out
  Adjustment refined;                              // with a lens that is fitted to the views, of the same model
};
LensCheck check_lens(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views);

// Whether a lens covers its whole image: every pixel at the image's border has a ray.
bool covers_image(const calib::CameraModel& model, calib::ImageSize size);

}  // namespace huetrack::solver
