// huetrack-calibrate board: a board to print, and its board file.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "calib/board/board_pdf.h"
#include "calib/board/board_yaml.h"
#include "calib/files/config_error.h"
#include "calib/files/output_file.h"
#include "calib/gather/picture_source.h"
#include "calib/program/commands.h"

namespace huetrack::program {
namespace {

struct BoardOptions {
  std::string type, paper = "A4", dictionary;
  int columns = 0, rows = 0, first_marker = 0;
  int border_bits = 1;
  double square_mm = 0, marker_mm = 0, gap_mm = 0, diameter_mm = 0;
  bool inverted = false, legacy = false, from_bottom = false;
  std::filesystem::path out, board_file;
};

board::Board board_of(const BoardOptions& o) {
  board::Board board;
  board.inverted = o.inverted;
  board.legacy = o.legacy;
  board.first_marker = o.first_marker;
  const bool grid = o.type == "aruco_grid" || o.type == "april_grid";
  for (const auto type : {board::BoardType::chessboard, board::BoardType::charuco, board::BoardType::aruco_grid,
                          board::BoardType::circles, board::BoardType::asymmetric_circles}) {
    if (board::name(type) == (grid ? "aruco_grid" : o.type)) board.type = type;
  }
  board.border_bits = o.border_bits;
  board.from_bottom = o.from_bottom;
  if (o.legacy && board.type != board::BoardType::charuco)
    throw gather::InputError("--legacy is for charuco boards only");
  if (o.from_bottom && !grid) throw gather::InputError("--from-bottom is for aruco_grid and april_grid");
  if (o.border_bits != 1 && !board.has_markers()) throw gather::InputError("--border-bits is for boards with markers");
  if (o.diameter_mm > 0 && !board.has_circles()) throw gather::InputError("--diameter is for circles");
  const bool asymmetric = board.type == board::BoardType::asymmetric_circles;
  board.columns = o.columns > 0                             ? o.columns
                  : asymmetric                              ? 4
                  : grid                                    ? 6
                  : board.type == board::BoardType::charuco ? 7
                                                            : 8;
  board.rows = o.rows > 0 ? o.rows : asymmetric ? 11 : grid ? 4 : 5;
  if (board.has_circles()) {
    if (o.marker_mm > 0 || o.gap_mm > 0)
      throw gather::InputError("circles have --square and --diameter, no --marker and no --gap");
    const double square = o.square_mm > 0 ? o.square_mm : asymmetric ? 20 : 25;
    board.pitch.setConstant(square / 1e3);
    board.diameter = (o.diameter_mm > 0 ? o.diameter_mm : (asymmetric ? 0.75 : 0.5) * square) / 1e3;
  } else if (grid) {
    if (o.square_mm > 0) throw gather::InputError("a grid of markers has --marker and --gap, no --square");
    const double marker = o.marker_mm > 0 ? o.marker_mm : 32, gap = o.gap_mm > 0 ? o.gap_mm : 0.3 * marker;
    board.marker = marker / 1e3;
    board.pitch.setConstant((marker + gap) / 1e3);
  } else {
    if (o.gap_mm > 0) throw gather::InputError("--gap is for aruco_grid and april_grid");
    const double square = o.square_mm > 0 ? o.square_mm : board.type == board::BoardType::charuco ? 32 : 25;
    board.pitch.setConstant(square / 1e3);
    if (board.type == board::BoardType::charuco)
      board.marker = (o.marker_mm > 0 ? o.marker_mm : 0.75 * square) / 1e3;
    else if (o.marker_mm > 0)
      throw gather::InputError("a chessboard has no markers: --marker is for the other types");
  }
  board.dictionary = !o.dictionary.empty()    ? o.dictionary
                     : o.type == "april_grid" ? "DICT_APRILTAG_36h11"
                                              : "DICT_4X4_50";
  for (const auto& problem : board.problems()) throw gather::InputError(problem);
  return board;
}

void refuse_other_than_a_board(const std::filesystem::path& file) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(file, none) || std::filesystem::file_size(file, none) == 0) return;
  try {
    board::read_board(file);
  } catch (const files::ConfigError&) {
    throw gather::InputError(file.string() + " exists and is no board file: it is not replaced. Give another --board");
  }
}

ExitStatus print(const BoardOptions& o) {
  const board::Board board = board_of(o);
  const auto paper = board::paper_of(o.paper);
  if (!paper)
    throw gather::InputError(
        "--paper is A4, A3, A2, A1, A0, letter, legal, tabloid or WIDTHxHEIGHT in millimetres, not " + o.paper);
  const board::BoardPdf printed = board::board_pdf(board, *paper);
  const std::filesystem::path yaml =
      o.board_file.empty() ? std::filesystem::path(o.out).replace_extension(".yaml") : o.board_file;
  if (std::filesystem::weakly_canonical(yaml) == std::filesystem::weakly_canonical(o.out))
    throw gather::InputError(yaml.string() +
                             " would be written twice, as the print and as the board file: give another --board");
  files::refuse_other_kind(o.out, {"PDF", [](std::string_view text) { return text.starts_with("%PDF"); }});
  refuse_other_than_a_board(yaml);
  files::write_whole_file(o.out, printed.pdf);
  files::write_whole_file(yaml, "# " + o.out.filename().string() + ", printed at 100 %\n" + board::to_yaml(board));
  std::printf(
      "%s: %s, %.1f x %.1f mm on %s\n%s: the board file for it\nPrint at 100 %%, not fitted to the page; measure "
      "the ruler; glue the board onto something flat.\n",
      o.out.c_str(), board.description().c_str(), printed.size_mm.x(), printed.size_mm.y(), paper->name.c_str(),
      yaml.c_str());
  return ExitStatus::usable;
}

}  // namespace

void add_board_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<BoardOptions>();
  CLI::App* command =
      app.add_subcommand("board", "make a calibration board to print (PDF, true scale), and its board file");
  command->add_option("--type", o->type, "chessboard, charuco, aruco_grid, april_grid, circles or asymmetric_circles")
      ->required()
      ->check(CLI::IsMember({"chessboard", "charuco", "aruco_grid", "april_grid", "circles", "asymmetric_circles"}));
  command->add_option("--out", o->out, "the PDF to write")->required();
  command->add_option("--board", o->board_file, "the board file to write; default: the PDF's name with .yaml");
  command->add_option("--paper", o->paper,
                      "A4 (default), A3, A2, A1, A0, letter, legal, tabloid, or WIDTHxHEIGHT in mm");
  command
      ->add_option("--columns", o->columns,
                   "chessboard: inner corners; charuco: squares; grids: markers, or circles in a row")
      ->check(CLI::Range(1, 100));
  command->add_option("--rows", o->rows, "the same, vertically")->check(CLI::Range(1, 100));
  command->add_option("--square", o->square_mm, "side of a square, mm; circles: distance of the rows")
      ->check(CLI::Range(1.0, 1000.0));
  command->add_option("--marker", o->marker_mm, "side of a marker, mm; default: charuco 3/4 of a square")
      ->check(CLI::Range(1.0, 1000.0));
  command->add_option("--gap", o->gap_mm, "between the markers of a grid, mm; default: 0.3 of a marker")
      ->check(CLI::Range(0.1, 1000.0));
  command->add_option("--diameter", o->diameter_mm, "of a circle, mm; default: 1/2 of --square, asymmetric: 3/4")
      ->check(CLI::Range(1.0, 1000.0));
  command->add_option("--border-bits", o->border_bits, "width of the markers' black border, in bits; Kalibr: 2")
      ->check(CLI::Range(1, 4));
  command->add_flag("--from-bottom", o->from_bottom, "grids: the rows are numbered from the bottom, as Kalibr's");
  command->add_option("--dictionary", o->dictionary,
                      "its name in OpenCV; default: DICT_4X4_50, april_grid: DICT_APRILTAG_36h11");
  command->add_option("--first-marker", o->first_marker, "number of the first marker")->check(CLI::Range(0, 10000));
  command->add_flag("--inverted", o->inverted, "black and white swapped");
  command->add_flag("--legacy", o->legacy, "charuco: the layout of OpenCV before 4.6");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token&) { return print(*o); }; });
}

}  // namespace huetrack::program
