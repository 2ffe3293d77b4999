// Poses of all cameras in one world, from views of a board that was carried through the volume.
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
  std::optional<calib::CameraModel> model;  // given intrinsics; nullopt: estimated from this camera's views
  calib::CameraTiming timing{};             // prior
  // As AdjustedCamera::lens_covariance, of `model`; empty: exact.
  Eigen::MatrixXd lens_covariance{};
};

enum class RefineLens {
  // Estimated lenses: yes. Given lenses: only where this camera's views, or all views of a moving board, contradict
  // them.
  automatic,
  yes,
  no,  // as given, or as estimated camera by camera
};

struct ExtrinsicsOptions {
  int reference = 0;  // its frame becomes the world
  RefineLens refine_lens = RefineLens::automatic;
  IntrinsicsOptions intrinsics{};  // of cameras without a given model
  AdjustmentOptions adjustment{};
  // Leave out cameras that cannot be calibrated, while two remain; otherwise they are errors.
  bool leave_out = false;
  Progress progress{};
};

struct CameraPair {
  int a = 0, b = 0;         // a < b
  int shared_sets = 0;      // both saw the board
  int consistent_sets = 0;  // of compared_sets, those that agree on the relative pose
  int compared_sets = 0;
  double rms_px = 0;  // of the shared sets after the adjustment, used corners of both cameras
};

// Treatment of the lenses in the joint adjustment.
enum class LensRefinement {
  asked_for,      // all refined
  kept_as_found,  // as estimated camera by camera
  kept_as_given,
  refined,           // the estimated ones
  given_refined,     // the given ones, too (AdjustedCamera::lens_prior): they contradict one another (held_px)
  not_synchronised,  // kept: single cameras fit far better (alone_px) than all together (noise_px)
};

// Usual rms ray error over the image of a given webcam lens, as a share of the image's width.
inline constexpr double usual_lens_share = 0.002;

// A given lens that is kept, compared with its refinement by these views; over the covered part of the image, px.
struct GivenLensCheck {
  double off_px = 0;            // rms difference
  double sigma_px = 0;          // of the refined lens, 95 %
  bool has_covariance = false;  // its file has one; otherwise usual_lens_share
};

struct LeftOutCamera {
  int camera = 0;  // index of the input
  std::vector<Reason> why;
};

// Vectors per camera are indexed by the kept cameras.
struct Extrinsics {
  std::vector<int> kept;  // indices of the input, ascending
  std::vector<LeftOutCamera> left_out;
  Adjustment adjustment;                                         // world: the reference camera's frame
  std::vector<std::optional<Intrinsics>> lenses;                 // nullopt: the model was given
  std::vector<std::optional<LensContradiction>> contradictions;  // of a given lens
  // Its views fit another lens better than the given one, but determine it less well: the given one is kept.
  std::vector<std::optional<LensContradiction>> kept_against;
  // Of given lenses that are kept; the covariance includes their errors.
  std::vector<std::optional<GivenLensCheck>> given_lens_checks;
  // The board deviates from its file: Adjustment::warp was estimated.
  bool board_is_warped = false;
  std::vector<HalvesCheck> halves;  // have widened the covariance
  std::optional<MovedWithin> moved_within;
  std::vector<CameraPair> pairs;  // with shared_sets > 0
  LensRefinement refinement = LensRefinement::kept_as_given;
  double held_px = 0;   // given_refined: noise with the given lenses
  double alone_px = 0;  // noise of single cameras by themselves; 0: not known
};

// views: views of one BoardView::set are simultaneous. throws CalibrationError: too few views, no overlap, or
// contradicting views (mirrored images, different boards, not simultaneous), with the cameras' names.
Extrinsics calibrate_extrinsics(const board::Board& board, const std::vector<CameraToCalibrate>& cameras,
                                const std::vector<BoardView>& views, const ExtrinsicsOptions& options = {});

// Board poses for known cameras: a start for adjust(), all cameras held. Views of symmetric boards are renumbered
// consistently within each set. views: BoardView::camera indexes `cameras`.
Adjustment place_boards(const board::Board& board, const calib::CameraRig& cameras,
                        const std::vector<BoardView>& views);

// made_by is empty. Timing as given, except what is_determined().
calib::CameraRig rig_of(const Adjustment& adjustment);

// Stamps with a larger Adjustment::stamp_sigma_s are those of a program that fetched the image. Drivers' stamps: 1 ms.
inline constexpr double worst_stamps_of_camera_s = 0.005;
// Whether a time was estimated: its sigma is at most a tenth of the prior's, and the stamps are the driver's.
bool is_determined(const Adjustment& adjustment, const AdjustedTime& time);

}  // namespace huetrack::solver
