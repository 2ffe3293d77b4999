// Conversions between OpenCV images, canvases and files.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "drawing/canvas.h"

namespace huetrack::pictures {

// A canvas with a magnified image, whose pixels stay visible as squares. top_left: of the image on the canvas.
//   bgr    8-bit; empty: only the background
drawing::Canvas canvas_over(const cv::Mat& bgr, const drawing::Point& top_left, double zoom, cv::Size size,
                            drawing::Color background);

cv::Mat image_of(const drawing::Canvas& canvas);  // 8-bit BGR

// throw std::runtime_error, naming the folder or the file.
void make_picture_folder(const std::filesystem::path& folder);
void write_png(const std::filesystem::path& file, const cv::Mat& bgr);

}  // namespace huetrack::pictures
