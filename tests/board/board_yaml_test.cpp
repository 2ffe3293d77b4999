#include "calib/board/board_yaml.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>

#include "calib/files/config_error.h"

namespace huetrack::board {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class BoardYaml : public testing::Test {
 protected:
  BoardYaml() : folder_(testing::TempDir() + "board_yaml_test." + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~BoardYaml() override { fs::remove_all(folder_); }

  Board read(const std::string& yaml) const {
    const fs::path file = folder_ / "board.yaml";
    std::ofstream(file, std::ios::binary) << yaml;
    return read_board(file);
  }

  std::string problem(const std::string& yaml) const {
    try {
      read(yaml);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "no error";
  }

  fs::path folder_;
};

TEST_F(BoardYaml, ReadsAChessboard) {
  const Board board = read("inner_corners: [9, 6]\nsquare: 0.06\n");
  EXPECT_EQ(board.type, BoardType::chessboard);
  EXPECT_EQ(board.point_count(), 54);
  EXPECT_EQ(board.point(10), Eigen::Vector3d(0.06, 0.06, 0));
}

TEST_F(BoardYaml, EveryBoardReadsBackTheSame) {
  for (const char* yaml :
       {"type: chessboard\ninner_corners: [6, 6]\npitch: [0.0354, 0.0358]\n",
        "type: chessboard\ninner_corners: [7, 5]\nsquare: 0.1\ninverted: true\n",
        "type: chessboard\ninner_corners: [7, 5]\nsquare: 0.1\nback: {thickness: 0.003, mirrored: true}\n",
        "type: charuco\nsquares: [4, 6]\nsquare: 0.054\nmarker: 0.0405\ndictionary: DICT_4X4_1000\nback: "
        "{thickness: 0, first_marker: 12}\n",
        "type: charuco\nsquares: [4, 6]\nsquare: 0.054\nmarker: 0.0405\ndictionary: DICT_4X4_1000\nlegacy: true\n",
        "type: aruco_grid\nmarkers: [3, 2]\nmarker: 0.04\ngap: 0.01\ndictionary: DICT_APRILTAG_36h11\nborder_bits: "
        "2\nnumbered_from: bottom\n",
        "type: circles\nsize: [7, 6]\nsquare: 0.03\ndiameter: 0.015\n",
        "type: asymmetric_circles\nsize: [4, 11]\nsquare: 0.02\ninverted: true\n",
        "type: aruco_grid\nmarkers: [3, 2]\nmarker: 0.04\ngap: 0.01\ndictionary: DICT_APRILTAG_36h11\nfirst_marker: "
        "7\n"}) {
    const Board board = read(yaml);
    EXPECT_EQ(read(to_yaml(board)), board) << yaml;
  }
}

// github.com/ethz-asl/kalibr/wiki/calibration-targets
TEST_F(BoardYaml, ReadsKalibrsTargets) {
  const Board tags =
      read("target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n");
  EXPECT_EQ(tags.type, BoardType::aruco_grid);
  EXPECT_EQ(tags.columns, 6);
  EXPECT_EQ(tags.rows, 5);
  EXPECT_EQ(tags.border_bits, 2);
  EXPECT_TRUE(tags.from_bottom);
  EXPECT_NEAR(tags.pitch.x(), 0.1144, 1e-12);
  const Board squares = read(
      "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.05\n");
  EXPECT_EQ(squares.type, BoardType::chessboard);
  EXPECT_EQ(squares.columns, 6);
  EXPECT_EQ(squares.pitch, Eigen::Vector2d(0.05, 0.06));
  const Board circles =
      read("target_type: 'circlegrid'\ntargetCols: 4\ntargetRows: 11\nspacingMeters: 0.02\nasymmetricGrid: True\n");
  EXPECT_EQ(circles.type, BoardType::asymmetric_circles);
  EXPECT_LT((circles.point(5) - Eigen::Vector3d(0.06, 0.02, 0)).norm(), 1e-12);  // second row, second circle
  EXPECT_EQ(
      read("target_type: circlegrid\ntargetCols: 6\ntargetRows: 7\nspacingMeters: 0.02\nasymmetricGrid: False\n").type,
      BoardType::circles);
  EXPECT_THROW(read("target_type: aprilgrid\ntagCols: 6\n"), files::ConfigError);
  // as their other keys show
  const Board offset = read("tagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\ncodeOffset: 36\n");
  EXPECT_EQ(offset.type, BoardType::aruco_grid);
  EXPECT_EQ(offset.first_marker, 36);
  EXPECT_EQ(tags.first_marker, 0);
  EXPECT_EQ(read("targetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.05\n").type,
            BoardType::chessboard);
  EXPECT_EQ(read("targetCols: 4\ntargetRows: 11\nspacingMeters: 0.02\nasymmetricGrid: True\n").type,
            BoardType::asymmetric_circles);
}

TEST_F(BoardYaml, MillimetresAreRecognised) {
  EXPECT_THAT(problem("inner_corners: [9, 6]\nsquare: 98.55\n"), testing::HasSubstr("did you mean 0.09855?"));
  EXPECT_THAT(problem("inner_corners: [9, 6]\nsquare: -1\n"), testing::HasSubstr("square"));
}

TEST(BoardSymmetriesOfCircles, AreTurnsThatMapTheGridToItself) {
  const auto count = [](BoardType type, int columns, int rows) {
    return Board{.type = type, .columns = columns, .rows = rows}.symmetries().size();
  };
  EXPECT_EQ(count(BoardType::circles, 7, 5), 2u);
  EXPECT_EQ(count(BoardType::circles, 5, 5), 4u);
  EXPECT_EQ(count(BoardType::asymmetric_circles, 4, 11), 1u);  // its first and last rows begin at the same side
  EXPECT_EQ(count(BoardType::asymmetric_circles, 4, 10), 2u);
}

TEST_F(BoardYaml, RejectsUnknownKeysAndValues) {
  EXPECT_THAT(problem("inner_corners: [9, 6]\nsqare: 0.06\nsquare: 0.06\n"),
              HasSubstr("board.yaml:2: sqare is not a known key (did you mean square?)"));
  EXPECT_THAT(problem("inner_corners: [9, 6]\nsquare: 60\n"), HasSubstr("board.yaml:2: square"));  // millimetres
  EXPECT_THAT(problem("inner_corners: [9.5, 6]\nsquare: 0.06\n"), HasSubstr("two whole numbers"));
  EXPECT_THAT(problem("inner_corners: [2, 6]\nsquare: 0.06\n"), HasSubstr("at least 3 x 3 inner corners"));
  EXPECT_THAT(problem("type: charuco\nsquares: [4, 6]\nsquare: 0.03\nmarker: 0.04\ndictionary: DICT_4X4_50\n"),
              HasSubstr("marker must be smaller than the squares"));
  EXPECT_THAT(problem("type: charuco\nsquares: [4, 6]\nsquare: 0.03\nmarker: 0.02\ndictionary: DICT_4X4_20\n"),
              HasSubstr("dictionary"));
  EXPECT_THAT(problem("type: charuco\nsquares: [12, 12]\nsquare: 0.03\nmarker: 0.02\ndictionary: DICT_4X4_50\n"),
              HasSubstr("DICT_4X4_50 has 50 markers; the board needs 0 to 71"));
}

TEST_F(BoardYaml, RejectsABackThatCannotBeDistinguished) {
  const std::string charuco = "type: charuco\nsquares: [4, 6]\nsquare: 0.03\nmarker: 0.02\ndictionary: DICT_4X4_50\n";
  EXPECT_THAT(problem(charuco + "back: {thickness: 0.003}\n"), HasSubstr("one of two must be given: mirrored: true"));
  EXPECT_THAT(problem(charuco + "back: {thickness: 0.003, mirrored: false}\n"), HasSubstr("one of two must be given"));
  EXPECT_THAT(problem(charuco + "back: {thickness: 0.003, mirrored: true, first_marker: 20}\n"),
              HasSubstr("one of two must be given"));
  EXPECT_THAT(problem(charuco + "back: {mirrored: true}\n"), HasSubstr("thickness"));
  EXPECT_THAT(problem(charuco + "back: {thickness: 3, mirrored: true}\n"), HasSubstr("less than 1 m"));
  EXPECT_THAT(problem(charuco + "back: {thickness: 0.003, first_marker: 11}\n"), HasSubstr("markers in common"));
  EXPECT_THAT(problem(charuco + "back: {thickness: 0.003, first_marker: 40}\n"), HasSubstr("its back needs 40 to 51"));
  EXPECT_THAT(problem("inner_corners: [9, 6]\nsquare: 0.06\nback: {thickness: 0.003, first_marker: 40}\n"),
              HasSubstr("a chessboard's back has no markers"));
}

TEST_F(BoardYaml, ReadsTheBoardOfTheRenderedSequence) {
  const fs::path file = fs::path(HUETRACK_SHARED_DATA) / "rendered/chessboard/board.yaml";
  if (!fs::exists(file)) GTEST_SKIP() << file << " is not there";
  EXPECT_EQ(read_board(file), read("inner_corners: [9, 6]\nsquare: 0.06\n"));
}

TEST(BoardSymmetries, MatchTheSquareColours) {
  const auto count = [](int columns, int rows) { return Board{.columns = columns, .rows = rows}.symmetries().size(); };
  EXPECT_EQ(count(9, 6), 1U);  // 10 x 7 squares: two black corner squares on one side
  EXPECT_EQ(count(9, 7), 2U);  // black corner squares opposite each other
  EXPECT_EQ(count(8, 6), 2U);  // all four black
  EXPECT_EQ(count(6, 6), 4U);
  EXPECT_EQ(count(7, 7), 2U);  // a quarter turn swaps black and white
}

TEST(BoardSymmetries, ExchangeTheSidesIfTheBackLooksTheSame) {
  const auto count = [](int columns, int rows) {
    return Board{.columns = columns, .rows = rows, .back = BoardBack{.thickness = 0.005}}.symmetries().size();
  };
  EXPECT_EQ(count(9, 6), 2U);  // upside down
  EXPECT_EQ(count(9, 7), 2U);  // its back has black and white swapped
  EXPECT_EQ(count(8, 6), 4U);
  EXPECT_EQ(count(6, 6), 8U);
  EXPECT_EQ(count(7, 7), 4U);  // turned about a diagonal
}

class BoardOfSixBySix : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Sides, BoardOfSixBySix, testing::Bool());

TEST_P(BoardOfSixBySix, SymmetriesMovePointsRigidly) {
  Board board{.columns = 6, .rows = 6};
  if (GetParam()) board.back = BoardBack{.thickness = 0.005};
  for (const auto& symmetry : board.symmetries()) {
    for (int a = 0; a < board.point_count(); ++a) {
      for (int b = 0; b < a; ++b) {
        const auto moved = [&](int id) { return board.point(symmetry[static_cast<std::size_t>(id)]); };
        EXPECT_NEAR((moved(a) - moved(b)).norm(), (board.point(a) - board.point(b)).norm(), 1e-12);
      }
    }
    const auto moved = [&](int id) { return board.point(symmetry[static_cast<std::size_t>(id)]); };
    const Eigen::Vector3d x = moved(1) - moved(0), y = moved(6) - moved(0);
    // A front that became the back is seen from behind.
    const bool is_turned_over = moved(0).z() > 0;
    EXPECT_GT((is_turned_over ? -1 : 1) * x.cross(y).z(), 0) << "not a turn but a mirror image";
  }
}

}  // namespace
}  // namespace huetrack::board
