#include "calib/board/board.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <tuple>
#include <utility>

namespace huetrack::board {
namespace {

// The square (column, row) of the index-th marker.
std::array<int, 2> marker_square(const Board& board, int index) {
  if (board.type == BoardType::aruco_grid) {
    const int row = index / board.columns;  // of the bottom left corner's origin: -1, -2, ...
    return {index % board.columns, board.from_bottom ? -1 - row : row};
  }
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

// What a turn by quarters about the middle does to the ids; empty: it changes the look.
std::vector<int> turned(const Board& board, int quarters) {
  const int count = board.side_point_count();
  Eigen::Vector3d low = board.point(0), high = low;
  for (int id = 1; id < count; ++id) low = low.cwiseMin(board.point(id)), high = high.cwiseMax(board.point(id));
  const Eigen::Vector3d middle = (low + high) / 2;
  std::vector<int> ids;
  for (int id = 0; id < count; ++id) {
    Eigen::Vector3d p = board.point(id) - middle;
    for (int q = 0; q < quarters; ++q) p = Eigen::Vector3d(-p.y(), p.x(), 0);
    for (int other = 0; other < count; ++other) {
      if ((board.point(other) - middle - p).norm() < 0.01 * board.pitch.minCoeff()) ids.push_back(other);
    }
  }
  return ids.size() == static_cast<std::size_t>(count) ? ids : std::vector<int>();
}

}  // namespace

void sort_corners(std::vector<int>& ids, std::vector<Eigen::Vector2d>& px) {
  std::vector<std::pair<int, Eigen::Vector2d>> corners;
  for (std::size_t k = 0; k < ids.size(); ++k) corners.emplace_back(ids[k], px[k]);
  std::ranges::sort(corners, {}, [](const auto& corner) { return corner.first; });
  for (std::size_t k = 0; k < ids.size(); ++k) std::tie(ids[k], px[k]) = corners[k];
}

int Board::side_point_count() const {
  return type == BoardType::aruco_grid ? 4 * marker_count() : corner_columns() * corner_rows();
}

int Board::marker_count() const {
  if (!has_markers()) return 0;
  if (type == BoardType::aruco_grid) return columns * rows;
  return (columns * rows + (is_marker_square(0, 0) ? 1 : 0)) / 2;
}

Eigen::Vector3d Board::point(int id) const {
  if (id >= side_point_count()) {
    Eigen::Vector3d p = point(id - side_point_count());
    p.z() = back->thickness;
    return p;
  }
  if (type == BoardType::aruco_grid) return marker_corners(id / 4)[static_cast<std::size_t>(id % 4)];
  const int column = id % corner_columns(), row = id / corner_columns();
  return {pitch.x() * (type == BoardType::asymmetric_circles ? 2 * column + row % 2 : column), pitch.y() * row, 0};
}

std::vector<Eigen::Vector3d> Board::marker_corners(int index) const {
  const auto [column, row] = marker_square(*this, index);
  Eigen::Vector3d origin(column * pitch.x(), row * pitch.y(), 0);
  if (from_bottom) origin.y() += pitch.y() - marker;
  if (type == BoardType::charuco) {  // centred in its square; the origin, corner 0, is one square further in
    origin += Eigen::Vector3d((pitch.x() - marker) / 2 - pitch.x(), (pitch.y() - marker) / 2 - pitch.y(), 0);
  }
  const auto at = [&](double x, double y) { return Eigen::Vector3d(origin + Eigen::Vector3d(x, y, 0)); };
  return {at(0, 0), at(marker, 0), at(marker, marker), at(0, marker)};
}

Board Board::front_alone() const {
  Board front = *this;
  front.back.reset();
  return front;
}

Board Board::back_alone() const {
  Board alone = front_alone();
  if (back->first_marker) alone.first_marker = *back->first_marker;
  return alone;
}

// The outlines coincide: columns from the left on the back are columns from the right on the front.
int Board::id_of_back(int id) const {
  if (!back->first_marker) return side_point_count() + id;
  if (type == BoardType::aruco_grid) {
    const int marker = id / 4, column = marker % columns, corner = id % 4;
    // The corners of a marker, clockwise from its top left one, seen through the sheet.
    constexpr std::array<int, 4> through{1, 0, 3, 2};
    return side_point_count() + 4 * (marker - column + columns - 1 - column) +
           through[static_cast<std::size_t>(corner)];
  }
  const int column = id % corner_columns();
  return side_point_count() + id - column + corner_columns() - 1 - column;
}

std::vector<std::vector<int>> Board::symmetries() const {
  std::vector<int> identity(static_cast<std::size_t>(point_count()));
  std::iota(identity.begin(), identity.end(), 0);
  std::vector<std::vector<int>> all{identity};
  if (has_circles()) {
    for (int quarters = 1; quarters < 4; ++quarters) {
      if (std::vector<int> ids = turned(*this, quarters); !ids.empty()) all.push_back(std::move(ids));
    }
  }
  if (type != BoardType::chessboard) return all;
  const int side = side_point_count();
  // Transposing, reversing the columns, reversing the rows: each mirrors the board; two together rotate it.
  for (int way = 1; way < 8; ++way) {
    const bool exchanged = (way & 4) != 0, columns_back = (way & 1) != 0, rows_back = (way & 2) != 0;
    if (exchanged && (columns != rows || pitch.x() != pitch.y())) continue;
    const bool swaps_sides = (exchanged ? 1 : 0) + (columns_back ? 1 : 0) + (rows_back ? 1 : 0) != 2;
    if (swaps_sides && !back) continue;
    // The first of (columns + 1) squares maps to the last of its row: the same colour if columns is even.
    if (((columns_back ? columns : 0) + (rows_back ? rows : 0)) % 2 != 0) continue;
    std::vector<int> renumbered(identity.size());
    for (int id = 0; id < point_count(); ++id) {
      int column = id % side % columns, row = id % side / columns;
      if (exchanged) std::swap(column, row);
      if (columns_back) column = columns - 1 - column;
      if (rows_back) row = rows - 1 - row;
      const bool on_back = (id >= side) != swaps_sides;
      renumbered[static_cast<std::size_t>(id)] = (on_back ? side : 0) + row * columns + column;
    }
    all.push_back(std::move(renumbered));
  }
  return all;
}

std::string Board::description() const {
  std::string text = (inverted ? "inverted " : "") + std::string(name(type)) + " " + std::to_string(columns) + "x" +
                     std::to_string(rows);
  text += type == BoardType::chessboard ? " inner corners" : type == BoardType::charuco ? " squares" : "";
  text += type == BoardType::aruco_grid ? " markers" : "";
  text += ", pitch " + millimetres(pitch.x());
  if (pitch.x() != pitch.y()) text += " x " + millimetres(pitch.y());
  if (has_markers()) text += ", markers of " + millimetres(marker) + " from " + dictionary;
  if (diameter > 0) text += ", diameter " + millimetres(diameter);
  if (border_bits != 1) text += ", with a border of " + std::to_string(border_bits) + " bits";
  if (from_bottom) text += ", numbered from the bottom";
  if (legacy) text += ", legacy layout";
  if (back) text += ", printed on both sides, " + millimetres(back->thickness) + " apart";
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
  if (has_circles() && (columns < 3 || rows < 3)) {
    problems.emplace_back("a grid of circles has at least 3 x 3 circles");
  }
  if (columns < 1 || rows < 1 || columns > 100 || rows > 100) {
    problems.emplace_back("a board has 1 to 100 columns and rows");
    return problems;
  }
  const auto is_length = [](double m) { return std::isfinite(m) && m > 0 && m < 10; };
  if (!is_length(pitch.x()) || !is_length(pitch.y())) {
    problems.emplace_back("the squares (pitch) must be larger than 0 and smaller than 10 m (lengths are in metres)");
  }
  if (back && !(std::isfinite(back->thickness) && back->thickness >= 0 && back->thickness < 1)) {
    problems.emplace_back("the back's thickness must be 0 or larger and less than 1 m (lengths are in metres)");
  }
  if (has_circles()) {
    if (back) problems.emplace_back("a grid of circles has no back: calibrate with its front");
    const double nearest = pitch.minCoeff() * (type == BoardType::circles ? 1 : std::sqrt(2));
    if (diameter < 0 || diameter >= nearest)
      problems.emplace_back("diameter, of a circle in metres, must be smaller than the distance between circles");
    return problems;
  }
  if (type == BoardType::chessboard) {
    if (back && back->first_marker) problems.emplace_back("a chessboard's back has no markers");
    return problems;
  }
  if (border_bits < 1 || border_bits > 4) problems.emplace_back("border_bits must be 1 to 4");
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
    return problems;
  }
  const auto check = [&](int first, const char* what) {
    if (first >= 0 && first + marker_count() <= found->markers) return;
    problems.push_back(dictionary + " has " + std::to_string(found->markers) + " markers; " + what + " needs " +
                       std::to_string(first) + " to " + std::to_string(first + marker_count() - 1));
  };
  check(first_marker, "the board");
  if (!back || !back->first_marker) return problems;
  check(*back->first_marker, "its back");
  if (std::abs(*back->first_marker - first_marker) < marker_count()) {
    problems.emplace_back("front and back have markers in common: give the back other ones");
  }
  return problems;
}

std::string_view name(BoardType type) {
  static constexpr std::string_view names[] = {"chessboard", "charuco", "aruco_grid", "circles", "asymmetric_circles"};
  static_assert(std::size(names) == std::size_t(BoardType::asymmetric_circles) + 1);
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
