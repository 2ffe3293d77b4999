// What the views of a board that were gathered so far still lack: for people who carry the board.
#pragma once

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
    std::vector<double> blurs_px;               // of the views whose blur is known (BoardView::blur_px)
    double image_share() const;                 // of the parts that have corners
    int tilts_seen() const;
  };

  ViewCoverage(board::Board board, std::vector<std::string> cameras, std::vector<calib::ImageSize> sizes);

  // Whether the views of one moment show the board elsewhere than all that were added: in some camera, or to a pair of
  // cameras that lacks shared views.
  bool is_new(const std::vector<solver::BoardView>& views) const;
  void add(const std::vector<solver::BoardView>& views);

  const std::vector<CameraCoverage>& cameras() const { return cameras_; }
  int shared(int a, int b) const;  // moments that both saw

  // What is missing, the most important first; a sentence each. Empty: it is enough.
  std::vector<std::string> needs() const;
  // For a terminal of 80 columns: a line per camera, what it has of what it needs; and the pairs that lack shared
  // views.
  std::string lines() const;
  std::string lacking_pairs() const;  // "left + right 8/10, ..."; empty: none lacks any

 private:
  board::Board board_;
  std::vector<std::string> names_;
  std::vector<calib::ImageSize> sizes_;
  std::vector<CameraCoverage> cameras_;
  std::vector<std::vector<solver::BoardView>> kept_;
  std::map<std::pair<int, int>, int> shared_;
};

}  // namespace huetrack::gather
