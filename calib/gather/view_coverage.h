// What the gathered views of a board still lack, as instructions for the user.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "calib/board/board.h"
#include "calib/model/camera_rig.h"
#include "calib/solver/bundle_adjustment.h"

namespace huetrack::gather {

// thread-compatible.
class ViewCoverage {
 public:
  static constexpr int enough_views = 15, enough_shared = 10;
  static constexpr double enough_image = 0.6;
  static constexpr int columns = 6, rows = 4;  // parts of the image
  enum Tilt { straight, left_nearer, right_nearer, top_nearer, bottom_nearer };

  struct CameraCoverage {
    int views = 0;
    std::array<int, columns * rows> corners{};  // per part of the image, row by row
    std::array<int, 5> tilts{};                 // views, by Tilt
    std::vector<double> blurs_px;               // of the views with known blur (BoardView::blur_px)
    double image_share() const;                 // share of parts with corners
    int tilts_seen() const {
      return static_cast<int>(std::ranges::count_if(tilts, [](int n) { return n > 0; }));
    }
  };

  ViewCoverage(board::Board board, std::vector<std::string> cameras, std::vector<calib::ImageSize> sizes);

  // Whether the views of a frame set show the board at a new place: in some camera, or to a pair of cameras that lacks
  // shared views.
  bool is_new(const std::vector<solver::BoardView>& views) const;
  void add(const std::vector<solver::BoardView>& views);

  const std::vector<CameraCoverage>& cameras() const { return cameras_; }
  int shared(int a, int b) const;  // frame sets with the board in both

  // What is missing, one sentence each, the most important first. Empty: enough.
  std::vector<std::string> needs() const;
  // For a terminal of 80 columns: a line per camera, and the pairs that lack shared views.
  std::string lines() const;
  std::string lacking_pairs() const;  // "left + right 8/10, ..."; empty: none

 private:
  board::Board board_;
  std::vector<std::string> names_;
  std::vector<calib::ImageSize> sizes_;
  std::vector<CameraCoverage> cameras_;
  std::vector<std::vector<solver::BoardView>> kept_;
  std::map<std::pair<int, int>, int> shared_;
};

}  // namespace huetrack::gather
