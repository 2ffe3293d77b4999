// Chessboard corners in an image: saddle points of the brightness, joined to lattices. Private to this module.
// Needs neither whole squares nor a white margin, finds parts of a board, and works down to squares of some 3 pixels.
#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

namespace huetrack::board {

// A part of a chessboard: corners at lattice cells (i, j). u and v, the image directions of growing i and j, are
// right-handed as seen (u right => v down).
struct ChessboardLattice {
  struct Node {
    Eigen::Vector2d px;   // image pixels; rough (some tenths of a pixel)
    double strength = 0;  // of the saddle
  };
  std::map<std::pair<int, int>, Node> nodes;  // by (i, j)
  // Whether the squares on the (-u, -v) and (+u, +v) sides of node (0, 0) are dark; alternates from node to node.
  bool dark_at_origin = false;

  bool dark_at(int i, int j) const { return dark_at_origin != ((i + j) % 2 != 0); }
  // Steps to the next node along i and j, from the existing neighbours.
  std::pair<Eigen::Vector2d, Eigen::Vector2d> steps_at(int i, int j) const;
};

// The lattices in a grey image (8 bit or float, one channel) scaled by `scale`; those with many corners of high
// contrast first.
std::vector<ChessboardLattice> find_chessboard_lattices(const cv::Mat& grey, double scale);

}  // namespace huetrack::board
