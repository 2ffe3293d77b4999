#include "calib/board/board.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>

namespace huetrack::board {
namespace {

// The square (column, row) of the index-th marker.
std::array<int, 2> marker_square(const Board& board, int index) {
  if (board.type == BoardType::aruco_grid) return {index % board.columns, index / board.columns};
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      if (board.is_marker_square(column, row) && index-- == 0) return {column, row};
    }
  }
  return {0, 0};
}

std::string millimetres(double metres) {
  return fmt::format("{:.4g} mm", 1000 * metres);
}

}  // namespace

int Board::corner_columns() const {
  return type == BoardType::chessboard ? columns : type == BoardType::charuco ? columns - 1 : 0;
}

int Board::corner_rows() const {
  return type == BoardType::chessboard ? rows : type == BoardType::charuco ? rows - 1 : 0;
}

int Board::point_count() const {
  return type == BoardType::aruco_grid ? 4 * marker_count() : corner_columns() * corner_rows();
}

int Board::marker_count() const {
  if (type == BoardType::chessboard) return 0;
  if (type == BoardType::aruco_grid) return columns * rows;
  return (columns * rows + (is_marker_square(0, 0) ? 1 : 0)) / 2;
}

// The squares alternate; OpenCV 4.6 changed with which they start.
bool Board::is_marker_square(int column, int row) const {
  return (column + row) % 2 == (legacy && rows % 2 == 0 ? 0 : 1);
}

Eigen::Vector3d Board::point(int id) const {
  if (type == BoardType::aruco_grid) return marker_corners(id / 4)[static_cast<std::size_t>(id % 4)];
  const int column = id % corner_columns(), row = id / corner_columns();
  return {pitch.x() * column, pitch.y() * row, 0};
}

std::vector<Eigen::Vector3d> Board::marker_corners(int index) const {
  const auto [column, row] = marker_square(*this, index);
  Eigen::Vector3d origin(column * pitch.x(), row * pitch.y(), 0);
  if (type == BoardType::charuco) {  // in the middle of its square; corner 0 is the origin, one square further in
    origin += Eigen::Vector3d((pitch.x() - marker) / 2 - pitch.x(), (pitch.y() - marker) / 2 - pitch.y(), 0);
  }
  const auto at = [&](double x, double y) { return Eigen::Vector3d(origin + Eigen::Vector3d(x, y, 0)); };
  return {at(0, 0), at(marker, 0), at(marker, marker), at(0, marker)};
}

std::vector<std::vector<int>> Board::symmetries() const {
  std::vector<int> identity(static_cast<std::size_t>(point_count()));
  std::iota(identity.begin(), identity.end(), 0);
  std::vector<std::vector<int>> all{identity};
  // A half turn takes square (i, j) to (columns - i, rows - j) of (columns + 1) x (rows + 1) squares: the same colour
  // when columns + rows is even. A quarter turn needs a square board, and keeps the colours when columns is even.
  if (type != BoardType::chessboard || (columns + rows) % 2 != 0) return all;
  all.emplace_back(identity.rbegin(), identity.rend());
  if (columns == rows && columns % 2 == 0 && pitch.x() == pitch.y()) {
    std::vector<int> quarter(identity.size());
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        quarter[static_cast<std::size_t>(row * columns + column)] = column * columns + (columns - 1 - row);
      }
    }
    all.push_back(quarter);
    all.emplace_back(quarter.rbegin(), quarter.rend());
  }
  return all;
}

std::string Board::description() const {
  std::string text = (inverted ? "inverted " : "") + std::string(name(type)) + " " + std::to_string(columns) + "x" +
                     std::to_string(rows);
  text += type == BoardType::chessboard ? " inner corners" : type == BoardType::charuco ? " squares" : " markers";
  text += ", pitch " + millimetres(pitch.x());
  if (pitch.x() != pitch.y()) text += " x " + millimetres(pitch.y());
  if (type != BoardType::chessboard) text += ", markers of " + millimetres(marker) + " from " + dictionary;
  if (legacy) text += ", legacy layout";
  return text;
}

std::vector<std::string> Board::problems() const {
  std::vector<std::string> problems;
  if (type == BoardType::chessboard && (columns < 3 || rows < 3)) {
    problems.emplace_back("a chessboard has at least 3 x 3 inner corners");
  }
  if (type == BoardType::charuco && (columns < 3 || rows < 3)) {
    problems.emplace_back("a charuco board has at least 3 x 3 squares");
  }
  if (columns < 1 || rows < 1 || columns > 100 || rows > 100) {
    problems.emplace_back("a board has 1 to 100 columns and rows");
    return problems;
  }
  const auto is_length = [](double m) { return std::isfinite(m) && m > 0 && m < 10; };
  if (!is_length(pitch.x()) || !is_length(pitch.y())) {
    problems.emplace_back("the squares must be larger than 0 and smaller than 10 m (lengths are in metres)");
  }
  if (type == BoardType::chessboard) return problems;
  const double room = pitch.minCoeff();
  if (!is_length(marker)) {
    problems.emplace_back("marker, its side in metres, must be larger than 0");
  } else if (type == BoardType::charuco && marker >= room) {
    problems.emplace_back("marker must be smaller than the squares");
  } else if (type == BoardType::aruco_grid && marker > room) {
    problems.emplace_back("marker must not be larger than the pitch of the grid");
  }
  const auto& dictionaries = marker_dictionaries();
  const auto found = std::ranges::find(dictionaries, dictionary, &MarkerDictionary::name);
  if (found == dictionaries.end()) {
    problems.push_back("dictionary " + dictionary + " is not one of OpenCV's predefined ones");
  } else if (first_marker < 0 || first_marker + marker_count() > found->markers) {
    problems.push_back(dictionary + " has " + std::to_string(found->markers) + " markers; the board needs " +
                       std::to_string(first_marker) + " to " + std::to_string(first_marker + marker_count() - 1));
  }
  return problems;
}

std::string_view name(BoardType type) {
  static constexpr std::string_view names[] = {"chessboard", "charuco", "aruco_grid"};
  static_assert(std::size(names) == std::size_t(BoardType::aruco_grid) + 1);
  return names[std::size_t(type)];
}

const std::vector<MarkerDictionary>& marker_dictionaries() {
  static const std::vector<MarkerDictionary> all{{"DICT_4X4_50", 0, 50},
                                                 {"DICT_4X4_100", 1, 100},
                                                 {"DICT_4X4_250", 2, 250},
                                                 {"DICT_4X4_1000", 3, 1000},
                                                 {"DICT_5X5_50", 4, 50},
                                                 {"DICT_5X5_100", 5, 100},
                                                 {"DICT_5X5_250", 6, 250},
                                                 {"DICT_5X5_1000", 7, 1000},
                                                 {"DICT_6X6_50", 8, 50},
                                                 {"DICT_6X6_100", 9, 100},
                                                 {"DICT_6X6_250", 10, 250},
                                                 {"DICT_6X6_1000", 11, 1000},
                                                 {"DICT_7X7_50", 12, 50},
                                                 {"DICT_7X7_100", 13, 100},
                                                 {"DICT_7X7_250", 14, 250},
                                                 {"DICT_7X7_1000", 15, 1000},
                                                 {"DICT_ARUCO_ORIGINAL", 16, 1024},
                                                 {"DICT_APRILTAG_16h5", 17, 30},
                                                 {"DICT_APRILTAG_25h9", 18, 35},
                                                 {"DICT_APRILTAG_36h10", 19, 2320},
                                                 {"DICT_APRILTAG_36h11", 20, 587}};
  return all;
}

}  // namespace huetrack::board
