#include "calib/board/board_yaml.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "calib/files/number_text.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::board {
namespace {

// The word of a type, and what its two counts are called.
struct TypeKeys {
  BoardType type;
  std::string_view counts;
};
constexpr std::array<TypeKeys, 5> type_keys{{{BoardType::chessboard, "inner_corners"},
                                             {BoardType::charuco, "squares"},
                                             {BoardType::aruco_grid, "markers"},
                                             {BoardType::circles, "size"},
                                             {BoardType::asymmetric_circles, "size"}}};

constexpr yaml::Range board_length{.min = 0, .max = 10, .min_is_open = true, .max_is_open = true};

// In metres; millimetres are recognised by their size.
double length_of(const yaml::YamlReader& reader, std::string_view key) {
  const double length = reader.number(key, yaml::positive);
  if (length < board_length.max) return length;
  reader.fail(key, fmt::format("is {:g} m: lengths are in metres: did you mean {:g}?", length, length / 1000));
}

void read_counts(const yaml::YamlReader& reader, std::string_view key, Board& board) {
  const auto values = reader.numbers(key, 2, 2, {.min = 1, .max = 100});
  for (const double value : values) {
    if (value != static_cast<int>(value)) reader.fail(key, "must be two whole numbers, [columns, rows]");
  }
  board.columns = static_cast<int>(values[0]);
  board.rows = static_cast<int>(values[1]);
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

void read_markers(const yaml::YamlReader& reader, Board& board) {
  board.marker = length_of(reader, "marker");
  std::vector<std::string_view> names;
  for (const auto& dictionary : marker_dictionaries()) names.push_back(dictionary.name);
  board.dictionary = reader.choice("dictionary", names);
  board.first_marker = static_cast<int>(reader.integer("first_marker", {.min = 0, .max = 10000}, 0));
  board.border_bits = static_cast<int>(reader.integer("border_bits", {.min = 1, .max = 4}, 1));
}

Board read_own(const yaml::YamlReader& reader) {
  reader.version(1, 1);
  std::vector<std::string_view> types;
  for (const TypeKeys& known : type_keys) types.push_back(name(known.type));
  const std::string type = reader.choice("type", types, "chessboard");
  if (reader.has("board_frame")) reader.string("board_frame");  // a remark for people; the frame is fixed
  Board board;
  for (const TypeKeys& known : type_keys) {
    if (type != name(known.type)) continue;
    board.type = known.type;
    read_counts(reader, known.counts, board);
  }
  if (board.has_markers()) read_markers(reader, board);
  if (board.has_circles()) board.diameter = reader.number("diameter", board_length, 0);
  if (board.type == BoardType::aruco_grid) {
    constexpr std::array<std::string_view, 2> ends{"top", "bottom"};
    board.from_bottom = reader.choice("numbered_from", ends, "top") == "bottom";
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
    board.pitch.setConstant(length_of(reader, "square"));
  }
  board.inverted = reader.boolean("inverted", false);
  if (board.type == BoardType::charuco) board.legacy = reader.boolean("legacy", false);
  if (const auto back = reader.optional_map("back")) board.back = read_back(*back);
  return board;
}

// Kalibr's target file (github.com/ethz-asl/kalibr/wiki/calibration-targets). Its AprilGrid has tags with two bits of
// border, numbered from the bottom left.
Board read_kalibr_target(const yaml::YamlReader& reader) {
  constexpr std::array<std::string_view, 3> types{"aprilgrid", "checkerboard", "circlegrid"};
  const std::string type = reader.has("target_type")        ? reader.choice("target_type", types)
                           : reader.has("tagCols")          ? "aprilgrid"
                           : reader.has("colSpacingMeters") ? "checkerboard"
                                                            : "circlegrid";
  Board board;
  const auto count = [&](std::string_view key) {
    return static_cast<int>(reader.integer(key, {.min = 1, .max = 100}));
  };
  board.columns = count(type == "aprilgrid" ? "tagCols" : "targetCols");
  board.rows = count(type == "aprilgrid" ? "tagRows" : "targetRows");
  if (type == "aprilgrid") {
    board.type = BoardType::aruco_grid;
    board.marker = reader.number("tagSize", board_length);
    board.pitch.setConstant(board.marker * (1 + reader.number("tagSpacing", yaml::non_negative)));
    board.dictionary = "DICT_APRILTAG_36h11";
    board.first_marker = static_cast<int>(reader.integer("codeOffset", {.min = 0, .max = 586}, 0));
    board.border_bits = 2;
    board.from_bottom = true;
  } else if (type == "checkerboard") {
    board.pitch = {reader.number("colSpacingMeters", board_length), reader.number("rowSpacingMeters", board_length)};
  } else {
    board.type = reader.boolean("asymmetricGrid", false) ? BoardType::asymmetric_circles : BoardType::circles;
    board.pitch.setConstant(reader.number("spacingMeters", board_length));
  }
  return board;
}

}  // namespace

Board read_board(const std::filesystem::path& file) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  const bool is_kalibrs = reader.has("target_type") || reader.has("tagCols") || reader.has("targetCols");
  const Board board = is_kalibrs ? read_kalibr_target(reader) : read_own(reader);
  reader.finish();
  for (const auto& problem : board.problems()) reader.fail("", problem);
  return board;
}

std::string to_yaml(const Board& board) {
  using files::shortest_text;
  std::string out = "version: 1\ntype: ";
  out += name(board.type);
  for (const TypeKeys& known : type_keys) {
    if (known.type == board.type) out += "\n" + std::string(known.counts);
  }
  out += ": [" + std::to_string(board.columns) + ", " + std::to_string(board.rows) + "]\n";
  if (board.type == BoardType::aruco_grid) {
    constexpr double nanometres = 1e9;  // the difference is not exact
    out += "gap: " + shortest_text(std::round(nanometres * (board.pitch.x() - board.marker)) / nanometres) + "\n";
  } else if (board.pitch.x() == board.pitch.y()) {
    out += "square: " + shortest_text(board.pitch.x()) + "\n";
  } else {
    out += "pitch: [" + shortest_text(board.pitch.x()) + ", " + shortest_text(board.pitch.y()) + "]\n";
  }
  if (board.has_markers()) {
    out += "marker: " + shortest_text(board.marker) + "\ndictionary: " + board.dictionary +
           "\nfirst_marker: " + std::to_string(board.first_marker) + "\n";
  }
  if (board.diameter > 0) out += "diameter: " + shortest_text(board.diameter) + "\n";
  if (board.border_bits != 1) out += "border_bits: " + std::to_string(board.border_bits) + "\n";
  if (board.from_bottom) out += "numbered_from: bottom\n";
  if (board.inverted) out += "inverted: true\n";
  if (board.legacy) out += "legacy: true\n";
  if (board.back) {
    out += "back: {thickness: " + shortest_text(board.back->thickness) +
           (board.back->first_marker ? ", first_marker: " + std::to_string(*board.back->first_marker)
                                     : ", mirrored: true") +
           "}\n";
  }
  return out;
}

}  // namespace huetrack::board
