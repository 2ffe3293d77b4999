// What a calibration is worth: figures, checks and a verdict, for people (text, HTML) and for scripts (the verdict).
// Reprojection error alone says little: it is small too when the boards were all held flat, or the lens was never seen
// to its edges.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/solver/extrinsics.h"
#include "calib/solver/ray_uncertainty.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::report {

enum class Verdict : std::uint8_t { usable, doubtful, failed };
std::string_view name(Verdict verdict);  // "usable", "doubtful", "failed"

// One thing that was looked at.
struct Check {
  Verdict verdict = Verdict::usable;
  std::string name;     // "coverage of left"
  std::string finding;  // one sentence, with the figure
  std::string advice;   // what to do; empty when usable
};

// Cells of an image: columns x rows, row by row; those of solver::ImageStations.
struct ImageGrid {
  static constexpr int columns = solver::ImageStations::columns, rows = solver::ImageStations::rows;
  std::array<int, 48> corners{};                    // used ones in the cell
  std::array<int, 48> left_out{};                   // those that do not fit, of views that are used
  std::array<Eigen::Vector2d, 48> mean_residual{};  // measured minus projected, pixels; zero where there is no corner
};

struct CameraReport {
  std::string name;
  calib::ImageSize image_size;
  solver::LensModel lens = solver::LensModel::radtan5;
  solver::LensParameters parameters = solver::LensParameters::Zero();
  solver::LensParameters sigma = solver::LensParameters::Zero();  // 0: taken as exact
  bool lens_was_found = false;                                    // here, rather than given
  std::string lens_reason;                                        // of the choice of model; empty when it was given
  std::string timing;  // latency and readout, where a board that moved told them; otherwise empty
  std::vector<solver::LensTrial> trials;
  // Looked at, with the board found in it, and smeared by motion beyond finding; 0 pictures: not known.
  int pictures = 0, boards = 0, smeared = 0;
  int views_used = 0, corners_used = 0;
  int corners_left_out = 0, left_out_at_edge = 0;  // of used views; at_edge: in the image's outermost cells
  int distinct_views = 0;  // of views_used, without those that show the board at the place of another
  double rms_px = 0;
  double worst_view_rms_px = 0;
  std::string worst_view;
  ImageGrid grid;
  double coverage = 0;             // share of the image's cells with corners in them
  std::vector<double> tilt_deg;    // per used view: of the board, against the line of sight
  std::vector<double> distance_m;  // per used view: of the board's centre
  solver::RayUncertainty rays;     // where its pixels look
  // Standard deviation of its edges' blur, median over its views, 0: not known; how many views are far more blurred
  // than its others; and how much noisier its corners are than those of most cameras.
  double blur_px = 0;
  int blurred_views = 0;
  double relative_noise = 1;
  double pattern_px = 0;                             // rms of what the lens model leaves systematically, over the cells
  std::optional<calib::Rigid3d> cam_from_world;      // nullopt: a lens alone
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // in the world, metres
  // Length of the three axes' standard deviations, in a world that is aligned with the volume.
  double centre_sigma_m = 0, rotation_sigma_rad = 0;
};

struct PairReport {
  int a = 0, b = 0;
  int shared_sets = 0;
  double rms_px = 0;
  double distance_m = 0, distance_sigma_m = 0;  // of the cameras' centres: what a tape measure can check
};

// A camera that has no place in the result, and why.
struct CameraLeftOut {
  std::string name, why;
};

struct DroppedView {
  int camera = 0;
  std::string image;
  std::string why;
};

struct CalibrationReport {
  std::string title;                                         // "extrinsics of left, right"
  std::vector<std::pair<std::string, std::string>> made_of;  // what went in: board, inputs, options
  std::string board;
  std::vector<CameraReport> cameras;
  std::vector<PairReport> pairs;
  std::vector<DroppedView> dropped;
  std::vector<CameraLeftOut> left_out;
  std::vector<Check> checks;  // all of them, the good ones too; the worst first
  Verdict verdict = Verdict::usable;
  double rms_px = 0, noise_px = 0;
  int sets = 0;
  std::string lens_reason;  // of extrinsics: why the lenses were refined, or not
  std::optional<solver::VolumeAccuracy> volume;
  std::vector<std::pair<int, Eigen::Vector3d>> board_centres;  // (set, world), for the plan
  std::vector<solver::BoardView> shown;  // views worth a picture, with their residuals beside them
  std::vector<solver::ViewFit> shown_fits;
};

// What is known besides the result.
struct ReportInput {
  struct CameraTally {
    int pictures = 0, boards = 0, smeared = 0;
  };
  std::vector<CameraTally> cameras;  // beside the result's; may be empty
  std::vector<std::string> warnings;       // damaged files: each a doubt
  std::string board_doubt{};               // what the pictures say against the board file; empty: nothing
  std::vector<CameraLeftOut> left_out{};   // cameras that should have been in it
  std::optional<solver::WorldBox> volume;  // nullopt: where the board was
  std::vector<std::pair<std::string, std::string>> made_of;
};

CalibrationReport report_on(const solver::Intrinsics& result, const ReportInput& input);
CalibrationReport report_on(const solver::Extrinsics& result, const ReportInput& input);

std::string to_text(const CalibrationReport& report);
// In part of a sentence: how good it is, and the worst of what speaks against it with what to do.
std::string summary(const CalibrationReport& report);
bool begins_a_report(std::string_view text);  // whether that is how such a text begins

// A picture as the report shows it: JPEG, `scale` times the size that the corners are in. nullptr: there is none.
struct EmbeddedPicture {
  std::vector<std::uint8_t> jpeg;
  double scale = 1;
};
std::string data_uri(const std::vector<std::uint8_t>& jpeg);  // "data:image/jpeg;base64,..."
using PictureOf = std::function<const EmbeddedPicture*(int camera, const std::string& image)>;

// One file with everything in it.
std::string to_html(const CalibrationReport& report, const PictureOf& picture_of = {});

}  // namespace huetrack::report
