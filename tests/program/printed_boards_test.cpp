// huetrack-calibrate intrinsics with the boards that laboratories have printed for other tools, among clutter.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>

#include "board/drawn_board.h"
#include "calib/board/board_yaml.h"
#include "calib/model/rig_yaml.h"
#include "end_to_end/process.h"

namespace huetrack::program {
namespace {

namespace fs = std::filesystem;
using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Printed {
  const char* name;
  const char* file;  // as its users have it
};

class PrintedBoards : public testing::TestWithParam<Printed> {};
INSTANTIATE_TEST_SUITE_P(All, PrintedBoards,
                         testing::Values(Printed{"circles", "type: circles\nsize: [9, 6]\nsquare: 0.03\n"},
                                         Printed{"asymmetric_circles",
                                                 "type: asymmetric_circles\nsize: [4, 11]\nsquare: 0.02\n"},
                                         Printed{"kalibrs_circles",
                                                 "target_type: 'circlegrid'\ntargetCols: 6\ntargetRows: 7\n"
                                                 "spacingMeters: 0.02\nasymmetricGrid: False\n"},
                                         Printed{"kalibrs_april_grid",
                                                 "target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 6\n"
                                                 "tagSize: 0.03           #size of apriltag, edge to edge [m]\n"
                                                 "tagSpacing: 0.25        #ratio of space between tags to tagSize\n"}),
                         [](const auto& param_info) { return std::string(param_info.param.name); });

// The print on a wall, and beside it discs as dark and about as large as the circles.
cv::Mat among_clutter(const cv::Mat& print, int square_px, int margin, cv::RNG& rng) {
  cv::Mat wall;
  cv::copyMakeBorder(print, wall, margin, margin, margin, margin, cv::BORDER_CONSTANT, cv::Scalar(150));
  const cv::Rect board(margin, margin, print.cols, print.rows);
  constexpr int discs = 40;
  for (int k = 0; k < discs; ++k) {
    const cv::Point centre(rng.uniform(0, wall.cols), rng.uniform(0, wall.rows));
    const int radius = rng.uniform(square_px / 8, square_px / 3);
    const cv::Rect around(centre.x - radius, centre.y - radius, 2 * radius + 1, 2 * radius + 1);
    if ((board & around).empty()) cv::circle(wall, centre, radius, rng.uniform(0, 60), cv::FILLED, cv::LINE_AA);
  }
  return wall;
}

// Kalibr prints black squares where its tags meet.
void add_corner_squares(cv::Mat& print, int square_px, const board::Board& grid) {
  const int gap = square_px - static_cast<int>(std::lround(square_px * grid.marker / grid.pitch.x()));
  const int border = (print.cols - grid.columns * square_px) / 2 - gap;
  for (int row = 0; row <= grid.rows; ++row)
    for (int column = 0; column <= grid.columns; ++column)
      print(cv::Rect(border + column * square_px, border + row * square_px, gap, gap)) = 0;
}

TEST_P(PrintedBoards, CalibrateTheLens) {
  const fs::path folder = fs::temp_directory_path() / ("huetrack_printed_" + std::to_string(getpid()));
  fs::remove_all(folder);
  fs::create_directories(folder / "pictures");
  std::ofstream(folder / "target.yaml") << GetParam().file;
  board::Board printed = board::read_board(folder / "target.yaml");
  if (printed.has_circles()) printed.diameter = 0.6 * printed.pitch.x();
  constexpr int square_px = 150, margin = 3 * square_px, views = 16;
  board::DrawnBoard drawn = board::draw_board(printed, square_px, 0.3);
  if (printed.from_bottom) add_corner_squares(drawn.image, square_px, printed);

  constexpr double focal = 620;
  const Matrix3d camera = (Matrix3d() << focal, 0, 322, 0, focal, 236, 0, 0, 1).finished();
  const cv::Size size(640, 480);
  cv::RNG rng(7);
  const double px = 1 / drawn.px_per_m;  // metres
  for (int view = 0; view < views; ++view) {
    const cv::Mat wall = among_clutter(drawn.image, square_px, margin, rng);
    const Matrix3d turn = (Eigen::AngleAxisd(rng.uniform(-0.6, 0.6), Vector3d::UnitX()) *
                           Eigen::AngleAxisd(rng.uniform(-0.6, 0.6), Vector3d::UnitY()) *
                           Eigen::AngleAxisd(rng.uniform(-0.4, 0.4), Vector3d::UnitZ()))
                              .toRotationMatrix();
    const double longer = px * std::max(drawn.image.cols, drawn.image.rows), distance = rng.uniform(1.9, 2.4) * longer;
    const Vector3d middle(0.25 * distance * (view % 4 - 1.5) / 1.5, 0.16 * distance * (view / 4 - 1.5) / 1.5, distance);
    Matrix3d plane;  // wall pixels, from its middle, to the camera
    plane << px * turn.col(0), px * turn.col(1), middle;
    Matrix3d centred = Matrix3d::Identity();
    centred.topRightCorner<2, 1>() << -wall.cols / 2., -wall.rows / 2.;
    cv::Matx33d h;
    cv::eigen2cv(Matrix3d(camera * plane * centred), h);
    cv::imwrite(folder / "pictures" / (std::to_string(view) + ".png"),
                board::seen_through(wall, h, size, 2, static_cast<std::uint64_t>(view)));
  }
  end_to_end::Process process({HUETRACK_CALIBRATE, "intrinsics", folder / "pictures", "--camera", "cam", "--board",
                               folder / "target.yaml", "--rig", folder / "rig.yaml"},
                              folder / "out", folder / "err");
  EXPECT_EQ(process.wait(), 0) << process.out() << process.err();
  EXPECT_THAT(process.out(), testing::HasSubstr("USABLE"));
  const calib::CameraRig rig = calib::read_rig(folder / "rig.yaml");
  ASSERT_EQ(rig.cameras.size(), 1u);
  EXPECT_NEAR(rig.cameras[0].model.fx(), focal, 0.003 * focal);
  EXPECT_NEAR(rig.cameras[0].model.fy(), focal, 0.003 * focal);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace huetrack::program
