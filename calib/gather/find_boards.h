// Detects the board in the images of a source, and selects views for a calibration.
#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "calib/board/board_detector.h"
#include "calib/gather/picture_source.h"
#include "calib/report/calibration_report.h"
#include "calib/solver/bundle_adjustment.h"

namespace huetrack::gather {

struct FindBoardsOptions {
  int every = 0;      // >= 1: process every n-th set; 0: about look_at sets, in pairs if there are time stamps
  int look_at = 800;  // >= 1
  // >= 1; number of sets to keep, spread over time, with the board as still as possible. With time stamps each comes
  // with the set that follows it, which gives the board's motion.
  int max_sets = 150;
  bool progress = true;
  std::filesystem::path page{};  // DetectionPage; empty: none
  // If fewer cameras than this have the board, a camera without it is an error. Default: always an error.
  std::size_t least_cameras = std::numeric_limits<std::size_t>::max() / 2;
};

// Counts of one camera's images.
struct PictureTally {
  std::string name;
  calib::ImageSize image_size;
  int pictures = 0;                    // processed
  int boards = 0;                      // with a detected board
  std::map<std::string, int> why_not;  // how often not, by BoardDetection::why_not, or motion_blur_reason
  int motion_blurred() const;          // number of failures by motion_blur_reason
};

struct FoundBoards {
  board::Board board;  // with the measured diameter of circles if the file has none
  std::vector<PictureTally> cameras;
  std::vector<solver::BoardView> views;  // BoardView::set counts the sets kept, from 0; sorted by set, camera
  std::vector<double> set_at_s;          // per set
  int sets_seen = 0;                     // in the source
  int sets_looked_at = 0;
  int duplicates = 0;                 // sets omitted because the board had not moved
  int thinned = 0;                    // sets omitted because of max_sets
  std::vector<std::string> warnings;  // damaged files
  std::string board_doubt;            // contradiction between images and board file; may be empty
  std::vector<std::pair<std::string, std::string>> without_boards;  // cameras without a detection, and why
  // A small JPEG for every entry of `views`.
  std::vector<report::EmbeddedPicture> thumbnails;
};

// throws InputError: no image, images of one camera with different sizes, `stop`, a camera (least_cameras) without a
// detection, or markers that contradict the board file; the message names the camera and the likely reason.
FoundBoards find_boards(PictureSource& source, const board::BoardDetector& detector, const FindBoardsOptions& options,
                        std::stop_token stop);

// throws InputError if a camera has fewer boards than `least`, with the reason and advice.
void require_views(const FoundBoards& found, int least);

// A set of views, during the selection; in time order.
struct BoardSet {
  double at_s = 0;
  std::vector<solver::BoardView> views;
  std::vector<report::EmbeddedPicture> thumbnails;  // one per view
};

// Median distance of the common corners, pixels; nullopt: none in common.
std::optional<double> moved_px(const solver::BoardView& a, const solver::BoardView& b);

report::EmbeddedPicture thumbnail_of(const cv::Mat& grey);

}  // namespace huetrack::gather
