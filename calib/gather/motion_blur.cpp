#include "calib/gather/motion_blur.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace huetrack::gather {
namespace {

constexpr int directions = 12;  // of half a turn
constexpr int in_a_row = 5;     // images without a board; after more the board may be anywhere

// Energy of the second derivative along each direction. An edge that is blurred over a square loses far more of it than
// of its gradient.
std::vector<double> sharpness_of(const cv::Mat& smooth) {
  const auto kernel = [](std::initializer_list<float> of) { return cv::Mat(std::vector<float>(of), true); };
  const cv::Mat one = kernel({1}), slope = kernel({-0.5, 0, 0.5}), bend = kernel({1, -2, 1});
  cv::Mat xx, xy, yy;
  cv::sepFilter2D(smooth, xx, CV_32F, bend, one);
  cv::sepFilter2D(smooth, xy, CV_32F, slope, slope);
  cv::sepFilter2D(smooth, yy, CV_32F, one, bend);
  std::vector<double> energy;
  for (int d = 0; d < directions; ++d) {
    const double angle = std::numbers::pi * d / directions, c = std::cos(angle), s = std::sin(angle);
    const cv::Mat along = c * c * xx + 2 * c * s * xy + s * s * yy;
    energy.push_back(along.dot(along) / static_cast<double>(along.total()));
  }
  return energy;
}

// Standard deviation of each cell of a grid.
std::vector<double> contrasts_of(const cv::Mat& smooth, double cell_px) {
  const int columns = std::max(1, static_cast<int>(smooth.cols / cell_px)),
            rows = std::max(1, static_cast<int>(smooth.rows / cell_px));
  std::vector<double> contrasts;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const cv::Rect cell(cv::Point(smooth.cols * column / columns, smooth.rows * row / rows),
                          cv::Point(smooth.cols * (column + 1) / columns, smooth.rows * (row + 1) / rows));
      cv::Scalar mean, deviation;
      cv::meanStdDev(smooth(cell), mean, deviation);
      contrasts.push_back(deviation[0]);
    }
  }
  return contrasts;
}

}  // namespace

void MotionBlurDetector::measure(const cv::Mat& grey, Place& place) {
  cv::Mat smooth;
  grey(place.box).convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {}, 1);  // suppress noise
  constexpr double squares_of_cell = 2;     // each has light and dark
  place.contrast = contrasts_of(smooth, squares_of_cell * place.square_px);
  place.sharpness = sharpness_of(smooth);
}

int MotionBlurDetector::found(const cv::Mat& grey, const std::vector<Eigen::Vector2d>& corners) {
  const std::optional<Place> before = std::exchange(place_, std::nullopt);
  const int blurred = std::exchange(blurred_since_, 0);
  const bool is_shortly_after = std::exchange(pictures_since_, 0) <= in_a_row;
  Eigen::Array2d low = corners.front(), high = low;
  double nearest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& px : corners) {
    low = low.min(px.array());
    high = high.max(px.array());
    if (&px != &corners.front()) nearest = std::min(nearest, (px - corners.front()).norm());
  }
  Place place;
  place.box = cv::Rect(cv::Point(static_cast<int>(low.x()), static_cast<int>(low.y())),
                       cv::Point(static_cast<int>(high.x()) + 1, static_cast<int>(high.y()) + 1)) &
              cv::Rect(0, 0, grey.cols, grey.rows);
  place.square_px = nearest;
  constexpr int least_px = 24;  // of the box: smaller ones are not conclusive
  if (corners.size() < 2 || place.box.width < least_px || place.box.height < least_px) return 0;
  measure(grey, place);
  place_ = place;
  const bool is_there_again = before && 2 * (before->box & place.box).area() > before->box.area();
  return is_shortly_after && is_there_again ? blurred : 0;
}

bool MotionBlurDetector::may_be_in(const cv::Mat& grey) {
  if (!place_ || ++pictures_since_ > in_a_row) return false;
  Place now = *place_;
  if ((now.box & cv::Rect(0, 0, grey.cols, grey.rows)) != now.box) return false;
  measure(grey, now);
  // Blurred over a square, squares keep half of their contrast and a few hundredths of their edges' sharpness; defocus
  // or an occluding object keeps more.
  constexpr double sharpness_left = 0.1, contrast_left = 0.25, most = 0.6;
  double left = std::numeric_limits<double>::infinity();
  for (std::size_t d = 0; d < now.sharpness.size(); ++d) left = std::min(left, now.sharpness[d] / place_->sharpness[d]);
  if (!(left < sharpness_left)) return false;
  std::size_t with_contrast = 0;
  for (std::size_t cell = 0; cell < now.contrast.size(); ++cell)
    with_contrast += now.contrast[cell] > contrast_left * place_->contrast[cell] ? 1 : 0;
  const bool is_blurred = static_cast<double>(with_contrast) > most * static_cast<double>(now.contrast.size());
  blurred_since_ += is_blurred ? 1 : 0;
  return is_blurred;
}

}  // namespace huetrack::gather
