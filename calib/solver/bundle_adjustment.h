// The joint adjustment of cameras, lenses and board poses to the corners that the cameras saw: least squares over the
// reprojection errors (Ceres), with outliers found and left out, and the covariance of everything that was found.
// Deterministic: one thread, and the order of the views does not matter. What cannot be done is a CalibrationError: its
// what() is a fact; what to do about it is said by report::with_advice().
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/model/camera_rig.h"
#include "calib/solver/calibration_error.h"
#include "calib/solver/lens.h"

namespace huetrack::solver {

// One board in one image.
struct BoardView {
  int camera = 0;                   // index into the cameras
  int set = 0;                      // >= 0; the views of one moment have the same board pose
  std::string image;                // for messages: "left07.jpg", "cam0 at 3.20 s"
  std::vector<int> ids;             // ascending; of Board::point()
  std::vector<Eigen::Vector2d> px;  // raw pixels, beside ids
  // The camera's time stamp, freed of jitter, on a clock that all cameras share. nullopt: it has none, as a still.
  std::optional<double> stamp_s{};
  double blur_px{};  // standard deviation of its edges' blur, median over the corners; 0: not known
};

// A time that is adjusted, and what is known of it beforehand.
struct AdjustedTime {
  double value_s = 0;
  double prior_s = 0, prior_sigma_s = 0;  // sigma 0: it is held
  double sigma_s = 0;                     // result: its standard deviation, the prior included
};

// What is known beforehand of a lens that is adjusted.
struct LensPrior {
  LensParameters mean = LensParameters::Zero();
  Eigen::MatrixXd information;  // the inverse of its covariance, parameter_count() square
};

struct AdjustedCamera {
  std::string name;
  calib::ImageSize image_size;
  LensModel lens = LensModel::radtan5;
  LensParameters parameters = LensParameters::Zero();
  calib::Rigid3d cam_from_world;
  bool lens_is_free = true;  // otherwise the intrinsics stay
  // Of an intrinsics that stays: how well it is known, parameter_count() square; empty: exactly. What follows from it
  // is part of the result's covariance.
  Eigen::MatrixXd lens_covariance;
  std::optional<LensPrior> lens_prior;  // of an intrinsics that is free
  // How much noisier its corners are than Adjustment::noise_px: they count that much less. Set by adjust(); 1 unless
  // they are clearly noisier than most cameras', as those of a camera that is out of focus.
  double relative_noise = 1;
  // > 0: keeps the distorted radius growing out to the image's corners, where no board may have been; without it,
  // coefficients that the views hardly determine can fold the image there. The weight of a slope that is too small by
  // 1, in pixels.
  double unfold = 0;
  bool pose_is_free = true;  // otherwise cam_from_world stays; at least one camera's must
  // When its rows are exposed, as in calib::CameraTiming: used, and adjusted, where a board moves. One constant that
  // all latencies have in common cannot be told, so at least one camera's is held.
  AdjustedTime latency, readout;
  // The usual error of its stamps (standard deviation), as it is learnt where a board moves: what is left of jitter;
  // or more, where a program noted when it took a picture that had been waiting for it. 0: not yet known.
  double stamp_sigma_s = 0;
  calib::CameraTiming timing;  // as it was given: rig_of() keeps it where nothing better was found

  calib::CameraModel model() const { return camera_model(lens, parameters); }
};

// How a board moves around the moment of its set: a time tau later, what was its point p is at R(turn) p + shift in its
// own frame at that moment, (turn, shift) = tau course.col(0) + tau^2 / 2 course.col(1).
struct BoardMotion {
  using Course = Eigen::Matrix<double, 6, 2>;  // rotation (rad) and translation (m): per s, and per s^2
  bool is_known = false;                       // from the sets around; otherwise the board rests while it is seen
  double at_s = 0;                             // the moment, on the clock of the stamps less latency
  Course course = Course::Zero();              // adjusted
  // What the sets around say of it, with the inverse of its covariance for each of the six. It does not change while
  // this set's pose is adjusted: a lens or a camera that moves, moves the boards of all sets alike. Held against where
  // the others were, none could follow.
  Course expected = Course::Zero();
  std::array<Eigen::Matrix2d, 6> information{};
};

// How a board is carried, as it is learnt from where it is found to be: rms of the second and third derivative of its
// turning (rad) and of its place (m), each axis.
struct BoardCarrying {
  std::array<double, 2> change{}, jerk{};  // per s^2, per s^3; 0: not yet known
};

// How far a view's corners are off whose greater part contradicts the other views: medians of the residuals' lengths.
struct ViewMisfit {
  double own_px = 0;
  double others_px = 0;  // of the views that are not dropped, and of this one before it is
};

// How one view fits.
struct ViewFit {
  std::vector<Eigen::Vector2d> residuals;  // measured minus projected, pixels, beside BoardView::ids
  std::vector<bool> used;                  // beside ids; false: an outlier
  double rms_px = 0;                       // length of the residuals, over all corners of the view
  double speed_px_s = 0;                   // of its corners, median; 0: the board rests, as far as is known
  std::optional<ViewMisfit> dropped;       // so far off that no corner of it is used; nullopt: some are
};

// How a board is not what its file says: first how far its middle stands out of the plane of its edges, along x and
// along y (a parabola each way), metres; then by what share its x is longer than its y, the mean of both being right.
using BoardWarp = Eigen::Vector3d;

// Before: where to start. After adjust(): what was found.
struct Adjustment {
  board::Board board;
  std::vector<AdjustedCamera> cameras;
  std::vector<BoardView> views;                  // sorted by set, camera, image
  std::vector<calib::Rigid3d> world_from_board;  // per set; only of sets with views
  BoardWarp warp = BoardWarp::Zero();
  bool warp_is_free = false;
  // Per set. Before: empty, and boards rest while they are seen; or as many as there are sets, and where views have
  // stamps and sets follow closely upon one another each view counts at the time of its rows.
  std::vector<BoardMotion> motions;
  BoardCarrying carrying;
  double stamp_sigma_s = 0;           // of all cameras (rms of AdjustedCamera::stamp_sigma_s)
  std::vector<double> stamp_error_s;  // beside views, what is added to the stamp; empty without motions

  // Results.
  std::vector<ViewFit> fits;  // beside views
  double noise_px = 0;        // standard deviation of a corner per axis, estimated from the residuals
  double rms_px = 0;          // length of the residuals of all used corners
  int corners_used = 0;
  // Of all camera parameters that are not exactly known, in the order of `cameras`: first those of its lens
  // (parameter_count() of them), then those of its pose: rotation (radians) and translation (metres) in the camera's
  // frame, so that cam_from_world_true = exp(error) * cam_from_world; after all cameras', where boards move, each
  // camera's latency and readout. Scaled by the noise, and widened where the scatter between sets says that errors
  // within a set are not independent.
  Eigen::MatrixXd covariance;
  std::vector<int> lens_offset;  // into covariance, per camera; -1: not in it
  std::vector<int> pose_offset;
  std::vector<int> time_offset;              // of its latency and readout
  BoardWarp warp_sigma = BoardWarp::Zero();  // of a warp that was free

  bool moves(int set) const { return !motions.empty() && motions[static_cast<std::size_t>(set)].is_known; }
  Eigen::Vector3d board_point(int id) const;         // with the warp, board frame
  Eigen::Vector3d centre_sigma(int camera) const;    // std. dev. of the camera's position, its own axes, metres
  Eigen::Vector3d rotation_sigma(int camera) const;  // about its own axes, radians
  LensParameters lens_sigma(int camera) const;       // 0 where exactly known
  double rms_of_camera(int camera) const;            // used corners, pixels
  int views_used(int camera) const;
};

struct AdjustmentOptions {
  // A corner further off than this many standard deviations (robustly estimated) is an outlier, but never one nearer
  // than least_outlier_px.
  double outlier_sigmas = 5;
  double least_outlier_px = 0.5;
  bool find_outliers = true;  // false: every corner counts
  int max_iterations = 100;   // >= 1, of each solution
  bool with_covariance = true;
};

// throws CalibrationError when it cannot be solved (nothing left to use, or numerically hopeless).
Adjustment adjust(Adjustment start, const AdjustmentOptions& options = {});

// Of what was adjusted: the views that were not dropped, each with its used corners.
std::vector<BoardView> inliers(const Adjustment& adjustment);
// Their Adjustment::stamp_error_s, beside them.
std::vector<double> stamp_errors_of_inliers(const Adjustment& adjustment);

// The residuals of every view for the state as it is: fits of `state`, nothing moved, every corner used.
std::vector<ViewFit> evaluate(const Adjustment& state);

// Where a board can be, as one view shows it: the best pose and, where the view hardly tells them apart (planar boards
// seen from afar have a mirrored twin), the second. Best first; empty when there are not enough corners.
struct BoardPose {
  calib::Rigid3d cam_from_board;
  double rms_px = 0;
};
std::vector<BoardPose> board_poses(const board::Board& board, const BoardView& view, LensModel lens,
                                   const LensParameters& parameters);

}  // namespace huetrack::solver
