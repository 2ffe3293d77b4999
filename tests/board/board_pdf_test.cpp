#include "calib/board/board_pdf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/board/board_detector.h"
#include "calib/board/board_yaml.h"
#include "calib/board/grey_view.h"

namespace huetrack::board {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr int dpi = 120, finer = 4;

bool have_pdftoppm() {
  return std::system("pdftoppm -v >/dev/null 2>&1") == 0;
}

// As a printer at `dpi` would see it.
cv::Mat rasterised(const std::string& pdf, const std::string& name) {
  const std::filesystem::path base = std::filesystem::path(testing::TempDir()) / name;
  std::ofstream(base.string() + ".pdf", std::ios::binary) << pdf;
  const std::string command = "pdftoppm -gray -singlefile -r " + std::to_string(finer * dpi) + " '" + base.string() +
                              ".pdf' '" + base.string() + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  cv::Mat image = cv::imread(base.string() + ".pgm", cv::IMREAD_GRAYSCALE);
  for (const char* extension : {".pdf", ".pgm"}) std::filesystem::remove(base.string() + extension);
  if (image.empty()) return image;
  // pdftoppm puts edges onto whole pixels: rasterised finer, and averaged. And no camera is as sharp.
  const cv::Size size(image.cols / finer, image.rows / finer);
  cv::resize(image(cv::Rect(0, 0, finer * size.width, finer * size.height)).clone(), image, size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(image, image, {}, 0.7);
  return image;
}

struct Case {
  const char* name;
  Board board;
  const char* paper;
};

class PrintedBoard : public testing::TestWithParam<Case> {};

// The board file that is written beside it finds the printed board, all of it, where it should be to a tenth of a
// millimetre.
TEST_P(PrintedBoard, IsFoundAtTrueScale) {
  if (!have_pdftoppm()) GTEST_SKIP() << "no pdftoppm (poppler-utils)";
  const BoardPdf printed = board_pdf(GetParam().board, *paper_of(GetParam().paper));
  const cv::Mat image = rasterised(printed.pdf, std::string("board_") + GetParam().name);
  ASSERT_FALSE(image.empty());
  const double px_per_mm = dpi / 25.4;
  EXPECT_NEAR(image.cols, printed.paper.width_mm * px_per_mm, 1);
  EXPECT_NEAR(image.rows, printed.paper.height_mm * px_per_mm, 1);

  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / (std::string(GetParam().name) + ".yaml");
  std::ofstream(file) << to_yaml(GetParam().board);
  const Board board = read_board(file);
  std::filesystem::remove(file);
  const BoardDetection found = BoardDetector(board).detect(view_of(image));
  ASSERT_TRUE(found.found()) << found.why_not;
  EXPECT_EQ(found.ids.size(), static_cast<std::size_t>(board.point_count()));

  // The orientation of a symmetric chessboard is ambiguous.
  double worst = 1e9;
  for (const auto& order : board.symmetries()) {
    std::vector<Eigen::Vector2d> off;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < found.ids.size(); ++i) {
      const Eigen::Vector2d mm = (found.px[i].array() + 0.5) / px_per_mm;  // pixel (0, 0) is a pixel's centre
      off.push_back(mm - printed.origin_mm -
                    1e3 * board.point(order[static_cast<std::size_t>(found.ids[i])]).head<2>());
      mean += off.back() / static_cast<double>(found.ids.size());
    }
    if (mean.norm() > 0.3) continue;  // pdftoppm rounds the page to whole pixels, of 0.2 mm
    double largest = 0;
    for (const Eigen::Vector2d& d : off) largest = std::max(largest, (d - mean).norm());
    worst = std::min(worst, largest);
  }
  EXPECT_LT(worst, 0.1) << "millimetres";

  // And the scale itself: the longest way across.
  double longest = 0, measured = 0;
  for (std::size_t i = 0; i < found.ids.size(); ++i) {
    for (std::size_t k = i + 1; k < found.ids.size(); ++k) {
      const double length = 1e3 * (board.point(found.ids[i]) - board.point(found.ids[k])).norm();
      if (length <= longest) continue;
      longest = length;
      measured = (found.px[i] - found.px[k]).norm() / px_per_mm;
    }
  }
  RecordProperty("measured_mm", std::to_string(measured));
  std::printf("%s: %.3f mm measured, %.3f mm meant; corners off by %.3f mm at most\n", GetParam().name, measured,
              longest, worst);
  EXPECT_NEAR(measured, longest, 0.1);
}

Board a_chessboard(int columns, int rows, double square) {
  return {.type = BoardType::chessboard, .columns = columns, .rows = rows, .pitch = {square, square}};
}
Board a_charuco(int columns, int rows, double square, double marker) {
  return {.type = BoardType::charuco,
          .columns = columns,
          .rows = rows,
          .pitch = {square, square},
          .marker = marker,
          .dictionary = "DICT_4X4_50"};
}
Board grid(const char* dictionary) {
  return {.type = BoardType::aruco_grid,
          .columns = 4,
          .rows = 3,
          .pitch = {0.045, 0.045},
          .marker = 0.035,
          .dictionary = dictionary};
}
Board inverted(Board board) {
  board.inverted = true;
  return board;
}
Board kalibr(Board board) {
  board.border_bits = 2;
  board.from_bottom = true;
  return board;
}
Board circles(BoardType type, int columns, int rows) {
  return {.type = type, .columns = columns, .rows = rows, .pitch = {0.022, 0.022}, .diameter = 0.012};
}
Board legacy(Board board) {
  board.legacy = true;
  return board;
}

INSTANTIATE_TEST_SUITE_P(All, PrintedBoard,
                         testing::Values(Case{"chessboard", a_chessboard(8, 5, 0.025), "A4"},
                                         Case{"chessboard_A3", a_chessboard(9, 6, 0.035), "A3"},
                                         Case{"charuco", a_charuco(7, 5, 0.033, 0.025), "A4"},
                                         Case{"charuco_legacy", legacy(a_charuco(7, 6, 0.028, 0.02)), "A4"},
                                         Case{"charuco_inverted", inverted(a_charuco(5, 4, 0.04, 0.03)), "A4"},
                                         Case{"aruco_grid", grid("DICT_5X5_100"), "A4"},
                                         Case{"april_grid", grid("DICT_APRILTAG_36h11"), "A4"},
                                         Case{"kalibr_grid", kalibr(grid("DICT_APRILTAG_36h11")), "A4"},
                                         Case{"circles", circles(BoardType::circles, 8, 6), "A4"},
                                         Case{"asymmetric_circles", circles(BoardType::asymmetric_circles, 4, 9), "A4"},
                                         Case{"own_paper", a_chessboard(6, 4, 0.02), "180x200"}),
                         [](const auto& test) { return test.param.name; });

TEST(BoardPdf, ReportsWhatFits) {
  try {
    board_pdf(a_chessboard(9, 6, 0.04), *paper_of("A4"));
    ADD_FAILURE() << "a board of 400 mm on A4";
  } catch (const DoesNotFit& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("does not fit on A4"), HasSubstr("It fits on A2"),
                                    HasSubstr("On A4 the squares can be 24 mm")));
  }
  EXPECT_NO_THROW(board_pdf(a_chessboard(9, 6, 0.024), *paper_of("A4")));
  EXPECT_THROW(board_pdf(a_chessboard(9, 6, 0.025), *paper_of("A4")), DoesNotFit);
}

TEST(BoardPdf, Papers) {
  EXPECT_EQ(paper_of("a3")->width_mm, 297);
  EXPECT_EQ(paper_of("100x250.5")->height_mm, 250.5);
  for (const char* wrong : {"", "A", "A9", "100", "100x", "x100", "10x10", "100x100x", "-100x100"})
    EXPECT_FALSE(paper_of(wrong)) << wrong;
}

TEST(BoardPdf, SameBoardSameBytes) {
  EXPECT_EQ(board_pdf(a_charuco(7, 5, 0.03, 0.02), *paper_of("A4")).pdf,
            board_pdf(a_charuco(7, 5, 0.03, 0.02), *paper_of("A4")).pdf);
}

}  // namespace
}  // namespace huetrack::board
