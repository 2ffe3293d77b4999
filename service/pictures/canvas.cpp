#include "pictures/canvas.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace huetrack::pictures {
namespace {

constexpr int font = cv::FONT_HERSHEY_SIMPLEX;
constexpr double capital_height = 21;  // of the font at scale 1, pixels
constexpr int fraction_bits = 4;       // OpenCV's fixed-point coordinates

cv::Scalar bgr(DrawColor c) {
  return cv::Scalar(c.b, c.g, c.r);
}

int stroke(double width, int scale) {
  return std::max(1, int(std::lround(width * scale)));
}

cv::Point fixed(cv::Point2d p, int scale) {
  const double factor = scale * (1 << fraction_bits);
  return {int(std::lround(p.x * factor)), int(std::lround(p.y * factor))};
}

double font_scale(double height) {
  return height / capital_height;
}
double font_stroke(double height, bool bold) {
  return height / (bold ? 6.0 : 9.0);
}

}  // namespace

DrawColor color_of_hue(double hue_deg, double saturation, double value) {
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue_deg / 60, 6);
    const double v = value - value * saturation * std::max(0.0, std::min({k, 4 - k, 1.0}));
    return int(std::lround(255 * v));
  };
  return {channel(5), channel(3), channel(1)};
}

Canvas::Canvas(int width, int height, DrawColor background)
    : pixels_(height * scale, width * scale, CV_8UC3, bgr(background)) {}

void Canvas::image(cv::Point2d top_left, const cv::Mat& source, double zoom) {
  cv::Mat large;
  cv::resize(source, large, {}, zoom * scale, zoom * scale, cv::INTER_NEAREST);
  const cv::Point at(int(std::lround(top_left.x * scale)), int(std::lround(top_left.y * scale)));
  const cv::Rect into = cv::Rect(at, large.size()) & cv::Rect(cv::Point(), pixels_.size());
  if (!into.empty()) large(into - at).copyTo(pixels_(into));
}

void Canvas::line(cv::Point2d a, cv::Point2d b, DrawColor color, double width) {
  cv::line(pixels_, fixed(a, scale), fixed(b, scale), bgr(color), stroke(width, scale), cv::LINE_AA, fraction_bits);
}

void Canvas::dashed(cv::Point2d a, cv::Point2d b, DrawColor color, double width, double dash) {
  const cv::Point2d along = b - a;
  const double length = std::hypot(along.x, along.y);
  for (double from = 0; from < length; from += 2 * dash) {
    line(a + along * (from / length), a + along * (std::min(from + dash, length) / length), color, width);
  }
}

void Canvas::polyline(std::span<const cv::Point2d> points, DrawColor color, double width, bool closed) {
  std::vector<cv::Point> at;
  for (const auto& p : points) at.push_back(fixed(p, scale));
  cv::polylines(pixels_, at, closed, bgr(color), stroke(width, scale), cv::LINE_AA, fraction_bits);
}

void Canvas::polygon(std::span<const cv::Point2d> points, DrawColor fill, double opacity) {
  std::vector<cv::Point> at;
  for (const auto& p : points) at.push_back(fixed(p, scale));
  cv::Mat layer = pixels_.clone();
  cv::fillPoly(layer, std::vector{at}, bgr(fill), cv::LINE_AA, fraction_bits);
  cv::addWeighted(layer, opacity, pixels_, 1 - opacity, 0, pixels_);
}

void Canvas::circle(cv::Point2d centre, double radius, DrawColor color, double width) {
  cv::circle(pixels_, fixed(centre, scale), int(std::lround(radius * scale * (1 << fraction_bits))), bgr(color),
             stroke(width, scale), cv::LINE_AA, fraction_bits);
}

void Canvas::disc(cv::Point2d centre, double radius, DrawColor fill) {
  cv::circle(pixels_, fixed(centre, scale), int(std::lround(radius * scale * (1 << fraction_bits))), bgr(fill),
             cv::FILLED, cv::LINE_AA, fraction_bits);
}

void Canvas::rectangle(cv::Rect2d box, DrawColor fill, double opacity) {
  const cv::Rect area = cv::Rect(int(std::lround(box.x * scale)), int(std::lround(box.y * scale)),
                                 int(std::lround(box.width * scale)), int(std::lround(box.height * scale))) &
                        cv::Rect(cv::Point(), pixels_.size());
  if (area.empty()) return;
  cv::Mat part = pixels_(area);
  cv::addWeighted(cv::Mat(area.size(), CV_8UC3, bgr(fill)), opacity, part, 1 - opacity, 0, part);
}

void Canvas::text(cv::Point2d at, const std::string& text, double height, DrawColor color, Align align, bool bold) {
  if (align != Align::left) at.x -= text_width(text, height, bold) * (align == Align::centre ? 0.5 : 1.0);
  cv::putText(pixels_, text, {int(std::lround(at.x * scale)), int(std::lround(at.y * scale))}, font,
              font_scale(height) * scale, bgr(color), stroke(font_stroke(height, bold), scale), cv::LINE_AA);
}

void Canvas::rimmed_text(cv::Point2d at, const std::string& text, double height, DrawColor color, DrawColor rim,
                         Align align) {
  if (align != Align::left) at.x -= text_width(text, height) * (align == Align::centre ? 0.5 : 1.0);
  const cv::Point origin(int(std::lround(at.x * scale)), int(std::lround(at.y * scale)));
  const int width = stroke(font_stroke(height, false), scale);
  cv::putText(pixels_, text, origin, font, font_scale(height) * scale, bgr(rim), width + 4 * scale, cv::LINE_AA);
  cv::putText(pixels_, text, origin, font, font_scale(height) * scale, bgr(color), width, cv::LINE_AA);
}

void Canvas::paste(cv::Point2d top_left, const Canvas& other) {
  const cv::Point at(int(std::lround(top_left.x * scale)), int(std::lround(top_left.y * scale)));
  const cv::Rect into = cv::Rect(at, other.pixels_.size()) & cv::Rect(cv::Point(), pixels_.size());
  if (!into.empty()) other.pixels_(into - at).copyTo(pixels_(into));
}

double Canvas::text_width(const std::string& text, double height, bool bold) {
  int base_line = 0;
  return cv::getTextSize(text, font, font_scale(height) * scale, stroke(font_stroke(height, bold), scale), &base_line)
             .width /
         double(scale);
}

cv::Mat Canvas::finished() const {
  cv::Mat small;
  cv::resize(pixels_, small, {}, 1.0 / scale, 1.0 / scale, cv::INTER_AREA);
  return small;
}

}  // namespace huetrack::pictures
