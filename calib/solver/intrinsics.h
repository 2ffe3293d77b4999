// One camera's lens from views of a board.
#pragma once

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

// How well one lens model does.
struct LensTrial {
  LensModel lens = LensModel::radtan4;
  bool possible = true;    // false: it cannot be fitted, or folds inside the image; see note
  double rms_px = 0;       // of the views that it was fitted to
  double held_out_px = 0;  // of views that it was not fitted to (cross-validation over the views); 0: not tried
  std::string note;        // why it is not possible; otherwise empty
};

struct Intrinsics {
  Adjustment adjustment;          // with one camera, which is the world
  std::vector<LensTrial> trials;  // those that were tried
  std::string lens_reason;        // why this lens model, one sentence
};

// views: of this camera (BoardView::camera 0), every one in its own set. start: nullopt: found from the views.
// throws CalibrationError: too few views, or views that do not determine a lens (all fronto-parallel, say).
Intrinsics calibrate_intrinsics(const board::Board& board, const std::string& camera, calib::ImageSize image_size,
                                const std::vector<BoardView>& views, const IntrinsicsOptions& options = {});

// Whether a camera's own views bear out a lens that was known before. It takes no other camera, so it holds for cameras
// that are not in step.
struct LensCheck {
  double given_px = 0;        // rms with the lens as given, and
  double refined_px = 0;      // with one that is fitted to the views, of the same model
  std::string contradiction;  // one clause; empty: they bear it out
  Adjustment refined;
};
LensCheck check_lens(const board::Board& board, const AdjustedCamera& camera, const std::vector<BoardView>& views);

// Whether a lens covers its whole image: every pixel at the image's border has a ray.
bool covers_image(const calib::CameraModel& model, calib::ImageSize size);

}  // namespace huetrack::solver
