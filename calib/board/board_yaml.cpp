#include "calib/board/board_yaml.h"

#include <array>

#include "calib/files/number_text.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::board {
namespace {

std::array<int, 2> counts(const yaml::YamlReader& reader, std::string_view key) {
  const auto values = reader.numbers(key, 2, 2, {.min = 1, .max = 100});
  for (const double value : values) {
    if (value != static_cast<int>(value)) reader.fail(key, "must be two whole numbers, [columns, rows]");
  }
  return {static_cast<int>(values[0]), static_cast<int>(values[1])};
}

// `mirrored` or its own markers: two equal prints could not be distinguished.
BoardBack read_back(const yaml::YamlReader& reader) {
  BoardBack back;
  back.thickness = reader.number("thickness", yaml::non_negative);
  const bool has_markers = reader.has("first_marker"), is_mirrored = reader.boolean("mirrored", false);
  if (has_markers == is_mirrored) {
    reader.fail(has_markers ? "first_marker" : "mirrored",
                "one of two must be given: mirrored: true, where the front's print is seen through the sheet, or "
                "first_marker, where the back has markers of its own");
  }
  if (has_markers) back.first_marker = static_cast<int>(reader.integer("first_marker", {.min = 0, .max = 10000}));
  reader.finish();
  return back;
}

constexpr yaml::Range board_length{.min = 0, .max = 10, .min_is_open = true, .max_is_open = true};

}  // namespace

Board read_board(const std::filesystem::path& file) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  reader.version(1, 1);
  constexpr std::array<std::string_view, 3> types{"chessboard", "charuco", "aruco_grid"};
  const std::string type = reader.choice("type", types, "chessboard");
  if (reader.has("board_frame")) reader.string("board_frame");  // a remark for people; the frame is fixed
  Board board;
  if (type == "chessboard") {
    board.type = BoardType::chessboard;
    const auto [columns, rows] = counts(reader, "inner_corners");
    board.columns = columns;
    board.rows = rows;
  } else {
    board.type = type == "charuco" ? BoardType::charuco : BoardType::aruco_grid;
    const auto [columns, rows] = counts(reader, type == "charuco" ? "squares" : "markers");
    board.columns = columns;
    board.rows = rows;
    board.marker = reader.number("marker", board_length);
    std::vector<std::string_view> names;
    for (const auto& dictionary : marker_dictionaries()) names.push_back(dictionary.name);
    board.dictionary = reader.choice("dictionary", names);
    board.first_marker = static_cast<int>(reader.integer("first_marker", {.min = 0, .max = 10000}, 0));
  }
  if (board.type == BoardType::aruco_grid) {
    const double gap = reader.number("gap", yaml::non_negative, 0);
    board.pitch.setConstant(board.marker + gap);
    if (board.columns * board.rows > 1 && !reader.has("gap")) {
      reader.fail("gap", "is missing: the distance between neighbouring markers, metres");
    }
  } else if (reader.has("pitch")) {
    if (reader.has("square")) reader.fail("pitch", "is given together with square: give one of them");
    const auto pitch = reader.numbers("pitch", 2, 2, board_length);
    board.pitch = {pitch[0], pitch[1]};
  } else {
    board.pitch.setConstant(reader.number("square", board_length));
  }
  board.inverted = reader.boolean("inverted", false);
  if (board.type == BoardType::charuco) board.legacy = reader.boolean("legacy", false);
  if (const auto back = reader.optional_map("back")) board.back = read_back(*back);
  reader.finish();
  for (const auto& problem : board.problems()) reader.fail("", problem);
  return board;
}

std::string to_yaml(const Board& board) {
  std::string out = "version: 1\ntype: ";
  out += name(board.type);
  out += board.type == BoardType::chessboard ? "\ninner_corners: ["
         : board.type == BoardType::charuco  ? "\nsquares: ["
                                             : "\nmarkers: [";
  out += std::to_string(board.columns) + ", " + std::to_string(board.rows) + "]\n";
  if (board.type == BoardType::aruco_grid) {
    out += "gap: " + files::shortest_text(board.pitch.x() - board.marker) + "\n";
  } else if (board.pitch.x() == board.pitch.y()) {
    out += "square: " + files::shortest_text(board.pitch.x()) + "\n";
  } else {
    out += "pitch: [" + files::shortest_text(board.pitch.x()) + ", " + files::shortest_text(board.pitch.y()) + "]\n";
  }
  if (board.type != BoardType::chessboard) {
    out += "marker: " + files::shortest_text(board.marker) + "\ndictionary: " + board.dictionary +
           "\nfirst_marker: " + std::to_string(board.first_marker) + "\n";
  }
  if (board.inverted) out += "inverted: true\n";
  if (board.legacy) out += "legacy: true\n";
  if (board.back) {
    out += "back: {thickness: " + files::shortest_text(board.back->thickness) +
           (board.back->first_marker ? ", first_marker: " + std::to_string(*board.back->first_marker)
                                     : ", mirrored: true") +
           "}\n";
  }
  return out;
}

}  // namespace huetrack::board
