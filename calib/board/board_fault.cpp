// What is wrong with a board file, from images that it does not explain.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <opencv2/core.hpp>
#include <set>
#include <tuple>

#include "calib/board/board_detector.h"
#include "calib/board/chessboard_lattice.h"
#include "calib/board/grey_view.h"
#include "calib/board/markers.h"

namespace huetrack::board {
namespace {

struct Explained {
  int markers = 0, contradicting = 0;
  int score() const { return 2 * markers - contradicting; }
  bool is_all() const { return markers >= 4 && 10 * contradicting <= markers; }
};

// Markers of images, found once for each dictionary, border and colours.
class MarkersInImages {
 public:
  explicit MarkersInImages(const std::vector<GreyPixels>& images) : images_(images) {}

  const std::vector<Markers>& of(const Board& board) {
    const auto key = std::tuple(board.dictionary, board.border_bits, board.inverted);
    const auto [at, is_new] = found_.try_emplace(key);
    if (is_new) {
      for (const GreyPixels& image : images_) at->second.push_back(find_markers(mat_of(image), board));
    }
    return at->second;
  }
  Explained by(const Board& board) {
    Explained sum;
    for (const Markers& found : of(board)) {
      const MarkerFit fit = fit_markers(found, board);
      sum.markers += static_cast<int>(fit.fitting.size());
      sum.contradicting += fit.contradicting;
    }
    return sum;
  }

 private:
  std::vector<GreyPixels> images_;
  std::map<std::tuple<std::string, int, bool>, std::vector<Markers>> found_;
};

// The board with other numbers on its markers: beginning so that all that were found are on it.
void add_first_markers(const Board& board, MarkersInImages& images, std::vector<Board>& changed) {
  std::set<int> ids;
  for (const Markers& markers : images.of(board)) {
    for (const auto& [id, corners] : markers) ids.insert(id);
  }
  if (ids.empty()) return;
  constexpr int most = 40;
  for (int first = *ids.begin(); first >= 0 && first > *ids.begin() - most; --first) {
    if (first + board.marker_count() <= *ids.rbegin()) break;
    changed.push_back(board);
    changed.back().first_marker = first;
  }
}

// The board with one thing changed, the usual mistakes first.
using Variants = std::vector<Board>;

// The same markers at other places.
Variants rearranged(const Board& board, MarkersInImages& images) {
  Variants changed;
  const auto add = [&](const auto& change) { change(changed.emplace_back(board)); };
  add([](Board& b) { b.legacy = !b.legacy && b.type == BoardType::charuco; });
  add([](Board& b) { std::swap(b.columns, b.rows); });
  add([](Board& b) { std::swap(b.columns, b.rows), b.legacy = !b.legacy && b.type == BoardType::charuco; });
  if (board.type == BoardType::aruco_grid) {
    add([](Board& b) { b.from_bottom = !b.from_bottom; });
    add([](Board& b) { b.from_bottom = !b.from_bottom, std::swap(b.columns, b.rows); });
  }
  // Where a part of the board explains several, the first of them is named: the fewest changes.
  if (board.first_marker != 0) add([](Board& b) { b.first_marker = 0; });
  for (const bool turns_legacy : {false, true}) {
    for (const int more_columns : {0, -1, 1, -2, 2, -3, 3}) {
      for (const int more_rows : {0, -1, 1}) {
        const int rows = board.rows + more_rows;
        const bool has_legacy = board.type == BoardType::charuco && rows % 2 == 0;
        if (turns_legacy && !has_legacy) continue;  // of odd rows it is the same board
        add([&](Board& b) {
          b.columns = std::max(1, b.columns + more_columns), b.rows = rows, b.legacy = b.legacy != turns_legacy;
        });
      }
    }
  }
  add_first_markers(board, images, changed);
  return changed;
}

// A grid also with the other border, with which a few markers are read, too.
Variants rearranged_in_borders(const Board& board, MarkersInImages& images) {
  Variants changed = rearranged(board, images);
  if (board.type != BoardType::aruco_grid) return changed;
  Board other = board;
  other.border_bits = board.border_bits == 1 ? 2 : 1;
  changed.push_back(other);
  std::ranges::copy(rearranged(other, images), std::back_inserter(changed));
  return changed;
}

// Other markers, each also at other places: without these the right markers may contradict the board more than none do.
Variants recoded(const Board& board, MarkersInImages& images) {
  Variants changed{board, board};
  changed[0].border_bits = board.border_bits == 1 ? 2 : 1;
  changed[1].inverted = !board.inverted;
  for (const MarkerDictionary& dictionary : marker_dictionaries()) {
    if (dictionary.name == board.dictionary) continue;
    Board other = board;
    other.dictionary = dictionary.name;
    changed.push_back(other);
    other.border_bits = other.border_bits == 1 ? 2 : 1;
    if (other.dictionary.starts_with("DICT_APRILTAG")) changed.push_back(other);
  }
  Variants arranged;
  for (const Board& markers : changed) {
    arranged.push_back(markers);
    if (std::ranges::any_of(images.of(markers), [](const Markers& found) { return !found.empty(); }))
      std::ranges::copy(rearranged(markers, images), std::back_inserter(arranged));
  }
  return arranged;
}

// What differs, as lines of a board file: "squares: [5, 7]" and "legacy: true".
std::string difference(const Board& from, const Board& to) {
  std::vector<std::string> lines;
  if (from.columns != to.columns || from.rows != to.rows)
    lines.push_back(
        fmt::format("{}: [{}, {}]", to.type == BoardType::charuco ? "squares" : "markers", to.columns, to.rows));
  if (from.dictionary != to.dictionary) lines.push_back("dictionary: " + to.dictionary);
  if (from.first_marker != to.first_marker) lines.push_back(fmt::format("first_marker: {}", to.first_marker));
  if (from.border_bits != to.border_bits) lines.push_back(fmt::format("border_bits: {}", to.border_bits));
  if (from.from_bottom != to.from_bottom)
    lines.push_back(fmt::format("numbered_from: {}", to.from_bottom ? "bottom" : "top"));
  if (from.legacy != to.legacy) lines.push_back(fmt::format("legacy: {}", to.legacy));
  if (from.inverted != to.inverted) lines.push_back(fmt::format("inverted: {}", to.inverted));
  return fmt::to_string(fmt::join(lines, " and "));
}

// Circles: the numbers swapped, the other grid, or inverted.
std::string other_circles(const Board& board, const GreyPixels& image) {
  for (int change = 1; change < 8; ++change) {
    Board other = board;
    other.diameter = 0;
    if ((change & 1) != 0) std::swap(other.columns, other.rows);
    if ((change & 2) != 0)
      other.type = board.type == BoardType::circles ? BoardType::asymmetric_circles : BoardType::circles;
    if ((change & 4) != 0) other.inverted = !board.inverted;
    if (!other.problems().empty() || !BoardDetector(other).detect(image).found()) continue;
    std::string text = "its circles are found with";
    if ((change & 1) != 0) text += fmt::format(" size: [{}, {}]", other.columns, other.rows);
    if ((change & 2) != 0) text += fmt::format(" type: {}", name(other.type));
    if ((change & 4) != 0) text += fmt::format(" inverted: {}", other.inverted);
    return text + " in the board file";
  }
  return {};
}

// A chessboard of other size than the file says; empty: none.
std::string other_chessboard(const Board& board, const cv::Mat& image) {
  for (const double scale : {1.0, 2.0}) {
    const auto lattices = find_chessboard_lattices(image, scale);
    if (lattices.empty()) continue;
    int i0 = 0, i1 = 0, j0 = 0, j1 = 0;
    for (const auto& [cell, node] : lattices.front().nodes) {
      i0 = std::min(i0, cell.first), i1 = std::max(i1, cell.first);
      j0 = std::min(j0, cell.second), j1 = std::max(j1, cell.second);
    }
    const int a = std::max(i1 - i0, j1 - j0) + 1, b = std::min(i1 - i0, j1 - j0) + 1;
    if (static_cast<int>(lattices.front().nodes.size()) < a * b || b < 3) continue;
    if (a == std::max(board.columns, board.rows) && b == std::min(board.columns, board.rows)) continue;
    const bool is_wide = board.columns >= board.rows;  // as the file has it: pictures do not show which side is which
    return fmt::format(
        "a chessboard of {0}x{1} inner corners is in them: is inner_corners right? (it counts the points where squares "
        "meet, not squares: [{0}, {1}])",
        is_wide ? a : b, is_wide ? b : a);
  }
  return {};
}

std::string mirrored_text(const Board& board) {
  // Equivalent for a chessboard with two odd counts.
  return board.type == BoardType::chessboard
             ? "they are mirrored (left and right swapped; record them as the sensor sees them), or black and white "
               "are swapped (inverted: true), or they show the back of a board that is printed on both sides (back: in "
               "the board file)"
             : "they are mirrored (left and right swapped): record them as the sensor sees them; or, if they show the "
               "back of a board that is printed on both sides, add back: to the board file";
}

}  // namespace

std::string fitting_board_file(const Board& board, const std::vector<GreyPixels>& images) {
  if (!board.has_markers() || images.empty()) return {};
  // The images with most markers: a few say most, and each dictionary takes a moment.
  MarkersInImages all(images);
  std::vector<std::pair<std::size_t, std::size_t>> most;
  for (std::size_t k = 0; k < images.size(); ++k) most.emplace_back(all.of(board)[k].size(), k);
  std::ranges::sort(most, std::greater());
  std::vector<GreyPixels> chosen;
  constexpr std::size_t enough = 4;
  for (std::size_t k = 0; k < std::min(enough, most.size()); ++k) chosen.push_back(images[most[k].second]);
  MarkersInImages in_images(chosen);
  Board best = board;
  Explained explained = in_images.by(board);
  const int given = explained.score();
  // Two changes at most, each of them the best one.
  for (const auto& variants : {rearranged_in_borders, recoded, rearranged}) {
    if (explained.is_all() && explained.score() > given) break;
    const Board start = best;
    for (const Board& other : variants(start, in_images)) {
      if (!other.problems().empty()) continue;
      const Explained by_other = in_images.by(other);
      if (by_other.score() <= explained.score()) continue;
      best = other;
      explained = by_other;
    }
  }
  constexpr int clearly = 4;
  if (!explained.is_all() || explained.score() < given + clearly) return {};
  // A board of another size: the smallest that explains as much, as the others have rows that no picture shows.
  const auto is_as_good = [&](const Board& smaller) {
    return smaller.problems().empty() && in_images.by(smaller).score() == explained.score();
  };
  for (int Board::*const side : {&Board::rows, &Board::columns}) {
    Board smaller = best;
    while ((best.columns != board.columns || best.rows != board.rows) && --(smaller.*side) > 0 && is_as_good(smaller))
      best = smaller;
  }
  return difference(board, best);
}

std::string explain_missing_board(const Board& board, const std::vector<GreyPixels>& images) {
  std::map<std::string, int> guesses;
  const BoardDetector detector(board);
  for (const GreyPixels& view : images) {
    cv::Mat mirrored;
    cv::flip(mat_of(view), mirrored, 1);
    std::string guess;
    if (!board.has_circles() && detector.detect(view_of(mirrored)).found()) {
      guess = mirrored_text(board);
    } else if (board.has_circles()) {
      guess = other_circles(board, view);
    } else if (!board.has_markers()) {
      guess = other_chessboard(board, mat_of(view));
    }
    if (!guess.empty()) ++guesses[guess];
  }
  const auto best = std::ranges::max_element(guesses, {}, [](const auto& guess) { return guess.second; });
  if (best != guesses.end()) return best->first;
  if (const std::string line = fitting_board_file(board, images); !line.empty())
    return "their markers fit with " + line + " in the board file";
  if (!board.has_markers()) return {};
  // The right dictionary, though others of its family share the codes.
  constexpr std::ptrdiff_t enough_to_tell = 4;
  MarkersInImages in_images(images);
  const bool shows_own = std::ranges::any_of(in_images.of(board), [&](const Markers& found) {
    return enough_to_tell <= std::ranges::count_if(found, [&](const auto& marker) {
             return marker.first >= board.first_marker && marker.first < board.first_marker + board.marker_count();
           });
  });
  if (board.type == BoardType::charuco && shows_own)
    return "its markers are in them, but not the corners of its squares: are square and marker right?";
  return {};
}

}  // namespace huetrack::board
