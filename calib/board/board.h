// Calibration boards and the positions of their points. Pure values.
//
// Board frame: metres; seen from the front x right, y down, z into the board (away from the viewer).
// - chessboard, charuco: the points are the inner corners, numbered row by row, x fastest; corner 0 is the origin.
//   A chessboard's corner 0 lies beside a black corner square (a white one when `inverted`). If that is
//   ambiguous (the usual mistake in multi-camera calibration), one image alone cannot resolve it: see symmetries().
// - aruco_grid: the points are the markers' corners, 4 * marker + (0..3), clockwise from its top left one; markers are
//   numbered row by row; the top left corner of marker 0 is the origin. from_bottom: the rows are numbered from the
//   bottom, and the bottom left corner of marker 0 is the origin (Kalibr's AprilGrid; y is negative on the board).
// - circles, asymmetric_circles: the points are the circles' centres, row by row; circle 0 is the origin. Rows of the
//   asymmetric grid are `pitch` apart, its circles two pitches; every second row is shifted by one pitch (OpenCV's).
//   Detected is the centre of a circle's image, which is not the image of its centre: the solver models the difference.
// The points of a back (BoardBack) follow those of the front, in the same number and frame.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::board {

enum class BoardType { chessboard, charuco, aruco_grid, circles, asymmetric_circles };

// A print on the back of the sheet, with the same squares and outline as the front.
struct BoardBack {
  double thickness = 0;  // >= 0; metres, from print to print
  // Charuco, aruco_grid: the back has its own markers, from this one, with columns counted from the left as seen from
  // behind. nullopt: mirrored, the front's print as seen through the sheet.
  std::optional<int> first_marker{};

  bool operator==(const BoardBack&) const = default;
};

// Sorts the corners of a view by id, after renumbering; ids and px belong together.
void sort_corners(std::vector<int>& ids, std::vector<Eigen::Vector2d>& px);

struct Board {
  BoardType type = BoardType::chessboard;
  int columns = 9;                         // chessboard: inner corners; charuco: squares; else: markers or circles
  int rows = 6;                            // same unit
  Eigen::Vector2d pitch{0.03, 0.03};       // > 0; metres from one column (row) to the next
  double marker = 0;                       // side of a marker, metres; charuco: < pitch; aruco_grid: <= pitch
  double diameter = 0;                     // of a circle, metres; 0: unknown
  std::string dictionary = "DICT_4X4_50";  // OpenCV's name; charuco, aruco_grid
  int first_marker = 0;                    // >= 0; the markers are first_marker, first_marker + 1, ... row by row
  bool inverted = false;                   // black and white are swapped, markers too
  // charuco with an even number of rows as drawn by OpenCV before 4.6: the top left square has a marker
  bool legacy = false;
  int border_bits = 1;       // >= 1; charuco, aruco_grid: width of a marker's black border, in its bits
  bool from_bottom = false;  // aruco_grid
  std::optional<BoardBack> back{};

  bool operator==(const Board&) const = default;

  bool has_markers() const { return type == BoardType::charuco || type == BoardType::aruco_grid; }
  bool has_circles() const { return type == BoardType::circles || type == BoardType::asymmetric_circles; }
  // of inner corners or circles; 0 for aruco_grid
  int corner_columns() const {
    return type == BoardType::aruco_grid ? 0 : type == BoardType::charuco ? columns - 1 : columns;
  }
  int corner_rows() const { return type == BoardType::aruco_grid ? 0 : type == BoardType::charuco ? rows - 1 : rows; }
  int side_point_count() const;                                            // of one side
  int point_count() const { return (back ? 2 : 1) * side_point_count(); }  // of all sides
  int marker_count() const;                                                // 0 without markers
  // charuco: white, with a marker
  bool is_marker_square(int column, int row) const { return (column + row) % 2 == (legacy && rows % 2 == 0 ? 0 : 1); }
  Eigen::Vector3d point(int id) const;  // in the board frame; z = 0; on the back: thickness
  // The four corners of marker `index` (0 .. marker_count() - 1), clockwise from its own top left one.
  std::vector<Eigen::Vector3d> marker_corners(int index) const;

  // One side as a board of its own, in its own frame.
  Board front_alone() const;
  Board back_alone() const;  // needs a back; of a mirrored one its mirror image, which is the front
  // The board's point that is point `id` of back_alone().
  int id_of_back(int id) const;

  // Permutations of the point ids that leave the board's look unchanged, the identity first. Boards with markers have
  // no other. Chessboards and circles: turned by half, or by quarters; and with a back whose mirror image is the same
  // chessboard, those that exchange the sides.
  std::vector<std::vector<int>> symmetries() const;

  std::string description() const;            // "chessboard 9x6, squares of 60 mm"
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
};

std::string_view name(BoardType type);  // "chessboard", "charuco", "aruco_grid", ...

// OpenCV's predefined dictionaries by name ("DICT_4X4_50", ..., "DICT_APRILTAG_36h11").
struct MarkerDictionary {
  std::string_view name;
  int opencv_id;  // cv::aruco::PREDEFINED_DICTIONARY_NAME
  int markers;
};
const std::vector<MarkerDictionary>& marker_dictionaries();

}  // namespace huetrack::board
