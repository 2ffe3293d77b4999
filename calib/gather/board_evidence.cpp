#include "calib/gather/board_evidence.h"

#include <fmt/format.h>

#include "calib/board/grey_view.h"
#include "calib/gather/picture_source.h"
#include "calib/model/median.h"

namespace huetrack::gather {

void BoardEvidence::add(const board::BoardDetection& detection, const cv::Mat& grey) {
  if (detection.marker_m > 0) {
    sides_m_.push_back(detection.marker_m);
    sides_px_.push_back(detection.marker_px);
  }
  if (detection.markers + detection.contradicting_markers == 0) return;
  ++images_;
  markers_ += detection.markers;
  constexpr int enough_to_tell = 4;
  const int all = detection.markers + detection.contradicting_markers;
  if (all >= enough_to_tell) (detection.contradicting_markers < 2 ? in_consistent_ : in_contradicting_) += all;
  if (detection.contradicting_markers == 0) return;
  ++contradicting_images_;
  contradicting_ += detection.contradicting_markers;
  constexpr std::size_t enough = 8;
  if (contradicting_samples_.size() < enough) contradicting_samples_.push_back(grey.clone());
}

// More than codes that are found by chance, or are misread.
bool BoardEvidence::contradicts() const {
  const int all = markers_ + contradicting_;
  return (contradicting_ >= 3 && 10 * contradicting_ > all) || (contradicting_ >= 5 && 20 * contradicting_ > all);
}

std::string BoardEvidence::contradiction() const {
  return fmt::format(
      "in {} of {} images with its markers, {} of {} markers are elsewhere than the board file says ({})",
      contradicting_images_, images_, contradicting_, markers_ + contradicting_, board_.description());
}

void BoardEvidence::refuse_wrong_board() const {
  if (!contradicts() || in_consistent_ >= in_contradicting_) return;
  std::vector<board::GreyPixels> samples;
  for (const cv::Mat& image : contradicting_samples_) samples.push_back(board::view_of(image));
  const std::string line = board::fitting_board_file(board_, samples);
  if (!line.empty()) throw InputError(contradiction() + "; they fit with " + line + " in the board file");
}

std::string BoardEvidence::doubt() const {
  return contradicts() ? contradiction() +
                             ": is it the file of this board? Are pictures mirrored, or do some show the back of a "
                             "board that is printed on both sides (back: in its file)?"
                       : doubt_of_lengths();
}

// Compares the measured ratio of markers (circles) to the pitch with the board file: one of its lengths may be wrong,
// and with the pitch the scale of the calibration.
std::string BoardEvidence::doubt_of_lengths() const {
  const bool circles = board_.has_circles();
  const double in_file = circles ? board_.diameter : board_.marker;
  if (sides_m_.empty() || !(in_file > 0)) return {};
  // 1 mm of a marker of 33 mm; views measure it to some hundredths. A corner of a soft edge is detected up to 0.35 px
  // inside the marker. A circle is measured by its grey values, which depend on the camera's gamma. A grid's markers
  // are compared with their own neighbours: pictures of Kalibr's grid agree to 1 %.
  const bool is_grid = board_.type == board::BoardType::aruco_grid;
  const double clearly = circles ? 0.15 : is_grid ? 0.01 : 0.03, inside_px = 0.35;
  const double measured = calib::median(sides_m_), px = calib::median(sides_px_), pitch = board_.pitch.mean();
  const double larger = measured / in_file - 1;
  if (larger < clearly && -larger < clearly + 2 * inside_px / px) return {};
  if (is_grid) {
    const double gap = in_file * pitch / measured - in_file;  // of markers of that size
    return fmt::format(
        "the board file has markers of {:.1f} mm and gaps of {:.1f} mm, but in the images gaps are {:.2f} of a marker "
        "rather than {:.2f}: one of the two lengths is wrong (if the markers are right: gap: {:.4f}, or in a target "
        "file of Kalibr tagSpacing: {:.2f})",
        1000 * in_file, 1000 * (pitch - in_file), gap / in_file, pitch / in_file - 1, gap, gap / in_file);
  }
  const std::string what = circles ? "circles" : "markers", of = circles ? "distance of the rows" : "square";
  return fmt::format(
      "the board file has {} of {:.1f} mm and {} of {:.1f} mm, but in the images {} are {:.3f} of a {} rather than "
      "{:.3f}: one of the two lengths is wrong (with {} of {:.1f} mm {} have {:.1f} mm)",
      circles ? "rows at a distance" : "squares", 1000 * pitch, what, 1000 * in_file, what, measured / pitch, of,
      in_file / pitch, circles ? "rows at a distance" : "squares", 1000 * pitch, what, 1000 * measured);
}

board::Board BoardEvidence::board() const {
  board::Board board = board_;
  if (board.has_circles() && !(board.diameter > 0)) board.diameter = calib::median(sides_m_);
  return board;
}

}  // namespace huetrack::gather
