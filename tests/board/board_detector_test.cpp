#include "calib/board/board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgcodecs.hpp>

#include "board/captures.h"
#include "board/drawn_board.h"
#include "calib/board/board_yaml.h"

namespace huetrack::board {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

cv::Mat grey_image(const fs::path& file) {
  cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  EXPECT_FALSE(image.empty()) << file;
  return image;
}

Eigen::Vector2d apply(const cv::Matx33d& h, const Eigen::Vector2d& p) {
  const cv::Vec3d q = h * cv::Vec3d(p.x(), p.y(), 1);
  return {q[0] / q[2], q[1] / q[2]};
}

// The drawn board tilted into an image: four corners of the drawing to four image points.
cv::Matx33d tilted(const cv::Mat& drawn, const std::array<cv::Point2f, 4>& corners) {
  const auto w = static_cast<float>(drawn.cols), h = static_cast<float>(drawn.rows);
  const std::array<cv::Point2f, 4> from{cv::Point2f{0, 0}, {w, 0}, {w, h}, {0, h}};
  return cv::getPerspectiveTransform(from.data(), corners.data());
}

// rms distance of the detected points to where they are; points that the board does not have fail.
// (One image of a symmetric board does not say which way up it is.)
double rms_px(const Board& board, const BoardDetection& detection, const DrawnBoard& drawn, const cv::Matx33d& h) {
  double least = 1e300;
  for (const auto& symmetry : board.symmetries()) {
    double sum = 0;
    for (std::size_t k = 0; k < detection.ids.size(); ++k) {
      const int id = symmetry[static_cast<std::size_t>(detection.ids[k])];
      sum += (detection.px[k] - apply(h, drawn.pixel(board.point(id)))).squaredNorm();
    }
    least = std::min(least, std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, detection.ids.size()))));
  }
  return least;
}

struct NamedBoard {
  std::string name;
  Board board;
};
std::ostream& operator<<(std::ostream& out, const NamedBoard& b) {
  return out << b.name;
}

const NamedBoard chessboard{"chessboard", {.columns = 9, .rows = 6}};
const NamedBoard charuco{
    "charuco", {.type = BoardType::charuco, .columns = 7, .rows = 5, .marker = 0.0225, .dictionary = "DICT_5X5_100"}};

std::vector<NamedBoard> all_boards() {
  Board inverted_chessboard = chessboard.board, inverted = charuco.board, even = charuco.board, legacy;
  inverted_chessboard.inverted = true;
  inverted.inverted = true;
  inverted.dictionary = "DICT_4X4_1000";
  even.columns = 5;
  even.rows = 6;
  legacy = even;
  legacy.legacy = true;
  legacy.first_marker = 20;
  const Board grid{
      .type = BoardType::aruco_grid, .columns = 4, .rows = 3, .marker = 0.024, .dictionary = "DICT_6X6_250"};
  Board tags = grid;
  tags.dictionary = "DICT_APRILTAG_36h11";
  Board kalibr = tags;
  kalibr.border_bits = 2;
  kalibr.from_bottom = true;
  const Board circles{.type = BoardType::circles, .columns = 7, .rows = 5, .diameter = 0.016};
  Board asymmetric = circles;
  asymmetric.type = BoardType::asymmetric_circles;
  asymmetric.columns = 4;
  asymmetric.rows = 9;
  Board white_circles = circles;
  white_circles.inverted = true;
  return {chessboard,
          {"kalibr_grid", kalibr},
          {"circles", circles},
          {"asymmetric_circles", asymmetric},
          {"white_circles", white_circles},
          {"inverted_chessboard", inverted_chessboard},
          charuco,
          {"inverted_charuco", inverted},
          {"even_rows", even},
          {"legacy_even_rows", legacy},
          {"aruco_grid", grid},
          {"apriltag_grid", tags}};
}

class EveryBoard : public testing::TestWithParam<NamedBoard> {};
INSTANTIATE_TEST_SUITE_P(All, EveryBoard, testing::ValuesIn(all_boards()),
                         [](const auto& param_info) { return param_info.param.name; });

TEST_P(EveryBoard, IsDetectedCompletelyAndAccurately) {
  const Board& board = GetParam().board;
  const DrawnBoard drawn = draw_board(board);
  const std::array<std::array<cv::Point2f, 4>, 3> views{{
      {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}},
      {{{500, 30}, {590, 440}, {200, 420}, {180, 120}}},   // turned by a quarter, tilted
      {{{440, 330}, {180, 400}, {190, 140}, {420, 180}}},  // upside down, with squares of some 25 pixels
  }};
  for (std::size_t v = 0; v < views.size(); ++v) {
    const cv::Matx33d h = tilted(drawn.image, views[v]);
    const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, v);
    const BoardDetection detection = BoardDetector(board).detect(view_of(image));
    const bool is_tiny = board.border_bits == 2 && v == 2;  // bits of 2 pixels
    EXPECT_GE(4 * detection.ids.size(), static_cast<std::size_t>((is_tiny ? 3 : 4) * board.point_count()))
        << "view " << v << ": " << detection.why_not;
    EXPECT_TRUE(std::ranges::is_sorted(detection.ids));
    // The corners of lone squares are softer than those where four squares meet.
    // The centre of a circle's image is not the image of its centre: here by up to 0.3 px.
    EXPECT_LT(rms_px(board, detection, drawn, h), board.type == BoardType::aruco_grid ? 0.6
                                                  : board.has_circles()               ? 0.35
                                                                                      : 0.1)
        << "view " << v;
    if (board.has_circles()) {
      EXPECT_NEAR(detection.marker_m, board.diameter, 0.05 * board.diameter);
    }
  }
}

// Boards whose two sides one picture tells apart.
std::vector<Board> two_sided_boards() {
  Board mirrored = charuco.board, own = charuco.board, inverted = charuco.board, odd = chessboard.board;
  mirrored.back = own.back = inverted.back = odd.back = BoardBack{.thickness = 0.01};
  own.back->first_marker = 40;
  inverted.inverted = true;
  odd.rows = 7;  // its mirror image has black and white swapped
  Board grid{.type = BoardType::aruco_grid, .columns = 4, .rows = 3, .marker = 0.024, .dictionary = "DICT_6X6_250"};
  grid.back = BoardBack{.thickness = 0.01};
  Board own_grid = grid;
  own_grid.back->first_marker = 100;
  return {mirrored, own, inverted, odd, grid, own_grid};
}

TEST(TwoSidedBoard, ABackGivesItsOwnPoints) {
  for (const Board& board : two_sided_boards()) {
    const std::string which = to_yaml(board);
    const DrawnBoard drawn = draw_board(board.front_alone());
    cv::Mat print = draw_board(board.back_alone()).image;
    if (!board.back->first_marker) cv::flip(print, print, 1);
    const cv::Matx33d h = tilted(print, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
    const BoardDetection back = BoardDetector(board).detect(view_of(seen_through(print, h, {640, 480}, 2, 1)));
    ASSERT_EQ(static_cast<int>(back.ids.size()), board.side_point_count()) << which << back.why_not;
    EXPECT_TRUE(std::ranges::is_sorted(back.ids));
    double sum = 0;
    // Drawn grids end with a gap, which is no part of their outline.
    const bool ends_with_gap = board.type == BoardType::aruco_grid && board.back->first_marker;
    const double right = print.cols - 1 - (ends_with_gap ? (board.pitch.x() - board.marker) * drawn.px_per_m : 0);
    for (std::size_t k = 0; k < back.ids.size(); ++k) {
      const Eigen::Vector3d p = board.point(back.ids[k]);
      EXPECT_EQ(p.z(), 0.01) << which << ": taken for the front";
      // Somebody who looks at the back sees what is on the front's left on the right.
      const Eigen::Vector2d on_front = drawn.pixel(p);
      sum += (back.px[k] - apply(h, {right - on_front.x(), on_front.y()})).squaredNorm();
    }
    EXPECT_LT(std::sqrt(sum / board.side_point_count()), board.type == BoardType::aruco_grid ? 0.6 : 0.1) << which;

    const cv::Mat front = seen_through(drawn.image, h, {640, 480}, 2, 2);
    const BoardDetection seen = BoardDetector(board).detect(view_of(front));
    ASSERT_EQ(static_cast<int>(seen.ids.size()), board.side_point_count()) << which << seen.why_not;
    EXPECT_EQ(seen.ids.back(), board.side_point_count() - 1) << which;
    EXPECT_LT(rms_px(board, seen, drawn, h), board.type == BoardType::aruco_grid ? 0.6 : 0.1) << which;
  }
}

TEST(TwoSidedBoard, ImagesOfAnUndeclaredBackAreReportedAsMirrored) {
  cv::Mat print = draw_board(charuco.board).image;
  cv::flip(print, print, 1);
  const cv::Matx33d h = tilted(print, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  const cv::Mat image = seen_through(print, h, {640, 480}, 2, 1);
  EXPECT_FALSE(BoardDetector(charuco.board).detect(view_of(image)).found());
  EXPECT_THAT(explain_missing_board(charuco.board, {view_of(image)}),
              testing::AllOf(HasSubstr("mirrored"), HasSubstr("back of a board that is printed on both sides")));
}

TEST(BoardDetectorMarkers, OpenCvsOwnDrawingIsTheNewLayout) {
  Board board = charuco.board;
  board.columns = 5;
  board.rows = 6;
  const auto opencv = cv::aruco::CharucoBoard::create(5, 6, 0.03F, 0.0225F,
                                                      cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100));
  cv::Mat image;
  opencv->draw({500, 600}, image, 0);
  cv::copyMakeBorder(image, image, 40, 40, 40, 40, cv::BORDER_CONSTANT, cv::Scalar(255));
  const BoardDetection detection = BoardDetector(board).detect(view_of(image));
  ASSERT_EQ(detection.ids.size(), 20U);
  EXPECT_NEAR((detection.px[0] - Eigen::Vector2d(139.5, 139.5)).norm(), 0, 0.2);
  EXPECT_NEAR((detection.px[19] - Eigen::Vector2d(439.5, 539.5)).norm(), 0, 0.2);
}

TEST(BoardDetectorParts, CutByTheImage) {
  const Board& board = chessboard.board;
  const DrawnBoard drawn = draw_board(board);
  // Two columns are beyond the right edge.
  const cv::Matx33d h = tilted(drawn.image, {{{260, 60}, {800, 90}, {780, 430}, {240, 400}}});
  const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
  const BoardDetection detection = BoardDetector(board).detect(view_of(image));
  EXPECT_GE(detection.ids.size(), 36U) << detection.why_not;
  EXPECT_LT(detection.ids.size(), 54U);
  EXPECT_LT(rms_px(board, detection, drawn, h), 0.1);
}

TEST(BoardDetectorParts, PartlyHidden) {
  for (const Board& board : {chessboard.board, charuco.board}) {
    const DrawnBoard drawn = draw_board(board);
    const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
    cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
    cv::ellipse(image, {330, 420}, {60, 230}, 0, 0, 360, cv::Scalar(90), -1);  // an arm over the middle
    const BoardDetection detection = BoardDetector(board).detect(view_of(image));
    EXPECT_GE(detection.ids.size(), static_cast<std::size_t>(board.point_count()) / 2) << detection.why_not;
    EXPECT_LT(detection.ids.size(), static_cast<std::size_t>(board.point_count()));
    EXPECT_LT(rms_px(board, detection, drawn, h), 0.15);
  }
}

TEST(BoardDetectorParts, RejectsAnAmbiguousPart) {
  const DrawnBoard drawn = draw_board(chessboard.board);
  // All four sides lie outside of the image.
  const cv::Matx33d h = tilted(drawn.image, {{{-400, -300}, {1040, -280}, {1000, 760}, {-380, 780}}});
  const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
  const BoardDetection detection = BoardDetector(chessboard.board).detect(view_of(image));
  EXPECT_FALSE(detection.found());
  EXPECT_THAT(detection.why_not, HasSubstr("could be at several places"));
}

TEST(BoardDetectorTrouble, IsNamed) {
  const BoardDetector detector(chessboard.board);
  EXPECT_EQ(detector.detect(view_of(cv::Mat(480, 640, CV_8UC1, cv::Scalar(3)))).why_not, "the image is black");
  EXPECT_EQ(detector.detect(view_of(cv::Mat(480, 640, CV_8UC1, cv::Scalar(120)))).why_not,
            "the image is empty (one even grey)");
  const DrawnBoard drawn = draw_board(chessboard.board);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  cv::Mat image = seen_through(drawn.image, h, {640, 480}, 0, 1);
  cv::GaussianBlur(image, image, {}, 30);
  EXPECT_EQ(detector.detect(view_of(image)).why_not, "the image is blurred");
  EXPECT_EQ(detector.detect(view_of(cv::Mat(20, 20, CV_8UC1, cv::Scalar(120)))).why_not, "the image is too small");
  Board wrong = chessboard.board;
  wrong.pitch.x() = -1;
  EXPECT_THROW(BoardDetector{wrong}, std::invalid_argument);
}

TEST(BoardDetectorTrouble, AWrongBoardFileIsExplained) {
  const auto explanation = [](const Board& real, const Board& in_file) {
    const DrawnBoard drawn = draw_board(real);
    const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
    const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
    EXPECT_FALSE(BoardDetector(in_file).detect(view_of(image)).found());
    return explain_missing_board(in_file, {view_of(image)});
  };
  Board counted_squares = chessboard.board;
  counted_squares.columns = 10;
  counted_squares.rows = 7;
  EXPECT_THAT(explanation(chessboard.board, counted_squares), HasSubstr("a chessboard of 9x6 inner corners"));
  std::swap(counted_squares.columns, counted_squares.rows);  // the order of the file is kept
  EXPECT_THAT(explanation(chessboard.board, counted_squares), HasSubstr("a chessboard of 6x9 inner corners"));
  Board smaller = chessboard.board;
  smaller.columns = 8;
  EXPECT_THAT(explanation(chessboard.board, smaller), HasSubstr("a chessboard of 9x6 inner corners"));
  Board inverted = charuco.board;
  inverted.inverted = true;
  EXPECT_THAT(explanation(inverted, charuco.board), HasSubstr("inverted: true"));
  Board other = charuco.board;
  other.dictionary = "DICT_6X6_250";
  EXPECT_THAT(explanation(charuco.board, other), HasSubstr("DICT_5X5"));
  Board smaller_markers = charuco.board;
  smaller_markers.marker *= 0.5;
  EXPECT_THAT(explanation(charuco.board, smaller_markers),
              AllOf(HasSubstr("are square and marker right?"), Not(HasSubstr("dictionary"))));
  Board transposed = charuco.board;
  std::swap(transposed.columns, transposed.rows);
  EXPECT_THAT(explanation(charuco.board, transposed), HasSubstr("squares: [7, 5] in the board file"));
  // (Swapped counts of symmetric circles are the same grid, turned.)
  const Board circles{.type = BoardType::circles, .columns = 7, .rows = 5, .diameter = 0.016};
  Board white = circles;
  white.inverted = true;
  EXPECT_THAT(explanation(white, circles), HasSubstr("inverted: true in the board file"));
}

// Circles of half a pitch, tilted by 60 degrees: their images' centres of area, within hundredths of a pixel.
TEST(BoardDetectorCircles, AreDetectedAtTheCentreOfTheirArea) {
  const Board board{.type = BoardType::circles, .columns = 7, .rows = 5, .diameter = 0.016};
  const DrawnBoard drawn = draw_board(board);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {500, 150}, {500, 330}, {120, 430}}});
  const BoardDetection found = BoardDetector(board).detect(view_of(seen_through(drawn.image, h, {640, 480}, 1, 1)));
  ASSERT_EQ(found.ids.size(), 35u) << found.why_not;
  double sum = 0, sum_of_centres = 0;
  for (std::size_t k = 0; k < 35; ++k) {
    const Eigen::Vector2d centre = drawn.pixel(board.point(found.ids[k]));
    const double radius = board.diameter / 2 * drawn.px_per_m;
    std::vector<cv::Point2f> rim;
    for (int i = 0; i < 360; ++i) {
      const double a = i * std::numbers::pi / 180;
      const Eigen::Vector2d p = apply(h, centre + radius * Eigen::Vector2d(std::cos(a), std::sin(a)));
      rim.emplace_back(float(p.x()), float(p.y()));
    }
    const cv::Moments m = cv::moments(rim);
    sum += (found.px[k] - Eigen::Vector2d(m.m10 / m.m00, m.m01 / m.m00)).squaredNorm() / 35;
    sum_of_centres += (found.px[k] - apply(h, centre)).squaredNorm() / 35;
  }
  EXPECT_LT(std::sqrt(sum), 0.05);
  EXPECT_GT(std::sqrt(sum_of_centres), 0.1);  // what a solver that does not model it would take for lens and pose
  std::printf("circles: %.3f px rms from the centre of area, %.3f from the image of the centre\n", std::sqrt(sum),
              std::sqrt(sum_of_centres));
}

TEST(BoardDetectorCircles, APrintWithMoreCirclesIsNotTaken) {
  const Board board{.type = BoardType::circles, .columns = 7, .rows = 5, .diameter = 0.016};
  Board fewer = board;
  fewer.columns = 6;
  const DrawnBoard drawn = draw_board(board);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  EXPECT_FALSE(BoardDetector(fewer).detect(view_of(seen_through(drawn.image, h, {640, 480}, 2, 1))).found());
}

// Kalibr prints its tags turned by half against OpenCV's; only its own file says where the origin is.
TEST(BoardDetectorMarkers, AprilGridsOfKalibrAreFoundAsTheyArePrinted) {
  const Board board{.type = BoardType::aruco_grid,
                    .columns = 4,
                    .rows = 3,
                    .marker = 0.024,
                    .dictionary = "DICT_APRILTAG_36h11",
                    .border_bits = 2,
                    .from_bottom = true};
  EXPECT_EQ(board.point(3), Eigen::Vector3d(0, 0, 0));  // the first tag's bottom left corner
  EXPECT_EQ(board.point(0), Eigen::Vector3d(0, -0.024, 0));
  EXPECT_LT((board.point(4 * 4 + 3) - Eigen::Vector3d(0, -0.03, 0)).norm(), 1e-12);  // one row further up
  for (const bool turned : {false, true}) {
    const DrawnBoard drawn = draw_board(board, 120, 1, turned);
    const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
    const BoardDetection found = BoardDetector(board).detect(view_of(seen_through(drawn.image, h, {640, 480}, 2, 1)));
    EXPECT_EQ(found.ids.size(), 48u) << found.why_not;
    EXPECT_LT(rms_px(board, found, drawn, h), 0.6) << turned;
  }
}

struct WrongFile {
  const char* name;
  Board real, in_file;
  const char* line;  // to write
};

std::vector<WrongFile> wrong_files() {
  const Board even{.type = BoardType::charuco, .columns = 6, .rows = 8, .marker = 0.0225};
  const Board grid{
      .type = BoardType::aruco_grid, .columns = 5, .rows = 4, .marker = 0.024, .dictionary = "DICT_APRILTAG_36h11"};
  const auto with = [](Board board, const auto& change) {
    change(board);
    return board;
  };
  const Board legacy = with(even, [](Board& b) { b.legacy = true; });
  const Board odd_columns = with(legacy, [](Board& b) { b.columns = 7; });
  const Board shifted = with(even, [](Board& b) { b.first_marker = 6; });
  const Board bottom = with(grid, [](Board& b) { b.from_bottom = true; });
  const Board swapped = with(even, [](Board& b) { std::swap(b.columns, b.rows); });
  return {
      {"legacy", legacy, even, "legacy: true"},
      {"not_legacy", even, legacy, "legacy: false"},
      {"legacy_of_odd_columns", odd_columns, with(odd_columns, [](Board& b) { b.legacy = false; }), "legacy: true"},
      {"first_marker", shifted, even, "first_marker: 6"},
      {"counted_from_one", even, with(even, [](Board& b) { b.first_marker = 1; }), "first_marker: 0"},
      {"numbered_from_the_bottom", bottom, grid, "numbered_from: bottom"},
      {"swapped", swapped, even, "squares: [8, 6]"},
      {"legacy_and_a_row_less", legacy, with(even, [](Board& b) { b.rows = 7; }), "squares: [6, 8] and legacy: true"},
      {"one_column_more", with(even, [](Board& b) { b.columns = 7; }), even, "squares: [7, 8]"},
      {"inverted", with(even, [](Board& b) { b.inverted = true; }), even, "inverted: true"},
      {"inverted_and_legacy", with(legacy, [](Board& b) { b.inverted = true; }), even,
       "legacy: true and inverted: true"},
      {"dictionary", with(even, [](Board& b) { b.dictionary = "DICT_5X5_100"; }), even, "dictionary: DICT_5X5_50"},
      {"kalibr", with(bottom, [](Board& b) { b.border_bits = 2; }), grid, "border_bits: 2 and numbered_from: bottom"},
      {"kalibr_without_its_border", with(bottom, [](Board& b) { b.border_bits = 2; }), bottom, "border_bits: 2"},
      {"border", with(grid, [](Board& b) { b.border_bits = 2; }), grid, "border_bits: 2"}};
}

class WrongBoardFile : public testing::TestWithParam<WrongFile> {};
INSTANTIATE_TEST_SUITE_P(All, WrongBoardFile, testing::ValuesIn(wrong_files()),
                         [](const auto& param_info) { return std::string(param_info.param.name); });

// It is not accepted, though half of the markers may lie as it says, and what fits is named.
TEST_P(WrongBoardFile, IsContradictedAndMended) {
  const DrawnBoard drawn = draw_board(GetParam().real);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
  const BoardDetection found = BoardDetector(GetParam().in_file).detect(view_of(image));
  EXPECT_TRUE(!found.found() || found.contradicting_markers >= 3) << found.markers << " markers fit";
  EXPECT_EQ(fitting_board_file(GetParam().in_file, {view_of(image)}), GetParam().line);
  // The right file needs no change, and nothing contradicts it.
  EXPECT_EQ(fitting_board_file(GetParam().real, {view_of(image)}), "");
  EXPECT_EQ(BoardDetector(GetParam().real).detect(view_of(image)).contradicting_markers, 0);
}

// What is hidden may be anything: of the files that explain the rest, that with the fewest changes is named.
TEST(FittingBoardFile, OfAPartOfTheBoardHasTheFewestChanges) {
  const Board real{.type = BoardType::charuco, .columns = 6, .rows = 8, .marker = 0.0225};
  const DrawnBoard drawn = draw_board(real);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
  image.rowRange(0, 230) = 128;
  Board from_one = real, lower = real;
  from_one.first_marker = 1;
  lower.rows = 7;
  EXPECT_EQ(fitting_board_file(from_one, {view_of(image)}), "first_marker: 0");
  EXPECT_EQ(fitting_board_file(lower, {view_of(image)}), "squares: [6, 8]");
}

// A row too many in the file: the board's edge has no corners, and of the boards that fit the smallest is named.
TEST(FittingBoardFile, ARowTooManyAddsNoCorners) {
  const Board real{.type = BoardType::charuco, .columns = 8, .rows = 6, .marker = 0.0225};
  const DrawnBoard drawn = draw_board(real);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
  Board taller = real, larger = real;
  taller.rows = 7;
  larger.columns = 9, larger.rows = 7;
  EXPECT_EQ(BoardDetector(real).detect(view_of(image)).ids.size(), 35u);
  EXPECT_EQ(BoardDetector(taller).detect(view_of(image)).ids.size(), 35u);
  EXPECT_EQ(fitting_board_file(larger, {view_of(image)}), "squares: [8, 6]");
}

// shared/data/field_cases: Kalibr's own target file and a board as its program prints it, with a known lens.
TEST(BoardDetectorCaptures, KalibrsAprilGrid) {
  const std::filesystem::path folder = std::filesystem::path(HUETRACK_SHARED_DATA) / "field_cases/kalibr_aprilgrid";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  const BoardDetector detector(read_board(folder / "april_6x6.yaml"));
  for (const auto& entry : std::filesystem::directory_iterator(folder / "pictures")) {
    const cv::Mat image = grey_image(entry.path());
    const BoardDetection found = detector.detect(view_of(image));
    EXPECT_GE(found.ids.size(), 4u * 35u) << entry.path() << found.why_not;  // a tag is cut off in two of them
    EXPECT_EQ(found.contradicting_markers, 0);
    EXPECT_NEAR(found.marker_m, 0.088, 0.001);
  }
}

TEST(BoardDetectorMarkers, MeasuresTheMarkersByTheSquares) {
  const DrawnBoard drawn = draw_board(charuco.board);
  const cv::Matx33d h = tilted(drawn.image, {{{120, 60}, {540, 90}, {510, 400}, {140, 370}}});
  const cv::Mat image = seen_through(drawn.image, h, {640, 480}, 2, 1);
  Board wrong = charuco.board;
  wrong.marker *= 0.9;
  for (const Board& in_file : {charuco.board, wrong}) {
    const BoardDetection found = BoardDetector(in_file).detect(view_of(image));
    ASSERT_TRUE(found.found());
    EXPECT_NEAR(found.marker_m / charuco.board.marker, 1, 0.02);
  }
}

// --- real and rendered captures ---

struct Found {
  int boards = 0, whole = 0, images = 0, corners = 0;
};

Found count_boards(const Board& board, const fs::path& folder, const std::string& prefix) {
  Found found;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    const auto extension = entry.path().extension();
    if (file.starts_with(prefix) && (extension == ".jpg" || extension == ".png")) files.push_back(entry.path());
  }
  for (const fs::path& file : files) {
    const cv::Mat image = grey_image(file);
    const BoardDetection detection = BoardDetector(board).detect(view_of(image));
    ++found.images;
    found.boards += detection.found() ? 1 : 0;
    found.corners += static_cast<int>(detection.ids.size());
    found.whole += static_cast<int>(detection.ids.size()) == board.point_count() ? 1 : 0;
    if (!detection.found()) std::printf("%s: %s\n", file.filename().c_str(), detection.why_not.c_str());
  }
  return found;
}

TEST(BoardDetectorCaptures, OpenCvStereoChessboards) {
  const fs::path folder = fs::path(HUETRACK_SHARED_DATA) / "opencv_chessboard_stereo";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  for (const char* side : {"left", "right"}) {
    const Found found = count_boards(chessboard.board, folder, side);
    EXPECT_EQ(found.whole, 13) << side;
    EXPECT_EQ(found.images, 13) << side;
  }
}

TEST(BoardDetectorCaptures, RedSquareChessboardsWithCutRows) {
  const fs::path folder = fs::path(HUETRACK_SHARED_DATA) / "red_square_stereo/calibration_images";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const Found found = count_boards({.columns = 6, .rows = 6, .pitch = {0.0354, 0.0358}}, folder, "camera");
  EXPECT_EQ(found.boards, 14);
  EXPECT_GE(found.corners, 14 * 31);  // of 36; some lie on the fold between the board's halves
}

TEST(BoardDetectorCaptures, RenderedChessboardAgainstTheTruth) {
  const fs::path folder = fs::path(HUETRACK_SHARED_DATA) / "rendered/chessboard";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  std::map<std::pair<int, int>, std::map<int, Eigen::Vector2d>> truth;  // (camera, pose) -> corner -> pixel
  std::ifstream csv(folder / "corners_gt.csv");
  std::string line;
  std::getline(csv, line);
  while (std::getline(csv, line)) {
    int pose, camera, corner;
    double u, v;
    ASSERT_EQ(std::sscanf(line.c_str(), "%d,cam%d,%d,%*f,%*f,%*f,%lf,%lf", &pose, &camera, &corner, &u, &v), 5) << line;
    truth[{camera, pose}][corner] = {u, v};
  }
  const BoardDetector detector({.columns = 9, .rows = 6, .pitch = {0.06, 0.06}});
  std::array<int, 3> found{}, false_ones{};
  double sum = 0, worst = 0;
  int corners = 0;
  for (int camera = 0; camera < 3; ++camera) {
    for (int pose = 0; pose < 25; ++pose) {
      std::array<char, 64> name;
      std::snprintf(name.data(), name.size(), "cam%d/%06d.jpg", camera, pose);
      const cv::Mat image = grey_image(folder / name.data());
      const BoardDetection detection = detector.detect(view_of(image));
      if (!detection.found()) continue;
      const auto known = truth.find({camera, pose});
      if (known == truth.end()) {
        ++false_ones[static_cast<std::size_t>(camera)];
        continue;
      }
      ++found[static_cast<std::size_t>(camera)];
      for (std::size_t k = 0; k < detection.ids.size(); ++k) {
        const double off = (detection.px[k] - known->second.at(detection.ids[k])).norm();
        sum += off * off;
        worst = std::max(worst, off);
        ++corners;
      }
    }
  }
  std::printf("found %d of 22, %d of 25, %d of 19 boards; %.3f px rms per axis, %.2f px at most\n", found[0], found[1],
              found[2], std::sqrt(sum / corners / 2), worst);
  EXPECT_GE(found[0], 20);
  EXPECT_GE(found[1], 25);
  EXPECT_GE(found[2], 17);
  EXPECT_EQ(false_ones, (std::array<int, 3>{}));
  EXPECT_LT(std::sqrt(sum / corners / 2), 0.08);
  EXPECT_LT(worst, 0.5);
}

}  // namespace
}  // namespace huetrack::board
