// Looks for the board in all pictures of a source.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
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
  int every = 0;      // >= 1: look at every so many-th set; 0: so that about look_at are, in pairs if they have stamps
  int look_at = 800;  // >= 1
  // >= 1; the sets that are kept, spread over the time, with the board as still as possible. Of a source with stamps
  // each comes with the set that follows closely upon it.
  int max_sets = 150;
  bool progress = true;
  std::filesystem::path page{};  // see DetectionPage; empty: none
  // With the board in fewer cameras than these a camera without it is an error. All: the default.
  std::size_t least_cameras = std::numeric_limits<std::size_t>::max() / 2;
};

// One camera's pictures, counted.
struct PictureTally {
  std::string name;
  calib::ImageSize image_size;
  int pictures = 0;                    // looked at
  int boards = 0;                      // found in them
  std::map<std::string, int> why_not;  // how often not, by BoardDetection::why_not, or motion_blur_reason
  int smeared() const;                 // how often by that
};

struct FoundBoards {
  std::vector<PictureTally> cameras;
  std::vector<solver::BoardView> views;  // BoardView::set counts the sets kept, from 0; sorted by set, camera
  std::vector<double> set_at_s;          // per set
  int sets_seen = 0;                     // in the source
  int sets_looked_at = 0;
  int duplicates = 0;                 // sets left out because the board had not moved
  int thinned = 0;                    // sets left out because there were more than max_sets
  std::vector<std::string> warnings;  // about the pictures: files that were damaged
  std::string board_doubt;            // what the pictures say against the board file; empty: nothing
  std::vector<std::pair<std::string, std::string>> without_boards;  // cameras, and why the board is in none of theirs
  // A small JPEG of every picture in `views`, beside it.
  std::vector<report::EmbeddedPicture> thumbnails;
};

// throws InputError: no picture at all, pictures of one camera with different sizes, and, naming the camera and the
// likely reason, a camera (every camera) in whose pictures the board is not; or `stop`.
FoundBoards find_boards(PictureSource& source, const board::BoardDetector& detector, const FindBoardsOptions& options,
                        std::stop_token stop);

// throws InputError: a camera with fewer boards than `least`, why they were not found in the others, and what to do.
void require_views(const FoundBoards& found, int least);

// A set of views, as kept while looking; in the order of time.
struct BoardSet {
  double at_s = 0;
  std::vector<solver::BoardView> views;
  std::vector<report::EmbeddedPicture> thumbnails;  // beside views
};

// How far the corners that both views have are apart, pixels (median); nullopt: they have none in common.
std::optional<double> moved_px(const solver::BoardView& a, const solver::BoardView& b);

report::EmbeddedPicture thumbnail_of(const cv::Mat& grey);

}  // namespace huetrack::gather
