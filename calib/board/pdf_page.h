// One page of PDF 1.4 with filled rectangles, discs and lines of text: exact to the micrometre. Private to this module.
#pragma once

#include <string>

namespace huetrack::board {

// Millimetres from the page's top left corner, x right, y down. grey: 0 black, 1 white.
class PdfPage {
 public:
  PdfPage(double width_mm, double height_mm);

  void rectangle(double x, double y, double width, double height, double grey);
  void disc(double x, double y, double radius, double grey);  // x, y: its centre
  // Helvetica, baseline at y; only printable ASCII is kept. turned: reads upwards.
  void text(double x, double y, double size_mm, const std::string& line, bool turned = false);

  std::string pdf(const std::string& title) const;  // the file, deterministic

 private:
  double width_mm_, height_mm_;
  std::string content_;
};

}  // namespace huetrack::board
