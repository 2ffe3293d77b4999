// All cameras of a rig in one world, from a board that was carried through the volume.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/solver/bundle_adjustment.h"
#include "calib/solver/intrinsics.h"
#include "calib/solver/progress.h"
#include "calib/solver/self_check.h"

namespace huetrack::solver {

struct CameraToCalibrate {
  std::string name;
  calib::ImageSize image_size;
  std::optional<calib::CameraModel> model;  // known intrinsics; nullopt: found from this camera's views
  calib::CameraTiming timing{};             // what is known of it
  // How well the model is known, as AdjustedCamera has it; empty: exactly. One of another model is not used.
  Eigen::MatrixXd lens_covariance{};
};

enum class RefineLens {
  // Found from these views: refined with them; given: only where the camera's own views contradict them, or all
  // cameras' views of a board that is carried do.
  automatic,
  yes,
  no,  // as known before, or as found camera by camera
};

struct ExtrinsicsOptions {
  int reference = 0;  // the camera whose frame becomes the world
  RefineLens refine_lens = RefineLens::automatic;
  IntrinsicsOptions intrinsics{};  // for cameras whose model is not known
  AdjustmentOptions adjustment{};
  // Cameras that cannot be calibrated are left out, as long as two are left; otherwise the first of them is an error.
  bool leave_out = false;
  Progress progress{};
};

// Two cameras that saw the board at the same time.
struct CameraPair {
  int a = 0, b = 0;         // a < b
  int shared_sets = 0;      // both saw the board
  int consistent_sets = 0;  // of those compared, the ones that agree on how the cameras stand to one another
  int compared_sets = 0;
  double rms_px = 0;  // of the shared sets after the adjustment, both cameras' used corners
};

// What the joint adjustment did with the lenses.
enum class LensRefinement {
  asked_for,      // refined, all of them
  kept_as_found,  // camera by camera
  kept_as_given,
  refined,        // those that were found here
  given_refined,  // and those that were given, too (AdjustedCamera::lens_prior): they contradict one another (held_px)
  not_synchronised,  // kept: the cameras agree far better with themselves (alone_px) than with one another (noise_px)
};

// Of the image's width: what the rays of a webcam's lens that was given are usually wrong by, rms over the image.
inline constexpr double usual_lens_share = 0.002;

// A lens that was given and stays, against the one that these views would make of it, beginning with what is known of
// it: over the parts of the image where boards were, px.
struct GivenLensCheck {
  double off_px = 0;            // by which the two differ, rms
  double sigma_px = 0;          // how well these views and what was known beforehand tell it (95 %)
  bool has_covariance = false;  // what was known of it was said in its file; otherwise as much as of a usual one
};

// A camera that has no place in the result, and why.
struct LeftOutCamera {
  int camera = 0;  // of those that were given
  std::vector<Reason> why;
};

// Everything is by the cameras that were kept.
struct Extrinsics {
  std::vector<int> kept;  // of the cameras that were given, ascending
  std::vector<LeftOutCamera> left_out;
  Adjustment adjustment;                                         // the world is the reference camera's frame
  std::vector<std::optional<Intrinsics>> lenses;                 // per camera; nullopt: the model was given
  std::vector<std::optional<LensContradiction>> contradictions;  // per camera: of the lens that was given
  // Per camera: its views fit another lens better than the given one, but know it less well: the given one stays.
  std::vector<std::optional<LensContradiction>> kept_against;
  // Per camera: of a lens that was given and stays. That it may be wrong is part of the covariance.
  std::vector<std::optional<GivenLensCheck>> given_lens_checks;
  // The board is not what its file says: Adjustment::warp was found and is accounted for.
  bool board_is_warped = false;
  std::vector<HalvesCheck> halves;  // the covariance is widened by them
  std::optional<MovedWithin> moved_within;
  std::vector<CameraPair> pairs;  // with shared_sets > 0
  LensRefinement refinement = LensRefinement::kept_as_given;
  double held_px = 0;   // given_refined: the noise with the lenses as they were given
  double alone_px = 0;  // noise of the corners, as each camera by itself shows it; 0: not known
};

// views: BoardView::set is the moment. throws CalibrationError: a camera without enough views, cameras that share too
// few views (names them), cameras whose views contradict one another (mirrored images, different boards, not at the
// same time).
Extrinsics calibrate_extrinsics(const board::Board& board, const std::vector<CameraToCalibrate>& cameras,
                                const std::vector<BoardView>& views, const ExtrinsicsOptions& options = {});

// Where the boards are for cameras that are known: a start for adjust(), all cameras held. Views of symmetric boards
// are renumbered so that those of one set agree. views: BoardView::camera indexes cameras.
Adjustment place_boards(const board::Board& board, const calib::CameraRig& cameras,
                        const std::vector<BoardView>& views);

// made_by is empty. Timing is as it was given, but for what views of a board that moved determine better.
calib::CameraRig rig_of(const Adjustment& adjustment);

// Stamps that scatter by more than this (Adjustment::stamp_sigma_s) say when a program fetched a picture. Drivers' own
// are within a millisecond.
inline constexpr double worst_stamps_of_camera_s = 0.005;
// Whether the views told a time of a camera's: it is known ten times better, at least, than beforehand, and by stamps
// that are the camera's.
bool is_determined(const Adjustment& adjustment, const AdjustedTime& time);

}  // namespace huetrack::solver
