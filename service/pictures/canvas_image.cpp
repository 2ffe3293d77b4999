#include "pictures/canvas_image.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace huetrack::pictures {

drawing::Canvas canvas_over(const cv::Mat& bgr, const drawing::Point& top_left, double zoom, cv::Size size,
                            drawing::Color background) {
  drawing::Canvas canvas(size.width, size.height, background);
  if (bgr.empty()) return canvas;
  // The nearest pixel at twice the size, then averaged down: squares with smooth edges at any zoom.
  constexpr int scale = 2;
  cv::Mat large, small;
  cv::resize(bgr, large, {}, zoom * scale, zoom * scale, cv::INTER_NEAREST);
  cv::Mat ground(size * scale, CV_8UC3, cv::Scalar(background.b, background.g, background.r));
  const cv::Point at(int(std::lround(top_left.x() * scale)), int(std::lround(top_left.y() * scale)));
  const cv::Rect into = cv::Rect(at, large.size()) & cv::Rect(cv::Point(), ground.size());
  if (!into.empty()) large(into - at).copyTo(ground(into));
  cv::resize(ground, small, size, 0, 0, cv::INTER_AREA);
  canvas.pixels({0, 0}, {small.data, small.cols, small.rows, small.step});
  return canvas;
}

cv::Mat image_of(const drawing::Canvas& canvas) {
  // OpenCV has no view of pixels that must not be changed; it only reads these.
  const cv::Mat bgrx(canvas.height(), canvas.width(), CV_8UC4, const_cast<std::uint8_t*>(canvas.bgrx()),
                     canvas.bgrx_stride());
  cv::Mat bgr;
  cv::cvtColor(bgrx, bgr, cv::COLOR_BGRA2BGR);
  return bgr;
}

}  // namespace huetrack::pictures
