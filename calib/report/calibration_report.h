// Report on a calibration: figures, checks and a verdict, as text and HTML. The reprojection error alone is not enough:
// it is also small if all boards were parallel to the image, or none reached its edges.
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

// Reads the report: a user at a terminal, or of the page, where options of a command mean nothing.
enum class Reader : std::uint8_t { terminal, page };

enum class Verdict : std::uint8_t { usable, doubtful, failed };
std::string_view name(Verdict verdict);  // "usable", "doubtful", "failed"

// The result of one check.
struct Check {
  Verdict verdict = Verdict::usable;
  std::string name;     // "coverage of left"
  std::string finding;  // one sentence, with the figure
  std::string advice;   // what to do; empty when usable
};

// Cells of an image: columns x rows, row by row; those of solver::ImageStations.
struct ImageGrid {
  static constexpr int columns = solver::ImageStations::columns, rows = solver::ImageStations::rows;
  std::array<int, 48> corners{};                    // used, in this cell
  std::array<int, 48> left_out{};                   // outliers of used views
  std::array<Eigen::Vector2d, 48> mean_residual{};  // measured minus projected, pixels; zero without corners
};

struct CameraReport {
  std::string name;
  calib::ImageSize image_size;
  solver::LensModel lens = solver::LensModel::radtan5;
  solver::LensParameters parameters = solver::LensParameters::Zero();
  solver::LensParameters sigma = solver::LensParameters::Zero();  // 0: exact
  bool lens_was_found = false;                                    // by this calibration, not given
  std::string lens_reason;                                        // of the choice of model; empty if given
  std::string timing;  // latency and readout, if a moving board determined them
  std::vector<solver::LensTrial> trials;
  // Images, images with a detected board, and images with motion blur too strong for detection; 0 images: unknown.
  int pictures = 0, boards = 0, motion_blurred = 0;
  int views_used = 0, corners_used = 0;
  int corners_left_out = 0, left_out_at_edge = 0;  // of used views; at_edge: in the outermost cells
  int distinct_views = 0;                          // of views_used, without repetitions of the same board pose
  double rms_px = 0;
  double worst_view_rms_px = 0;
  std::string worst_view;
  ImageGrid grid;
  double coverage = 0;             // share of cells with corners
  std::vector<double> tilt_deg;    // per used view: of the board against the line of sight
  std::vector<double> distance_m;  // per used view: of the board's centre
  solver::RayUncertainty rays;     // uncertainty of its pixels' directions
  // Standard deviation of the edges' blur, median over the views, 0: unknown; number of views with far more blur; noise
  // of its corners relative to most cameras.
  double blur_px = 0;
  int blurred_views = 0;
  double relative_noise = 1;
  double pattern_px = 0;                             // rms of the systematic residual over the cells
  std::optional<calib::Rigid3d> cam_from_world;      // nullopt: a lens alone
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // in the world, metres
  // Norm of the standard deviations along three axes, in a world aligned with the volume.
  double centre_sigma_m = 0, rotation_sigma_rad = 0;
};

struct PairReport {
  int a = 0, b = 0;
  int shared_sets = 0;
  double rms_px = 0;
  double distance_m = 0, distance_sigma_m = 0;  // between the cameras' centres, for a tape measure
};

// A camera without a result, and why.
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
  std::vector<std::pair<std::string, std::string>> made_of;  // board, inputs, options
  std::string board;
  std::vector<CameraReport> cameras;
  std::vector<PairReport> pairs;
  std::vector<DroppedView> dropped;
  std::vector<CameraLeftOut> left_out;
  std::vector<Check> checks;  // all, the worst first
  Verdict verdict = Verdict::usable;
  double rms_px = 0, noise_px = 0;
  int sets = 0;
  std::string lens_reason;  // of extrinsics: whether and why the lenses were refined
  std::optional<solver::VolumeAccuracy> volume;
  std::vector<std::pair<int, Eigen::Vector3d>> board_centres;  // (set, world), for the plan
  std::vector<solver::BoardView> shown;                        // views to show with an image, and their residuals
  std::vector<solver::ViewFit> shown_fits;
};

// Input besides the result.
struct ReportInput {
  struct CameraTally {
    int pictures = 0, boards = 0, motion_blurred = 0;
  };
  std::vector<CameraTally> cameras;        // one per camera of the result; may be empty
  std::vector<std::string> warnings;       // damaged files; each makes the result doubtful
  std::string board_doubt{};               // contradiction between images and board file; may be empty
  std::vector<CameraLeftOut> left_out{};   // cameras without a result
  std::optional<solver::WorldBox> volume;  // nullopt: the volume of the board's places
  std::vector<std::pair<std::string, std::string>> made_of;
  Reader reader = Reader::terminal;
};

CalibrationReport report_on(const solver::Intrinsics& result, const ReportInput& input);
CalibrationReport report_on(const solver::Extrinsics& result, const ReportInput& input);

std::string to_text(const CalibrationReport& report);
// One clause: accuracy, and the worst check with its advice.
std::string summary(const CalibrationReport& report);
bool begins_a_report(std::string_view text);  // whether a text begins like to_text()

// An image for the report: JPEG, `scale` times the size that the corners refer to. nullptr: none.
struct EmbeddedPicture {
  std::vector<std::uint8_t> jpeg;
  double scale = 1;
};
std::string data_uri(const std::vector<std::uint8_t>& jpeg);  // "data:image/jpeg;base64,..."
using PictureOf = std::function<const EmbeddedPicture*(int camera, const std::string& image)>;

// A self-contained file.
std::string to_html(const CalibrationReport& report, const PictureOf& picture_of = {});

}  // namespace huetrack::report
