// A report as a list of parts, told once and written twice: HTML with everything in it, and PDF on paper of A4.
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "calib/report/calibration_report.h"
#include "drawing/canvas.h"

namespace huetrack::report {

struct Heading {
  std::string text;
};
struct Paragraph {
  std::string text;
};
struct Banner {  // the verdict, and what it is of
  Verdict verdict = Verdict::usable;
  std::string word;  // "PASS"
  std::string text;
};
struct Table {
  std::vector<std::string> head;  // a column that is not the first stands at its right edge
  std::vector<std::vector<std::string>> rows;
};
struct Figure {
  int width = 0, height = 0;  // pixels, or points on paper; wider than the page it is made smaller
  std::function<void(drawing::Canvas&)> draw;
  std::string caption;
};
using Part = std::variant<Heading, Paragraph, Banner, Table, Figure>;

struct Document {
  std::string title, subtitle;
  std::vector<Part> parts;

  void heading(std::string text);
  void paragraph(std::string text);
  void banner(Verdict verdict, std::string word, std::string text);
  void table(Table table);
  void figure(Figure figure);
};

std::string to_html(const Document& document);
std::string to_pdf(const Document& document);   // the same bytes for the same document
std::string to_text(const Document& document);  // without the figures; a banner is a line of its own

}  // namespace huetrack::report
