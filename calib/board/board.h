// What a calibration board is: where its corners lie on it. Pure values.
//
// Board frame: metres; seen from the front x right, y down, z into the board (away from the viewer).
// - chessboard, charuco: the points are the inner corners, numbered row by row, x fastest; corner 0 is the origin.
//   A chessboard's corner 0 lies beside a black corner square (a white one when `inverted`). Where that leaves more
//   than one way round (the usual mistake in multi-camera calibration), one image alone cannot tell which.
// - aruco_grid: the points are the markers' corners, 4 * marker + (0..3), clockwise from its top left one; markers are
//   numbered row by row; the top left corner of marker 0 is the origin.
// The points of a back (see BoardBack) come after all of the front's, as many, in the same frame.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::board {

enum class BoardType { chessboard, charuco, aruco_grid };

// A print on the other side of the sheet: of the same squares, its outline on the front's.
struct BoardBack {
  double thickness = 0;  // >= 0; metres, from print to print
  // Charuco, aruco_grid: the back has markers of its own, from this one, and is as it was printed: to somebody who
  // looks at it its columns count from the left. nullopt: it is mirrored, the front's print as seen through the sheet.
  std::optional<int> first_marker{};

  bool operator==(const BoardBack&) const = default;
};

// Corners of a view whose points have got other ids, in the order of these again. ids and px: beside each other.
void sort_corners(std::vector<int>& ids, std::vector<Eigen::Vector2d>& px);

struct Board {
  BoardType type = BoardType::chessboard;
  int columns = 9;                         // chessboard: inner corners; charuco: squares; aruco_grid: markers
  int rows = 6;                            // of the same
  Eigen::Vector2d pitch{0.03, 0.03};       // > 0; metres from one column (row) to the next
  double marker = 0;                       // side of a marker, metres; charuco: < pitch; aruco_grid: <= pitch
  std::string dictionary = "DICT_4X4_50";  // OpenCV's name of it; charuco, aruco_grid
  int first_marker = 0;                    // >= 0; the markers are first_marker, first_marker + 1, ... row by row
  bool inverted = false;                   // black and white are swapped, markers too
  // charuco with an even number of rows, as OpenCV drew them before 4.6: the top left square carries a marker
  bool legacy = false;
  std::optional<BoardBack> back{};

  bool operator==(const Board&) const = default;

  int corner_columns() const;  // of inner corners; 0 for aruco_grid
  int corner_rows() const;
  int side_point_count() const;                      // of one side
  int point_count() const;                           // of all sides
  int marker_count() const;                          // 0 for a chessboard
  bool is_marker_square(int column, int row) const;  // charuco: whether that square is white and carries a marker
  Eigen::Vector3d point(int id) const;               // in the board frame; z = 0, of the back its thickness
  // The four corners of marker `index` (0 .. marker_count() - 1), clockwise from its own top left one.
  std::vector<Eigen::Vector3d> marker_corners(int index) const;

  // What one side shows, as a board by itself, in its own frame.
  Board front_alone() const;
  Board back_alone() const;  // there is one; a mirrored one as its mirror image is, and that is the front
  // The point of the board that is point `id` of back_alone().
  int id_of_back(int id) const;

  // The ways in which the board's points can be renumbered so that it looks the same: permutations of the point ids,
  // the identity first. Only chessboards have more than one: two (turned by half), or four (square, both counts even);
  // and with a back, where its mirror image is the chessboard again, those that exchange the sides.
  std::vector<std::vector<int>> symmetries() const;

  std::string description() const;            // "chessboard 9x6, squares of 60 mm"
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
};

std::string_view name(BoardType type);  // "chessboard", "charuco", "aruco_grid"

// OpenCV's predefined dictionaries by name ("DICT_4X4_50", ..., "DICT_APRILTAG_36h11").
struct MarkerDictionary {
  std::string_view name;
  int opencv_id;  // cv::aruco::PREDEFINED_DICTIONARY_NAME
  int markers;
};
const std::vector<MarkerDictionary>& marker_dictionaries();

}  // namespace huetrack::board
