#include "pictures/canvas_image.h"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "calib/files/output_file.h"

namespace huetrack::pictures {

drawing::Canvas canvas_over(const cv::Mat& bgr, const drawing::Point& top_left, double zoom, cv::Size size,
                            drawing::Color background) {
  drawing::Canvas canvas(size.width, size.height, background);
  if (bgr.empty()) return canvas;
  // Nearest pixel at twice the size, then averaged: squares with smooth edges at any zoom.
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
  // OpenCV has no const view; it only reads these pixels.
  const cv::Mat bgrx(canvas.height(), canvas.width(), CV_8UC4, const_cast<std::uint8_t*>(canvas.bgrx()),
                     canvas.bgrx_stride());
  cv::Mat bgr;
  cv::cvtColor(bgrx, bgr, cv::COLOR_BGRA2BGR);
  return bgr;
}

void make_picture_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error("cannot make the folder " + folder.string() + ": " + error.message());
}

void write_png(const std::filesystem::path& file, const cv::Mat& bgr) {
  constexpr int compression = 2;  // of 9: fast
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", bgr, bytes, {cv::IMWRITE_PNG_COMPRESSION, compression}))
    throw std::runtime_error("cannot encode " + file.string());
  files::write_whole_file(file,
                          {reinterpret_cast<const char*>(bytes.data()), bytes.size()});  // imwrite() gives no reason
}

}  // namespace huetrack::pictures
