#include "calib/board/board_detector.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "calib/board/chessboard_lattice.h"
#include "calib/board/circle_grid.h"
#include "calib/board/corner_refinement.h"
#include "calib/board/grey_view.h"
#include "calib/board/markers.h"
#include "calib/model/median.h"

namespace huetrack::board {
namespace {

using Eigen::Vector2d;
using Cell = std::pair<int, int>;

// A reason that keeps any detector from working; empty: none.
std::string trouble_of(const cv::Mat& grey) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(grey, mean, deviation);
  if (deviation[0] < 2.5) {
    return mean[0] < 30    ? "the image is black"
           : mean[0] > 225 ? "the image is white"
                           : "the image is empty (one even grey)";
  }
  cv::Mat edges;
  cv::Laplacian(grey, edges, CV_32F);
  cv::meanStdDev(edges, mean, deviation);
  // Even a soft image of a board has an edge.
  double low = 0, high = 0;
  cv::minMaxLoc(edges, &low, &high);
  if (std::max(-low, high) < 14) return "the image is blurred";
  return {};
}

// Placement of lattice cells on the board: x grows along (xi, xj), y along (-xj, xi) in lattice steps, and corner 0
// is at cell `origin`.
struct Placement {
  int xi = 1, xj = 0;
  Cell origin;
  Cell cell(int column, int row) const {
    return {origin.first + column * xi - row * xj, origin.second + column * xj + row * xi};
  }
};

// cells of the lattice to pixels
cv::Matx33d homography_of(const ChessboardLattice& lattice) {
  std::vector<cv::Point2d> from, to;
  for (const auto& [cell, node] : lattice.nodes) {
    from.emplace_back(cell.first, cell.second);
    to.emplace_back(node.px.x(), node.px.y());
  }
  return cv::findHomography(from, to);
}

Vector2d apply(const cv::Matx33d& h, double x, double y) {
  const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
  return {p[0] / p[2], p[1] / p[2]};
}

struct PlacementChoice {
  std::optional<Placement> placement;
  std::string why_not;
};

// Cells of a lattice, from the first column and row to the last.
struct Extent {
  int i0 = std::numeric_limits<int>::max(), i1 = std::numeric_limits<int>::min(), j0 = i0, j1 = i1;
  int width() const { return i1 - i0 + 1; }
  int height() const { return j1 - j0 + 1; }
};

// Rows and columns of the lattice that are mostly complete: a stray saddle beside the board makes no row.
Extent extent_of(const ChessboardLattice& lattice) {
  std::map<int, int> in_column, in_row;
  for (const auto& [cell, node] : lattice.nodes) {
    ++in_column[cell.first];
    ++in_row[cell.second];
  }
  const auto find = [](const std::map<int, int>& counts, int& low, int& high) {
    int most = 0;
    for (const auto& [line, count] : counts) most = std::max(most, count);
    for (const auto& [line, count] : counts) {
      if (10 * count < 4 * most) continue;
      low = std::min(low, line);
      high = std::max(high, line);
    }
  };
  Extent extent;
  find(in_column, extent.i0, extent.i1);
  find(in_row, extent.j0, extent.j1);
  return extent;
}

// One candidate placement of a lattice on the board.
struct PlacementTrial {
  Placement placement;
  int inside = 0;  // corners of the lattice on the board
  int unseen = 0;  // corners of the board that should be in the image but are missing
  double upright = 0;
  std::vector<int> ids;  // of the lattice's nodes, in order; -1: not on the board

  int score() const { return inside - unseen; }
};

// pixels: from cells to the image.
PlacementTrial trial_of(const Placement& placement, const ChessboardLattice& lattice, const Board& board,
                        const cv::Matx33d& pixels, cv::Size image) {
  const int columns = board.corner_columns(), rows = board.corner_rows();
  PlacementTrial trial;
  trial.placement = placement;
  std::map<Cell, int> id_of;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Cell cell = placement.cell(column, row);
      id_of[cell] = row * columns + column;
      if (lattice.nodes.contains(cell)) {
        ++trial.inside;
        continue;
      }
      const Vector2d px = apply(pixels, cell.first, cell.second);
      constexpr double border = 4;
      if (px.x() > border && px.y() > border && px.x() < image.width - border && px.y() < image.height - border)
        ++trial.unseen;
    }
  }
  for (const auto& [cell, node] : lattice.nodes) trial.ids.push_back(id_of.contains(cell) ? id_of[cell] : -1);
  const Cell origin = placement.cell(0, 0), next = placement.cell(1, 0);
  const Vector2d x_way = apply(pixels, next.first, next.second) - apply(pixels, origin.first, origin.second);
  trial.upright = x_way.x() / x_way.norm();
  return trial;
}

// All placements, in four rotations, whose square colours match.
std::vector<PlacementTrial> trials_of(const ChessboardLattice& lattice, const Extent& extent, const Board& board,
                                      cv::Size image) {
  const int columns = board.corner_columns(), rows = board.corner_rows();
  const cv::Matx33d pixels = homography_of(lattice);
  std::vector<PlacementTrial> trials;
  constexpr std::array<Cell, 4> turns{Cell{1, 0}, Cell{0, 1}, Cell{-1, 0}, Cell{0, -1}};
  // All four corner squares have the same colour: no constraint.
  const bool any_colour = columns % 2 == 0 && rows % 2 == 0;
  for (const auto& [xi, xj] : turns) {
    const int extent_x = xi != 0 ? extent.width() : extent.height(),
              extent_y = xi != 0 ? extent.height() : extent.width();
    if (extent_x > columns || extent_y > rows) continue;
    // Cell of the lattice's first corner in this rotation.
    const Cell first{xi > 0 || xj < 0 ? extent.i0 : extent.i1, xj > 0 || xi > 0 ? extent.j0 : extent.j1};
    for (int left = 0; left <= columns - extent_x; ++left) {
      for (int top = 0; top <= rows - extent_y; ++top) {
        Placement placement{xi, xj, {0, 0}};
        const Cell shift = placement.cell(left, top);
        placement.origin = {first.first - shift.first, first.second - shift.second};
        // Every quarter turn exchanges the dark sides.
        const bool dark = lattice.dark_at(placement.origin.first, placement.origin.second) == (xi != 0);
        const bool whole = extent_x == columns && extent_y == rows;
        if (dark == board.inverted && !(any_colour && whole)) continue;
        trials.push_back(trial_of(placement, lattice, board, pixels, image));
      }
    }
  }
  return trials;
}

// Up to a symmetry of the board.
bool is_same_place(const PlacementTrial& a, const PlacementTrial& b, const std::vector<std::vector<int>>& symmetries) {
  return std::ranges::any_of(symmetries, [&](const std::vector<int>& symmetry) {
    for (std::size_t k = 0; k < a.ids.size(); ++k) {
      const int id = a.ids[k];
      if ((id < 0 ? -1 : symmetry[static_cast<std::size_t>(id)]) != b.ids[k]) return false;
    }
    return true;
  });
}

// The placement of a lattice on the board, or why there is none.
PlacementChoice place(const ChessboardLattice& lattice, const Board& board, cv::Size image) {
  const Extent extent = extent_of(lattice);
  const auto [shorter, longer] = std::minmax({extent.width(), extent.height()});
  const int columns = board.corner_columns(), rows = board.corner_rows();
  const std::string size = std::to_string(longer) + "x" + std::to_string(shorter);
  if (shorter < 3) return {{}, "no chessboard in it"};
  if (longer > std::max(columns, rows) || shorter > std::min(columns, rows))
    return {{}, "it shows " + size + " inner corners, more than the board has"};
  const std::vector<PlacementTrial> trials = trials_of(lattice, extent, board, image);
  if (trials.empty()) return {{}, "it shows " + size + " inner corners, which do not fit on the board"};
  const PlacementTrial& best = *std::ranges::min_element(trials, [](const auto& a, const auto& b) {
    return a.score() != b.score() ? a.score() > b.score() : a.upright > b.upright;
  });
  if (best.inside < std::max(9, columns * rows / 4) || best.inside < 2 * best.unseen) {
    return {
        {},
        "only " + std::to_string(best.inside) + " of its " + std::to_string(columns * rows) + " corners were found"};
  }
  // Any other placement must fit clearly worse, or be equal up to a symmetry of the board.
  Board square = board;
  square.pitch.y() = square.pitch.x();  // an image does not show the difference
  const auto symmetries = square.symmetries();
  for (const PlacementTrial& other : trials) {
    if (&other == &best || other.score() + std::min(columns, rows) / 2 < best.score()) continue;
    if (!is_same_place(best, other, symmetries))
      return {{}, "it shows a part of the board (" + size + " inner corners) that could be at several places on it"};
  }
  return {best.placement, {}};
}

// Corners before the removal of outliers.
struct FoundCorners {
  std::vector<int> ids;
  std::vector<RefinedCorner> corners;

  void add(int id, const RefinedCorner& corner) {
    ids.push_back(id);
    corners.push_back(corner);
  }
};

// Removes corners that are partly covered (a finger, the edge of a glare): they fit the image worse than the others, or
// lie off the lines through their neighbours.
BoardDetection without_odd_ones(const FoundCorners& found, int columns) {
  if (found.ids.empty()) return {};
  std::vector<double> misfits;
  for (const RefinedCorner& c : found.corners) misfits.push_back(c.residual / c.contrast);
  const double usual = calib::median(misfits);
  std::map<int, Vector2d> px;
  for (std::size_t k = 0; k < found.ids.size(); ++k) {
    if (misfits[k] < 0.2 + 2 * usual) px[found.ids[k]] = found.corners[k].px;
  }
  const auto at = [&](int id, int dx, int dy) {
    const int column = id % columns + dx;
    return column < 0 || column >= columns ? px.end() : px.find(id + dx + dy * columns);
  };
  for (;;) {
    // Distance of a corner from the midpoint of opposite neighbours; perspective changes it little.
    std::map<int, double> off;
    for (const auto& [id, p] : px) {
      double least = 1e9;
      for (const auto& [dx, dy] : {Cell{1, 0}, Cell{0, 1}}) {
        const auto before = at(id, -dx, -dy), after = at(id, dx, dy);
        if (before == px.end() || after == px.end()) continue;
        const Vector2d along = after->second - before->second, way = p - before->second;
        least = std::min(least, std::abs(along.x() * way.y() - along.y() * way.x()) / along.norm());
      }
      if (least < 1e9) off[id] = least;
    }
    if (off.size() < 3) break;
    std::vector<double> values;
    for (const auto& [id, distance] : off) values.push_back(distance);
    const auto worst = std::ranges::max_element(off, {}, [](const auto& o) { return o.second; });
    if (worst->second < 0.4 + 6 * calib::median(values)) break;
    px.erase(worst->first);
  }
  BoardDetection detection;
  for (const auto& [id, p] : px) {
    detection.ids.push_back(id);
    detection.px.push_back(p);
  }
  std::vector<double> blurs;
  for (const RefinedCorner& c : found.corners) blurs.push_back(c.blur_px);
  detection.blur_px = calib::median(std::move(blurs));
  return detection;
}

// Measures the markers relative to the squares, and in the image; unknown if there are too few.
void measure_markers(const Board& board, const Markers& markers, BoardDetection& found) {
  constexpr std::size_t enough = 8;  // for a homography that is robust to small lens distortion
  if (found.ids.size() < enough) return;
  std::vector<cv::Point2d> from, to;
  for (std::size_t k = 0; k < found.ids.size(); ++k) {
    const Eigen::Vector3d p = board.point(found.ids[k]);
    from.emplace_back(found.px[k].x(), found.px[k].y());
    to.emplace_back(p.x(), p.y());
  }
  const cv::Mat h = cv::findHomography(from, to);
  if (h.empty()) return;
  const cv::Matx33d onto_board = h;
  std::vector<double> sides, sides_px;
  for (const auto& [id, corners] : markers) {
    for (std::size_t k = 0; k < 4; ++k) {
      const auto on_board = [&](const cv::Point2f& p) { return apply(onto_board, double(p.x), double(p.y)); };
      sides.push_back((on_board(corners[k]) - on_board(corners[(k + 1) % 4])).norm());
      sides_px.push_back(cv::norm(corners[k] - corners[(k + 1) % 4]));
    }
  }
  found.marker_m = calib::median(std::move(sides));
  found.marker_px = calib::median(std::move(sides_px));
}

// As above, for a grid of markers without squares: by the steps from a marker to the next one beside or below it.
void measure_grid(const Board& board, const Markers& markers, BoardDetection& found) {
  std::vector<double> sides, sides_px;
  for (const auto& [id, corners] : markers) {
    const int column = (id - board.first_marker) % board.columns;
    for (const bool is_beside : {true, false}) {
      const auto next = markers.find(is_beside ? id + 1 : id + board.columns);
      if (next == markers.end() || (is_beside && column + 1 == board.columns)) continue;
      double step_px = 0, side_px = 0;  // four times
      for (std::size_t k = 0; k < 4; ++k) step_px += cv::norm(next->second[k] - corners[k]);
      const std::size_t along = is_beside ? 0 : 1;  // the first of the two edges that lead there
      for (const MarkerCorners& of : {corners, next->second})
        side_px += cv::norm(of[along + 1] - of[along]) + cv::norm(of[(along + 3) % 4] - of[along + 2]);
      sides.push_back((is_beside ? board.pitch.x() : board.pitch.y()) * side_px / step_px);
      sides_px.push_back(side_px / 4);
    }
  }
  if (sides.empty()) return;
  found.marker_m = calib::median(std::move(sides));
  found.marker_px = calib::median(std::move(sides_px));
}

BoardDetection corners_of_markers(const Markers& markers, const Board& board) {
  BoardDetection found;
  for (const auto& [id, corners] : markers) {
    for (int k = 0; k < 4; ++k) {
      const cv::Point2f& p = corners[static_cast<std::size_t>(k)];
      found.ids.push_back(4 * (id - board.first_marker) + k);
      found.px.emplace_back(p.x, p.y);
    }
  }
  return found;
}

// Homography from board to pixels by the four markers nearest to a point.
std::optional<cv::Matx33d> pixels_around(const Eigen::Vector3d& point, const Markers& markers, const Board& board) {
  std::vector<std::pair<double, int>> nearest;
  for (const auto& [marker, px] : markers) {
    const auto on_board = board.marker_corners(marker - board.first_marker);
    nearest.emplace_back(((on_board[0] + on_board[2]) / 2 - point).norm(), marker);
  }
  std::ranges::sort(nearest);
  if (nearest.front().first > 1.6 * board.pitch.norm()) return std::nullopt;  // too far from any detected marker
  std::vector<cv::Point2f> from, to;
  for (std::size_t k = 0; k < std::min<std::size_t>(4, nearest.size()); ++k) {
    const auto on_board = board.marker_corners(nearest[k].second - board.first_marker);
    for (std::size_t c = 0; c < 4; ++c) {
      from.emplace_back(on_board[c].x(), on_board[c].y());
      to.emplace_back(markers.at(nearest[k].second)[c]);
    }
  }
  const cv::Mat h = cv::findHomography(from, to);
  return h.empty() ? std::nullopt : std::optional(cv::Matx33d(h));
}

// Corners of the squares between markers: predicted by the markers, then refined.
// Corners outside of what the markers enclose are left out: where the board file has a row too many, they lie on the
// board's edge.
BoardDetection squares_corners(const cv::Mat& image, const Markers& markers, const Board& board) {
  FoundCorners corners;
  Eigen::AlignedBox2d enclosed;
  for (const auto& [id, px] : markers)
    for (const Eigen::Vector3d& corner : board.marker_corners(id - board.first_marker))
      enclosed.extend(corner.head<2>());
  const double white_margin = 0.5 * (1 - board.marker / board.pitch.maxCoeff());
  for (int id = 0; id < board.point_count(); ++id) {
    const Eigen::Vector3d corner = board.point(id);
    if (!enclosed.contains(Eigen::Vector2d(corner.head<2>()))) continue;
    const std::optional<cv::Matx33d> pixels = pixels_around(corner, markers, board);
    if (!pixels) continue;
    const auto px = [&](double dx, double dy) {
      return apply(*pixels, corner.x() + dx * board.pitch.x(), corner.y() + dy * board.pitch.y());
    };
    const Vector2d step_i = (px(0.5, 0) - px(-0.5, 0)), step_j = px(0, 0.5) - px(0, -0.5);
    const int column = id % board.corner_columns(), row = id / board.corner_columns();
    const bool dark = !board.is_marker_square(column, row);  // the square above and left of the corner
    if (const auto refined = refine_corner(image, px(0, 0), step_i, step_j, dark, white_margin))
      corners.add(id, *refined);
  }
  return without_odd_ones(corners, board.corner_columns());
}

BoardDetection detect_chessboard(const Board& board, const GreyPixels& view) {
  const cv::Mat image = mat_of(view);
  const double pixels = static_cast<double>(view.width) * view.height;
  BoardDetection best;
  best.why_not = "no chessboard in it";
  // From the usual size of a board in an image to the extremes, up to 1.3 million pixels.
  for (const double scale : {1.0, 2.0, 0.5, 4.0, 0.25}) {
    if (scale > 1 && scale * scale * pixels > 1.3e6) continue;
    if (scale < 1 && scale * scale * pixels < 7e4) continue;
    const auto lattices = find_chessboard_lattices(image, scale);
    for (std::size_t k = 0; k < std::min<std::size_t>(4, lattices.size()); ++k) {
      const ChessboardLattice& lattice = lattices[k];
      const auto [placement, why_not] = place(lattice, board, image.size());
      if (!placement) {
        if (k == 0 && best.ids.empty() && lattice.nodes.size() >= 12) best.why_not = why_not;
        continue;
      }
      const int columns = board.corner_columns(), rows = board.corner_rows();
      FoundCorners corners;
      for (int id = 0; id < columns * rows; ++id) {
        const auto [i, j] = placement->cell(id % columns, id / columns);
        const auto node = lattice.nodes.find({i, j});
        if (node == lattice.nodes.end()) continue;
        const auto [step_i, step_j] = lattice.steps_at(i, j);
        if (step_i.isZero() || step_j.isZero()) continue;
        if (const auto corner = refine_corner(image, node->second.px, step_i, step_j, lattice.dark_at(i, j))) {
          corners.add(id, *corner);
        }
      }
      BoardDetection found = without_odd_ones(corners, columns);
      if (found.ids.size() > best.ids.size()) best = std::move(found);
    }
    if (static_cast<int>(best.ids.size()) == board.point_count()) break;
  }
  if (static_cast<int>(best.ids.size()) < std::max(9, board.point_count() / 4)) {
    if (best.found()) best.why_not = "only " + std::to_string(best.ids.size()) + " of its corners are sharp enough";
    best.ids.clear();
    best.px.clear();
  }
  return best;
}

BoardDetection detect_markers(const Board& board, const GreyPixels& view) {
  const cv::Mat given = mat_of(view);
  const Markers all = find_markers(given, board);
  const MarkerFit fit = fit_markers(all, board);
  const Markers& markers = fit.fitting;
  const auto counted = [&](BoardDetection detection) {
    detection.markers = static_cast<int>(markers.size());
    detection.contradicting_markers = fit.contradicting;
    return detection;
  };
  BoardDetection found;
  if (fit.contradicts()) {
    found.why_not = "its markers do not lie as the board file says";
    return counted(found);
  }
  if (markers.empty()) {
    found.why_not = all.empty() ? "no marker of " + board.dictionary + " in it"
                                : "it shows markers of " + board.dictionary + ", but not those of the board";
    return counted(found);
  }
  if (board.type == BoardType::aruco_grid) {
    found = corners_of_markers(markers, board);
    measure_grid(board, markers, found);
    return counted(found);
  }
  found = squares_corners(upright_colours(given, board.inverted), markers, board);
  const auto lines = [&](auto line_of) {
    std::vector<int> all;
    for (const int id : found.ids) all.push_back(line_of(id));
    std::ranges::sort(all);
    return std::ranges::unique(all).begin() - all.begin();
  };
  const int columns = board.corner_columns();
  if (found.ids.size() < 5 || lines([&](int id) { return id % columns; }) < 2 ||
      lines([&](int id) { return id / columns; }) < 2) {
    const std::string count = found.ids.empty() ? "none" : "only " + std::to_string(found.ids.size());
    found = {{}, {}, count + " of its corners were found"};
  }
  measure_markers(board, markers, found);
  return counted(found);
}

BoardDetection detect_side(const Board& side, const GreyPixels& image) {
  if (side.has_circles()) return detect_circles(side, mat_of(image));
  return side.type == BoardType::chessboard ? detect_chessboard(side, image) : detect_markers(side, image);
}

cv::Mat mirror_image(const cv::Mat& image) {
  cv::Mat mirrored;
  cv::flip(image, mirrored, 1);
  return mirrored;
}

// Ids and pixels as of the whole board.
BoardDetection detect_back(const Board& board, const GreyPixels& image) {
  const bool is_mirrored = !board.back->first_marker;
  const cv::Mat seen = is_mirrored ? mirror_image(mat_of(image)) : mat_of(image);
  BoardDetection back = detect_side(board.back_alone(), view_of(seen));
  for (int& id : back.ids) id = board.id_of_back(id);
  if (is_mirrored) {
    for (Vector2d& px : back.px) px.x() = image.width - 1 - px.x();
  }
  sort_corners(back.ids, back.px);
  return back;
}

}  // namespace

BoardDetector::BoardDetector(Board board) : board_(std::move(board)) {
  if (const auto problems = board_.problems(); !problems.empty()) throw std::invalid_argument(problems.front());
}

BoardDetection BoardDetector::detect(const GreyPixels& image) const {
  if (image.width < 32 || image.height < 32) return {{}, {}, "the image is too small"};
  BoardDetection detection = detect_side(board_.front_alone(), image);
  // An image shows one side; a few of its markers may be misread as the other's.
  if (board_.back && 2 * static_cast<int>(detection.ids.size()) < board_.side_point_count()) {
    BoardDetection back = detect_back(board_, image);
    if (back.ids.size() > detection.ids.size()) detection = std::move(back);
  }
  if (detection.found()) return detection;
  if (std::string trouble = trouble_of(mat_of(image)); !trouble.empty()) detection.why_not = trouble;
  return detection;
}

}  // namespace huetrack::board
