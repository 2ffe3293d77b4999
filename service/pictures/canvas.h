// A small drawing surface for the pictures: everything is drawn at twice the size and averaged down, which turns
// OpenCV's stroke font and lines into clean ones. Coordinates and sizes are in pixels of the finished picture, (0,0)
// top left. thread-compatible.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace huetrack::pictures {

struct DrawColor {
  int r = 0, g = 0, b = 0;
};

// A colour of this hue (degrees), saturation and value (0..1).
DrawColor color_of_hue(double hue_deg, double saturation, double value);

enum class Align { left, centre, right };

class Canvas {
 public:
  Canvas(int width, int height, DrawColor background);

  int width() const { return pixels_.cols / scale; }
  int height() const { return pixels_.rows / scale; }

  void image(cv::Point2d top_left, const cv::Mat& bgr, double zoom);  // nearest pixel: raw pixels stay visible
  void line(cv::Point2d a, cv::Point2d b, DrawColor color, double width);
  void dashed(cv::Point2d a, cv::Point2d b, DrawColor color, double width, double dash = 4);
  void polyline(std::span<const cv::Point2d> points, DrawColor color, double width, bool closed = false);
  void polygon(std::span<const cv::Point2d> points, DrawColor fill, double opacity = 1);
  void circle(cv::Point2d centre, double radius, DrawColor color, double width);
  void disc(cv::Point2d centre, double radius, DrawColor fill);
  void rectangle(cv::Rect2d box, DrawColor fill, double opacity = 1);
  void paste(cv::Point2d top_left, const Canvas& other);
  // at: on the base line. height: of a capital letter.
  void text(cv::Point2d at, const std::string& text, double height, DrawColor color, Align align = Align::left,
            bool bold = false);
  // As text(), with a rim of another colour that keeps it readable over lines.
  void rimmed_text(cv::Point2d at, const std::string& text, double height, DrawColor color, DrawColor rim,
                   Align align = Align::left);
  static double text_width(const std::string& text, double height, bool bold = false);

  cv::Mat finished() const;  // 8-bit BGR

 private:
  static constexpr int scale = 2;
  cv::Mat pixels_;
};

}  // namespace huetrack::pictures
